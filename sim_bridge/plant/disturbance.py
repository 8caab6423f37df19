"""Disturbances: wind and gusts, a constant force, a constant and a gusty torque.

Gusts of wind and torque are first-order Gauss-Markov processes: normally distributed with the given standard
deviation σ and the autocorrelation σ²·exp(−|t|/T), T the correlation time.
"""

from __future__ import annotations

from typing import NamedTuple

from flightstack.core.contract import Vector3
from flightstack.params.vehicle import Vehicle
from sim_bridge.errors import UsageProblemError

GUST_TIME_S = 1.5
"""Correlation time of the gusts."""

GUST_DOWN_RATIO = 0.5
"""Ratio of vertical to horizontal gusts, about that of MIL-F-8785C near the ground."""

TORQUE_GUST_TIME_S = 0.1
"""Correlation time of the gusty torque.

MIL-F-8785C gives rolling gusts the corner πV/4b: 10 rad/s for a span b of 0.4 m in a wind V of 5 m/s.
"""

TORQUE_GUST_YAW_RATIO = 0.1
"""Ratio of the gusty torque about yaw to that about roll and pitch.

Turbulence makes the rotor thrusts unequal. The lever is the arm about roll and pitch, and torque over thrust of a
rotor about yaw, which is 0.12 and 0.09 of the arm on the built-in vehicles.
"""

_STILL = Vector3(0.0, 0.0, 0.0)


class Disturbance(NamedTuple):
    """Disturbances of the plant; all zero by default."""

    wind_ned_m_s: Vector3 = _STILL
    gust_m_s: float = 0.0  # standard deviation of the north and the east gust
    force_ned_n: Vector3 = _STILL
    torque_frd_n_m: Vector3 = _STILL
    torque_gust_n_m: float = 0.0  # standard deviation about roll and about pitch


NO_DISTURBANCE = Disturbance()


def check_wind(vehicle: Vehicle, plant: str, disturbance: Disturbance) -> None:
    """Raise UsageProblemError for wind or gusts on a plant or vehicle without drag."""
    if disturbance.wind_ned_m_s == _STILL and disturbance.gust_m_s == 0.0:
        return
    refusal = vehicle.wind_refusal(plant)
    if refusal is not None:
        raise UsageProblemError(f"{'--wind' if disturbance.gust_m_s == 0.0 else '--gust'}: {refusal}")
