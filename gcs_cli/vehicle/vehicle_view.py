"""Fold MAVLink messages into a ``VehicleView``. Pure; invalid values on the wire never raise."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from flightstack.core.portable_math import euler_angles
from gcs_cli.vehicle.px4_modes import mode_name
from gcs_cli.vehicle.status_texts import add_piece, without_stale_piece
from gcs_cli.vehicle.view_types import (
    Battery,
    Euler,
    GeoPosition,
    Identity,
    LinkCounts,
    LoopTiming,
    Mission,
    Setpoint,
    Vector,
    VehicleView,
)

_NO_AUTOPILOT = 8  # MAV_AUTOPILOT_INVALID: a ground station, a camera …
_ARMED = 128  # MAV_MODE_FLAG_SAFETY_ARMED
_IGNORE_POSITION, _IGNORE_VELOCITY, _IGNORE_YAW = 0b111, 0b111000, 1 << 10  # POSITION_TARGET_TYPEMASK
_IGNORE_ATTITUDE = 128  # ATTITUDE_TARGET_TYPEMASK
_PREARM_CHECK = 1 << 28  # MAV_SYS_STATUS_PREARM_CHECK: no sensor
_RATE_WINDOW_S = 1.0
_MOST_ROTORS = 16
_NO_NUMBER = 65535  # MISSION_CURRENT.total when the vehicle has no mission


def update(view: VehicleView, message: Any, now_s: float) -> VehicleView:
    """Return ``view`` after ``message``, received at ``now_s``; messages of others are ignored.

    The first heartbeat of an autopilot selects the vehicle.
    """
    if view.identity is None:
        if message.get_type() != "HEARTBEAT" or message.autopilot == _NO_AUTOPILOT:
            return view
        sender = Identity(
            message.get_srcSystem(), message.get_srcComponent(), message.type, message.autopilot
        )
        view = view._replace(identity=sender)
    elif (message.get_srcSystem(), message.get_srcComponent()) != view.identity[:2]:
        return view
    view = without_stale_piece(view, now_s)._replace(link=_counted(view.link, message.get_seq(), now_s))
    fold = _FOLDS.get(message.get_type())
    return view if fold is None else fold(view, message, now_s)


def _counted(link: LinkCounts, sequence: int, now_s: float) -> LinkCounts:
    gap = 0 if link.last_sequence is None else (sequence - link.last_sequence - 1) % 256
    if gap > 128:  # out of order or repeated, not a gap of more than half the range
        gap = 0
    start, count, rate = link.window_start_s, link.window_count + 1, link.rate_hz
    if start is None:
        start = now_s
    elif now_s - start >= _RATE_WINDOW_S:
        start, count, rate = now_s, 0, count / (now_s - start)
    return LinkCounts(link.received + 1, link.lost + gap, sequence, now_s, rate, start, count)


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _vector(x: float, y: float, z: float) -> Vector | None:
    return Vector(x, y, z) if math.isfinite(x) and math.isfinite(y) and math.isfinite(z) else None


def _euler(q: Any) -> Euler | None:
    """Return the angles of a quaternion (w, x, y, z) of any length; None without a direction."""
    norm = math.sqrt(sum(v * v for v in q))
    if not 1e-6 < norm < 1e6:  # NaN fails this too
        return None
    return Euler(*euler_angles(*(v / norm for v in q)))


def _heartbeat(view: VehicleView, message: Any, now_s: float) -> VehicleView:
    armed = bool(message.base_mode & _ARMED)
    return view._replace(
        last_heartbeat_s=now_s,
        mode=mode_name(message.custom_mode),
        armed=armed,
        ever_armed=view.ever_armed or armed,
        system_status=message.system_status,
    )


def _system(view: VehicleView, message: Any, _now_s: float) -> VehicleView:
    used = message.onboard_control_sensors_present & message.onboard_control_sensors_enabled & ~_PREARM_CHECK
    view = view._replace(healthy=not used & ~message.onboard_control_sensors_health)
    remaining = message.battery_remaining / 100 if 0 <= message.battery_remaining <= 100 else None
    voltage = message.voltage_battery / 1000 if 0 < message.voltage_battery < 65535 else None
    current = message.current_battery / 100 if message.current_battery >= 0 else None
    if remaining is None and voltage is None:
        return view._replace(battery=None)
    return view._replace(battery=Battery(remaining, voltage, current))


def _attitude(view: VehicleView, message: Any, _now_s: float) -> VehicleView:
    angles = _vector(message.roll, message.pitch, message.yaw)
    return view._replace(
        attitude=None if angles is None else Euler(*angles),
        rates_frd_rad_s=_vector(message.rollspeed, message.pitchspeed, message.yawspeed),
        time_s=message.time_boot_ms / 1e3,
    )


def _attitude_target(view: VehicleView, message: Any, _now_s: float) -> VehicleView:
    ignored = message.type_mask & _IGNORE_ATTITUDE
    return view._replace(
        attitude_target=None if ignored else _euler(message.q), time_s=message.time_boot_ms / 1e3
    )


def _local_position(view: VehicleView, message: Any, _now_s: float) -> VehicleView:
    return view._replace(
        position_ned_m=_vector(message.x, message.y, message.z),
        velocity_ned_m_s=_vector(message.vx, message.vy, message.vz),
        time_s=message.time_boot_ms / 1e3,
    )


def _global_position(view: VehicleView, message: Any, _now_s: float) -> VehicleView:
    geo = GeoPosition(message.lat / 1e7, message.lon / 1e7, message.alt / 1e3, message.relative_alt / 1e3)
    return view._replace(geo=geo, time_s=message.time_boot_ms / 1e3)


def _home(view: VehicleView, message: Any, _now_s: float) -> VehicleView:
    home = GeoPosition(message.latitude / 1e7, message.longitude / 1e7, message.altitude / 1e3, 0.0)
    return view._replace(home=home)


def _position_target(view: VehicleView, message: Any, _now_s: float) -> VehicleView:
    mask = message.type_mask
    position = None if mask & _IGNORE_POSITION else _vector(message.x, message.y, message.z)
    velocity = None if mask & _IGNORE_VELOCITY else _vector(message.vx, message.vy, message.vz)
    yaw = None if mask & _IGNORE_YAW else _number(message.yaw)
    return view._replace(setpoint=Setpoint(position, velocity, yaw), time_s=message.time_boot_ms / 1e3)


def _hud(view: VehicleView, message: Any, _now_s: float) -> VehicleView:
    return view._replace(heading_deg=float(message.heading % 360), throttle=message.throttle / 100)


def _extended_state(view: VehicleView, message: Any, _now_s: float) -> VehicleView:
    return view._replace(landed_state=message.landed_state)


def _mission_current(view: VehicleView, message: Any, _now_s: float) -> VehicleView:
    total = None if message.total == _NO_NUMBER else message.total
    state = message.mission_state or None
    reached = view.mission.reached
    if total is not None and reached is not None and reached >= total:
        reached = None  # of a former mission
    return view._replace(mission=Mission(message.seq, total, reached, state))


def _item_reached(view: VehicleView, message: Any, _now_s: float) -> VehicleView:
    return view._replace(mission=view.mission._replace(reached=message.seq))


def _rotors(view: VehicleView, message: Any, _now_s: float) -> VehicleView:
    first = message.index
    if first >= _MOST_ROTORS:
        return view
    rpm = list(view.rotor_rpm) + [0.0] * (first + 4 - len(view.rotor_rpm))
    rpm[first : first + 4] = [float(value) for value in message.rpm]
    if view.identity is not None and view.identity.rotors is not None:  # a message always holds four
        rpm = rpm[: view.identity.rotors]
    peak = max(view.rotor_peak_rpm, *(abs(value) for value in rpm))
    return view._replace(rotor_rpm=tuple(rpm), rotor_peak_rpm=peak)


def _loop_timing(view: VehicleView, message: Any, _now_s: float) -> VehicleView:
    names = LoopTiming._fields[4:-1]
    measured = (_number(getattr(message, name)) for name in names)
    counts = (message.time_us / 1e6, message.ticks, message.overruns, message.missed)
    timing = LoopTiming._make((*counts, *measured, message.clock == 0))
    return view._replace(timing=timing)


def _system_time(view: VehicleView, message: Any, _now_s: float) -> VehicleView:
    return view._replace(time_s=message.time_boot_ms / 1e3)


_FOLDS: dict[str, Callable[[VehicleView, Any, float], VehicleView]] = {
    "HEARTBEAT": _heartbeat,
    "SYS_STATUS": _system,
    "ATTITUDE": _attitude,
    "ATTITUDE_TARGET": _attitude_target,
    "LOCAL_POSITION_NED": _local_position,
    "GLOBAL_POSITION_INT": _global_position,
    "HOME_POSITION": _home,
    "POSITION_TARGET_LOCAL_NED": _position_target,
    "VFR_HUD": _hud,
    "EXTENDED_SYS_STATE": _extended_state,
    "MISSION_CURRENT": _mission_current,
    "MISSION_ITEM_REACHED": _item_reached,
    "ESC_STATUS": _rotors,
    "FS_LOOP_TIMING": _loop_timing,
    "SYSTEM_TIME": _system_time,
    "STATUSTEXT": add_piece,
}
