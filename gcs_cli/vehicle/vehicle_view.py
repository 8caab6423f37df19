"""What the messages of a vehicle change in its ``VehicleView``. Pure; invalid values on the wire never raise."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.core.portable_math import euler_angles
from flightstack.mavlink.decoding import field_reader
from flightstack.mavlink.dialect import NAME_IN_VERSION, mavlink
from gcs_cli.vehicle import mission_fold
from gcs_cli.vehicle.status_texts import add_piece
from gcs_cli.vehicle.view_types import (
    AvailableMode,
    Battery,
    Changes,
    Estimator,
    Euler,
    GeoPosition,
    Gnss,
    LoopTiming,
    Mission,
    Setpoint,
    Vector,
    VehicleView,
    view_with,
)

_ARMED = 128  # MAV_MODE_FLAG_SAFETY_ARMED
_IGNORE_POSITION, _IGNORE_VELOCITY, _IGNORE_YAW = 0b111, 0b111000, 1 << 10  # POSITION_TARGET_TYPEMASK
_SEA_LEVEL_FRAMES = (0, 5)  # MAV_FRAME_GLOBAL and its twin for integers
_RELATIVE_FRAMES = (3, 6)  # MAV_FRAME_GLOBAL_RELATIVE_ALT and its twin for integers
_IGNORE_ATTITUDE = 128  # ATTITUDE_TARGET_TYPEMASK
_PREARM_CHECK = 1 << 28  # MAV_SYS_STATUS_PREARM_CHECK: no sensor
_MOST_ROTORS = 16
_STANDARD = "MAV_STANDARD_MODE_"
_NOT_SELECTABLE = 2  # MAV_MODE_PROPERTY_NOT_USER_SELECTABLE
_ATTITUDE, _VELOCITY, _POSITION, _ALTITUDE = 1, 0b110, 1 << 4, 1 << 5
"""Flags of ESTIMATOR_STATUS and EKF_STATUS_REPORT."""


SENSOR_NAMES = {
    bit: entry.name.removeprefix("MAV_SYS_STATUS_").removeprefix("SENSOR_").lower().replace("_", " ")
    for bit, entry in mavlink.enums["MAV_SYS_STATUS_SENSOR"].items()
    if bit.bit_count() == 1 and bit not in (_PREARM_CHECK, mavlink.MAV_SYS_STATUS_EXTENSION_USED)
}
"""Names of the sensors in SYS_STATUS, by bit."""


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _vector(x: float, y: float, z: float) -> Vector | None:
    """Return the vector, None if a part is not finite; the sum of three numbers in single precision has no overflow."""
    return Vector(x, y, z) if math.isfinite(x + y + z) else None


def _euler(q: Any) -> Euler | None:
    """Return the angles of a quaternion (w, x, y, z) of any length; None without a direction."""
    norm = math.sqrt(sum(v * v for v in q))
    if not 1e-6 < norm < 1e6:  # NaN fails this too
        return None
    return Euler(*euler_angles(*(v / norm for v in q)))


def _heartbeat(view: VehicleView, message: Any, now_s: float) -> Changes:
    armed = bool(message.base_mode & _ARMED)
    mode = mode_name(view, message.custom_mode)
    changes: Changes = {
        "last_heartbeat_s": now_s,
        "mode": mode,
        "custom_mode": message.custom_mode,
        "mission": mission_fold.after_heartbeat(view, mode, armed),
        "armed": armed,
        "ever_armed": view.ever_armed or armed,
        "system_status": message.system_status,
    }
    if (mode, armed) != (view.mode, view.armed):
        changes["setpoint"] = None  # it may be sent only in modes that have one, or in another frame
    return changes


def mode_name(view: VehicleView, custom_mode: int) -> str:
    """Return the name of a custom mode of this vehicle; an unknown one is shown by its number."""
    known = view.autopilot.mode_name(view.vehicle_type, custom_mode)
    if known is not None:
        return known
    labels = (mode.label.upper() for mode in view.modes if mode.number == custom_mode)
    return next(labels, f"mode {custom_mode}")


def _standard_label(standard_mode: int) -> str:
    """Return the label of a mode that has none of its own: PX4 leaves out those of MAVLink's standard modes."""
    entry = mavlink.enums["MAV_STANDARD_MODE"].get(standard_mode) if standard_mode else None
    return "" if entry is None else entry.name.removeprefix(_STANDARD).replace("_", " ").capitalize()


