"""Offboard setpoints: their messages, and their stream. The newest message of any sender counts.

As in PX4, a number with its ignore bit set, or that is not finite, is not given; north and east must be given
together; horizontal and vertical motion each need a position, a velocity or an acceleration. Beyond PX4, positions in
the frames that move with the vehicle are supported, as defined in common.xml.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable
from typing import NamedTuple

from flightstack.core.contract import Quaternion, Vector3
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.core.linear_algebra import dot
from flightstack.core.portable_math import sin_cos
from flightstack.guidance.setpoints import AttitudeSetpoint, OffboardSetpoint, PointSetpoint
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address, Message, is_for
from flightstack.services.streams.link_loss import StreamMonitor

FORCE_SET, YAW_IGNORE, YAW_RATE_IGNORE = 1 << 9, 1 << 10, 1 << 11
POSITION_BIT, VELOCITY_BIT, ACCELERATION_BIT = 0, 3, 6
"""First of the three ignore bits of position, velocity and acceleration."""

ROLL_RATE_IGNORE, PITCH_RATE_IGNORE, BODY_YAW_RATE_IGNORE = 1, 2, 4
THRUST_BODY_SET, THROTTLE_IGNORE, ATTITUDE_IGNORE = 32, 64, 128

_GLOBAL = (mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT)
_RELATIVE = (mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)
_LOCAL = mavlink.MAV_FRAME_LOCAL_NED
_BODY_NED = (
    mavlink.MAV_FRAME_BODY_NED
)  # positions as in LOCAL_NED, velocities and accelerations as in BODY_FRD
_OFFSET_FRAMES = (
    mavlink.MAV_FRAME_LOCAL_OFFSET_NED,
    mavlink.MAV_FRAME_BODY_OFFSET_NED,
    mavlink.MAV_FRAME_BODY_FRD,
)
_BODY_FRAMES = (_BODY_NED, mavlink.MAV_FRAME_BODY_OFFSET_NED, mavlink.MAV_FRAME_BODY_FRD)
_UNSET = 0x7FFFFFFF  # INT32_MAX: a latitude or longitude that is not given
_MAX_POSITION_M = 1e7
"""Larger numbers of a position count as not given."""
_WARNING_INTERVAL_S = 10.0  # setpoints come at 50 Hz


class PoseReference(NamedTuple):
    """Pose of the vehicle, for frames that move with it, and the local frame, for global positions."""

    position_ned_m: Vector3
    yaw_rad: float
    frame: LocalFrame
    home_altitude_m: float


def read_setpoint(message: Message, reference: Callable[[], PoseReference]) -> OffboardSetpoint | str:
    """Return the setpoint of a message, or the reason that it is refused."""
    kind = message.get_type()
    if kind == "SET_ATTITUDE_TARGET":
        return _attitude(message)
    if message.type_mask & FORCE_SET:
        return "a force is not supported"
    is_global = kind.endswith("GLOBAL_INT")
    point = _global_point(message, reference()) if is_global else _local_point(message, reference)
    return point if isinstance(point, str) else _checked(point)


def _number(value: float, ignored: int) -> float:
    return math.nan if ignored or not math.isfinite(value) else float(value)


def _vector(values: tuple[float, float, float], mask: int, first_bit: int) -> Vector3:
    return Vector3(*(_number(value, mask >> (first_bit + axis) & 1) for axis, value in enumerate(values)))


def _rotated_by_yaw(v: Vector3, yaw_rad: float) -> Vector3:
    """Rotate forward, right, down to NED by the heading alone. If one horizontal number is not given, it is zero."""
    if math.isnan(v.x) and math.isnan(v.y):
        return v
    forward, right = (0.0 if math.isnan(part) else part for part in v[:2])
    sin_yaw, cos_yaw = sin_cos(yaw_rad)
    return Vector3(cos_yaw * forward - sin_yaw * right, sin_yaw * forward + cos_yaw * right, v.z)


def _bounded_position(position: Vector3) -> Vector3:
    return Vector3(*(value if abs(value) <= _MAX_POSITION_M else math.nan for value in position))


def _local_point(message: Message, reference: Callable[[], PoseReference]) -> PointSetpoint | str:
    frame, mask = message.coordinate_frame, message.type_mask
    position = _vector((message.x, message.y, message.z), mask, POSITION_BIT)
    velocity = _vector((message.vx, message.vy, message.vz), mask, VELOCITY_BIT)
    acceleration = _vector((message.afx, message.afy, message.afz), mask, ACCELERATION_BIT)
    if frame not in (_LOCAL, _BODY_NED, *_OFFSET_FRAMES):
        return f"coordinate frame {frame} is not supported"
    if frame != _LOCAL:
        own, yaw_rad, _, _ = reference()
        if frame in _BODY_FRAMES:
            velocity, acceleration = (
                _rotated_by_yaw(velocity, yaw_rad),
                _rotated_by_yaw(acceleration, yaw_rad),
            )
        if frame in _OFFSET_FRAMES:
            offset = _rotated_by_yaw(position, yaw_rad) if frame in _BODY_FRAMES else position
            position = Vector3(own.x + offset.x, own.y + offset.y, own.z + offset.z)
    return PointSetpoint(_bounded_position(position), velocity, acceleration, *_heading(message))


def _global_point(message: Message, reference: PoseReference) -> PointSetpoint | str:
    frame, mask = message.coordinate_frame, message.type_mask
    if frame not in _GLOBAL and frame not in _RELATIVE:
        return f"coordinate frame {frame} is not supported"
    latitude = math.nan if message.lat_int == _UNSET else message.lat_int / 1e7
    longitude = math.nan if message.lon_int == _UNSET else message.lon_int / 1e7
    place = _vector((latitude, longitude, message.alt), mask, POSITION_BIT)
    if abs(place.x) > 90.0 or abs(place.y) > 180.0:
        return "the position is not on earth"
    altitude_m = place.z + (reference.home_altitude_m if frame in _RELATIVE else 0.0)
    position = reference.frame.to_ned(GeoPoint(place.x, place.y, altitude_m))
    velocity = _vector((message.vx, message.vy, message.vz), mask, VELOCITY_BIT)
    acceleration = _vector((message.afx, message.afy, message.afz), mask, ACCELERATION_BIT)
    return PointSetpoint(_bounded_position(position), velocity, acceleration, *_heading(message))


def _heading(message: Message) -> tuple[float, float]:
    yaw = _number(message.yaw, message.type_mask & YAW_IGNORE)
    if abs(yaw) > 1e4:  # a 32-bit float of this size does not resolve an angle
        yaw = math.nan
    return yaw, _number(message.yaw_rate, message.type_mask & YAW_RATE_IGNORE)


def _checked(point: PointSetpoint) -> PointSetpoint | str:
    vectors = (point.position_ned_m, point.velocity_ned_m_s, point.acceleration_ned_m_s2)
    for vector, name in zip(vectors, ("position", "velocity", "acceleration"), strict=True):
        if math.isnan(vector.x) != math.isnan(vector.y):
            return f"the {name} has only one of its horizontal parts"
    if all(math.isnan(vector.x) for vector in vectors):
        return "no horizontal position, velocity or acceleration is given"
    if all(math.isnan(vector.z) for vector in vectors):
        return "no vertical position, velocity or acceleration is given"
    return point


def _attitude(message: Message) -> AttitudeSetpoint | str:
    mask = message.type_mask
    if mask & THRUST_BODY_SET:
        return "a thrust in three directions is not supported"
    if mask & THROTTLE_IGNORE or not math.isfinite(message.thrust):
        return "no thrust is given"
    thrust = min(max(float(message.thrust), 0.0), 1.0)
    if not mask & ATTITUDE_IGNORE:
        q = tuple(float(part) for part in message.q)
        norm = math.sqrt(dot(q, q))
        if not 0.5 <= norm <= 2.0:  # True for NaN
            return "the attitude is not a unit quaternion"
        attitude = Quaternion(q[0] / norm, q[1] / norm, q[2] / norm, q[3] / norm)
        return AttitudeSetpoint(attitude, Vector3(0.0, 0.0, 0.0), thrust)
    rates = Vector3(
        _number(message.body_roll_rate, mask & ROLL_RATE_IGNORE),
        _number(message.body_pitch_rate, mask & PITCH_RATE_IGNORE),
        _number(message.body_yaw_rate, mask & BODY_YAW_RATE_IGNORE),
    )
    if all(math.isnan(rate) for rate in rates):
        return "neither an attitude nor a body rate is given"
    return AttitudeSetpoint(None, Vector3(*(_bounded_rate(rate) for rate in rates)), thrust)


def _bounded_rate(rate_rad_s: float) -> float:
    """Return a rate limited to ±100 rad/s; 0 if it is not given."""
    return 0.0 if math.isnan(rate_rad_s) else min(max(rate_rad_s, -100.0), 100.0)


class SetpointServer:
    """Takes SET_POSITION_TARGET_LOCAL_NED, SET_POSITION_TARGET_GLOBAL_INT and SET_ATTITUDE_TARGET."""

    handles = frozenset(
        {"SET_POSITION_TARGET_LOCAL_NED", "SET_POSITION_TARGET_GLOBAL_INT", "SET_ATTITUDE_TARGET"}
    )

    def __init__(
        self,
        own: Address,
        reference: Callable[[], PoseReference],
        accept: Callable[[OffboardSetpoint], None],
        warn: Callable[[str], None],
        monitor: StreamMonitor,
    ) -> None:
        """Pass accepted setpoints to ``accept`` and the texts of refusals to ``warn``."""
        self._own = own
        self._reference = reference
        self._accept = accept
        self._warn = warn
        self._monitor = monitor
        self._warned_s = -math.inf

    def receive(self, message: Message, peer: Hashable, now_s: float) -> None:
        """Take a setpoint. A refused one neither replaces the last one nor restarts the stream's timeout."""
        if not is_for(message, self._own):
            return
        setpoint = read_setpoint(message, self._reference)
        if not isinstance(setpoint, str):
            self._accept(setpoint)
            self._monitor.heard()
        elif now_s - self._warned_s >= _WARNING_INTERVAL_S:
            self._warned_s = now_s
            self._warn(f"Setpoint refused: {setpoint}")

    def poll(self, now_s: float) -> list[tuple[Hashable | None, Message]]:
        """Evaluate the stream's timeout. Send nothing."""
        self._monitor.check()
        return []

    def next_deadline(self) -> float | None:
        """Return the time of the next poll."""
        return self._monitor.next_deadline()
