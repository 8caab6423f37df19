"""The estimator on flights with truth in closed form."""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest

from flightstack.core.contract import FloatArray, Vector3
from flightstack.core.geodesy import LocalFrame
from flightstack.core.geometry import conjugate, quaternion_product, rotation_vector
from flightstack.estimation.error_state import ACCEL_BIAS, ATTITUDE, GYRO_BIAS, POSITION, VELOCITY
from flightstack.estimation.estimator import Estimator
from flightstack.estimation.estimator_params import EstimatorParams
from flightstack.estimation.kalman import (
    BARO,
    GNSS_VELOCITY,
)
from flightstack.estimation.sensor_samples import BaroSample, GnssSample, ImuSample, MagSample
from tests.support import flown_sensors as flown
from tests.support.flown_sensors import Faults

SECONDS = 60.0
NO_FAULTS = Faults()
PARAMS = EstimatorParams()._replace(gnss_delay_s=flown.GNSS_DELAY_S, delay_s=flown.GNSS_DELAY_S + 0.012)


class Flight(NamedTuple):
    """Errors of a flight every 0.1 s: time, attitude error [rad] (3), velocity (3), position (3); deviations (27)."""

    errors: FloatArray
    deviations: FloatArray
    nis: FloatArray
    estimator: Estimator

    def between(self, begin_s: float, end_s: float) -> FloatArray:
        times = self.errors[:, 0]
        return self.errors[(times >= begin_s) & (times < end_s)]


@cache
def fly(faults: Faults = NO_FAULTS) -> Flight:
    estimator = Estimator(PARAMS)
    estimator.set_earth_field(flown.EARTH)
    errors, deviations, nis = [], [], []
    for sample in flown.samples(SECONDS, faults):
        flown.feed(estimator, sample)
        if isinstance(sample, GnssSample):
            rows = estimator.memory["observations"][0, GNSS_VELOCITY : GNSS_VELOCITY + 3]
            nis.append(rows["innovation"] ** 2 / np.maximum(rows["variance"], 1e-9))
        if isinstance(sample, ImuSample) and estimator.frame and round(sample.time_s / flown.DT_S) % 25 == 0:
            errors.append(_errors(estimator, sample.time_s))
            deviations.append(estimator.deviations())
    return Flight(np.array(errors), np.array(deviations), np.array(nis), estimator)


def _errors(estimator: Estimator, time_s: float) -> FloatArray:
    state, frame = estimator.state(), estimator.frame
    assert frame is not None
    turn = rotation_vector(quaternion_product(state.attitude, conjugate(flown.attitude(time_s))))
    place = np.array(state.position_ned_m) + LocalFrame(flown.HOME).to_ned(frame.origin)
    return np.concatenate(
        [[time_s], turn, state.velocity_ned_m_s - flown.velocity(time_s), place - flown.position(time_s)]
    )


def rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.sum(np.square(values), axis=-1))))


def test_estimate_follows_a_flight_with_delayed_gnss() -> None:
    errors = fly().between(15.0, SECONDS)
    assert math.degrees(rms(errors[:, 1:3])) < 0.4
    assert math.degrees(rms(errors[:, 3:4])) < 1.0
    assert rms(errors[:, 4:6]) < 0.1  # a delay of 0.12 s alone would be an error of 0.36 m/s
    assert rms(errors[:, 7:9]) < 0.5
    assert rms(errors[:, 9:10]) < 0.5


def test_biases_are_estimated_within_their_deviation() -> None:
    flight = fly()
    nominal, deviation = flight.estimator.memory["nominal"][0], flight.deviations[-1]
    for at, start, truth in ((10, GYRO_BIAS, flown.GYRO_BIAS), (13, ACCEL_BIAS, flown.ACCEL_BIAS)):
        assert np.abs((nominal[at : at + 3] - truth) / deviation[start : start + 3]).max() < 3.5


def test_errors_stay_within_their_deviation() -> None:
    flight = fly()
    for part, at in ((ATTITUDE, 1), (VELOCITY, 4), (POSITION, 7)):
        ratio = flight.errors[100:, at : at + 3] / flight.deviations[100:, part : part + 3]
        assert np.mean(np.square(ratio)) < 2.0


def test_innovations_have_their_predicted_variance() -> None:
    assert 0.6 < float(np.mean(fly().nis[150:])) < 1.4


OUTAGE = Faults(no_gnss_s=(35.0, 50.0))


def test_dead_reckoning_grows_no_faster_than_its_deviation() -> None:
    flight = fly(OUTAGE)
    horizontal = np.hypot(flight.errors[:, 7], flight.errors[:, 8])
    bound = np.hypot(flight.deviations[:, POSITION], flight.deviations[:, POSITION + 1])
    lost = (flight.errors[:, 0] > 36.0) & (flight.errors[:, 0] < 50.0)
    assert (horizontal[lost] < 3.0 * bound[lost]).all()
    assert bound[lost][-1] > 2.0 * bound[lost][0]


