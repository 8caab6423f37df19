"""Single updates and predictions of the filter: what each may move, and what it adds."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from flightstack.core.contract import Vector3
from flightstack.core.geometry import quaternion_from_euler, rotate, wrap_pi
from flightstack.estimation.alignment import align
from flightstack.estimation.error_state import (
    ACCEL_BIAS,
    ATTITUDE,
    BARO_BIAS,
    ERROR_STATES,
    GYRO_BIAS,
    POSITION,
    VELOCITY,
)
from flightstack.estimation.estimator_params import EstimatorParams
from flightstack.estimation.fusion import fuse_baro, fuse_field_axis, fuse_rest_rate
from flightstack.estimation.kalman import BARO, GNSS_VELOCITY, MAG, REST_RATE, Filter
from flightstack.estimation.memory import MEMORY
from flightstack.estimation.prediction import ImuNoise, predict_errors
from flightstack.estimation.source_checks import take_rest_innovation

PARAMS = EstimatorParams(mag_noise_gauss=0.001)
FIELD = Vector3(0.2, 0.0, 0.4)
"""Of the Earth, and so that of a level vehicle that heads north."""
NOISE_RAD_S = 2.2e-4
"""Of the mean rate over 0.1 s, of a consumer's gyro."""
QUIET = ImuNoise(Vector3(0.0, 0.0, 0.0), Vector3(0.0, 0.0, 0.0))


def level(gnss_s: float = 0.0) -> Filter:
    """Return a filter at 10 s, level and heading north, with all states correlated; GNSS was fused at ``gnss_s``."""
    memory = np.zeros(1, MEMORY)[0]
    f = Filter(*(memory[name] for name in Filter._fields))
    f.clock[0] = 10.0
    f.nominal[0], f.nominal[16], f.nominal[18] = 1.0, FIELD.x, FIELD.z
    mixed = np.random.default_rng(3).normal(size=(ERROR_STATES, ERROR_STATES))
    f.covariance[:] = 1e-4 * (mixed @ mixed.T / ERROR_STATES)
    f.observations[GNSS_VELOCITY]["fused_s"] = gnss_s
    return f


@pytest.mark.parametrize(("gnss_s", "moves"), [(9.8, False), (5.0, True)], ids=["with GNSS", "without GNSS"])
def test_magnetometer_moves_yaw_but_neither_tilt_nor_what_moves_it(gnss_s: float, moves: bool) -> None:
    f = level(gnss_s)
    before, spread = f.nominal.copy(), f.covariance.copy()
    fuse_field_axis(f, 1, FIELD._replace(y=0.004), PARAMS)
    changed = f.nominal - before
    assert abs(changed[3]) > 5e-5  # the yaw
    assert changed[1:3] == pytest.approx(0.0, abs=1e-12)
    assert np.all(changed[4:10] == 0.0)  # velocity, position
    assert np.all(changed[13:16] == 0.0)  # bias of the accelerometer
    assert np.all((changed[10:12] != 0.0) == moves)  # biases of the gyro about x and y
    assert changed[12] != 0.0
    held = [*range(ATTITUDE, ATTITUDE + 2), *range(VELOCITY, GYRO_BIAS + (0 if moves else 2))]
    assert np.array_equal(f.covariance[np.ix_(held, held)], spread[np.ix_(held, held)])


@pytest.mark.parametrize("strength", [0.9, 1.1])
def test_alignment_finds_the_yaw_at_every_heading_in_a_field_of_another_strength(strength: float) -> None:
    earth = Vector3(0.22, 0.014, 0.43)
    for heading_deg in range(-180, 180, 2):
        yaw_rad = math.radians(heading_deg)
        memory = np.zeros(1, MEMORY)[0]
        f = Filter(*(memory[name] for name in Filter._fields))
        sums, field = memory["alignment"], rotate(quaternion_from_euler(0.0, 0.0, -yaw_rad), earth)
        sums["force"], sums["forces"], sums["fields"] = (0.0, 0.0, -9.80665), 1.0, 1.0
        sums["field"] = [strength * value for value in field]
        f.observations["noise"][MAG : MAG + 3] = 1e-6  # learnt before the Earth's field became known
        align(f, sums, earth, math.nan, PARAMS)
        error_rad = wrap_pi(2.0 * math.atan2(f.nominal[3], f.nominal[0]) - yaw_rad)
        # measured: at most 0.0024; 0.087 rad if x always comes first
        assert abs(error_rad) < 0.004, f"{heading_deg} deg: {error_rad:.4f} rad"
        assert np.all(f.observations["fused"][MAG : MAG + 2] == 1.0)


