"""Messages of the whole vehicle: state, health, mission, battery, home, version."""

from __future__ import annotations

import math
from collections.abc import Iterator

from flightstack import __version__
from flightstack.commander.failsafe import Action
from flightstack.core.contract import Vector3
from flightstack.core.enums import CUSTOM_MODE, Mode
from flightstack.guidance.fence import FenceBreach
from flightstack.mavlink.dialect import NAME_IN_VERSION, mavlink
from flightstack.mavlink.fields import int16, int32, whole
from flightstack.mavlink.link import Message
from flightstack.params.vehicle import system_type
from flightstack.services.telemetry.fields import NAN, boot_ms, wrapped
from flightstack.services.telemetry.sensors import sensor_health
from flightstack.vehicle.status import VehicleStatus, VehicleSummary

MAVLINK_2 = 200
NO_MISSION = 0xFFFF
"""MISSION_CURRENT.total of a vehicle without a mission."""
_OWN_TARGETS = (Mode.TAKEOFF, Mode.MISSION, Mode.HOLD, Mode.RETURN, Mode.LAND)


def heartbeat(f: VehicleSummary, leaving: bool = False) -> Message:
    """HEARTBEAT with PX4's custom mode and, in each mode, PX4's base mode flags."""
    base = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | mavlink.MAV_MODE_FLAG_HIL_ENABLED
    base |= mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED
    if f.mode in _OWN_TARGETS:
        base |= mavlink.MAV_MODE_FLAG_AUTO_ENABLED
    if f.mode not in (Mode.ALTITUDE, Mode.TERMINATION):
        base |= mavlink.MAV_MODE_FLAG_GUIDED_ENABLED
    if f.mode in (Mode.POSITION, Mode.ALTITUDE):
        base |= mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
    if f.armed:
        base |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    system = mavlink.MAV_STATE_POWEROFF if leaving else system_status(f)
    autopilot = mavlink.MAV_AUTOPILOT_GENERIC if f.info.is_generic else mavlink.MAV_AUTOPILOT_PX4
    return mavlink.MAVLink_heartbeat_message(
        system_type(f.info.rotors), autopilot, base, CUSTOM_MODE[f.mode], system, 3
    )


def system_status(f: VehicleSummary) -> int:
    """Return MAV_STATE: critical while a failsafe is active, emergency if its action ends the flight."""
    if f.mode is Mode.TERMINATION:
        return int(mavlink.MAV_STATE_FLIGHT_TERMINATION)
    if f.armed and f.failsafe_action >= Action.LAND:
        return int(mavlink.MAV_STATE_EMERGENCY)
    if f.armed and f.failsafe_action > Action.WARN:
        return int(mavlink.MAV_STATE_CRITICAL)
    return int(mavlink.MAV_STATE_ACTIVE if f.armed else mavlink.MAV_STATE_STANDBY)


def mission_state(f: VehicleStatus) -> int:
    """Return MISSION_STATE."""
    if not f.mission_count:
        return int(mavlink.MISSION_STATE_NO_MISSION)
    if f.mission_complete:
        return int(mavlink.MISSION_STATE_COMPLETE)
    if f.mode is Mode.MISSION:
        return int(mavlink.MISSION_STATE_ACTIVE if f.armed else mavlink.MISSION_STATE_NOT_STARTED)
    begun = f.mission.reached >= 0
    return int(mavlink.MISSION_STATE_PAUSED if begun else mavlink.MISSION_STATE_NOT_STARTED)


def extended_state(f: VehicleStatus) -> Message:
    """EXTENDED_SYS_STATE."""
    landed = mavlink.MAV_LANDED_STATE_IN_AIR
    if f.landed:
        landed = mavlink.MAV_LANDED_STATE_ON_GROUND
    elif f.mode is Mode.TAKEOFF:
        landed = mavlink.MAV_LANDED_STATE_TAKEOFF
    elif f.mode is Mode.LAND:
        landed = mavlink.MAV_LANDED_STATE_LANDING
    return mavlink.MAVLink_extended_sys_state_message(mavlink.MAV_VTOL_STATE_UNDEFINED, landed)


def mission_current(f: VehicleStatus) -> Message:
    """MISSION_CURRENT. ``total`` is 0xFFFF without a mission, since 0 stands for "not supported"."""
    total = f.mission_count or NO_MISSION
    # the current item of a finished mission is one past the last
    current = min(f.mission.current, max(0, f.mission_count - 1))
    mission_mode = 1 if f.mode is Mode.MISSION else 2
    return mavlink.MAVLink_mission_current_message(
        current, total, mission_state(f), mission_mode, *f.plan_ids
    )