def _available_mode(view: VehicleView, message: Any, _now_s: float) -> Changes:
    selectable = not message.properties & _NOT_SELECTABLE
    label = message.mode_name or _standard_label(message.standard_mode)
    entry = AvailableMode(message.custom_mode, label, selectable, message.standard_mode)
    others = [mode for mode in view.modes if mode.number != entry.number]
    changes: Changes = {"modes": (*others, entry), "mode_total": message.number_modes}
    return {**changes, "mode": mode_name(view_with(view, changes), view.custom_mode)}


def _system(view: VehicleView, message: Any, _now_s: float) -> Changes:
    enabled = message.onboard_control_sensors_present & message.onboard_control_sensors_enabled
    failed = enabled & ~message.onboard_control_sensors_health
    changes: Changes = {
        "healthy": not failed & ~_PREARM_CHECK,
        "unhealthy": tuple(name for bit, name in SENSOR_NAMES.items() if failed & bit),
        "can_arm": not failed & _PREARM_CHECK if enabled & _PREARM_CHECK else None,
        "battery": None,
    }
    remaining = message.battery_remaining / 100 if 0 <= message.battery_remaining <= 100 else None
    voltage = message.voltage_battery / 1000 if 0 < message.voltage_battery < 65535 else None
    current = message.current_battery / 100 if message.current_battery >= 0 else None
    if remaining is None and voltage is None:
        return changes
    if not view.armed or remaining is None:
        changes["charge_at_arming"] = None
    elif view.charge_at_arming is None and view.time_s is not None:
        changes["charge_at_arming"] = (view.time_s, remaining)
    time_s = None if view.battery is None else view.battery.time_remaining_s
    changes["battery"] = Battery(remaining, voltage, current, time_s)
    return changes


def _fence(_view: VehicleView, message: Any) -> Changes:
    return {"fence_breached": bool(message.breach_status)}


def _battery(view: VehicleView, message: Any, _now_s: float) -> Changes:
    """Take the remaining time of the first battery; SYS_STATUS has the rest."""
    if message.id != 0 or view.battery is None:
        return {}
    return {"battery": view.battery._replace(time_remaining_s=message.time_remaining or None)}


def _gnss(_view: VehicleView, message: Any) -> Changes:
    satellites = None if message.satellites_visible == 255 else message.satellites_visible
    hdop = None if message.eph == 65535 else message.eph / 100
    return {"gnss": Gnss(message.fix_type, satellites, hdop, message.h_acc / 1e3 or None)}


def _estimator_status(_view: VehicleView, message: Any) -> Changes:
    ratios = (message.vel_ratio, message.pos_horiz_ratio, message.pos_vert_ratio, message.mag_ratio)
    horizontal_m, vertical_m = (
        accuracy if accuracy > 0.0 else None  # the true state has none
        for accuracy in (message.pos_horiz_accuracy, message.pos_vert_accuracy)
    )
    health = _estimator(message.flags, ratios)._replace(horizontal_m=horizontal_m, vertical_m=vertical_m)
    return {"estimator": health}


def _ekf_status(_view: VehicleView, message: Any) -> Changes:
    variances = (
        message.velocity_variance,
        message.pos_horiz_variance,
        message.pos_vert_variance,
        message.compass_variance,
    )
    return {"estimator": _estimator(message.flags, variances)}


def _estimator(flags: int, ratios: Iterable[float]) -> Estimator:
    finite = [ratio for ratio in ratios if math.isfinite(ratio)]
    return Estimator(
        bool(flags & _ATTITUDE),
        flags & _VELOCITY == _VELOCITY,
        bool(flags & _POSITION),
        bool(flags & _ALTITUDE),
        max(finite, default=None),
    )


def _wind(_view: VehicleView, message: Any) -> Changes:
    """ArduPilot's WIND: the direction that the wind comes from, and the speed."""
    if not math.isfinite(message.direction):
        return {"wind_ned_m_s": None}
    away_rad = math.radians(message.direction)
    north, east = -message.speed * math.cos(away_rad), -message.speed * math.sin(away_rad)
    return {"wind_ned_m_s": _vector(north, east, message.speed_z)}