def test_field_of_another_heading_is_refused_for_a_moment_only() -> None:
    f = level(9.8)
    f.covariance[:] = np.eye(ERROR_STATES) * 1e-10
    rng = np.random.default_rng(4)
    for _ in range(1500):
        fuse_field_axis(f, 1, FIELD._replace(y=rng.normal(0.0, 0.001)), PARAMS)
    o = f.observations[MAG + 1]
    assert math.sqrt(o["noise"]) < 0.0015
    refused = o["refused"]
    for _ in range(100):
        fuse_field_axis(f, 1, FIELD._replace(y=0.02 + rng.normal(0.0, 0.001)), PARAMS)
    assert 5 < o["refused"] - refused < 40  # measured: 14, at 20 Hz below a second


def test_disturbance_beyond_the_noise_of_the_start_is_refused_and_not_learnt() -> None:
    f = level(9.8)
    f.covariance[:] = np.eye(ERROR_STATES) * 1e-10
    for _ in range(1500):
        fuse_field_axis(f, 1, FIELD._replace(y=0.0), PARAMS)
    o = f.observations[MAG + 1]
    noise, refused = float(o["noise"]), float(o["refused"])
    for _ in range(300):
        fuse_field_axis(f, 1, FIELD._replace(y=0.1), PARAMS)
    assert o["refused"] == refused + 300
    assert o["noise"] == noise