def item_reached(f: VehicleStatus) -> tuple[Message, ...]:
    """MISSION_ITEM_REACHED of the last reached item, if any."""
    reached = f.mission.reached
    return (mavlink.MAVLink_mission_item_reached_message(reached),) if reached >= 0 else ()


SENSORS = (
    mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG
    | mavlink.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
    | mavlink.MAV_SYS_STATUS_SENSOR_GPS
    | mavlink.MAV_SYS_STATUS_AHRS
    | mavlink.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
)
"""Sensors reported for the true state from the simulator: clients count a vehicle without them as unhealthy."""


def sys_status(f: VehicleStatus) -> Message:
    """SYS_STATUS with the health bits that MAVSDK and QGroundControl evaluate."""
    checks = mavlink.MAV_SYS_STATUS_GEOFENCE | mavlink.MAV_SYS_STATUS_PREARM_CHECK
    sensors, good_sensors = (SENSORS, SENSORS) if f.sensed is None else sensor_health(f.sensed)
    present = sensors | checks
    healthy = good_sensors | checks if f.state_is_good else 0
    if not f.can_arm():
        healthy &= ~mavlink.MAV_SYS_STATUS_PREARM_CHECK
    if f.fence_breached:
        healthy &= ~mavlink.MAV_SYS_STATUS_GEOFENCE
    if f.battery.valid:
        present |= mavlink.MAV_SYS_STATUS_SENSOR_BATTERY
        healthy |= mavlink.MAV_SYS_STATUS_SENSOR_BATTERY
    enabled = present if f.fence_acts else present & ~mavlink.MAV_SYS_STATUS_GEOFENCE
    return mavlink.MAVLink_sys_status_message(
        present, enabled, healthy, 0, *_battery_fields(f), 0, 0, 0, 0, 0, 0
    )


def _battery_fields(f: VehicleStatus) -> tuple[int, int, int]:
    """Return voltage [mV], current [cA] and charge [%], or MAVLink's values for unknown."""
    b = f.battery
    if not b.valid:
        return 0xFFFF, -1, -1
    voltage = whole(b.voltage_v * 1e3, 0, 0xFFFE) if math.isfinite(b.voltage_v) else 0xFFFF
    current = int16(b.current_a * 100.0) if math.isfinite(b.current_a) else -1
    return voltage, current, whole(b.remaining * 100.0, 0, 100) if math.isfinite(b.remaining) else -1


CHARGE_STATES = (
    mavlink.MAV_BATTERY_CHARGE_STATE_OK,
    mavlink.MAV_BATTERY_CHARGE_STATE_LOW,
    mavlink.MAV_BATTERY_CHARGE_STATE_CRITICAL,
    mavlink.MAV_BATTERY_CHARGE_STATE_EMERGENCY,
)
"""By the battery level of arming checks and failsafes."""


def battery_status(f: VehicleStatus) -> Message:
    """BATTERY_STATUS of one battery, without cell voltages."""
    voltage, current, remaining = _battery_fields(f)
    known = f.battery.valid and math.isfinite(f.battery.remaining)
    charge = CHARGE_STATES[f.battery_level] if known else mavlink.MAV_BATTERY_CHARGE_STATE_UNDEFINED
    return mavlink.MAVLink_battery_status_message(
        0, mavlink.MAV_BATTERY_FUNCTION_ALL, mavlink.MAV_BATTERY_TYPE_LIPO, 0x7FFF,
        [voltage, *[0xFFFF] * 9], current, -1, -1, remaining, 0, charge,
    )  # fmt: skip


def system_time(f: VehicleStatus) -> Message:
    """SYSTEM_TIME, now."""
    return system_time_at(f.time_us)