def _wind_cov(_view: VehicleView, message: Any) -> Changes:
    vertical_m_s = message.wind_z if math.isfinite(message.wind_z) else 0.0  # NaN: unknown
    return {"wind_ned_m_s": _vector(message.wind_x, message.wind_y, vertical_m_s)}


def _attitude(_view: VehicleView, message: Any) -> Changes:
    angles = _vector(message.roll, message.pitch, message.yaw)
    return {
        "attitude": None if angles is None else Euler(*angles),
        "rates_frd_rad_s": _vector(message.rollspeed, message.pitchspeed, message.yawspeed),
    }


def _attitude_target(_view: VehicleView, message: Any) -> Changes:
    ignored = message.type_mask & _IGNORE_ATTITUDE
    return {"attitude_target": None if ignored else _euler(message.q)}


_read_local_position = field_reader("LOCAL_POSITION_NED", "x", "y", "z", "vx", "vy", "vz")


def _local_position(_view: VehicleView, message: Any) -> Changes:
    x, y, z, vx, vy, vz = _read_local_position(message)
    return {"position_ned_m": _vector(x, y, z), "velocity_ned_m_s": _vector(vx, vy, vz)}


_read_global_position = field_reader(
    "GLOBAL_POSITION_INT", "lat", "lon", "alt", "relative_alt", "vx", "vy", "vz"
)


def _global_position(view: VehicleView, message: Any) -> Changes:
    """Take the position, and the velocity without LOCAL_POSITION_NED; ArduPilot sends zeros until it has them."""
    lat, lon, alt, relative_alt, vx, vy, vz = _read_global_position(message)
    is_known = bool(lat or lon or alt)
    changes: Changes = {
        "geo": GeoPosition(lat / 1e7, lon / 1e7, alt / 1e3, relative_alt / 1e3) if is_known else None
    }
    if view.position_ned_m is None:
        changes["velocity_ned_m_s"] = Vector(vx / 1e2, vy / 1e2, vz / 1e2) if is_known else None
    return changes


def _home(view: VehicleView, message: Any, _now_s: float) -> Changes:
    home = GeoPosition(message.latitude / 1e7, message.longitude / 1e7, message.altitude / 1e3, 0.0)
    return {"home": home, "home_count": view.home_count + 1}


_read_position_target = field_reader(
    "POSITION_TARGET_LOCAL_NED", "type_mask", "x", "y", "z", "vx", "vy", "vz", "yaw"
)


def _position_target(_view: VehicleView, message: Any) -> Changes:
    mask, x, y, z, vx, vy, vz, yaw_rad = _read_position_target(message)
    position = None if mask & _IGNORE_POSITION else _vector(x, y, z)
    velocity = None if mask & _IGNORE_VELOCITY else _vector(vx, vy, vz)
    yaw = None if mask & _IGNORE_YAW else _number(yaw_rad)
    return {"setpoint": Setpoint(position, velocity, yaw)}


def _global_target(view: VehicleView, message: Any, _now_s: float) -> Changes:
    """Take the setpoint of a vehicle that does not send it in its local frame (ArduPilot)."""
    now, geo = view.position_ned_m, view.geo
    is_local = view.setpoint is not None and not view.setpoint.is_global
    is_relative = message.coordinate_frame in _RELATIVE_FRAMES
    has_height = is_relative or message.coordinate_frame in _SEA_LEVEL_FRAMES
    is_known = has_height and not message.type_mask & _IGNORE_POSITION
    if is_local or not is_known or now is None or geo is None:
        return {}
    height_m = geo.relative_altitude_m if is_relative else geo.altitude_m
    frame = LocalFrame(GeoPoint(geo.latitude_deg, geo.longitude_deg, height_m))
    ahead = frame.to_ned(GeoPoint(message.lat_int / 1e7, message.lon_int / 1e7, message.alt))
    place = _vector(now.x + ahead.x, now.y + ahead.y, now.z + ahead.z)
    return {"setpoint": Setpoint(place, is_global=True)}


def _hud(_view: VehicleView, message: Any) -> Changes:
    return {"heading_deg": float(message.heading % 360), "throttle": message.throttle / 100}


def _extended_state(_view: VehicleView, message: Any) -> Changes:
    return {"landed_state": message.landed_state}


def _rotors(view: VehicleView, message: Any, _now_s: float) -> Changes:
    return _with_rotors(view, message.index, message.rpm)


