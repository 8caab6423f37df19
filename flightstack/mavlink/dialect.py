"""The MAVLink dialect: pymavlink's common.xml and the messages of ``flightstack.xml``.

``mavlink`` is pymavlink's module of common.xml. The messages of ``flightstack.xml`` are registered there under
pymavlink's names (``MAVLink_available_modes_message``, ``MAVLINK_MSG_ID_AVAILABLE_MODES``), so that every codec
(``mavlink.MAVLink``) supports them. MISSION_COUNT, MISSION_ACK and MISSION_CURRENT replace pymavlink's versions, which
lack the plan ids at the end. A module of its own: one dialect for all.
"""

from __future__ import annotations

from functools import cache
from typing import Any

from pymavlink.dialects.v20 import common as mavlink

from flightstack.mavlink.dialect_generated import ENTRIES, LAYOUTS
from flightstack.mavlink.layout import Layout, message_class

LAYOUT_BY_NAME: dict[str, Layout] = {layout.name: layout for layout in LAYOUTS}

for _name, _value in ENTRIES.items():
    setattr(mavlink, _name, _value)

for _layout in LAYOUTS:
    _class = message_class(_layout)
    mavlink.mavlink_map[_layout.message_id] = _class
    setattr(mavlink, _class.__name__, _class)
    setattr(mavlink, f"MAVLINK_MSG_ID_{_layout.name}", _layout.message_id)


@cache
def ardupilot_dialect() -> Any:
    """Return pymavlink's module of ardupilotmega.xml, and register the messages that only it has.

    The import takes 0.1 s: call this once an ArduPilot vehicle is heard.
    """
    from pymavlink.dialects.v20 import ardupilotmega

    for number, kind in ardupilotmega.mavlink_map.items():
        mavlink.mavlink_map.setdefault(number, kind)
    return ardupilotmega


EscStatus: Any = mavlink.mavlink_map[LAYOUT_BY_NAME["ESC_STATUS"].message_id]
FsLoopTiming: Any = mavlink.mavlink_map[LAYOUT_BY_NAME["FS_LOOP_TIMING"].message_id]
FsPlantState: Any = mavlink.mavlink_map[LAYOUT_BY_NAME["FS_PLANT_STATE"].message_id]
FsActuators: Any = mavlink.mavlink_map[LAYOUT_BY_NAME["FS_ACTUATORS"].message_id]

NAME_IN_VERSION = list(b"flightst")
"""AUTOPILOT_VERSION.flight_custom_version in place of a Git hash; it distinguishes the vehicle from PX4."""

FS_PLANT_STATE_ID: int = FsPlantState.id
FS_ACTUATORS_ID: int = FsActuators.id
FS_LOOP_TIMING_ID: int = FsLoopTiming.id

__all__ = [
    "FS_ACTUATORS_ID",
    "FS_LOOP_TIMING_ID",
    "FS_PLANT_STATE_ID",
    "LAYOUT_BY_NAME",
    "NAME_IN_VERSION",
    "EscStatus",
    "FsActuators",
    "FsLoopTiming",
    "FsPlantState",
    "ardupilot_dialect",
    "mavlink",
]
