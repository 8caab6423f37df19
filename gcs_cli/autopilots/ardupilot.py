"""ArduPilot: ArduCopter, and the modes of its other vehicles.

Commands: GCS_Common.cpp and GCS_MAVLink_Copter.cpp of ArduPilot. ``hold`` selects BRAKE, as QGroundControl's pause
does: LOITER takes the climb rate from the throttle stick, and without a remote control the vehicle descends in it.
The first mode that is named also makes the messages of ArduPilot's dialect known to the decoder.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

from flightstack.mavlink.dialect import FS_LOOP_TIMING_ID, EscStatus, ardupilot_dialect, mavlink
from gcs_cli.autopilots import common_commands
from gcs_cli.autopilots.ardupilot_items import PACKED, PACKED_BY_PLANES
from gcs_cli.autopilots.autopilot import Autopilot, Packing, Phase, Role, VehicleCommand

_ENUM_OF_TYPE = {
    mavlink.MAV_TYPE_FIXED_WING: "PLANE_MODE",
    mavlink.MAV_TYPE_GROUND_ROVER: "ROVER_MODE",
    mavlink.MAV_TYPE_SURFACE_BOAT: "ROVER_MODE",
    mavlink.MAV_TYPE_SUBMARINE: "SUB_MODE",
    mavlink.MAV_TYPE_ANTENNA_TRACKER: "TRACKER_MODE",
}
"""Enumeration of the modes by MAV_TYPE; all other types are ArduCopter's."""
_COPTER = "COPTER_MODE"


@cache
def _names_of(enum: str) -> dict[int, str]:
    entries: Mapping[int, Any] = ardupilot_dialect().enums[enum]
    prefix = f"{enum}_"
    named = {number: entry.name.removeprefix(prefix) for number, entry in entries.items()}
    return {number: name for number, name in named.items() if name != "ENUM_END"}


def _mode_names(vehicle_type: int) -> Mapping[int, str]:
    return _names_of(_ENUM_OF_TYPE.get(vehicle_type, _COPTER))


def _select_mode(custom_mode: int) -> VehicleCommand:
    return common_commands.custom_mode(float(custom_mode))


def _speed_modes(vehicle_type: int) -> tuple[str, ...]:
    """Return the modes of ArduCopter with a ``set_speed_xy_cms`` of their own."""
    return () if vehicle_type in _ENUM_OF_TYPE else ("AUTO", "GUIDED", "RTL")


def _packing(vehicle_type: int) -> Packing:
    return PACKED_BY_PLANES if _ENUM_OF_TYPE.get(vehicle_type) == "PLANE_MODE" else PACKED


def _yaw(heading_deg: float) -> VehicleCommand:
    """CONDITION_YAW to an absolute heading, at the default rate, the shorter way round."""
    return VehicleCommand(mavlink.MAV_CMD_CONDITION_YAW, (heading_deg % 360.0, 0.0, 0.0, 0.0))


ARDUPILOT = Autopilot(
    name="ardupilot",
    title="ArduPilot",
    mode_names=_mode_names,
    selectable=lambda _vehicle_type, _mode: True,
    roles={
        Role.HOLD: "BRAKE",
        Role.RETURN: "RTL",
        Role.LAND: "LAND",
        Role.TAKEOFF: "GUIDED",
        Role.GUIDED: "GUIDED",
        Role.MISSION: "AUTO",
    },
    aliases={"HOLD": "BRAKE", "RETURN": "RTL", "MISSION": "AUTO", "OFFBOARD": "GUIDED", "POSITION": "LOITER"},
    select_mode=_select_mode,
    takeoff_phases=(Phase.GUIDED, Phase.ARM, Phase.TAKEOFF),
    takeoff_frame=mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    has_takeoff_altitude=False,
    goto_frame=mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    goto_keeps_altitude=False,
    yaw=_yaw,
    yaw_phases=(Phase.GUIDED,),
    default_speed=None,
    speed_modes=_speed_modes,
    start_phases=(Phase.GUIDED, Phase.ARM, Phase.START),
    stream_groups_hz={
        mavlink.MAV_DATA_STREAM_RAW_SENSORS: 2,
        mavlink.MAV_DATA_STREAM_EXTENDED_STATUS: 2,
        mavlink.MAV_DATA_STREAM_RC_CHANNELS: 2,
        mavlink.MAV_DATA_STREAM_POSITION: 4,
        mavlink.MAV_DATA_STREAM_EXTRA1: 10,
        mavlink.MAV_DATA_STREAM_EXTRA2: 4,
        mavlink.MAV_DATA_STREAM_EXTRA3: 2,
    },
    stream_messages_hz={
        mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 2.0,
        mavlink.MAVLINK_MSG_ID_HOME_POSITION: 0.5,
    },
    reports_estimator=True,
    lacks_messages=frozenset(
        {
            FS_LOOP_TIMING_ID,
            int(EscStatus.id),
            mavlink.MAVLINK_MSG_ID_MISSION_ITEM_REACHED,
            mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS,
        }
    ),
    sends_modes_as_stream=True,
    refusal_prefixes=("Arm: ", "PreArm: "),
    casts_parameters=True,
    mission_begins_with_home=True,
    replaces_plans_at_once=False,
    stores_items_exactly=False,
    is_silent_without_logs=False,
    sends_logs_armed=False,  # AP_Logger::handle_log_message
    counters=frozenset(
        {"MIS_TOTAL", "FENCE_TOTAL", "RALLY_TOTAL", "STAT_BOOTCNT", "STAT_FLTTIME", "STAT_RUNTIME"}
    ),
    packing=_packing,
    log_suffix=".bin",
)
