"""Tables I to III of the paper: what is printed, and what flies, read from the vehicle and gains files that fly."""

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
        """Whether what flies is another number than what is printed."""
        return self.printed is not None and self.printed != self.used


def table_1(vehicle: Vehicle | None = None) -> list[Entry]:
    """Table I, the vehicle, and behind it what the paper leaves out and a flight needs."""
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
    """Table II, the PID; behind it what the loops need besides."""
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
