"""What a companion or a pilot streams to the vehicle: offboard setpoints and stick positions. Pure.

The array form of a stream, ``stream`` in the kernels, is laid out by ``S_…`` and ``STICKS_AT``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from flightstack.core.contract import FloatArray, Quaternion, Vector3

NOT_GIVEN = Vector3(math.nan, math.nan, math.nan)
IDENTITY = Quaternion(1.0, 0.0, 0.0, 0.0)


class PointSetpoint(NamedTuple):
    """A point of a trajectory in NED; NaN where the sender leaves a number open.

    North and east are given together or not at all. Each direction has at least one of position, velocity
    and acceleration. Without a heading ``yaw_rate_rad_s`` turns the vehicle; without either it keeps its own.
    """

    position_ned_m: Vector3 = NOT_GIVEN
    velocity_ned_m_s: Vector3 = NOT_GIVEN
    acceleration_ned_m_s2: Vector3 = NOT_GIVEN
    yaw_rad: float = math.nan
    yaw_rate_rad_s: float = math.nan


class AttitudeSetpoint(NamedTuple):
    """An attitude, or body rates when ``attitude`` is None, with the thrust as share of the largest one."""

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

# array form: the kind, the numbers of either setpoint, the age of the newest, and the sticks
S_KIND, S_POSITION, S_VELOCITY, S_ACCELERATION, S_YAW, S_YAW_RATE = 0, 1, 4, 7, 10, 11
S_ATTITUDE, S_THRUST, S_RATES, S_AGE = 12, 16, 17, 20
STICKS_AT = 21
STREAM_SIZE = 25
NOTHING, POINT, ATTITUDE, RATES = 0.0, 1.0, 2.0, 3.0
"""Kinds of setpoint."""


def empty_stream() -> FloatArray:
    """Return a stream without setpoint, sticks centred."""
    stream = np.zeros(STREAM_SIZE)
    stream[S_POSITION:S_ATTITUDE] = math.nan
    stream[S_ATTITUDE] = 1.0
    return stream


def store_setpoint(stream: FloatArray, setpoint: OffboardSetpoint, max_thrust_n: float) -> None:
    """Make ``setpoint`` the newest of ``stream``; the thrust becomes newtons."""
    stream[S_AGE] = 0.0
    if isinstance(setpoint, PointSetpoint):
        stream[S_KIND] = POINT
        stream[S_POSITION:S_VELOCITY] = setpoint.position_ned_m
        stream[S_VELOCITY:S_ACCELERATION] = setpoint.velocity_ned_m_s
        stream[S_ACCELERATION:S_YAW] = setpoint.acceleration_ned_m_s2
        stream[S_YAW], stream[S_YAW_RATE] = setpoint.yaw_rad, setpoint.yaw_rate_rad_s
        return
    stream[S_KIND] = RATES if setpoint.attitude is None else ATTITUDE
    stream[S_ATTITUDE:S_THRUST] = IDENTITY if setpoint.attitude is None else setpoint.attitude
    stream[S_RATES:S_AGE] = setpoint.rates_frd_rad_s
    stream[S_THRUST] = setpoint.thrust_share * max_thrust_n