def test_correction_after_a_gnss_outage_counts_as_one_reset() -> None:
    flight = fly(OUTAGE)
    assert rms(flight.between(52.0, SECONDS)[:, 7:9]) < 1.0
    assert flight.estimator.memory["resets"]["position"]["number"][0] == 1.0


def test_short_jump_of_gnss_is_refused() -> None:
    flight = fly(Faults(jump_s=(35.0, 39.0), jump_m=30.0))
    errors = flight.between(35.0, 39.0)
    assert np.abs(errors[:, 7:9]).max() < 1.0
    assert flight.estimator.memory["resets"]["position"]["number"][0] == 0.0


def test_lasting_jump_of_gnss_resets_the_position_alone() -> None:
    flight = fly(Faults(jump_s=(35.0, math.inf), jump_m=30.0))
    resets = flight.estimator.memory["resets"][0]
    assert resets["position"]["number"] == 1.0
    assert resets["position"]["change"][0] == pytest.approx(30.0, abs=1.5)
    assert resets["velocity"]["number"] == 0.0
    assert rms(flight.between(45.0, SECONDS)[:, 4:6]) < 0.15


def test_disturbed_magnetometer_does_not_turn_the_yaw() -> None:
    errors = fly(Faults(disturbed_s=(35.0, 50.0), disturbance_gauss=0.3)).between(35.0, 50.0)
    assert math.degrees(np.abs(errors[:, 3]).max()) < 3.0


def test_sample_of_the_imu_fuses_one_scalar_at_most_and_keeps_pace() -> None:
    estimator, frame = Estimator(), LocalFrame(flown.HOME)
    estimator.set_earth_field(flown.EARTH)
    still, force = Vector3(0.0, 0.0, 0.0), Vector3(0.0, 0.0, -flown.GRAVITY)
    observations, most, lag_s = estimator.memory["observations"][0], 0.0, 0.0
    for tick in range(1, 5001):  # 500 Hz, 10 s
        time_s = 0.002 * tick
        if tick % 10 == 0:
            estimator.mag(MagSample(time_s, flown.EARTH))
            estimator.baro(BaroSample(time_s, 955.0, 488.0 + 0.01 * (tick % 7), 20.0))
        if tick % 50 == 0:
            point = frame.to_geo(Vector3(0.01 * (tick % 7), 0.0, 0.0))
            estimator.gnss(GnssSample(time_s, *point, Vector3(0.01, 0.0, 0.0), 0.5, 0.8, 0.1, 3, 14))
        before = observations["fused"].sum() + observations["refused"].sum()
        was_aligned = estimator.aligned
        estimator.imu(ImuSample(time_s, 0.002, still, force))
        if was_aligned:
            after = observations["fused"].sum() + observations["refused"].sum()
            most = max(most, after - before)
            lag_s = max(lag_s, time_s - estimator.memory["clock"][0, 0])
    assert most == 1.0
    assert lag_s < EstimatorParams().delay_s + 0.045  # within the backlog of 0.03 s, a step and a sample
    assert observations[GNSS_VELOCITY]["fused"] > 85.0  # of 94 after the alignment and the delay
    assert observations[BARO]["fused"] > 150.0  # of 158: it is not stuck


def test_equal_samples_give_equal_bytes() -> None:
    first, second = Estimator(PARAMS), Estimator(PARAMS)
    for sample in flown.samples(5.0, NO_FAULTS):
        flown.feed(first, sample)
        flown.feed(second, sample)
    assert first.memory.tobytes() == second.memory.tobytes()


def test_samples_that_are_not_finite_are_dropped() -> None:
    estimator, nan = Estimator(PARAMS), Vector3(math.nan, 0.0, 0.0)
    for sample in flown.samples(5.0, NO_FAULTS):
        flown.feed(estimator, sample)
        if isinstance(sample, ImuSample):
            estimator.imu(sample._replace(accel_frd_m_s2=nan))
        elif isinstance(sample, MagSample):
            estimator.mag(sample._replace(field_frd_gauss=nan))
        elif isinstance(sample, GnssSample):
            estimator.gnss(sample._replace(velocity_ned_m_s=nan))
        else:
            estimator.baro(sample._replace(pressure_altitude_m=math.inf))
    expected = Estimator(PARAMS)
    for sample in flown.samples(5.0, NO_FAULTS):
        flown.feed(expected, sample)
    assert estimator.memory.tobytes() == expected.memory.tobytes()