def hovered(f: Filter, change_m_s: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    """Return the covariance after a prediction of 10 ms level flight, with a change of the velocity north and east."""
    f.covariance[:] = 0.0
    f.behind[0], f.behind[4:] = 0.01, (*change_m_s, -9.80665 * 0.01)
    without = PARAMS._replace(gyro_noise=0.0, accel_noise=0.0, accel_bias_walk=0.0, gyro_bias_walk=0.0)
    predict_errors(f, QUIET, without)
    return f.covariance.copy()


@pytest.mark.parametrize("yaw_rad", [0.0, 0.7, 2.5])
def test_bias_by_misalignment_of_the_gyro_does_not_move_the_velocity(yaw_rad: float) -> None:
    f = level()
    f.nominal[0], f.nominal[3] = math.cos(0.5 * yaw_rad), math.sin(0.5 * yaw_rad)
    hovered(f)
    added = f.covariance[ACCEL_BIAS, ACCEL_BIAS]
    assert math.sqrt(added) == pytest.approx(9.80665 * PARAMS.gyro_scale_error)
    f.covariance[POSITION:GYRO_BIAS] = 0.0
    f.behind[0], f.behind[6] = 0.01, -9.80665 * 0.01
    predict_errors(f, QUIET, PARAMS._replace(gyro_noise=0.0, accel_noise=0.0, accel_bias_walk=0.0))
    moved = f.covariance[VELOCITY, VELOCITY] + f.covariance[VELOCITY + 1, VELOCITY + 1]
    assert moved < 1e-6 * added * 0.01**2  # a bias alone gives twice the last product


def test_bias_of_the_barometer_spreads_with_changes_of_the_airspeed() -> None:
    still = hovered(level())[BARO_BIAS, BARO_BIAS]
    assert still == pytest.approx(PARAMS.baro_walk**2 * 0.01)
    f = level()
    f.nominal[4] = 6.0  # m/s
    share = PARAMS.baro_dynamic_share / 9.80665
    expected = (share * 0.03) ** 2 * (6.0**2 + 2.0**2) * 1.0 / 0.01
    assert hovered(f, (0.03, 0.0))[BARO_BIAS, BARO_BIAS] - still == pytest.approx(expected, rel=1e-6)
    largest = hovered(f, (30.0, 0.0))[BARO_BIAS, BARO_BIAS] - still
    assert largest == pytest.approx(0.01)  # m², of an impact


def turned(f: Filter, rates_rad_s: tuple[float, float, float], seconds: float) -> np.ndarray:
    """Return the deviations of the attitude [rad] after a turn, of a gyro that has errors of scale alone."""
    without = PARAMS._replace(gyro_noise=0.0, accel_noise=0.0, accel_bias_walk=0.0, gyro_bias_walk=0.0)
    for _ in range(round(seconds / 0.02)):
        f.behind[0], f.behind[1:4] = 0.02, np.multiply(rates_rad_s, 0.02)
        predict_errors(f, QUIET, without)
    return np.sqrt(np.diag(f.covariance)[:3])


def test_turn_about_the_vertical_makes_the_yaw_uncertain_but_not_the_tilt() -> None:
    f = level()
    f.covariance[:] = 0.0
    spread = turned(f, (0.0, 0.0, 0.5), 6.0)
    assert 0.5 < spread[2] / (PARAMS.gyro_scale_error * 3.0) < 0.8  # measured 0.60
    # the tilt that a misaligned axis causes turns with the heading: it is counted once, as a bias
    assert spread[:2] == pytest.approx(PARAMS.gyro_scale_error, rel=0.1)


def test_rotation_there_and_back_leaves_little_error_of_scale() -> None:
    f = level()
    f.covariance[:] = 0.0
    turned(f, (0.0, 0.0, 1.0), 0.2)
    spread = turned(f, (0.0, 0.0, -1.0), 0.2)
    assert (
        spread[2] < 0.4 * PARAMS.gyro_scale_error * 0.2
    )  # measured 0.24; 3.2 with noise that is white for 1 s


def test_gusts_weigh_less_than_white_noise_of_the_barometer() -> None:
    weights = []
    for kept in (0.0, 0.9):
        f, error_m, rng = level(9.8), 0.0, np.random.default_rng(6)
        for _ in range(1500):
            f.covariance[:], f.nominal[9] = np.eye(ERROR_STATES) * 1e-6, 0.0
            error_m = kept * error_m + rng.normal(0.0, 0.3 * math.sqrt(1.0 - kept * kept))
            fuse_baro(f, error_m, 0.0, PARAMS)
        o = f.observations[BARO]
        assert math.sqrt(o["noise"]) == pytest.approx(0.3, rel=0.2)
        assert o["nis_sum"] / o["fused"] == pytest.approx(1.0, abs=0.15)
        weights.append(f.gain[POSITION + 2])
    assert weights[1] / weights[0] < 0.1  # measured 0.045; (1 − 0.9) / (1 + 0.9) = 0.053


def rested(f: Filter, rate_rad_s: Callable[[float], float], seconds: float = 10.0) -> float:
    """Return the deviation of the gyro's bias about x after a rest with this rate, measured ten times a second."""
    memory = np.zeros(1, MEMORY)[0]
    f.covariance[:] = 0.0
    f.covariance[GYRO_BIAS, GYRO_BIAS] = 0.02**2
    for step in range(round(10.0 * seconds)):
        fuse_rest_rate(f, 0, Vector3(rate_rad_s(0.1 * step), 0.0, 0.0), NOISE_RAD_S**2, PARAMS)
        take_rest_innovation(memory["checks"], f, 0)
    return math.sqrt(f.covariance[GYRO_BIAS, GYRO_BIAS])


def test_gyro_bias_at_rest_is_known_as_well_as_the_noise_permits() -> None:
    rng = np.random.default_rng(5)
    deviations, errors = [], []
    for _ in range(40):
        f = level()
        f.nominal[10] = 0.0
        deviations.append(rested(f, lambda _: 0.004 + rng.normal(0.0, NOISE_RAD_S)))
        errors.append(f.nominal[10] - 0.004)
    assert np.sqrt(np.mean(np.square(errors))) < 4e-5  # measured 2.5e-5
    assert np.mean(deviations) == pytest.approx(NOISE_RAD_S / 10.0, rel=0.3)  # measured 1.2 times that


def test_gyro_noise_of_a_vehicle_that_sways_is_that_of_its_motion() -> None:
    f = level()
    f.nominal[10] = 0.0
    deviation = rested(f, lambda time_s: 0.002 * math.sin(2.0 * math.pi * 0.3 * time_s))
    assert math.sqrt(f.observations[REST_RATE]["noise"]) > 5.0 * NOISE_RAD_S  # measured 6.6
    assert abs(f.nominal[10]) < deviation < 5e-4  # measured 3e-6, 2.9e-4


def test_gyro_bias_that_steps_at_rest_is_learnt_within_four_seconds() -> None:
    f, rng = level(), np.random.default_rng(7)
    f.nominal[10] = 0.0
    rested(f, lambda _: rng.normal(0.0, NOISE_RAD_S))
    before = f.covariance.copy()
    memory = np.zeros(1, MEMORY)[0]
    for _ in range(40):
        fuse_rest_rate(f, 0, Vector3(0.005 + rng.normal(0.0, NOISE_RAD_S), 0.0, 0.0), NOISE_RAD_S**2, PARAMS)
        take_rest_innovation(memory["checks"], f, 0)
    assert f.nominal[10] == pytest.approx(0.005, abs=2.0 * NOISE_RAD_S)  # measured 0.0049
    assert f.covariance[GYRO_BIAS, GYRO_BIAS] > before[GYRO_BIAS, GYRO_BIAS]
