"""The sensors watch each other: accelerometer, barometer, velocity and position of GNSS."""

from __future__ import annotations

import functools
import itertools
import math
from collections import Counter
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from flightstack.core.contract import Vector3
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.estimation.error_state import POSITION
from flightstack.estimation.estimator import Estimator
from flightstack.estimation.estimator_params import EstimatorParams, tuning_of
from flightstack.estimation.kalman import (
    BARO,
    GNSS_POSITION,
    MAG,
)
from flightstack.estimation.sensor_samples import BaroSample, GnssSample, ImuSample, MagSample
from flightstack.estimation.source_checks import (
    POSITION_DRIFTS,
    VELOCITY_IS_WRONG,
)
from flightstack.params.vehicle import load_vehicle
from tests.support import flown_sensors as flown
from tests.support.flown_sensors import Faults

PARAMS = EstimatorParams()._replace(gnss_delay_s=flown.GNSS_DELAY_S, delay_s=flown.GNSS_DELAY_S + 0.012)
BUILT_IN = tuning_of(dict(load_vehicle("x_quad").default_params))[0]
"""Parameters of a built-in vehicle, which states the noise of its sensors."""
STEADY_S, BEGIN_S, END_S = 10.0, 20.0, 50.0
Change = Callable[[Any, float], Any]


@functools.cache
def _flight() -> tuple[Any, ...]:
    return tuple(flown.samples(80.0, Faults()))


def samples_until(end_s: float) -> Iterator[Any]:
    """Yield the samples of a flight."""
    return itertools.takewhile(lambda sample: sample.time_s <= end_s, _flight())


def errors_m(
    change: Change, end_s: float = END_S, params: EstimatorParams = PARAMS
) -> tuple[np.ndarray, Estimator]:
    """Return the largest errors of the position since ``BEGIN_S``, beyond that at ``BEGIN_S``, and the estimator.

    ``change`` returns a sample of a sensor with the fault, from the sample and the time since ``BEGIN_S``.
    """
    estimator, errors = Estimator(params), []
    estimator.set_earth_field(flown.EARTH)
    for sample in samples_until(end_s):
        late = sample.time_s > BEGIN_S
        flown.feed(estimator, change(sample, sample.time_s - BEGIN_S) if late else sample)
        if late and isinstance(sample, ImuSample):
            errors.append(np.array(estimator.state().position_ned_m) - flown.position(sample.time_s))
    return np.abs(np.array(errors) - errors[0]).max(axis=0), estimator


@pytest.mark.parametrize("bias_m_s2", [0.5, -1.5])
def test_wrong_vertical_acceleration_moves_the_height_by_decimetres(bias_m_s2: float) -> None:
    def change(sample: Any, _: float) -> Any:
        if not isinstance(sample, ImuSample):
            return sample
        x, y, z = sample.accel_frd_m_s2
        return sample._replace(accel_frd_m_s2=Vector3(x, y, z + bias_m_s2))

    error, estimator = errors_m(change, 40.0)
    assert error[2] < 1.5  # measured 0.6 and 0.7; 7 and more without the check
    assert estimator.memory["nominal"][0, 15] - flown.ACCEL_BIAS.z == pytest.approx(bias_m_s2, abs=0.1)


@pytest.mark.parametrize("drift_m_s", [0.4, -0.4])
def test_drifting_barometer_is_contradicted_by_gnss_velocity(drift_m_s: float) -> None:
    def change(sample: Any, since_s: float) -> Any:
        if not isinstance(sample, BaroSample):
            return sample
        return sample._replace(pressure_altitude_m=sample.pressure_altitude_m + drift_m_s * since_s)

    error, _ = errors_m(change)
    assert error[2] < 1.8  # measured 1.3 and 1.4, of a drift of 12 m


def _turning(x_deg_s: float) -> Change:
    def turning(sample: Any, _: float) -> Any:
        if not isinstance(sample, ImuSample):
            return sample
        x, y, z = sample.gyro_frd_rad_s
        return sample._replace(gyro_frd_rad_s=Vector3(x + math.radians(x_deg_s), y, z))

    return turning


@pytest.mark.parametrize(("bias_deg_s", "most_m"), [(1.0, 0.5), (3.0, 0.9)])  # measured 0.29, 0.55
def test_gyro_bias_that_steps_in_flight_loses_no_position(bias_deg_s: float, most_m: float) -> None:
    error, estimator = errors_m(_turning(bias_deg_s), 40.0, BUILT_IN)
    assert max(error[:2]) < most_m
    assert estimator.memory["resets"]["position"]["number"][0] == 0.0


def test_stuck_barometer_is_left_out_until_it_changes() -> None:
    held: list[float] = []

    def change(sample: Any, since_s: float) -> Any:
        if not isinstance(sample, BaroSample) or since_s > 20.0:
            return sample
        held.append(sample.pressure_altitude_m + 5.0)
        return sample._replace(pressure_altitude_m=held[0])

    error, estimator = errors_m(change)
    assert error[2] < 0.5  # measured 0.1
    observations = estimator.memory["observations"][0]
    assert observations[BARO]["refused"] < 60.0
    assert observations[BARO]["fused_s"] > END_S - 0.5


