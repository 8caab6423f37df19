"""The messages of telemetry, each made from what the vehicle knows. Pure."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from flightstack.mavlink.dialect import FS_LOOP_TIMING_ID, EscStatus, mavlink
from flightstack.mavlink.link import Message
from flightstack.services.telemetry import modes, motion, vehicle
from flightstack.services.telemetry.facts import FlightTimes, PlanIds, VehicleFacts
from flightstack.services.telemetry.fields import euler
from flightstack.services.telemetry.texts import status_texts
from flightstack.services.telemetry.vehicle import autopilot_version, heartbeat

__all__ = [
    "MAKERS",
    "FlightTimes",
    "PlanIds",
    "VehicleFacts",
    "autopilot_version",
    "euler",
    "heartbeat",
    "is_available",
    "messages",
    "status_texts",
]

MAKERS: dict[int, Callable[[VehicleFacts], Message]] = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: heartbeat,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: vehicle.sys_status,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: vehicle.system_time,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: motion.gps_raw,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: motion.attitude,
    mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: motion.attitude_quaternion,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: motion.local_position,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: motion.global_position,
    mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: motion.servo_output,
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: vehicle.mission_current,
    mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: vehicle.origin,
    mavlink.MAVLINK_MSG_ID_VFR_HUD: motion.vfr_hud,
    mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET: motion.attitude_target,
    mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: motion.position_target,
    mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT: motion.position_target_global,
    mavlink.MAVLINK_MSG_ID_ALTITUDE: motion.altitude,
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: vehicle.battery_status,
    mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: autopilot_version,
    mavlink.MAVLINK_MSG_ID_FENCE_STATUS: vehicle.fence_status,
    mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS: vehicle.estimator_status,
    mavlink.MAVLINK_MSG_ID_HOME_POSITION: vehicle.home_position,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: vehicle.extended_state,
    mavlink.MAVLINK_MSG_ID_FLIGHT_INFORMATION: vehicle.flight_information,
    EscStatus.id: motion.esc_status,
    mavlink.MAVLINK_MSG_ID_PROTOCOL_VERSION: vehicle.protocol_version,
    mavlink.MAVLINK_MSG_ID_ODOMETRY: motion.odometry,
    mavlink.MAVLINK_MSG_ID_ACTUATOR_OUTPUT_STATUS: motion.actuator_output,
    mavlink.MAVLINK_MSG_ID_CURRENT_MODE: modes.current_mode,
    mavlink.MAVLINK_MSG_ID_AVAILABLE_MODES_MONITOR: modes.available_modes_monitor,
    FS_LOOP_TIMING_ID: lambda f: f.loop_timing(),
}
"""What can be streamed, by message id."""

_MANY = frozenset({mavlink.MAVLINK_MSG_ID_AVAILABLE_MODES})


def is_available(message_id: int) -> bool:
    """Tell whether ``messages`` knows the message."""
    return message_id in MAKERS or message_id in _MANY


def messages(message_id: int, f: VehicleFacts, argument: float = 0.0) -> Iterator[Message]:
    """Yield a message as it is now; ``argument`` is the second parameter of REQUEST_MESSAGE.

    Two of ESC_STATUS, which holds four rotors, for more of them; as many AVAILABLE_MODES as are asked for.
    """
    if message_id == mavlink.MAVLINK_MSG_ID_AVAILABLE_MODES:
        yield from modes.available_modes(argument)
        return
    yield MAKERS[message_id](f)
    if message_id == EscStatus.id and f.rotors > 4:
        yield motion.esc_status(f, 4)
