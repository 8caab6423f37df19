"""The gains of the loops for the linear analysis: one set of numbers for each axis.

All are normalised to accelerations, as the loops themselves use them: rad/s² or m/s² per error. They are read from
the loops' own parameters, so the analysis is that of the flown loops.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

ATTITUDE_AXES = ("roll", "pitch", "yaw")
POSITION_AXES = ("x", "y", "z")
BACKSTEPPING = "backstepping"
BACKSTEPPING_C = {"roll": ("C1", "C2"), "pitch": ("C3", "C4"), "yaw": ("C5", "C6")}
"""Names of the constants of each axis, outer and inner."""


class AttitudeGains(NamedTuple):
    """u = kp e + ki ∫e + kd (ff ω_d − ω) + fa ω̇_d: angular acceleration of one axis [rad/s²]."""

    kp: float
    ki: float
    kd: float
    rate_feedforward: float
    acceleration_feedforward: float


class PositionGains(NamedTuple):
    """a = kp e + ki ∫e + kd (v_d − v): acceleration along one axis [m/s²]."""

    kp: float
    ki: float
    kd: float


class ReferenceFilter(NamedTuple):
    """The second-order filter of the attitude target; bandwidth 0 passes the target through."""

    bandwidth_rad_s: float
    damping: float


class Gains(NamedTuple):
    """All gains of a controller with a gains file."""

    attitude: Mapping[str, AttitudeGains]
    position: Mapping[str, PositionGains]
    reference: ReferenceFilter


def backstepping_gains(
    c_outer: float, c_inner: float, rate_ff: float, acceleration_ff: float
) -> AttitudeGains:
    """Return the PD that the backstepping law is once coupling and gyroscopic torque are cancelled.

    ε1 − c2 ε2 − c1 (c1 ε1 + ε2) with ε2 = ω − ω_d − c1 ε1 is (1 + c1 c2) ε1 + (c1 + c2) (ω_d − ω).
    """
    return AttitudeGains(1.0 + c_outer * c_inner, 0.0, c_outer + c_inner, rate_ff, acceleration_ff)


def gains_from(controller: str, parameters: Mapping[str, float]) -> Gains:
    """Sort the loops' parameters (names of docs/reference/parameters.md) by axis; KeyError if one is missing."""
    p = parameters
    attitude = {
        axis: _backstepping_axis(p, axis) if controller == BACKSTEPPING else _pid_axis(p, axis)
        for axis in ATTITUDE_AXES
    }
    horizontal = PositionGains(p["POS_XY_P"], p["POS_XY_I"], p["POS_XY_D"])
    vertical = PositionGains(p["POS_Z_P"], p["POS_Z_I"], p["POS_Z_D"])
    return Gains(
        attitude,
        {"x": horizontal, "y": horizontal, "z": vertical},
        ReferenceFilter(p["ATT_REF_BW"], p["ATT_REF_DAMP"]),
    )


def _pid_axis(p: Mapping[str, float], axis: str) -> AttitudeGains:
    kp, ki, kd = (p[f"PID_{axis.upper()}_{term}"] for term in "PID")
    return AttitudeGains(kp, ki, kd, p["PID_RATE_FF"], p["PID_ACC_FF"])


def _backstepping_axis(p: Mapping[str, float], axis: str) -> AttitudeGains:
    c_outer, c_inner = (p[f"BS_{axis.upper()}_{name}"] for name in BACKSTEPPING_C[axis])
    return backstepping_gains(c_outer, c_inner, p["BS_RATE_FF"], p["BS_ACC_FF"])