def test_barometer_that_jumps_is_used_again_with_a_new_bias() -> None:
    def change(sample: Any, _: float) -> Any:
        if not isinstance(sample, BaroSample):
            return sample
        return sample._replace(pressure_altitude_m=sample.pressure_altitude_m + 20.0)

    error, estimator = errors_m(change)
    assert error[2] < 0.5  # measured 0.1
    assert estimator.memory["observations"][0][BARO]["fused_s"] > END_S - 0.5


def moved(sample: GnssSample, north_m: float, north_m_s: float) -> GnssSample:
    """Return a GNSS sample at another place, with another velocity."""
    frame = LocalFrame(flown.HOME)
    place = frame.to_ned(GeoPoint(sample.latitude_deg, sample.longitude_deg, sample.altitude_msl_m))
    point, v = frame.to_geo(Vector3(place.x + north_m, place.y, place.z)), sample.velocity_ned_m_s
    return GnssSample(sample.time_s, *point, Vector3(v.x + north_m_s, v.y, v.z), *sample[5:])


@pytest.mark.parametrize("wrong_m_s", [0.4, -0.4])
@pytest.mark.parametrize(
    ("accel_noise", "most_m"),
    [
        (BUILT_IN.accel_noise, 0.6),  # measured 0.4 and 0.2, of 12 m: the gate refuses the velocity
        (
            PARAMS.accel_noise,
            2.0,
        ),  # measured 1.8 and 1.6: the filter follows it until it drifts from the barometer
    ],
)
def test_wrong_vertical_velocity_of_gnss_is_outvoted_by_barometer_and_gnss_height(
    wrong_m_s: float, accel_noise: float, most_m: float
) -> None:
    def change(sample: Any, _since_s: float) -> Any:
        if not isinstance(sample, GnssSample):
            return sample
        v = sample.velocity_ned_m_s
        return sample._replace(velocity_ned_m_s=Vector3(v.x, v.y, v.z + wrong_m_s))

    error, _ = errors_m(change, params=PARAMS._replace(accel_noise=accel_noise))
    assert error[2] < most_m


@pytest.mark.parametrize("noise_m", [0.5, 1.0])
def test_noise_of_gnss_height_does_not_put_the_blame_on_the_barometer(noise_m: float) -> None:
    rng, found = np.random.default_rng(2), set()
    estimator = Estimator(PARAMS)
    estimator.set_earth_field(flown.EARTH)
    for sample in samples_until(END_S):
        given = sample
        if isinstance(sample, GnssSample):
            v, height_m = sample.velocity_ned_m_s, sample.altitude_msl_m + noise_m * rng.normal()
            wrong_m_s = 0.4 if sample.time_s > BEGIN_S else 0.0
            given = sample._replace(
                altitude_msl_m=height_m, velocity_ned_m_s=Vector3(v.x, v.y, v.z + wrong_m_s)
            )
        flown.feed(estimator, given)
        found |= blamed(estimator) if sample.time_s > STEADY_S else set()
    assert found == {"climb of GNSS"}


@pytest.mark.parametrize("drift_m_s", [0.2, 1.0])
def test_gnss_position_that_drifts_from_its_velocity_is_refused(drift_m_s: float) -> None:
    def change(sample: Any, since_s: float) -> Any:
        return moved(sample, drift_m_s * since_s, 0.0) if isinstance(sample, GnssSample) else sample

    error, estimator = errors_m(change)
    assert error[0] < 2.0  # measured 1.0 and 0.5, of 6 and 30 m
    assert estimator.memory["refused_s"][0, 3] > 10.0  # GNSS counts as refused
    assert estimator.memory["observations"][0][GNSS_POSITION + 1]["refused"] == 0.0


@pytest.mark.parametrize("wrong_m_s", [0.3, -0.3, 1.0])
def test_sudden_error_of_gnss_velocity_is_outvoted_by_gnss_position(wrong_m_s: float) -> None:
    def change(sample: Any, _since_s: float) -> Any:
        return moved(sample, 0.0, wrong_m_s) if isinstance(sample, GnssSample) else sample

    error, estimator = errors_m(change, 80.0)
    assert error[0] < 2.5  # measured 1.5, 1.4 and 0.3, of 18 and 60 m; 17 m if the position is blamed
    assert estimator.memory["observations"][0][GNSS_POSITION]["refused"] < 40.0


