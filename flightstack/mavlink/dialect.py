"""The dialect that both sides of every link speak: common.xml (pymavlink's) and our few messages.

``mavlink`` is pymavlink's module of common.xml with our messages registered, so that every codec made from it
(``mavlink.MAVLink``) knows them.
"""

from __future__ import annotations

from typing import Any

from pymavlink.dialects.v20 import common as mavlink

from flightstack.mavlink.dialect_generated import LAYOUTS
from flightstack.mavlink.layout import Layout, message_class

LAYOUT_BY_NAME: dict[str, Layout] = {layout.name: layout for layout in LAYOUTS}

for _layout in LAYOUTS:
    mavlink.mavlink_map[_layout.message_id] = message_class(_layout)

EscStatus: Any = mavlink.mavlink_map[LAYOUT_BY_NAME["ESC_STATUS"].message_id]
FsLoopTiming: Any = mavlink.mavlink_map[LAYOUT_BY_NAME["FS_LOOP_TIMING"].message_id]
FsPlantState: Any = mavlink.mavlink_map[LAYOUT_BY_NAME["FS_PLANT_STATE"].message_id]
FsActuators: Any = mavlink.mavlink_map[LAYOUT_BY_NAME["FS_ACTUATORS"].message_id]

FS_PLANT_STATE_ID: int = FsPlantState.id
FS_ACTUATORS_ID: int = FsActuators.id
FS_LOOP_TIMING_ID: int = FsLoopTiming.id

__all__ = [
    "FS_ACTUATORS_ID",
    "FS_LOOP_TIMING_ID",
    "FS_PLANT_STATE_ID",
    "LAYOUT_BY_NAME",
    "EscStatus",
    "FsActuators",
    "FsLoopTiming",
    "FsPlantState",
    "mavlink",
]
