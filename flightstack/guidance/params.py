"""Parameters of guidance in the form of its compiled code."""

from __future__ import annotations

import math
from typing import NamedTuple

from flightstack.guidance.trajectory import POLE_RAD_S
from flightstack.params.behaviour import Behaviour

FAR_BELOW_M = 1e4
"""Down coordinate of a goal for a descent until ground contact."""


class GuidanceParams(NamedTuple):
    """Parameters of guidance from ``Behaviour``, angles in radians."""

    cruise_speed_m_s: float
    max_speed_m_s: float
    climb_speed_m_s: float
    descent_speed_m_s: float
    takeoff_speed_m_s: float
    takeoff_altitude_m: float
    land_speed_m_s: float
    land_slow_altitude_m: float
    acceleration_m_s2: float
    vertical_acceleration_m_s2: float
    jerk_m_s3: float
    yaw_rate_rad_s: float
    yaw_mode: float
    acceptance_radius_m: float
    altitude_acceptance_m: float
    yaw_acceptance_rad: float
    return_altitude_m: float
    return_min_distance_m: float
    weight_n: float
    far_below_m: float
    manual_speed_m_s: float
    manual_tilt_rad: float
    manual_yaw_rate_rad_s: float
    stick_deadzone: float
    stick_xy_expo: float
    stick_z_expo: float
    stick_yaw_expo: float
    ground_down_m: float = 0.0
    """Assumed ground: landings and manual descents slow down near it."""
    ceiling_down_m: float = -math.inf
    """Highest position that guidance climbs to by itself, below GF_MAX_VER_DIST."""


def guidance_params(behaviour: Behaviour, weight_n: float) -> GuidanceParams:
    """Return the parameters of guidance.

    A low jerk limit reduces the acceleration, because the reference would otherwise overshoot its goal.
    """
    b = behaviour
    jerk_bound_m_s2 = b.jerk_m_s3 / POLE_RAD_S
    return GuidanceParams(
        cruise_speed_m_s=b.cruise_speed_m_s,
        max_speed_m_s=b.max_speed_m_s,
        climb_speed_m_s=b.climb_speed_m_s,
        descent_speed_m_s=b.descent_speed_m_s,
        takeoff_speed_m_s=b.takeoff_speed_m_s,
        takeoff_altitude_m=b.takeoff_altitude_m,
        land_speed_m_s=b.land_speed_m_s,
        land_slow_altitude_m=b.land_slow_altitude_m,
        acceleration_m_s2=min(b.acceleration_m_s2, jerk_bound_m_s2),
        vertical_acceleration_m_s2=min(b.vertical_acceleration_m_s2, jerk_bound_m_s2),
        jerk_m_s3=b.jerk_m_s3,
        yaw_rate_rad_s=math.radians(b.yaw_rate_deg_s),
        yaw_mode=b.yaw_mode,
        acceptance_radius_m=b.acceptance_radius_m,
        altitude_acceptance_m=b.altitude_acceptance_m,
        yaw_acceptance_rad=math.radians(b.yaw_acceptance_deg),
        return_altitude_m=b.return_altitude_m,
        return_min_distance_m=b.return_min_distance_m,
        weight_n=weight_n,
        far_below_m=FAR_BELOW_M,
        manual_speed_m_s=b.manual_speed_m_s,
        manual_tilt_rad=math.radians(b.manual_tilt_deg),
        manual_yaw_rate_rad_s=math.radians(b.manual_yaw_rate_deg_s),
        stick_deadzone=b.stick_deadzone,
        stick_xy_expo=b.stick_xy_expo,
        stick_z_expo=b.stick_z_expo,
        stick_yaw_expo=b.stick_yaw_expo,
    )


class SpeedOverrides(NamedTuple):
    """Speeds set by a command [m/s]; NaN selects the parameter's."""

    cruise_m_s: float = math.nan
    climb_m_s: float = math.nan
    descent_m_s: float = math.nan

    def applied_to(self, params: GuidanceParams) -> GuidanceParams:
        """Return the parameters with these speeds, each limited to the vehicle's maximum."""
        given = {
            "cruise_speed_m_s": min(self.cruise_m_s, params.max_speed_m_s),
            "climb_speed_m_s": min(self.climb_m_s, params.climb_speed_m_s),
            "descent_speed_m_s": min(self.descent_m_s, params.descent_speed_m_s),
        }
        return params._replace(**{name: speed for name, speed in given.items() if math.isfinite(speed)})
