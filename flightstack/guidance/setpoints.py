"""Offboard setpoints and stick positions, and the record that passes the newest of them to the kernels. Pure."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from flightstack.core.contract import Quaternion, RecordArray, Vector3

NOT_GIVEN = Vector3(math.nan, math.nan, math.nan)
IDENTITY = Quaternion(1.0, 0.0, 0.0, 0.0)


class PointSetpoint(NamedTuple):
    """A trajectory point in NED; NaN for values that the sender does not set.

    North and east are set together or not at all. Each direction has at least one of position, velocity
    and acceleration. Without a heading, ``yaw_rate_rad_s`` turns the vehicle; without either, the vehicle keeps its
    heading.
    """

    position_ned_m: Vector3 = NOT_GIVEN
    velocity_ned_m_s: Vector3 = NOT_GIVEN
    acceleration_ned_m_s2: Vector3 = NOT_GIVEN
    yaw_rad: float = math.nan
    yaw_rate_rad_s: float = math.nan


class AttitudeSetpoint(NamedTuple):
    """An attitude, or body rates if ``attitude`` is None, with the thrust as share of the maximum thrust."""

    attitude: Quaternion | None
    rates_frd_rad_s: Vector3
    thrust_share: float


OffboardSetpoint = PointSetpoint | AttitudeSetpoint


class Sticks(NamedTuple):
    """Stick positions from −1 to 1; 0 is the centre, also of ``up``."""

    forward: float
    right: float
    up: float
    yaw: float


CENTRED = Sticks(0.0, 0.0, 0.0, 0.0)

NOTHING, POINT, ATTITUDE, RATES = range(4)
"""Kinds of setpoint."""

STREAM = np.dtype(
    [
        ("kind", "i8"),
        ("age", "f8"),  # s since the newest setpoint
        ("position", "f8", 3),  # m NED, NaN where not given, as in the next two
        ("velocity", "f8", 3),
        ("acceleration", "f8", 3),
        ("yaw", "f8"),
        ("yaw_rate", "f8"),
        ("attitude", "f8", 4),
        ("rates", "f8", 3),  # rad/s FRD
        ("thrust", "f8"),  # N
        ("sticks", "f8", 4),  # fields of ``Sticks``
    ]
)


def empty_stream() -> RecordArray:
    """Return a stream without a setpoint, with centred sticks."""
    stream: RecordArray = np.zeros(1, STREAM)
    for name in ("position", "velocity", "acceleration", "yaw", "yaw_rate"):
        stream[name] = math.nan
    stream["attitude"] = IDENTITY
    return stream


def store_setpoint(stream: RecordArray, setpoint: OffboardSetpoint, max_thrust_n: float) -> None:
    """Store ``setpoint`` in ``stream``; the thrust is converted to newtons."""
    s = stream[0]
    s["age"] = 0.0
    if isinstance(setpoint, PointSetpoint):
        s["kind"] = POINT
        s["position"] = setpoint.position_ned_m
        s["velocity"] = setpoint.velocity_ned_m_s
        s["acceleration"] = setpoint.acceleration_ned_m_s2
        s["yaw"], s["yaw_rate"] = setpoint.yaw_rad, setpoint.yaw_rate_rad_s
        return
    s["kind"] = RATES if setpoint.attitude is None else ATTITUDE
    s["attitude"] = setpoint.attitude or IDENTITY
    s["rates"] = setpoint.rates_frd_rad_s
    s["thrust"] = setpoint.thrust_share * max_thrust_n
