"""Printed values of the paper and the values flown: Tables I to III, and the corrections of the equations.

Flown values come from the vehicle and gains files.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from flightstack.params.gains_file import open_gains
from flightstack.params.vehicle import GRAVITY_M_S2, Vehicle, load_vehicle

_LARGEST = 1e9


class Entry(NamedTuple):
    """One line of a table."""

    symbol: str
    meaning: str
    printed: float | None
    """None: the paper does not give it."""
    used: float
    unit: str
    note: str = ""

    @property
    def corrected(self) -> bool:
        """True if the flown value differs from the printed one."""
        return self.printed is not None and self.printed != self.used


def table_1(vehicle: Vehicle | None = None) -> list[Entry]:
    """Table I, the vehicle, then values that a flight needs and the paper leaves out."""
    v = load_vehicle("paper_quad") if vehicle is None else vehicle
    rotor = v.rotors[0]
    ix, iy, iz = v.inertia_kg_m2
    arm_m = max(math.hypot(*r.position_frd_m[:2]) for r in v.rotors)
    missing = "not in the paper"
    return [
        Entry(
            "I_x", "inertia about the roll axis", 7.2e-3, ix, "kg m²", "a true inertia: ∫, not ½∫ as printed"
        ),
        Entry("I_y", "inertia about the pitch axis", 7.2e-3, iy, "kg m²"),
        Entry("I_z", "inertia about the yaw axis", 1.1e-2, iz, "kg m²"),
        Entry("J_r", "inertia of a rotor", 6.3e-5, rotor.inertia_kg_m2, "kg m²"),
        Entry("l", "arm of a rotor", 0.2, arm_m, "m"),
        Entry("g", "gravity", 9.81, GRAVITY_M_S2, "m/s²"),
        Entry("m", "mass", 0.55, v.mass_kg, "kg"),
        Entry("b", "thrust over Ω²", 2.93e-5, rotor.thrust_coefficient_n_s2, "N s²", "kg m as printed"),
        Entry(
            "d", "drag torque over Ω²", 7.2e-7, rotor.torque_coefficient_n_m_s2, "N m s²", "kg m² as printed"
        ),
        Entry("τ", "lag of a motor", None, rotor.lag_s, "s", missing),
        Entry(
            "Ω_max",
            "largest speed",
            None,
            rotor.max_speed_rad_s,
            "rad/s",
            f"{missing}: thrust is twice the weight",
        ),
        Entry("Ω_min", "smallest speed", None, rotor.min_speed_rad_s, "rad/s", missing),
    ]


def table_2() -> list[Entry]:
    """Table II, the PID, then further values that the loops need."""
    gains = open_gains("paper")
    attitude, position, altitude = (gains.table(name) for name in ("attitude_pid", "position", "altitude"))
    kp, kd = attitude.numbers("kp", 3, 0.0, _LARGEST), attitude.numbers("kd", 3, 0.0, _LARGEST)
    xy = "one gain for x and y; the output is a horizontal acceleration"
    newton, torque = "N, by the arm: l/I", "N m: 1/I_z, not l/I_z as printed"
    kd_z = "printed 6.15e3 gives a damping of 0.04; the digits are those of Kd_φ"
    return [
        Entry("Kp_φ", "roll", 280.55, kp[0], "N/rad", newton),
        Entry("Kd_φ", "roll rate", 6.15, kd[0], "N s/rad", "on the gyro"),
        Entry("Kp_θ", "pitch", 53.39, kp[1], "N/rad", newton),
        Entry("Kd_θ", "pitch rate", 1.43, kd[1], "N s/rad", "on the gyro"),
        Entry("Kp_ψ", "yaw", 25.52, kp[2], "N m/rad", torque),
        Entry("Kd_ψ", "yaw rate", 0.95, kd[2], "N m s/rad", "on the gyro"),
        Entry("Kp_x, Kp_y", "position", 10.0, position.number("kp", 0.0, _LARGEST), "1/s²", xy),
        Entry("Kd_x, Kd_y", "velocity", 3.0, position.number("kd", 0.0, _LARGEST), "1/s"),
        Entry("Kp_z", "height", 2.83e5, altitude.number("kp", 0.0, _LARGEST), "1/(m s²)", "ΣΩ² per metre"),
        Entry("Kd_z", "climb rate", 6.15e3, altitude.number("kd", 0.0, _LARGEST), "1/(m s)", kd_z),
        Entry(
            "Ki", "all loops", None, altitude.number("ki", 0.0, _LARGEST), "", "called PID, tabulated as PD"
        ),
        *_reference_entries(),
    ]


def _reference_entries() -> list[Entry]:
    filter_ = open_gains("paper").table("attitude_reference")
    why = "not in the paper: the filter that gives ẋ_d"
    return [
        Entry(
            "ω_r", "attitude reference", None, filter_.number("bandwidth_rad_s", 0.0, _LARGEST), "rad/s", why
        ),
        Entry("ζ_r", "attitude reference", None, filter_.number("damping", 0.0, _LARGEST), "", why),
    ]


def table_3() -> list[Entry]:
    """Table III, backstepping."""
    law = open_gains("paper").table("attitude_backstepping")
    c = law.numbers("c", 6, 0.0, _LARGEST)
    printed = (27.79, 285.74, 4.70, 45.02, 4.55, 21.67)
    axes = ("roll", "roll rate", "pitch", "pitch rate", "yaw", "yaw rate")
    fed = "the rate that the paper's ε4 and ε6 leave out, and its final law assumes"
    return [
        *(
            Entry(f"c{number}", axis, value, used, "1/s")
            for number, (axis, value, used) in enumerate(zip(axes, printed, c, strict=True), start=1)
        ),
        Entry("ẋ_d", "share of the reference rate", None, law.number("rate_feedforward", 0.0, 1.0), "", fed),
        Entry(
            "ẍ_d", "its acceleration", 0.0, law.number("acceleration_feedforward", 0.0, 1.0), "", "as printed"
        ),
    ]


class Correction(NamedTuple):
    """One correction."""

    where: str
    printed: str
    used: str
    why: str
    place: str
    """The file in which the corrected form lives."""


CORRECTIONS = (
    Correction(
        "equations 4 to 7, frames",
        "z up in 4 to 6, z down in the attitude and height rows of 7, z up again in its x and y rows",
        "north, east, down and forward, right, down throughout",
        "mixed frames are unstable: a controller of one in the other has poles at +63 /s (pitch) and +108 /s (yaw)",
        "sim_bridge/plant/paper.py",
    ),
    Correction(
        "I_x, I_y, I_z",
        "half the integral",
        "the integral",
        "the kinetic energy has the factor already; Table I holds true inertias",
        "flightstack/params/vehicles/paper_quad.toml",
    ),
    Correction(
        "potential energy",
        "the offsets of the centre of gravity alone",
        "m g z added",
        "without it the height has no weight in Lagrange's equations",
        "docs/explanation/paper.md",
    ),
    Correction(
        "equation 6, pitch",
        "Ω3² − Ω2²",
        "Ω3² − Ω1²",
        "the misprint halves the pitch gain and couples half of a roll command into pitch",
        "sim_bridge/plant/paper.py",
    ),
    Correction(
        "equation 6, yaw",
        "over I_x",
        "over I_z",
        "yaw would answer 1.53 times too strongly",
        "sim_bridge/plant/paper.py",
    ),
    Correction(
        "equation 7, b3",
        "l / I_z",
        "1 / I_z",
        "U4 is a torque already and has no arm",
        "flightstack/control/attitude_pid.py",
    ),
    Correction(
        "equation 7, x and y",
        "a plus sign",
        "a minus sign",
        "with z down the thrust points along −z of the body",
        "sim_bridge/plant/paper.py",
    ),
    Correction(
        "a5",
        "not defined",
        "(I_x − I_y) / I_z",
        "the yaw row uses it; zero for this vehicle",
        "sim_bridge/plant/paper.py",
    ),
    Correction(
        "backstepping: ε1, V1 and α1",
        "dots missing and to spare",
        "ε̇1 = ẋ1d − x2, V̇1 = −c1 ε1², α1 = ẋ1d + c1 ε1",
        "only so does each step of the proof follow from the one before",
        "flightstack/control/attitude_backstepping.py",
    ),
    Correction(
        "ε4 and ε6",
        "x3d and x5d",
        "ẋ3d and ẋ5d",
        "a rate is compared with a rate; without it x has 4.9° of phase margin, and is unstable behind the filter",
        "flightstack/control/attitude_backstepping.py",
    ),
    Correction(
        "U3, gyroscopic term",
        "−a4 x2 Ωr",
        "+a4 x2 Ωr",
        "the printed sign doubles the torque that it is meant to cancel",
        "flightstack/control/attitude_backstepping.py",
    ),
    Correction(
        "Table II, Kd_z",
        "6.15e3",
        "1.312e5",
        "in no unit does the printed value fly a limited, sampled vehicle: in ΣΩ² the damping is 0.04; now it is 0.9",
        "flightstack/params/gains/paper.toml",
    ),
    Correction(
        "outer loop",
        "PID by name, no Ki, no term for the weight",
        "the weight is fed forward",
        "a PD without it sinks until its error carries the vehicle",
        "flightstack/control/position_pid.py",
    ),
    Correction(
        "rotors",
        "no limits, no lag; the gains ask for negative thrust from 0.55° of roll error",
        "thrust to weight 2, motors of 5 ms, roll and pitch before thrust before yaw; also flown without",
        "a propeller does not turn backwards in flight",
        "flightstack/control/mixer.py",
    ),
)
