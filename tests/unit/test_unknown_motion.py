"""The estimator over time and motion that its inertial sensor did not measure: gaps, and values beyond its range."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from flightstack.core.contract import FloatArray, Vector3
from flightstack.core.geodesy import LocalFrame
from flightstack.estimation.error_state import ATTITUDE, VELOCITY
from flightstack.estimation.estimator import Estimator
from flightstack.estimation.estimator_params import EstimatorParams, tuning_of
from flightstack.estimation.kalman import GNSS_VELOCITY, KNOWN_FIELD
from flightstack.estimation.rings import Mean, take_mean
from flightstack.estimation.sensor_samples import BaroSample, GnssSample, ImuSample, MagSample
from flightstack.firmware.c_filter import c_layout
from tests.support import flown_sensors as flown
from tests.support.generated_c import in_python

STEP_S, START_S = 0.002, 12.06
PARAMS, _ = tuning_of({})
STILL, GRAVITY = Vector3(0.0, 0.0, 0.0), Vector3(0.0, 0.0, -PARAMS.gravity_m_s2)
RANGE_M_S2 = PARAMS.accel_range_m_s2


def motion(tick: int, accel_m_s2: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return position and velocity NED at a tick, of a vehicle at rest before ``START_S``.

    ``accel_m_s2``, shape (n, 3), are its accelerations from then on, one a tick, and zero after them.
    """
    past = accel_m_s2[: max(0, tick - round(START_S / STEP_S))]
    if not len(past):
        return np.zeros(3), np.zeros(3)
    velocities = np.cumsum(past, axis=0) * STEP_S
    rest = max(0, tick - round(START_S / STEP_S) - len(past))
    return velocities.sum(axis=0) * STEP_S + rest * STEP_S * velocities[-1], velocities[-1]


def samples(seconds: float, accel_m_s2: FloatArray, gap_s: float = 0.0) -> Iterator[Any]:
    """Yield the samples of a level vehicle, with an inertial sensor that is silent for ``gap_s`` from ``START_S``."""
    rng, frame = np.random.default_rng(1), LocalFrame(flown.HOME)
    delay = round(PARAMS.gnss_delay_s / STEP_S)
    start = round(START_S / STEP_S)
    for tick in range(1, round(seconds / STEP_S) + 1):
        time_s = tick * STEP_S
        if tick % 5 == 0:
            yield MagSample(time_s, Vector3(*(np.array(flown.EARTH) + 0.002 * rng.normal(size=3)).tolist()))
        if tick % 10 == 0:
            height_m = -motion(tick, accel_m_s2)[0][2]
            yield BaroSample(time_s, 955.0, 488.0 + height_m + 0.1 * rng.normal(), 20.0)
        if tick % 50 == 0:
            place, velocity = motion(tick - delay, accel_m_s2)
            point = frame.to_geo(Vector3(*(place + 0.1 * rng.normal(size=3)).tolist()))
            speed = Vector3(*(velocity + 0.05 * rng.normal(size=3)).tolist())
            yield GnssSample(time_s, *point, speed, 0.5, 0.8, 0.2, 3, 14)
        if not start < tick < start + round(gap_s / STEP_S):
            index = tick - 1 - start
            force = np.array(GRAVITY) + (accel_m_s2[index] if 0 <= index < len(accel_m_s2) else 0.0)
            force += 0.1 * rng.normal(size=3)
            force = np.clip(force, -RANGE_M_S2, RANGE_M_S2)
            yield ImuSample(
                time_s, STEP_S, Vector3(*(0.01 * rng.normal(size=3)).tolist()), Vector3(*force.tolist())
            )


def fed(seconds: float, accel_m_s2: FloatArray, gap_s: float = 0.0) -> Iterator[Estimator]:
    """Yield the estimator in flight after each sample of its inertial sensor."""
    estimator = Estimator(PARAMS)
    estimator.set_earth_field(flown.EARTH)
    for sample in samples(seconds, accel_m_s2, gap_s):
        flown.feed(estimator, sample)
        if isinstance(sample, ImuSample):
            estimator.set_landed(sample.time_s < 5.0)
            yield estimator


@pytest.mark.parametrize("gap_s", [0.1, 0.2, 0.4, 0.6])
def test_gnss_velocity_is_believed_after_a_gap_with_unseen_acceleration(gap_s: float) -> None:
    accel = np.tile([2.5, 0.0, 0.0], (round(gap_s / STEP_S), 1))
    estimator = list(fed(START_S + gap_s + 2.0, accel, gap_s))[-1]
    observed = estimator.memory["observations"][0, GNSS_VELOCITY]
    assert observed["refused"] == 0.0  # of 0.4 s: 14 while an earlier step had the uncertainty
    assert abs(estimator.state().velocity_ned_m_s.x - 2.5 * gap_s) < 0.1  # measured 0.04


