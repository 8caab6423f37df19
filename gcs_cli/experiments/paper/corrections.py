"""What is printed in the paper and cannot be right, and what flies in its place."""

from __future__ import annotations

from typing import NamedTuple


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
        "docs/paper.md",
    ),
    Correction(
        "equation 6, pitch",
        "Ω3² − Ω2²",
        "Ω3² − Ω1²",
        "the misprint halves the pitch gain and lets half of a roll command into pitch",
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