def test_position_becomes_uncertain_while_gnss_contradicts_itself() -> None:
    """A velocity that becomes wrong slowly cannot be told from a position that drifts: the deviation says so."""

    def change(sample: Any, since_s: float) -> Any:
        return moved(sample, 0.0, min(0.1 * since_s, 0.3)) if isinstance(sample, GnssSample) else sample

    error, estimator = errors_m(change, 80.0)
    assert error[0] > 10.0  # 17 m: the filter follows the velocity
    assert float(estimator.deviations()[POSITION]) > 0.5 * error[0]  # 11.6 m; 0.33 m without the doubt


def test_error_of_velocity_beside_an_accuracy_of_centimetres_is_no_drift() -> None:
    def change(sample: Any, _since_s: float) -> Any:
        if not isinstance(sample, GnssSample):
            return sample
        return moved(sample, 0.0, 0.05)._replace(eph_m=0.02, epv_m=0.03)

    error, estimator = errors_m(change)
    assert error[0] < 2.0  # measured 1.4
    assert estimator.memory["observations"][0][GNSS_POSITION]["refused"] < 20.0  # measured 3


# ------------------------------------------------------------------ which sensor is blamed


def _raised(sample: Any, since_s: float) -> Any:
    if not isinstance(sample, BaroSample):
        return sample
    return sample._replace(pressure_altitude_m=sample.pressure_altitude_m + 0.4 * since_s)


def _held(sample: Any, _: float) -> Any:
    return sample._replace(pressure_altitude_m=500.0) if isinstance(sample, BaroSample) else sample


def _pushed(sample: Any, _: float) -> Any:
    if not isinstance(sample, ImuSample):
        return sample
    x, y, z = sample.accel_frd_m_s2
    return sample._replace(accel_frd_m_s2=Vector3(x, y, z - 1.0))


def _climbing(sample: Any, _: float) -> Any:
    if not isinstance(sample, GnssSample):
        return sample
    v = sample.velocity_ned_m_s
    return sample._replace(velocity_ned_m_s=Vector3(v.x, v.y, v.z - 0.4))


def _fast(sample: Any, _: float) -> Any:
    return moved(sample, 0.0, 0.4) if isinstance(sample, GnssSample) else sample


def _drifting(sample: Any, since_s: float) -> Any:
    return moved(sample, 0.4 * since_s, 0.0) if isinstance(sample, GnssSample) else sample


def _turned(sample: Any, _: float) -> Any:
    if not isinstance(sample, MagSample):
        return sample
    x, y, z = sample.field_frd_gauss
    return sample._replace(field_frd_gauss=Vector3(-y, x, z))


def blamed(estimator: Estimator) -> set[str]:
    """Return the sources that count as wrong now."""
    memory = estimator.memory[0]
    checks, now_s, o = memory["checks"], memory["clock"][0], memory["observations"]
    faults = set(checks["fault"][:2])
    signs = {
        "accelerometer": now_s < checks["accel_until_s"],
        "gyro": 0.0 < checks["gyro_s"] > now_s - 2.0,
        "barometer drifts": now_s < checks["baro_until_s"],
        "barometer is stuck": memory["flags"]["has_baro"] == 0,
        "climb of GNSS": checks["fault"][2] == VELOCITY_IS_WRONG,
        "position of GNSS": POSITION_DRIFTS in faults,
        "velocity of GNSS": VELOCITY_IS_WRONG in faults,
        "magnetometer": max(o[MAG]["test_ratio"], o[MAG + 1]["test_ratio"]) > 1.0,
    }
    return {name for name, holds in signs.items() if holds}


@pytest.mark.parametrize(
    ("change", "source"),
    [
        (_pushed, "accelerometer"),
        (_turning(2.0), "gyro"),
        (_raised, "barometer drifts"),
        (_held, "barometer is stuck"),
        (_climbing, "climb of GNSS"),
        (_fast, "velocity of GNSS"),
        (_drifting, "position of GNSS"),
        (_turned, "magnetometer"),
    ],
    ids=lambda value: value.__name__.strip("_") if callable(value) else "",
)
def test_the_sensor_that_is_wrong_is_blamed_longest(change: Change, source: str) -> None:
    estimator, found = Estimator(PARAMS), Counter[str]()
    estimator.set_earth_field(flown.EARTH)
    for sample in samples_until(END_S):
        late = sample.time_s > BEGIN_S
        flown.feed(estimator, change(sample, sample.time_s - BEGIN_S) if late else sample)
        if isinstance(sample, GnssSample) and sample.time_s > STEADY_S:
            assert late or not blamed(estimator)
            found.update(blamed(estimator))
    assert found.most_common(1)[0][0] == source
    assert found.most_common(1)[0][1] > 10  # a second


def test_spoofing_that_moves_position_and_velocity_slowly_is_followed() -> None:
    def change(sample: Any, since_s: float) -> Any:
        if not isinstance(sample, GnssSample):
            return sample
        return moved(sample, 0.025 * since_s * since_s, 0.05 * since_s)

    error, _ = errors_m(change)
    assert error[0] > 10.0  # no other sensor measures position or velocity: a limit of the sensors
