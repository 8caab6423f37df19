"""Checks of the estimate: reasons not to arm, and conditions of failsafes in flight."""

from __future__ import annotations

import math
from typing import Any

import pytest

from flightstack.commander.estimate_checks import (
    ATTITUDE_DOUBTFUL,
    BARO_FAULT,
    GNSS_REFUSED,
    IMU_FAULT,
    MAG_FAULT,
    MAG_MISSING,
    POSITION_LOST,
    PREFLIGHT,
    VELOCITY_UNKNOWN,
    conditions_of,
    estimate_failsafes,
    estimate_refusals,
    limits_of,
)
from flightstack.commander.failsafe import Failsafe
from flightstack.core.compiled import plain
from flightstack.estimation.health import (
    NO_HEALTH,
    NOISY,
    Accuracy,
    EstimateHealth,
    PressureTrack,
    accuracy_step,
    is_stuck,
    pressure_step,
)
from flightstack.params.behaviour import Behaviour

GOOD = EstimateHealth(
    aligned=True, has_origin=True, imu_age_s=0.0, imu_is_stuck=False, mag_age_s=0.01, baro_age_s=0.02,
    baro_is_stuck=False, fix_age_s=0.1, unaided_s=0.1, refused_s=0.0, is_inaccurate=False, lag_s=0.13,
    horizontal_m=0.5, velocity_m_s=0.1, tilt_rad=0.005, gyro_bias_rad_s=0.005, accel_bias_m_s2=0.05,
    velocity_ratio=0.2, position_ratio=0.2, height_ratio=0.2, heading_ratio=0.3,
)  # fmt: skip


def test_good_estimate_has_no_refusal_and_no_failsafe() -> None:
    assert estimate_refusals(GOOD, Behaviour()) == estimate_refusals(None, Behaviour()) == ()
    assert estimate_failsafes(GOOD, Behaviour()) == estimate_failsafes(None, Behaviour()) == frozenset()


REFUSED = [
    ({"spare_imu_has_failed": True}, "an inertial sensor has failed"),
    ({"imus_disagree": True}, "the inertial sensors disagree"),
    ({"mag_age_s": math.inf}, "the compass is missing"),
    ({"baro_age_s": 1.5}, "the barometer is missing"),
    ({"baro_is_stuck": True}, "the barometer is stuck"),
    ({"fix_age_s": 3.0}, "GNSS has no fix"),
    ({"aligned": False}, "the attitude is not aligned yet"),
    ({"has_origin": False}, "the GNSS fix is not accurate enough yet"),
    ({"gyro_bias_rad_s": 0.2}, "the gyroscope bias is too high"),
    ({"accel_bias_m_s2": 0.4}, "the accelerometer bias is too high"),
    ({"velocity_ratio": 0.6}, "the velocity estimate is not stable"),
    ({"position_ratio": 0.6}, "the position estimate is not stable"),
    ({"height_ratio": 1.1}, "the height estimate is not stable"),
    ({"heading_ratio": 0.6}, "the heading estimate is not stable"),
]


@pytest.mark.parametrize(("change", "reason"), REFUSED)
def test_each_fault_of_the_estimate_is_a_reason_not_to_arm(change: dict, reason: str) -> None:
    assert estimate_refusals(GOOD._replace(**change), Behaviour()) == (reason,)


def test_every_preflight_check_of_the_estimate_is_tested() -> None:
    assert {reason for _, reason in REFUSED} == {text for text, _ in PREFLIGHT}


CONDITIONS = [
    ({"imu_age_s": 0.05}, Failsafe.IMU_FAULT, "inertial sensor is missing or stuck"),
    ({"imu_is_stuck": True}, Failsafe.IMU_FAULT, "inertial sensor is missing or stuck"),
    ({"tilt_rad": 0.2}, Failsafe.ATTITUDE_DOUBTFUL, "attitude estimate is doubtful"),
    ({"unaided_s": 5.1}, Failsafe.POSITION_LOST, "position is lost"),
    ({"is_inaccurate": True}, Failsafe.POSITION_LOST, "position is lost"),
    ({"lag_s": 0.6}, Failsafe.POSITION_LOST, "position is lost"),
    ({"refused_s": 1.1}, Failsafe.GNSS_REFUSED, "spoofed GNSS suspected"),
]


@pytest.mark.parametrize(("change", "_", "reason"), CONDITIONS)
def test_condition_that_acts_in_the_air_prevents_arming(change: dict, _: Failsafe, reason: str) -> None:
    for action in (0, 1):  # of a lost position: altitude mode, land
        behaviour = Behaviour(position_loss_action=action, gnss_doubt_action=2)
        assert estimate_refusals(GOOD._replace(**change), behaviour) == (reason,)


def test_condition_that_only_warns_does_not_prevent_arming() -> None:
    doubtful = GOOD._replace(refused_s=2.0, tilt_rad=0.2)
    assert estimate_refusals(doubtful, Behaviour(gnss_doubt_action=0, attitude_doubt_action=0)) == ()


def test_estimate_before_the_first_measurement_is_refused() -> None:
    assert "GNSS has no fix" in estimate_refusals(NO_HEALTH, Behaviour())
    assert "the attitude is not aligned yet" in estimate_refusals(NO_HEALTH, Behaviour())