def test_gap_makes_uncertain_what_comes_after_it() -> None:
    gap_s, nothing = 0.4, np.zeros((0, 3))
    before: float = 0.0
    for estimator in fed(START_S + gap_s + 0.3, nothing, gap_s):
        clock_s = float(estimator.memory["clock"][0, 0])
        deviations = estimator.deviations()
        if clock_s <= START_S:
            before = max(before, float(deviations[VELOCITY])) if clock_s > START_S - 1.0 else 0.0
        else:
            break
    assert before < 0.1  # measured 0.02
    assert float(deviations[VELOCITY]) == pytest.approx(3.0 * gap_s, rel=0.05)
    assert float(deviations[ATTITUDE]) == pytest.approx(0.3 * gap_s, rel=0.1)


def test_gap_in_the_alignment_leaves_no_uncertainty_for_the_flight() -> None:
    def tilt_after(gap_s: float) -> float:
        estimator, late_s = Estimator(PARAMS), 0.0
        for tick in range(1, 500):
            late_s = gap_s if tick > 100 else 0.0
            time_s = tick * STEP_S + late_s
            if tick % 5 == 0:
                estimator.mag(MagSample(time_s, flown.EARTH))
            estimator.imu(ImuSample(time_s, STEP_S, STILL, GRAVITY))
        return float(estimator.deviations()[ATTITUDE])

    assert tilt_after(0.8) == pytest.approx(tilt_after(0.0), rel=0.1)  # 0.25 rad instead of 0.05 before


@pytest.mark.parametrize("speed_m_s", [4.0, 8.0])
def test_impact_beyond_the_range_of_the_accelerometer_costs_a_metre(speed_m_s: float) -> None:
    fall = np.zeros((round(speed_m_s / 2.0 / STEP_S) + 2, 3))
    fall[:-2, 2] = 2.0  # down, to the speed; then an impact in two samples
    fall[-2:, 2] = -0.5 * speed_m_s / STEP_S
    end_s, worst_m, late_m = START_S + len(fall) * STEP_S, 0.0, 0.0
    for estimator in fed(end_s + 4.0, fall):
        time_s = float(estimator.memory["output"][0, 0])
        off_m = abs(float(estimator.state().position_ned_m.z) - motion(round(time_s / STEP_S), fall)[0][2])
        worst_m, late_m = max(worst_m, off_m), off_m
    assert worst_m < 2.0  # measured 1.0; 17 m before, until GNSS had been refused for 7 s
    assert late_m < 0.5  # measured 0.2


def test_mean_of_equal_single_precision_samples_is_their_value() -> None:
    mean_of = in_python(take_mean)
    for hz in (50, 100, 200, 1000):
        for value in np.linspace(480.0, 500.0, 7, dtype=np.float32):
            mean = np.zeros(1, c_layout(Mean, "f4"))[0]
            for tick in range(1, 4 * hz):
                row = np.array([5.0 + tick / hz, value], np.float32)
                if mean_of(mean, row, np.float32(0.05)):
                    assert row[1] == value  # an ulp off, it would not count as stuck


def test_earth_field_is_fused_with_a_covariance_of_that_time() -> None:
    estimator: Estimator | None = None
    for estimator in fed(START_S + 1.0, np.zeros((0, 3))):
        if (
            float(estimator.memory["output"][0, 0]) > START_S
            and float(estimator.memory["behind"][0, 0]) > 0.025
        ):
            break
    assert estimator is not None
    fused = estimator.memory["observations"][0][KNOWN_FIELD]["fused"]
    turned, count = estimator.state().attitude, estimator.memory["resets"]["yaw"]["number"][0]
    east = Vector3(flown.EARTH.x, flown.EARTH.y + 0.05, flown.EARTH.z)
    estimator.set_earth_field(east)
    assert estimator.memory["resets"]["yaw"]["number"][0] == count  # with the attitude, not before it
    assert estimator.state().attitude == turned
    time_s = float(estimator.memory["output"][0, 0])
    for tick in range(1, 30):
        estimator.imu(ImuSample(time_s + tick * STEP_S, STEP_S, STILL, GRAVITY))
        if estimator.memory["resets"]["yaw"]["number"][0] > count:
            break
    assert estimator.memory["observations"][0][KNOWN_FIELD]["fused"] == fused + 1.0
    assert float(estimator.memory["behind"][0, 0]) == 0.0
    assert abs(estimator.state().attitude.z - turned.z) > 0.01


def test_parameters_have_the_range_of_the_sensor() -> None:
    params, _ = tuning_of({"IMU_ACCEL_RANGE": 39.2, "IMU_GYRO_RANGE": 500.0})
    assert isinstance(params, EstimatorParams)
    assert params.accel_range_m_s2 == 39.2
    assert params.gyro_range_rad_s == pytest.approx(8.7266, abs=1e-3)
