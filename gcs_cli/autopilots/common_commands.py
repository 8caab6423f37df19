"""Commands that every autopilot takes in the same form. Pure."""

from __future__ import annotations

import math

from flightstack.mavlink.dialect import mavlink
from gcs_cli.autopilots.autopilot import VehicleCommand

NAN = math.nan
GLOBAL = int(mavlink.MAV_FRAME_GLOBAL)
_CUSTOM_MODE = float(mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED)
_FORCE = 21196.0  # MAVLink's magic number

ARM = VehicleCommand(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (1.0,))
DISARM = VehicleCommand(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (0.0,))
FORCE_DISARM = VehicleCommand(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (0.0, _FORCE))
LAND = VehicleCommand(mavlink.MAV_CMD_NAV_LAND, (0.0, 0.0, 0.0, NAN, NAN, NAN, NAN))
RETURN = VehicleCommand(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH)
PAUSE = VehicleCommand(mavlink.MAV_CMD_DO_PAUSE_CONTINUE, (0.0,))
START_MISSION = VehicleCommand(mavlink.MAV_CMD_MISSION_START)
TERMINATE = VehicleCommand(mavlink.MAV_CMD_DO_FLIGHTTERMINATION, (1.0,))
REBOOT = VehicleCommand(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, (1.0,))
HOME_HERE = VehicleCommand(mavlink.MAV_CMD_DO_SET_HOME, (1.0,))


def takeoff(frame: int | None, altitude_m: float) -> VehicleCommand:
    """Return NAV_TAKEOFF to an altitude in ``frame``; NaN: the vehicle's default."""
    position = (NAN, NAN) if frame is None else (0.0, 0.0)
    yaw = NAN if frame is None else 0.0
    return VehicleCommand(mavlink.MAV_CMD_NAV_TAKEOFF, (0.0, 0.0, 0.0, yaw, *position, altitude_m), frame)


def reposition(
    frame: int, latitude_deg: float, longitude_deg: float, altitude_m: float, yaw_rad: float = NAN
) -> VehicleCommand:
    """Return DO_REPOSITION, which also selects the mode that executes it; NaN keeps a value."""
    change_mode = float(mavlink.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE)
    params = (-1.0, change_mode, 0.0, yaw_rad, latitude_deg, longitude_deg, altitude_m)
    return VehicleCommand(mavlink.MAV_CMD_DO_REPOSITION, params, frame)


def speed(speed_m_s: float) -> VehicleCommand:
    """Return the command to set the ground speed."""
    return VehicleCommand(mavlink.MAV_CMD_DO_CHANGE_SPEED, (1.0, speed_m_s, -1.0))


def set_home(latitude_deg: float, longitude_deg: float, altitude_amsl_m: float) -> VehicleCommand:
    """Return the command to set home to a position."""
    params = (0.0, 0.0, 0.0, NAN, latitude_deg, longitude_deg, altitude_amsl_m)
    return VehicleCommand(mavlink.MAV_CMD_DO_SET_HOME, params, mavlink.MAV_FRAME_GLOBAL)


def set_mission_current(seq: int) -> VehicleCommand:
    """Return the command that makes an item, in the vehicle's numbers, the current one."""
    return VehicleCommand(mavlink.MAV_CMD_DO_SET_MISSION_CURRENT, (float(seq),))


def inject_failure(unit: int, failure: int, instance: int) -> VehicleCommand:
    """Return the command that injects a failure; instance 0 means all."""
    return VehicleCommand(mavlink.MAV_CMD_INJECT_FAILURE, (float(unit), float(failure), float(instance)))


def request_message(message_id: int, parameter: float = 0.0) -> VehicleCommand:
    """Return the request for one message."""
    return VehicleCommand(mavlink.MAV_CMD_REQUEST_MESSAGE, (float(message_id), parameter))


def message_interval(message_id: int, rate_hz: float | None) -> VehicleCommand:
    """Return the request for a stream; a rate of 0 stops it, None is the vehicle's default."""
    interval_us = 0.0 if rate_hz is None else 1e6 / rate_hz if rate_hz > 0.0 else -1.0
    return VehicleCommand(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, (float(message_id), interval_us))


def custom_mode(*numbers: float) -> VehicleCommand:
    """Return DO_SET_MODE with the custom mode, or PX4's main and sub mode."""
    return VehicleCommand(mavlink.MAV_CMD_DO_SET_MODE, (_CUSTOM_MODE, *numbers))
