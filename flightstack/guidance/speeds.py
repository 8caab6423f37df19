"""Speeds that a command sets in place of the parameters'."""

from __future__ import annotations

import math
from typing import NamedTuple

from flightstack.guidance.params import GuidanceParams


class SpeedOverrides(NamedTuple):
    """Speeds that a command set [m/s]; NaN leaves the parameter's."""

    cruise_m_s: float = math.nan
    climb_m_s: float = math.nan
    descent_m_s: float = math.nan

    def applied_to(self, params: GuidanceParams) -> GuidanceParams:
        """Return the parameters with these speeds, each at most the vehicle's largest."""
        given = {
            "cruise_speed_m_s": min(self.cruise_m_s, params.max_speed_m_s),
            "climb_speed_m_s": min(self.climb_m_s, params.climb_speed_m_s),
            "descent_speed_m_s": min(self.descent_m_s, params.descent_speed_m_s),
        }
        return params._replace(**{name: speed for name, speed in given.items() if math.isfinite(speed)})
