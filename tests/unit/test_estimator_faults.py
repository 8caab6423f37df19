"""The estimator with faults of its sensors, late or missing samples, and a field that is known late."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from flightstack.core.contract import Quaternion, Vector3
from flightstack.core.geometry import conjugate, quaternion_product, rotate
from flightstack.estimation.error_state import POSITION, VELOCITY, turn_between
from flightstack.estimation.estimator import Estimator
from flightstack.estimation.estimator_params import EstimatorParams, GnssLimits, tuning_of
from flightstack.estimation.kalman import GNSS_POSITION, GNSS_VELOCITY, MAG, RANGE
from flightstack.estimation.sensor_samples import (
    BaroSample,
    GnssSample,
    ImuSample,
    MagSample,
    RangeSample,
)
from tests.support import flown_sensors as flown
from tests.support.flown_sensors import Faults

PARAMS = EstimatorParams()._replace(gnss_delay_s=flown.GNSS_DELAY_S, delay_s=flown.GNSS_DELAY_S + 0.012)
GRAVITY = Vector3(0.0, 0.0, -PARAMS.gravity_m_s2)
STILL = Vector3(0.0, 0.0, 0.0)
STEPPED, _ = tuning_of({"EKF2_PREDICT_US": 1000.0, "EKF2_GPS_DELAY": 300.0})
Change = Callable[[Any], Any]


def fly(
    seconds: float, faults: Faults, change: Change = lambda sample: sample, limits: GnssLimits | None = None
) -> Estimator:
    """Fly with samples that ``change`` may replace, or drop by None."""
    estimator = Estimator(PARAMS, limits)
    estimator.set_earth_field(flown.EARTH)
    for sample in flown.samples(seconds, faults):
        changed = change(sample)
        if changed is not None:
            flown.feed(estimator, changed)
    return estimator


def without_barometer(sample: Any) -> Any:
    return None if isinstance(sample, BaroSample) else sample


def yaw_error_deg(estimator: Estimator, time_s: float) -> float:
    return math.degrees(turn_between(flown.attitude(time_s), estimator.state().attitude))


def resets(estimator: Estimator, kind: str) -> float:
    return float(estimator.memory["resets"][kind]["number"][0])


def last_change(estimator: Estimator, kind: str) -> list[float]:
    changes: list[float] = estimator.memory["resets"][kind]["change"][0].tolist()
    return changes


def field_at(yaw_rad: float, earth: Vector3 = flown.EARTH) -> Vector3:
    attitude = Quaternion(math.cos(0.5 * yaw_rad), 0.0, 0.0, math.sin(0.5 * yaw_rad))
    return rotate(conjugate(attitude), earth)


def turning(rate_rad_s: float, seconds: float, begin_s: float = 0.0, mag_period: int = 5) -> Iterator[Any]:
    """Yield IMU at 250 Hz and magnetometer of a level vehicle that turns about its vertical after one second."""
    for tick in range(1, round(seconds / 0.004) + 1):
        time_s = begin_s + 0.004 * tick
        turns = time_s > 1.0
        if tick % mag_period == 0:
            yield MagSample(time_s, field_at(rate_rad_s * max(0.0, time_s - 1.0)))
        yield ImuSample(time_s, 0.004, Vector3(0.0, 0.0, rate_rad_s if turns else 0.0), GRAVITY)


def yaw_deg(estimator: Estimator) -> float:
    return math.degrees(turn_between(Quaternion(1.0, 0.0, 0.0, 0.0), estimator.state().attitude))


# ------------------------------------------------------------------ the Earth's field


@pytest.mark.parametrize("declination_deg", [3.5, -20.0, 120.0])
def test_earth_field_known_late_keeps_a_turn_since_the_alignment(declination_deg: float) -> None:
    estimator = Estimator(PARAMS)
    for sample in turning(math.radians(45.0), 3.0):  # to 90°
        flown.feed(estimator, sample)
    before = yaw_deg(estimator)
    assert before == pytest.approx(90.0 - math.degrees(math.atan2(flown.EARTH.y, flown.EARTH.x)), abs=1.5)
    size, declination = math.hypot(flown.EARTH.x, flown.EARTH.y), math.radians(declination_deg)
    estimator.set_earth_field(
        Vector3(size * math.cos(declination), size * math.sin(declination), flown.EARTH.z)
    )
    for sample in turning(math.radians(45.0), 0.3, begin_s=3.0):
        flown.feed(estimator, sample)
    turned = (yaw_deg(estimator) - before - 13.5 + 180.0) % 360.0 - 180.0
    assert turned == pytest.approx(declination_deg, abs=2.5)  # measured 1.6
    assert resets(estimator, "yaw") == 1.0
    assert math.degrees(estimator.memory["resets"]["yaw"]["change_rad"][0]) == pytest.approx(
        declination_deg, abs=2.5
    )


def test_earth_field_known_in_flight_keeps_the_yaw_of_gnss_velocity() -> None:
    estimator = Estimator(PARAMS)
    estimator.set_declination(math.atan2(flown.EARTH.y, flown.EARTH.x))
    for sample in flown.samples(30.0, Faults()):
        flown.feed(estimator, sample)
    before = yaw_error_deg(estimator, 30.0)
    estimator.set_earth_field(flown.EARTH)
    flown.feed(estimator, ImuSample(30.004, 0.004, STILL, GRAVITY))
    assert abs(before) < 1.5
    assert abs(yaw_error_deg(estimator, 30.0) - before) < 0.5


def test_magnetometer_that_starts_late_gives_the_yaw() -> None:
    estimator = fly(12.0, Faults(mag_from_s=3.0))
    assert estimator.memory["flags"][0]["has_yaw"] == 1
    assert abs(yaw_error_deg(estimator, 12.0)) < 3.0
    assert estimator.memory["observations"][0][MAG]["refused"] == 0.0
    assert resets(estimator, "yaw") == 1.0


# ------------------------------------------------------------------ yaw from GNSS velocity


def test_yaw_without_magnetometer_comes_from_gnss_velocity() -> None:
    estimator = fly(30.0, Faults(has_mag=False))
    assert estimator.memory["flags"][0]["has_yaw"] == 1
    assert abs(yaw_error_deg(estimator, 30.0)) < 5.0
    assert np.abs(estimator.state().velocity_ned_m_s - flown.velocity(30.0)).max() < 0.3
    assert resets(estimator, "yaw") == 1.0


def test_yaw_without_magnetometer_stays_unknown_at_rest() -> None:
    estimator = fly(flown.STANDS_S, Faults(has_mag=False))
    assert estimator.memory["flags"][0]["has_yaw"] == 0
    assert math.degrees(estimator.deviations()[2]) > 90.0


@pytest.mark.parametrize("turned_deg", [90.0, 180.0])
def test_turned_magnetometer_is_disproved_by_gnss_velocity(turned_deg: float) -> None:
    estimator = fly(40.0, Faults(mag_turned_rad=math.radians(turned_deg)))
    assert estimator.memory["flags"][0]["mag_fault"] == 1
    assert abs(yaw_error_deg(estimator, 40.0)) < 5.0
    assert np.abs(estimator.state().velocity_ned_m_s - flown.velocity(40.0)).max() < 0.3


def test_good_magnetometer_is_not_suspected() -> None:
    estimator = fly(30.0, Faults())
    assert estimator.memory["flags"][0]["mag_fault"] == 0
    assert resets(estimator, "yaw") == 0.0


# ------------------------------------------------------------------ GNSS


@pytest.mark.parametrize("accuracy", [math.nan, 0.0, -1.0])
def test_reset_to_gnss_of_unknown_accuracy_stays_finite(accuracy: float) -> None:
    def unknown(sample: Any) -> Any:
        if isinstance(sample, GnssSample):
            return sample._replace(eph_m=accuracy, epv_m=accuracy, speed_accuracy_m_s=accuracy)
        return without_barometer(sample)

    faults = Faults(jump_s=(12.0, math.inf), jump_m=60.0, vertical_jump_m_s=6.0)
    estimator = fly(30.0, faults, unknown, GnssLimits(eph_m=5.0, epv_m=8.0))
    assert resets(estimator, "position") >= 1.0
    assert resets(estimator, "velocity") >= 1.0
    assert np.isfinite(estimator.memory["covariance"]).all()
    assert np.isfinite(estimator.memory["nominal"]).all()


@pytest.mark.parametrize("unknown", [math.nan, math.inf, -1.0])
@pytest.mark.parametrize(("field", "assumed"), [("eph_m", 5.0), ("epv_m", 8.0), ("speed_accuracy_m_s", 0.5)])
def test_first_fix_of_unknown_accuracy_is_judged_by_the_assumed_one(
    field: str, assumed: float, unknown: float
) -> None:
    def change(sample: Any) -> Any:
        return sample._replace(**{field: unknown}) if isinstance(sample, GnssSample) else sample

    for limit, starts in ((0.9 * assumed, False), (assumed, True)):
        estimator = fly(1.5, Faults(), change, GnssLimits()._replace(**{field: limit}))
        assert (estimator.frame is not None) is starts


def test_ideal_gnss_with_zero_accuracies_is_trusted() -> None:
    def ideal(sample: Any) -> Any:
        if isinstance(sample, GnssSample):
            return sample._replace(eph_m=0.0, epv_m=0.0, speed_accuracy_m_s=0.0)
        return sample

    estimator = fly(12.0, Faults(), ideal)
    assert estimator.deviations()[POSITION] < 0.3


def test_lasting_error_of_the_vertical_velocity_without_a_barometer_resets_it_alone() -> None:
    estimator = fly(25.0, Faults(jump_s=(12.0, math.inf), vertical_jump_m_s=4.0), without_barometer)
    assert resets(estimator, "velocity") >= 1.0
    assert last_change(estimator, "velocity")[:2] == [0.0, 0.0]
    assert np.abs(np.array(estimator.state().velocity_ned_m_s)[:2] - flown.velocity(25.0)[:2]).max() < 0.3


def test_vertical_velocity_that_contradicts_both_heights_is_not_followed() -> None:
    estimator = fly(40.0, Faults(jump_s=(12.0, math.inf), vertical_jump_m_s=4.0))
    assert resets(estimator, "velocity") == 0.0
    assert abs(estimator.state().velocity_ned_m_s.z - flown.velocity(40.0)[2]) < 0.5  # measured 0.1
    assert abs(estimator.state().position_ned_m.z - flown.position(40.0)[2]) < 1.0


def test_lasting_jump_of_slow_gnss_resets_the_position() -> None:
    estimator = fly(35.0, Faults(jump_s=(20.0, math.inf), jump_m=60.0, gnss_period=500))  # every 2 s
    assert resets(estimator, "position") == 1.0


def test_resets_of_all_axes_in_one_step_are_added_up() -> None:
    def higher(sample: Any) -> Any:
        is_late = isinstance(sample, GnssSample) and sample.time_s >= 12.0
        return sample._replace(altitude_msl_m=sample.altitude_msl_m + 30.0) if is_late else sample

    estimator = fly(22.0, Faults(jump_s=(12.0, math.inf), jump_m=60.0), higher)
    reset = estimator.memory["resets"]["position"][0]
    assert reset["number"] == 2.0
    assert reset["change"].tolist() == reset["sum"].tolist()
    assert reset["sum"].tolist() == pytest.approx([60.0, 0.0, -30.0], abs=3.0)


def test_refused_fix_after_an_outage_is_not_reset_to() -> None:
    faults = Faults(no_gnss_s=(12.0, 24.0), jump_s=(24.0, 25.0), jump_m=300.0)
    estimator = fly(26.0, faults)
    assert estimator.memory["observations"][0][GNSS_POSITION]["refused"] > 0.0
    # the first accepted one corrects the error of dead reckoning, not the jump of 300 m
    assert abs(last_change(estimator, "position")[0]) < 10.0  # measured 1.7
    assert abs(last_change(estimator, "velocity")[0]) < 2.0  # measured 0.3
    assert np.abs(estimator.state().position_ned_m - flown.position(26.0)).max() < 2.0  # measured 0.2


def test_fix_that_repeats_itself_in_motion_is_dropped() -> None:
    held: list[GnssSample] = []

    def freeze(sample: Any) -> Any:
        if not isinstance(sample, GnssSample) or sample.time_s < 20.0:
            return sample
        held.append(sample)
        return held[0]._replace(time_s=sample.time_s)

    estimator = fly(35.0, Faults(), freeze)
    assert estimator.memory["observations"][0][GNSS_VELOCITY]["fused_s"] == pytest.approx(20.0, abs=0.2)
    assert resets(estimator, "position") == 0.0
    assert (
        np.abs(estimator.state().position_ned_m - flown.position(35.0)).max() < 2.0
    )  # 0.8; 84 if it is fused


# ------------------------------------------------------------------ rates and gaps of samples


@pytest.mark.parametrize("rate_hz", [250, 1000])
def test_fast_sensors_do_not_displace_samples_that_wait(rate_hz: int) -> None:
    estimator, period_s = Estimator(PARAMS._replace(delay_s=0.36)), 1.0 / rate_hz
    for tick in range(1, 3 * rate_hz):
        time_s = tick * period_s
        estimator.mag(MagSample(time_s, flown.EARTH))
        estimator.baro(BaroSample(time_s, 955.0, 500.0, 20.0))
        estimator.imu(ImuSample(time_s, period_s, STILL, GRAVITY))
    used = estimator.memory["observations"][0][MAG]["fused"]
    assert used > 45.0  # 50 Hz, less alignment and delay; each was 10 ms older than the horizon before


def test_fast_gnss_does_not_displace_samples_that_wait() -> None:
    estimator = fly(14.0, Faults(gnss_period=3))  # 83 Hz
    assert estimator.memory["observations"][0][GNSS_VELOCITY]["fused"] > 250.0
    assert abs(estimator.memory["last_gnss_s"][0] - (14.0 - flown.GNSS_DELAY_S)) < 0.08  # measured 0.056


@pytest.mark.parametrize("params", [PARAMS._replace(period_s=0.001, delay_s=0.312), STEPPED])
def test_filter_moves_with_many_steps_in_its_delay(params: EstimatorParams) -> None:
    estimator = Estimator(params)
    for tick in range(1, 3000):
        estimator.imu(ImuSample(0.001 * tick, 0.001, STILL, GRAVITY))
    lag_s = estimator.memory["output"][0, 0] - estimator.memory["clock"][0, 0]
    assert min(params.delay_s, 0.063) <= lag_s < params.delay_s + 0.01


def test_imu_gap_is_bridged_in_real_time_and_counted() -> None:
    def without(sample: Any) -> Any:
        return None if isinstance(sample, ImuSample) and 20.0 < sample.time_s <= 20.1 else sample

    estimator = fly(20.2, Faults(), without)
    assert estimator.memory["gaps"][0]["number"] == 1.0
    assert estimator.memory["gaps"][0]["total_s"] == pytest.approx(0.1, abs=1e-9)
    assert estimator.memory["output"][0, 0] == pytest.approx(20.2)
    assert abs(yaw_error_deg(estimator, 20.2)) < 3.0
    assert np.abs(estimator.state().velocity_ned_m_s - flown.velocity(20.2)).max() < 0.5


def test_imu_gap_raises_the_uncertainty() -> None:
    def after(gap_s: float) -> float:
        estimator = Estimator(PARAMS)
        for sample in turning(0.0, 2.0):
            flown.feed(estimator, sample)
        estimator.set_landed(False)
        for tick in range(60):
            estimator.imu(ImuSample(2.0 + gap_s + 0.004 * (tick + 1), 0.004, STILL, GRAVITY))
        return float(estimator.deviations()[VELOCITY])

    assert after(0.2) > after(0.0) + 0.3


def test_imu_sample_that_is_not_later_is_dropped() -> None:
    estimator = Estimator(PARAMS)
    for sample in turning(0.0, 2.0):
        flown.feed(estimator, sample)
    before = estimator.memory.tobytes()
    estimator.imu(ImuSample(1.9, 0.004, STILL, GRAVITY))
    assert estimator.memory.tobytes() == before


# ------------------------------------------------------------------ range finder, moving platform


def test_tilted_range_finder_does_not_lower_the_ground() -> None:
    estimator, tilt = Estimator(PARAMS), math.radians(30.0)
    force = Vector3(PARAMS.gravity_m_s2 * math.sin(tilt), 0.0, -PARAMS.gravity_m_s2 * math.cos(tilt))
    for tick in range(1, 500):
        estimator.imu(ImuSample(0.004 * tick, 0.004, STILL, force))
        if tick % 5 == 0:
            estimator.mag(MagSample(0.004 * tick, flown.EARTH))
            estimator.range(RangeSample(0.004 * tick, 2.0, 1.0))
    assert estimator.memory["ground_m"][0] == pytest.approx(2.0 * math.cos(tilt), abs=0.03)


def test_ground_is_measured_again_after_a_loss_of_range() -> None:
    estimator = Estimator(PARAMS)
    for tick in range(1, 2000):
        time_s = 0.004 * tick
        estimator.imu(ImuSample(time_s, 0.004, STILL, GRAVITY))
        if tick % 5 == 0 and not 3.0 < time_s < 5.0:
            estimator.range(RangeSample(time_s, 2.0 if time_s < 4.0 else 9.0, 1.0))
    assert estimator.memory["ground_m"][0] == pytest.approx(9.0, abs=0.3)
    assert estimator.memory["observations"][0][RANGE]["refused"] == 0.0


def test_boat_that_drifts_is_not_held_at_rest() -> None:
    estimator = Estimator(PARAMS)
    estimator.set_earth_field(flown.EARTH)
    estimator.set_landed(True)
    frame = flown.LocalFrame(flown.HOME)
    for tick in range(1, 7500):
        time_s = 0.004 * tick
        if tick % 5 == 0:
            estimator.mag(MagSample(time_s, flown.EARTH))
        if tick % 25 == 0:
            point = frame.to_geo(Vector3(0.6 * (time_s - flown.GNSS_DELAY_S), 0.0, 0.0))
            estimator.gnss(GnssSample(time_s, *point, Vector3(0.6, 0.0, 0.0), 0.5, 0.8, 0.1, 3, 14))
        estimator.imu(ImuSample(time_s, 0.004, STILL, GRAVITY))
    assert estimator.state().velocity_ned_m_s.x == pytest.approx(0.6, abs=0.05)
    assert resets(estimator, "velocity") == 0.0


def test_reset_of_the_yaw_turns_the_output_without_a_jump_of_its_rates() -> None:
    estimator, yaws = Estimator(PARAMS), []
    estimator.set_earth_field(flown.EARTH)
    for sample in flown.samples(20.0, Faults(mag_from_s=3.0)):
        flown.feed(estimator, sample)
        if isinstance(sample, ImuSample) and sample.time_s > 4.0:
            yaws.append(yaw_error_deg(estimator, sample.time_s))
    assert max(abs(b - a) for a, b in pairwise(yaws)) < 1.0
    assert quaternion_product(estimator.state().attitude, conjugate(flown.attitude(20.0))).w ** 2 > 0.999
