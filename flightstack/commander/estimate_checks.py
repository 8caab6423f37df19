"""Checks of the estimate of a vehicle that flies on its sensors: before arming, and in flight. Pure.

Names and limits are PX4's, https://docs.px4.io/main/en/flying/pre_flight_checks.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from flightstack.commander.failsafe import RULES, Action, Failsafe, action_of
from flightstack.core.compiled import compiled, plain
from flightstack.core.record_types import dtype_of
from flightstack.estimation.health import EstimateHealth, WatchArray, update_health
from flightstack.estimation.imu_track import IMU_MISSING_S, TrackArray
from flightstack.estimation.memory import MemoryArray
from flightstack.params.behaviour import Behaviour

MISSING_S = 1.0
"""Age of the newest measurement at which a sensor is missing."""
MOST_GYRO_BIAS_RAD_S, MOST_ACCEL_BIAS_M_S2 = 0.1125, 0.3
"""Three quarters of the limits that PX4 sets to the biases, EKF2_GYR_B_LIM and EKF2_ABL_LIM."""
MOST_RATIO, MOST_HEIGHT_RATIO = 0.5, 1.0
"""Largest mean test ratios: PX4's defaults of COM_ARM_EKF_VEL, _POS, _YAW and _HGT."""
LATE_S = 0.5
"""Age of the filter's state at which the filter has stopped; the longest delay is 0.32 s."""
REFUSED_S = 1.0
"""Time of refused GNSS positions after which spoofing is suspected."""

PREFLIGHT: tuple[tuple[str, Callable[[EstimateHealth], bool]], ...] = (
    ("an inertial sensor has failed", lambda h: not h.spare_imu_has_failed),
    ("the inertial sensors disagree", lambda h: not h.imus_disagree),
    ("the compass is missing", lambda h: h.mag_age_s < MISSING_S),
    ("the barometer is missing", lambda h: h.baro_age_s < MISSING_S),
    ("the barometer is stuck", lambda h: not h.baro_is_stuck),
    ("GNSS has no fix", lambda h: h.fix_age_s < MISSING_S),
    ("the attitude is not aligned yet", lambda h: h.aligned),
    ("the GNSS fix is not accurate enough yet", lambda h: h.has_origin or not h.fix_age_s < MISSING_S),
    ("the gyroscope bias is too high", lambda h: h.gyro_bias_rad_s < MOST_GYRO_BIAS_RAD_S),
    ("the accelerometer bias is too high", lambda h: h.accel_bias_m_s2 < MOST_ACCEL_BIAS_M_S2),
    ("the velocity estimate is not stable", lambda h: h.velocity_ratio < MOST_RATIO),
    ("the position estimate is not stable", lambda h: h.position_ratio < MOST_RATIO),
    ("the height estimate is not stable", lambda h: h.height_ratio < MOST_HEIGHT_RATIO),
    ("the heading estimate is not stable", lambda h: h.heading_ratio < MOST_RATIO),
)
"""Reasons not to arm, each with the condition under which it does not apply."""


def estimate_refusals(health: EstimateHealth | None, behaviour: Behaviour) -> tuple[str, ...]:
    """Return every reason not to arm; none for a vehicle that flies on the simulator's state.

    A condition that acts in the air also prevents arming.
    """
    if health is None:
        return ()
    conditions = estimate_failsafes(health, behaviour) if health.has_origin else frozenset()
    acting = (
        rule
        for rule in RULES
        if rule.failsafe in conditions and action_of(rule.failsafe, behaviour) > Action.WARN
    )
    reasons = [text for text, passes in PREFLIGHT if not passes(health)]
    return (*reasons, *(f"{rule.begins[0].lower()}{rule.begins[1:]}" for rule in acting))


class EstimateLimits(NamedTuple):
    """Limits of the estimate in flight."""

    position_m: float
    """Deviation [1σ] of the horizontal position; zero or less for none."""
    dead_reckoning_s: float
    """Time without an accepted horizontal position or velocity."""
    tilt_rad: float
    """Deviation [1σ]; zero or less for none."""
    velocity_m_s: float
    """Deviation [1σ] of the horizontal velocity."""


LIMITS = dtype_of(EstimateLimits)


def limits_of(behaviour: Behaviour) -> EstimateLimits:
    """Return the limits of the parameters."""
    return EstimateLimits(
        behaviour.position_accuracy_m,
        behaviour.dead_reckoning_s,
        math.radians(behaviour.tilt_accuracy_deg),
        behaviour.velocity_accuracy_m_s,
    )


IMU_FAULT, ATTITUDE_DOUBTFUL, POSITION_LOST, GNSS_REFUSED = 1, 2, 4, 8
VELOCITY_UNKNOWN, MAG_FAULT, BARO_FAULT, MAG_MISSING = 16, 32, 64, 128
"""Bits of ``conditions_of``."""
_FAILSAFES = {
    IMU_FAULT: Failsafe.IMU_FAULT,
    ATTITUDE_DOUBTFUL: Failsafe.ATTITUDE_DOUBTFUL,
    POSITION_LOST: Failsafe.POSITION_LOST,
    GNSS_REFUSED: Failsafe.GNSS_REFUSED,
}


@compiled
def conditions_of(h: Any, limits: Any, mag_fault: int, flying: bool) -> int:
    """Return the bits of the conditions of a health that commander, guidance or reports follow.

    A fault of the barometer, and a magnetometer that has gone silent, count only while the vehicle is ``flying``.
    """
    bits: int = 0
    if h.imu_age_s > IMU_MISSING_S or h.imu_is_stuck:
        bits |= IMU_FAULT
    if h.tilt_rad > limits.tilt_rad > 0.0:
        bits |= ATTITUDE_DOUBTFUL
    if h.unaided_s > limits.dead_reckoning_s or h.is_inaccurate or h.lag_s > LATE_S:
        bits |= POSITION_LOST
    if h.refused_s > REFUSED_S:
        bits |= GNSS_REFUSED
    if not h.velocity_m_s <= limits.velocity_m_s:  # also of NaN
        bits |= VELOCITY_UNKNOWN
    if mag_fault != 0:
        bits |= MAG_FAULT
    if flying and (h.baro_is_stuck or h.baro_age_s > MISSING_S):
        bits |= BARO_FAULT
    if flying and MISSING_S < h.mag_age_s < math.inf:
        bits |= MAG_MISSING
    return bits


@compiled
def watch_estimate(
    memory: MemoryArray,
    watch: WatchArray,
    track: TrackArray,
    limits: Any,
    has_origin: bool,
    flying: bool,
    time_s: float,
) -> int:
    """Update the health after a sample of the inertial sensor at ``time_s``; return its ``conditions_of``.

    ``track`` has the sample; ``limits`` is an array of one ``EstimateLimits``.
    """
    newest = watch[0]["newest"]
    newest["imu_s"], newest["repeats"] = time_s, track[0]["repeats"]
    update_health(memory, watch, has_origin, limits[0]["position_m"], time_s)
    return conditions_of(watch[0]["health"], limits[0], memory[0]["flags"]["mag_fault"], flying)


def estimate_failsafes(health: EstimateHealth | None, behaviour: Behaviour) -> frozenset[Failsafe]:
    """Return the conditions of failsafes in flight."""
    if health is None:
        return frozenset()
    return failsafes_of(plain(conditions_of)(health, limits_of(behaviour), 0, False))


def failsafes_of(conditions: int) -> frozenset[Failsafe]:
    """Return the failsafes of the bits of ``conditions_of``."""
    return frozenset(failsafe for bit, failsafe in _FAILSAFES.items() if conditions & bit)
