"""The state of a vehicle at one instant, for conditions and assertions."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from flightstack.core.contract import Quaternion, Vector3
from flightstack.core.geodesy import GeoPoint
from flightstack.core.geometry import euler_from_quaternion
from flightstack.core.portable_math import distance
from flightstack.process.assembly import Stack
from flightstack.testing.expression import Expression
from sim_bridge.simulator import Simulator

_TOUCH_M = 0.05
"""A vehicle no higher than this touches the ground, as in the figures of a flight."""


class State(NamedTuple):
    """True motion of the vehicle, and what the vehicle reports of itself. Positions count from home at the start."""

    time_s: float
    """Simulated time."""
    mode: str
    """HOLD, TAKEOFF, MISSION, RETURN, LAND, POSITION, ALTITUDE, OFFBOARD or TERMINATION."""
    armed: bool
    landed: bool
    """Result of the vehicle's land detector."""
    altitude_m: float
    position_ned_m: Vector3
    velocity_ned_m_s: Vector3
    roll_deg: float
    pitch_deg: float
    yaw_deg: float
    distance_to_home_m: float
    """Horizontal distance to home."""
    battery_percent: float
    """Charge that the vehicle reports; NaN without a battery."""
    failsafes: tuple[str, ...]
    """Active failsafes by their names, the most important first, such as GCS_LOST or BATTERY_LOW."""
    failsafe: bool
    """True while a failsafe acts: until its end, a user's override, or disarming."""
    item: int
    """The current mission item, from 0; −1 without a mission."""
    error_m: float
    """Distance between true position and position setpoint in flight; NaN if the setpoint leaves an axis free.

    0 on the ground, into which the setpoint of a landing sinks.
    """

    @property
    def north_m(self) -> float:
        """Position north of home at the start."""
        return self.position_ned_m.x

    @property
    def east_m(self) -> float:
        """Position east of home at the start."""
        return self.position_ned_m.y

    @property
    def speed_m_s(self) -> float:
        """Horizontal speed."""
        return distance(self.velocity_ned_m_s.x, self.velocity_ned_m_s.y)

    @property
    def climb_m_s(self) -> float:
        """Vertical speed, positive upwards."""
        return -self.velocity_ned_m_s.z

    def __str__(self) -> str:
        north, east, _ = self.position_ned_m
        parts = [
            f"t = {self.time_s:.2f} s: {self.mode}, {'armed' if self.armed else 'disarmed'}, "
            f"{'landed' if self.landed else 'in the air'}",
            f"{north:.2f} m north, {east:.2f} m east, {self.altitude_m:.2f} m high",
            f"{self.speed_m_s:.2f} m/s, climbing {self.climb_m_s:.2f} m/s",
            f"roll {self.roll_deg:.1f}°, pitch {self.pitch_deg:.1f}°, yaw {self.yaw_deg:.1f}°",
        ]
        if self.failsafes:
            parts.append(f"failsafes {', '.join(self.failsafes)}")
        return "; ".join(parts)


class Reported(NamedTuple):
    """The signals of a state that are modes and flags, in a tenth of the time of a ``State``."""

    mode: str
    armed: bool
    landed: bool
    failsafe: bool


def reported_by(stack: Stack) -> Reported:
    """Return the modes and flags of the present state."""
    now = stack.now
    armed, mode = now.status
    return Reported(mode.name, armed, now.landed, stack.journal.failsafe_acts)


class Condition(NamedTuple):
    """A condition of the present state."""

    is_true: Callable[[], object]
    is_of_events: bool
    """True if its value changes by events of the vehicle alone: it is an expression of modes and flags."""


def condition_of(
    condition: Callable[[State], object] | str, state: Callable[[], State], reported: Callable[[], Reported]
) -> Condition:
    """Return the condition that is a function or an expression."""
    if not isinstance(condition, str):
        return Condition(lambda: condition(state()), is_of_events=False)
    expression = Expression(condition)
    source = reported if expression.has_no_numbers else state
    return Condition(lambda: expression.of_state(source()), expression.has_no_numbers)


def state_of(stack: Stack, simulator: Simulator, start: GeoPoint, time_s: float) -> State:
    """Return the present state; ``start`` is the origin of the simulator, ``time_s`` the time of the world."""
    now, truth = stack.now, simulator.frame.state
    position, velocity = Vector3(*truth[0:3].tolist()), Vector3(*truth[3:6].tolist())
    euler = euler_from_quaternion(Quaternion(*truth[6:10].tolist()))
    roll, pitch, yaw = (math.degrees(angle) for angle in euler)
    flies = now.status.armed and not now.landed and -position.z > _TOUCH_M
    # of the start in the local frame, 0 unless the vehicle had to find out where it is; heights count from there
    offset = stack.places.frame.to_ned(start)._replace(z=0.0)
    home = stack.places.frame.to_ned(stack.area.home)
    in_frame = position + np.array(offset)
    return State(
        time_s=time_s,
        mode=now.status.mode.name,
        armed=now.status.armed,
        landed=now.landed,
        altitude_m=-position.z,
        position_ned_m=position,
        velocity_ned_m_s=velocity,
        roll_deg=roll,
        pitch_deg=pitch,
        yaw_deg=yaw,
        distance_to_home_m=distance(in_frame[0] - home.x, in_frame[1] - home.y),
        battery_percent=100.0 * stack.simulator.battery.remaining,
        failsafes=tuple(failsafe.name for failsafe in stack.parts.failsafes.active),
        failsafe=stack.journal.failsafe_acts,
        item=now.progress.current if now.mission_count else -1,
        error_m=distance(*(now.setpoint[0:3] - in_frame).tolist()) if flies else 0.0,
    )
