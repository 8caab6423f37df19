"""Sensor samples of a vehicle that stands, climbs and flies circles while it turns, with truth in closed form."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from flightstack.core.contract import Quaternion, Vector3
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.core.geometry import (
    conjugate,
    quaternion_product,
    rotate,
    rotation_vector,
)
from flightstack.estimation.estimator import Estimator
from flightstack.estimation.sensor_samples import BaroSample, GnssSample, ImuSample, MagSample

HOME = GeoPoint(47.397742, 8.545594, 488.0)
EARTH = Vector3(0.2150, 0.0130, 0.4300)
GRAVITY = 9.80665
DT_S = 0.004
STANDS_S, CLIMBS_S = 3.0, 4.0
RADIUS_M, RATE_RAD_S, TURN_RAD_S, HEIGHT_M = 12.0, 0.5, 0.25, 8.0
GYRO_BIAS, ACCEL_BIAS = Vector3(0.004, -0.006, 0.003), Vector3(0.05, -0.04, 0.08)
BODY_FIELD = Vector3(0.010, -0.008, 0.005)
GNSS_DELAY_S = 0.12


def _eased(share: float) -> float:
    """Rise from 0 to 1 with zero velocity and acceleration at both ends."""
    s = min(max(share, 0.0), 1.0)
    return s * s * s * (10.0 + s * (-15.0 + 6.0 * s))


@cache
def position(time_s: float) -> Any:
    """Return the position [m, NED]."""
    height = HEIGHT_M * _eased((time_s - STANDS_S) / CLIMBS_S)
    grown = RADIUS_M * _eased((time_s - STANDS_S - CLIMBS_S) / 6.0)
    angle = RATE_RAD_S * max(0.0, time_s - STANDS_S - CLIMBS_S)
    return np.array([grown * math.cos(angle), grown * math.sin(angle), -height])


@cache
def velocity(time_s: float) -> Any:
    """Return the velocity [m/s, NED]."""
    return (position(time_s + 1e-3) - position(time_s - 1e-3)) / 2e-3


@cache
def attitude(time_s: float) -> Quaternion:
    """Return the attitude whose thrust axis accelerates the vehicle, with a yaw that turns in the air."""
    acceleration = (position(time_s + 0.01) - 2.0 * position(time_s) + position(time_s - 0.01)) / 1e-4
    dx, dy, dz = down = _unit(np.array([0.0, 0.0, GRAVITY]) - acceleration)
    yaw = 0.7 + TURN_RAD_S * max(0.0, time_s - STANDS_S - CLIMBS_S)
    sx, sy, sz = side = _unit(np.array(_cross(down, (math.cos(yaw), math.sin(yaw), 0.0))))
    fx, fy, fz = _cross(side, down)
    w = 0.5 * math.sqrt(max(0.0, 1.0 + fx + sy + dz))
    if w < 0.1:  # close to half a turn
        z = 0.5 * math.sqrt(max(0.0, 1.0 - fx - sy + dz))
        quarter = 0.25 / z
        return Quaternion((fy - sx) * quarter, (dx + fz) * quarter, (dy + sz) * quarter, z)
    quarter = 0.25 / w
    return Quaternion(w, (sz - dy) * quarter, (dx - fz) * quarter, (fy - sx) * quarter)


def _unit(vector: Any) -> list[float]:
    unit: list[float] = (vector / math.sqrt(vector.dot(vector))).tolist()
    return unit


def _cross(a: Sequence[float], b: Sequence[float]) -> tuple[float, float, float]:
    """Return the cross product; NumPy's takes 20 times as long for two vectors."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@cache
def _motion(tick: int) -> tuple[Any, Any]:
    """Return the mean rates [rad/s] and specific force [m/s^2] over the step to ``tick``, body frame."""
    before_s, time_s = (tick - 1) * DT_S, tick * DT_S
    turn = quaternion_product(conjugate(attitude(before_s)), attitude(time_s))
    middle = attitude(time_s - 0.5 * DT_S)
    acceleration = (velocity(time_s) - velocity(before_s)) / DT_S - [0.0, 0.0, GRAVITY]
    force = rotate(conjugate(middle), Vector3(*acceleration.tolist()))
    return np.array(rotation_vector(turn)) / DT_S, np.array(force)


