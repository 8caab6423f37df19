"""Messages of a companion or a pilot, and functions that stream them to a ``World``."""

from __future__ import annotations

import math
from collections.abc import Callable

from flightstack.core.contract import Vector3
from flightstack.core.geodesy import LocalFrame
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Message
from flightstack.params.config import DEFAULT_HOME
from tests.support.truth import World

IGNORE_ALL = 0b1101_1111_1111
"""Type mask that ignores all fields."""
INTERVAL_S = 0.02
CHANGE_MODE = 1.0
"""Flag of DO_REPOSITION that selects HOLD."""

Triple = tuple[float, float, float]


def local_point(
    position: Triple | None = None,
    velocity: Triple | None = None,
    acceleration: Triple | None = None,
    yaw: float | None = None,
    yaw_rate: float | None = None,
    frame: int = mavlink.MAV_FRAME_LOCAL_NED,
    target: tuple[int, int] = (1, 1),
) -> Message:
    """Return SET_POSITION_TARGET_LOCAL_NED with the given values; NaN omits a single number."""
    mask = IGNORE_ALL
    for bits, given in (
        (0x7, position),
        (0x38, velocity),
        (0x1C0, acceleration),
        (1 << 10, yaw),
        (1 << 11, yaw_rate),
    ):
        if given is not None:
            mask &= ~bits
    zero = (0.0, 0.0, 0.0)
    numbers = (*(position or zero), *(velocity or zero), *(acceleration or zero), yaw or 0.0, yaw_rate or 0.0)
    return mavlink.MAVLink_set_position_target_local_ned_message(0, *target, frame, mask, *numbers)


def attitude(q: tuple[float, float, float, float], thrust: float) -> Message:
    """Return SET_ATTITUDE_TARGET with an attitude."""
    return mavlink.MAVLink_set_attitude_target_message(0, 1, 1, 7, list(q), 0.0, 0.0, 0.0, thrust)


def body_rates(rates: Triple, thrust: float) -> Message:
    """Return SET_ATTITUDE_TARGET with body rates [rad/s]."""
    return mavlink.MAVLink_set_attitude_target_message(0, 1, 1, 128, [1.0, 0.0, 0.0, 0.0], *rates, thrust)


def sticks(forward: float = 0.0, right: float = 0.0, up: float = 0.0, yaw: float = 0.0) -> Message:
    """Return MANUAL_CONTROL for stick positions of −1 to 1."""
    x, y, r = (round(1000.0 * stick) for stick in (forward, right, yaw))
    return mavlink.MAVLink_manual_control_message(1, x, y, round(500.0 + 500.0 * up), r, 0)


def stream(world: World, message: Message | Callable[[float], Message], seconds: float) -> None:
    """Send a message, or the result of a function of the time since the start, at 50 Hz."""
    began_s = world.time_s
    for _ in range(round(seconds / INTERVAL_S)):
        world.sender.send(message(world.time_s - began_s) if callable(message) else message)
        world.run_for(INTERVAL_S)


def go_to(
    world: World,
    north: float = math.nan,
    east: float = math.nan,
    altitude: float = math.nan,
    yaw: float = math.nan,
    speed: float = -1.0,
    flags: float = CHANGE_MODE,
) -> None:
    """Send DO_REPOSITION as a COMMAND_LONG; ``altitude`` is above home [m]."""
    place = LocalFrame(DEFAULT_HOME).to_geo(Vector3(north, east, 0.0))
    latitude, longitude = place.latitude_deg, place.longitude_deg
    altitude += DEFAULT_HOME.altitude_m
    world.command(mavlink.MAV_CMD_DO_REPOSITION, speed, flags, 0.0, yaw, latitude, longitude, altitude)


def level(yaw_rad: float = 0.0) -> tuple[float, float, float, float]:
    """Return the quaternion of a level vehicle."""
    return math.cos(0.5 * yaw_rad), 0.0, 0.0, math.sin(0.5 * yaw_rad)


def hover_thrust(world: World) -> float:
    """Return hover thrust as a fraction of the maximum thrust."""
    vehicle = world.engine.stack.vehicle
    return vehicle.weight_n / vehicle.max_thrust_n
