"""Checks of the estimate of a vehicle that flies on its sensors: before arming, and in flight. Pure.

Names and limits are PX4's, https://docs.px4.io/main/en/flying/pre_flight_checks.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from flightstack.commander.failsafe import RULES, Action, Failsafe, action_of
from flightstack.estimation.health import EstimateHealth
from flightstack.estimation.imu_track import IMU_MISSING_S
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


def estimate_failsafes(health: EstimateHealth | None, behaviour: Behaviour) -> frozenset[Failsafe]:
    """Return the conditions of failsafes in flight."""
    if health is None:
        return frozenset()
    b = behaviour
    is_off = health.is_inaccurate or health.lag_s > LATE_S
    conditions = (
        (Failsafe.IMU_FAULT, health.imu_age_s > IMU_MISSING_S or health.imu_is_stuck),
        (Failsafe.ATTITUDE_DOUBTFUL, health.tilt_rad > math.radians(b.tilt_accuracy_deg) > 0.0),
        (
            Failsafe.POSITION_LOST,
            health.unaided_s > b.dead_reckoning_s or is_off,
        ),
        (Failsafe.GNSS_REFUSED, health.refused_s > REFUSED_S),
    )
    return frozenset(failsafe for failsafe, holds in conditions if holds)
