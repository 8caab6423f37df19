"""PX4, and the flight stack of this project, which takes PX4's commands and modes.

Modes: px4_custom_mode.h; ``custom_mode`` on the wire is ``main << 16 | sub << 24``. Commands: Commander.cpp and
navigator_main.cpp of PX4.
"""

from __future__ import annotations

import math

from flightstack.mavlink.dialect import mavlink
from gcs_cli.autopilots import common_commands
from gcs_cli.autopilots.autopilot import Autopilot, Phase, Role, VehicleCommand

_AUTO, _POSITION = 4, 3
_MAIN_NAMES = {
    1: "MANUAL",
    2: "ALTITUDE",
    3: "POSITION",
    5: "ACRO",
    6: "OFFBOARD",
    7: "STABILIZED",
    8: "RATTITUDE",
    9: "SIMPLE",
    10: "TERMINATION",
}
_AUTO_NAMES = {
    1: "READY",
    2: "TAKEOFF",
    3: "HOLD",
    4: "MISSION",
    5: "RTL",
    6: "LAND",
    8: "FOLLOW",
    9: "PRECLAND",
    10: "VTOL TAKEOFF",
}
_POSITION_NAMES = {1: "ORBIT", 2: "POSITION SLOW"}
_NAMES: dict[int, str] = {
    **{_AUTO << 16 | sub << 24: name for sub, name in _AUTO_NAMES.items()},
    **{main << 16: name for main, name in _MAIN_NAMES.items()},
    **{_POSITION << 16 | sub << 24: name for sub, name in _POSITION_NAMES.items()},
}
_NOT_SELECTABLE = {"READY", "RATTITUDE", "SIMPLE", "TERMINATION", "VTOL TAKEOFF"}


def custom_mode_numbers(custom_mode: int) -> tuple[int, int]:
    """Return main and sub mode of a custom mode."""
    return custom_mode >> 16 & 255, custom_mode >> 24 & 255


def _select_mode(custom_mode: int) -> VehicleCommand:
    main, sub = custom_mode_numbers(custom_mode)
    return common_commands.custom_mode(float(main), float(sub))


def _yaw(heading_deg: float) -> VehicleCommand:
    nan = math.nan
    return common_commands.reposition(mavlink.MAV_FRAME_GLOBAL, nan, nan, nan, math.radians(heading_deg))


PX4 = Autopilot(
    name="px4",
    title="PX4",
    mode_names=lambda _vehicle_type: _NAMES,
    selectable=lambda _vehicle_type, mode: _NAMES.get(mode) not in _NOT_SELECTABLE,
    roles={
        Role.HOLD: "HOLD",
        Role.RETURN: "RTL",
        Role.LAND: "LAND",
        Role.TAKEOFF: "TAKEOFF",
        Role.GUIDED: "HOLD",
        Role.MISSION: "MISSION",
        Role.TERMINATION: "TERMINATION",
    },
    aliases={
        "LOITER": "HOLD",
        "RETURN": "RTL",
        "POSCTL": "POSITION",
        "ALTCTL": "ALTITUDE",
        "STABILISED": "STABILIZED",
        "AUTO": "MISSION",
        "FOLLOWME": "FOLLOW",
        "AUTOLOITER": "HOLD",
        "AUTOFOLLOWTARGET": "FOLLOW",
        **{f"AUTO{name}": name for name in ("MISSION", "RTL", "LAND", "TAKEOFF", "PRECLAND")},
    },
    select_mode=_select_mode,
    takeoff_phases=(Phase.TAKEOFF, Phase.ARM),
    takeoff_frame=None,
    has_takeoff_altitude=True,
    goto_frame=mavlink.MAV_FRAME_GLOBAL,
    goto_keeps_altitude=True,
    yaw=_yaw,
    yaw_phases=(),
    default_speed=-2.0,
    speed_modes=lambda _vehicle_type: (),
    start_phases=(Phase.START,),
    stream_groups_hz={},
    stream_messages_hz={},
    reports_estimator=True,
    lacks_messages=frozenset(),
    sends_modes_as_stream=False,
    refusal_prefixes=(
        "Command refused: ",
        "Mission refused: ",
        "Geofence refused: ",
        "List of rally points refused: ",
        "Arming denied: ",
        "Arming denied! ",
        "Preflight Fail: ",
    ),
    casts_parameters=False,
    mission_begins_with_home=False,
    replaces_plans_at_once=True,
    stores_items_exactly=True,
    is_silent_without_logs=True,
    sends_logs_armed=True,
)