@pytest.mark.parametrize(("change", "failsafe", "_"), CONDITIONS)
def test_each_fault_of_the_estimate_is_a_condition_in_flight(
    change: dict, failsafe: Failsafe, _: str
) -> None:
    assert estimate_failsafes(GOOD._replace(**change), Behaviour()) == {failsafe}


@pytest.mark.parametrize(
    ("changed", "mag_fault", "flying", "bit"),
    [
        ({"imu_is_stuck": True}, 0, False, IMU_FAULT),
        ({"imu_age_s": 0.1}, 0, False, IMU_FAULT),
        ({"tilt_rad": 0.5}, 0, False, ATTITUDE_DOUBTFUL),
        ({"is_inaccurate": True}, 0, False, POSITION_LOST),
        ({"lag_s": 1.0}, 0, False, POSITION_LOST),
        ({"refused_s": 2.0}, 0, False, GNSS_REFUSED),
        ({"velocity_m_s": 2.0}, 0, False, VELOCITY_UNKNOWN),
        ({"velocity_m_s": math.nan}, 0, False, VELOCITY_UNKNOWN),
        ({}, 1, False, MAG_FAULT),
        ({"baro_is_stuck": True}, 0, True, BARO_FAULT),
        ({"baro_age_s": 2.0}, 0, True, BARO_FAULT),
        ({"baro_age_s": 2.0}, 0, False, 0),
        ({"mag_age_s": 2.0}, 0, True, MAG_MISSING),
        ({"mag_age_s": 2.0}, 0, False, 0),
        ({"mag_age_s": math.inf}, 0, True, 0),  # never there
    ],
)
@pytest.mark.parametrize("function", [conditions_of, plain(conditions_of)], ids=["compiled", "plain"])
def test_each_condition_has_a_bit(
    function: Any, changed: dict[str, Any], mag_fault: int, flying: bool, bit: int
) -> None:
    health = GOOD._replace(**changed)
    assert function(health, limits_of(Behaviour()), mag_fault, flying) == bit


def test_limits_of_the_estimate_are_parameters() -> None:
    behaviour = Behaviour(dead_reckoning_s=20.0, tilt_accuracy_deg=0.0)
    doubtful = GOOD._replace(unaided_s=19.0, tilt_rad=1.0)
    assert estimate_failsafes(doubtful, behaviour) == frozenset()
    assert estimate_failsafes(doubtful._replace(unaided_s=21.0), behaviour) == {Failsafe.POSITION_LOST}


def _times_inaccurate(deviations_m: list[float], limit_m: float = 5.0) -> list[float]:
    memory, times = Accuracy(), []
    for tick, deviation_m in enumerate(deviations_m):
        memory = accuracy_step(memory, deviation_m, limit_m, 0.5 * tick)
        if memory.is_inaccurate:
            times.append(0.5 * tick)
    return times


def test_position_is_accurate_again_well_below_its_limit_for_a_second() -> None:
    assert _times_inaccurate([4.9, 5.1, 4.9, 4.1, 3.9, 3.9, 4.9]) == [0.5, 1.0, 1.5, 2.0]
    assert _times_inaccurate([5.1, 3.9, 4.1, 3.9, 3.9]) == [0.0, 0.5, 1.0, 1.5]
    assert _times_inaccurate([5.1, 4.9] * 4) == [0.5 * tick for tick in range(8)]


def test_position_without_a_limit_is_never_inaccurate() -> None:
    assert _times_inaccurate([90.0, math.inf], -1.0) == []


@pytest.mark.parametrize(
    ("landed", "noise_hpa", "is_noisy"), [(True, 0.01, True), (True, 0.0, False), (False, 0.01, False)]
)
def test_pressure_that_changes_at_rest_has_noise(landed: bool, noise_hpa: float, is_noisy: bool) -> None:
    memory = PressureTrack()
    for step in range(2 * NOISY):
        memory = pressure_step(memory, 955.0 + noise_hpa * (step % 3), landed, 0.0, 0.05 * step)
    assert (memory.changes == NOISY) is is_noisy
    for step in range(10):
        memory = pressure_step(memory, 950.0, landed, 2.0, 10.0 + 0.05 * step)
    assert memory.equal_since_s == 10.0
    assert (memory.changes == NOISY) is is_noisy
    assert is_stuck(memory, landed, 2.0, 11.5) is (is_noisy or not landed)
    assert is_stuck(memory, False, 2.0, 11.5) is not (landed and not is_noisy)  # an ideal one may hover
    assert is_stuck(memory, False, 2.5, 11.5)  # in the air a climb shows it
    assert not is_stuck(memory, landed, 2.5, 10.5)


def test_pressures_that_are_equal_by_chance_are_those_of_a_barometer_with_noise() -> None:
    memory = PressureTrack()
    for step, pressure_hpa in enumerate((955.0, 955.1, 955.1, 955.1, 955.0, 955.1)):
        memory = pressure_step(memory, pressure_hpa, True, 0.0, 0.05 * step)
    assert (memory.is_ideal, memory.changes) == (False, 4)
    assert is_stuck(memory, False, 0.0, 1.5)