def system_time_at(time_us: int) -> Message:
    """SYSTEM_TIME: time since boot. Simulated time has no date."""
    return mavlink.MAVLink_system_time_message(0, wrapped(time_us // 1000))


def home_position(f: VehicleStatus) -> Message:
    """HOME_POSITION."""
    home = f.home
    local = f.info.frame.to_ned(home)
    return mavlink.MAVLink_home_position_message(
        int32(home.latitude_deg * 1e7), int32(home.longitude_deg * 1e7), int32(home.altitude_m * 1e3),
        *local, [1.0, 0.0, 0.0, 0.0], NAN, NAN, NAN, f.time_us,
    )  # fmt: skip


def origin(f: VehicleStatus) -> Message:
    """GPS_GLOBAL_ORIGIN: origin of the local frame."""
    point = f.info.frame.to_geo(Vector3(0.0, 0.0, 0.0))
    return mavlink.MAVLink_gps_global_origin_message(
        int32(point.latitude_deg * 1e7), int32(point.longitude_deg * 1e7), int32(point.altitude_m * 1e3),
        f.time_us,
    )  # fmt: skip


def estimator_status(f: VehicleStatus) -> Message:
    """ESTIMATOR_STATUS: the state is the true one, so innovations are zero."""
    flags = (
        mavlink.ESTIMATOR_ATTITUDE | mavlink.ESTIMATOR_VELOCITY_HORIZ | mavlink.ESTIMATOR_VELOCITY_VERT
        | mavlink.ESTIMATOR_POS_HORIZ_REL | mavlink.ESTIMATOR_POS_HORIZ_ABS | mavlink.ESTIMATOR_POS_VERT_ABS
        | mavlink.ESTIMATOR_PRED_POS_HORIZ_REL | mavlink.ESTIMATOR_PRED_POS_HORIZ_ABS
    )  # fmt: skip
    return mavlink.MAVLink_estimator_status_message(
        f.time_us, flags if f.state_is_good else 0, 0.0, 0.0, 0.0, 0.0, NAN, NAN, 0.0, 0.0
    )


def flight_information(f: VehicleStatus) -> Message:
    """FLIGHT_INFORMATION: vehicle time of arming, takeoff and landing of the current flight."""
    times = f.flight
    return mavlink.MAVLink_flight_information_message(
        boot_ms(f), times.armed_us, times.takeoff_us, times.armed_us, times.landing_us // 1000
    )


def fence_status(f: VehicleStatus) -> Message:
    """FENCE_STATUS: breach state, number of breaches, kind and time of the latest."""
    breaches = f.fence_breaches
    kind = mavlink.FENCE_BREACH_NONE
    if breaches.number:  # the boundary goes before the altitude: its breach takes longer to end
        too_high = breaches.flags is FenceBreach.TOO_HIGH
        kind = mavlink.FENCE_BREACH_MAXALT if too_high else mavlink.FENCE_BREACH_BOUNDARY
    return mavlink.MAVLink_fence_status_message(
        int(f.fence_breached), breaches.number, kind, breaches.latest_us // 1000
    )


CAPABILITIES = (
    mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE
    | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_RALLY
    | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FLOAT
    | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
    | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT
    | mavlink.MAV_PROTOCOL_CAPABILITY_FTP
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_ATTITUDE_TARGET
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_FLIGHT_TERMINATION
    | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
)


def autopilot_version(f: VehicleStatus) -> Message:
    """AUTOPILOT_VERSION: capabilities and version of the flight stack."""
    major, minor, patch = (int(part) for part in __version__.split(".")[:3])
    version = major << 24 | minor << 16 | patch << 8
    nothing = [0] * 8
    return mavlink.MAVLink_autopilot_version_message(
        CAPABILITIES, version, 0, 0, 0, NAME_IN_VERSION, nothing, nothing, 0, 0, f.info.system_id
    )


def protocol_version(f: VehicleStatus) -> Message:
    """PROTOCOL_VERSION: sends MAVLink 2, accepts MAVLink 1 and 2."""
    nothing = [0] * 8
    return mavlink.MAVLink_protocol_version_message(MAVLINK_2, 100, MAVLINK_2, nothing, nothing)


STATUSTEXT_SIZE = 50


def status_texts(severity: int, text: str) -> Iterator[Message]:
    """STATUSTEXT, in chunks if longer than 50 bytes; the last chunk is not full."""
    data = text.encode("utf-8")
    if len(data) <= STATUSTEXT_SIZE:
        yield mavlink.MAVLink_statustext_message(severity, data, 0, 0)
        return
    identity = 1 + sum(data) % 0xFFFF
    for chunk, start in enumerate(range(0, len(data) + 1, STATUSTEXT_SIZE)):
        part = data[start : start + STATUSTEXT_SIZE]
        yield mavlink.MAVLink_statustext_message(severity, part, identity, chunk)