@dataclass(frozen=True)
class Faults:
    """Faults of a flight: times [s] without GNSS, a jump of it [m], a disturbance of the magnetometer [gauss]."""

    no_gnss_s: tuple[float, float] = (math.inf, math.inf)
    jump_s: tuple[float, float] = (math.inf, math.inf)
    jump_m: float = 0.0
    disturbed_s: tuple[float, float] = (math.inf, math.inf)
    disturbance_gauss: float = 0.0
    mag_turned_rad: float = 0.0
    has_mag: bool = True
    mag_from_s: float = 0.0
    gnss_period: int = 25
    """Ticks between two measurements of GNSS."""
    vertical_jump_m_s: float = 0.0
    """Error of the vertical velocity of GNSS during ``jump_s``."""


def _during(span: tuple[float, float], time_s: float) -> bool:
    return span[0] <= time_s < span[1]


def samples(seconds: float, faults: Faults, seed: int = 3) -> Iterator[Any]:
    """Yield the samples of a flight in the order of their arrival."""
    rng = np.random.default_rng(seed)
    frame = LocalFrame(HOME)
    for tick in range(1, round(seconds / DT_S) + 1):
        time_s = tick * DT_S
        if tick % 10 == 0 and faults.has_mag and time_s >= faults.mag_from_s:
            field = (
                np.array(rotate(conjugate(attitude(time_s)), EARTH)) + BODY_FIELD + rng.normal(0.0, 0.003, 3)
            )
            cosine, sine = math.cos(faults.mag_turned_rad), math.sin(faults.mag_turned_rad)
            field[:2] = cosine * field[0] - sine * field[1], sine * field[0] + cosine * field[1]
            field[0] += faults.disturbance_gauss * _during(faults.disturbed_s, time_s)
            yield MagSample(time_s, Vector3(*field.tolist()))
        if tick % 12 == 0:
            altitude_m = HOME.altitude_m - position(time_s)[2] + 3.0 + rng.normal(0.0, 0.1)
            yield BaroSample(time_s, 955.0, float(altitude_m), 20.0)
        if tick % faults.gnss_period == 0 and time_s > GNSS_DELAY_S and not _during(faults.no_gnss_s, time_s):
            yield _gnss(frame, time_s, rng, faults)
        rate, force = _motion(tick)
        rate = rate + GYRO_BIAS + rng.normal(0.0, 0.002, 3)
        noisy = force + ACCEL_BIAS + rng.normal(0.0, 0.05, 3)
        yield ImuSample(time_s, DT_S, Vector3(*rate.tolist()), Vector3(*noisy.tolist()))


def _gnss(frame: LocalFrame, time_s: float, rng: np.random.Generator, faults: Faults) -> GnssSample:
    then_s = time_s - GNSS_DELAY_S
    place = position(then_s) + rng.normal(0.0, 0.2, 3)
    place[0] += faults.jump_m * _during(faults.jump_s, time_s)
    point = frame.to_geo(Vector3(*place.tolist()))
    speed = velocity(then_s) + rng.normal(0.0, 0.05, 3)
    speed[2] += faults.vertical_jump_m_s * _during(faults.jump_s, time_s)
    return GnssSample(time_s, *point, Vector3(*speed.tolist()), 0.5, 0.8, 0.1, 3, 14)


def feed(estimator: Estimator, sample: Any) -> None:
    """Hand a sample to the estimator; the vehicle reports itself landed until it climbs."""
    if isinstance(sample, ImuSample):
        estimator.set_landed(sample.time_s < STANDS_S)
        estimator.imu(sample)
    elif isinstance(sample, MagSample):
        estimator.mag(sample)
    elif isinstance(sample, BaroSample):
        estimator.baro(sample)
    else:
        estimator.gnss(sample)