def _with_rotors(view: VehicleView, first: int, speeds_rpm: Iterable[float]) -> Changes:
    if first >= _MOST_ROTORS:
        return {}
    rpm = list(view.rotor_rpm) + [0.0] * (first + 4 - len(view.rotor_rpm))
    rpm[first : first + 4] = [float(value) for value in speeds_rpm]
    if view.identity is not None and view.identity.rotors is not None:  # a message always holds four
        rpm = rpm[: view.identity.rotors]
    peak = max(view.rotor_peak_rpm, *(abs(value) for value in rpm))
    return {"rotor_rpm": tuple(rpm), "rotor_peak_rpm": peak}


def _esc_telemetry(view: VehicleView, message: Any, _now_s: float) -> Changes:
    """ArduPilot's ESC_TELEMETRY_1_TO_4 and the like: the speeds of four rotors, the first one in the name.

    An ESC that draws current at no speed does not measure it, as in ArduPilot's simulation.
    """
    if any(message.current) and not any(message.rpm):
        return {"rotor_rpm": ()}
    first = int(message.get_type().split("_")[2]) - 1
    return _with_rotors(view, first, message.rpm)


def _loop_timing(_view: VehicleView, message: Any) -> Changes:
    names = LoopTiming._fields[4:-1]
    measured = (_number(getattr(message, name)) for name in names)
    lockstep = message.clock == 0
    late = (None, None) if lockstep else (message.overruns, message.missed)
    timing = LoopTiming._make((message.time_us / 1e6, message.ticks, *late, *measured, lockstep))
    return {"timing": timing}


def _version(_view: VehicleView, message: Any) -> Changes:
    return {"is_own": list(message.flight_custom_version) == NAME_IN_VERSION}


def _mission(fold: Callable[[VehicleView, Any], Mission]) -> Callable[[VehicleView, Any, float], Changes]:
    return lambda view, message, _now_s: {"mission": fold(view, message)}


MEASUREMENTS: dict[str, Callable[[VehicleView, Any], Changes]] = {
    "ATTITUDE": _attitude,
    "ATTITUDE_TARGET": _attitude_target,
    "AUTOPILOT_VERSION": _version,
    "EKF_STATUS_REPORT": _ekf_status,
    "ESTIMATOR_STATUS": _estimator_status,
    "EXTENDED_SYS_STATE": _extended_state,
    "FENCE_STATUS": _fence,
    "FS_LOOP_TIMING": _loop_timing,
    "GLOBAL_POSITION_INT": _global_position,
    "GPS_RAW_INT": _gnss,
    "LOCAL_POSITION_NED": _local_position,
    "POSITION_TARGET_LOCAL_NED": _position_target,
    "VFR_HUD": _hud,
    "WIND": _wind,
    "WIND_COV": _wind_cov,
}
"""Messages that leave nothing of an earlier one of their type: only the newest one counts."""

TIMES: dict[str, Callable[[Any], int]] = {
    name: field_reader(name, "time_boot_ms")
    for name in (
        "ATTITUDE",
        "ATTITUDE_TARGET",
        "GLOBAL_POSITION_INT",
        "LOCAL_POSITION_NED",
        "POSITION_TARGET_GLOBAL_INT",
        "POSITION_TARGET_LOCAL_NED",
        "SYSTEM_TIME",
    )
}
"""The vehicle's clock in messages [ms], of which each one counts."""

FOLDS: dict[str, Callable[[VehicleView, Any, float], Changes]] = {
    "AVAILABLE_MODES": _available_mode,
    "BATTERY_STATUS": _battery,
    "ESC_STATUS": _rotors,
    "ESC_TELEMETRY_1_TO_4": _esc_telemetry,
    "ESC_TELEMETRY_5_TO_8": _esc_telemetry,
    "HEARTBEAT": _heartbeat,
    "HOME_POSITION": _home,
    "MISSION_COUNT": _mission(mission_fold.after_count),
    "MISSION_CURRENT": _mission(mission_fold.after_current),
    "MISSION_ITEM": _mission(mission_fold.after_item),
    "MISSION_ITEM_INT": _mission(mission_fold.after_item),
    "MISSION_ITEM_REACHED": _mission(mission_fold.after_reached),
    "POSITION_TARGET_GLOBAL_INT": _global_target,
    "STATUSTEXT": add_piece,
    "SYS_STATUS": _system,
}
"""The other messages, which are folded into the view before, at the time at which they are received."""
