"""The matrix of experiments: controllers, trajectories, conditions and plants. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import product
from typing import Any, NamedTuple

from flightstack.core.contract import Vector3
from gcs_cli.experiments.paper.flights.types import Case

SMALL_ANGLE, RIGID, MULTIBODY = "paper", "rigid", "multibody"
DESIRED, SMOOTH, HARD = "desired", "smooth", "hard"
PATHS = (DESIRED, SMOOTH, HARD)
ATTITUDE_STEPS = ("step_roll", "step_pitch", "step_yaw")
POSITION_STEPS = ("step_x", "step_y", "step_z")
STEPS = (*ATTITUDE_STEPS, *POSITION_STEPS)
PLAIN, IDEAL, NO_LIMITS, NO_LAG, SHAPED, DRIVE = (
    "plain", "ideal", "no_limits", "lag_0", "shaped", "drive",
)  # fmt: skip


class Contender(NamedTuple):
    """A controller with its gains."""

    name: str
    label: str
    controller: str
    gains: str


class Condition(NamedTuple):
    """A change to the plain flight."""

    name: str
    label: str
    changes: dict[str, Any]
    """Fields of ``Case``."""


PID, BACKSTEPPING, POLES = "pid", "backstepping", "poles"
TUNED_PID, TUNED_BACKSTEPPING = "tuned_pid", "tuned_backstepping"
RATE_FED_PID = "rate_fed_pid"

CONTENDERS = (
    Contender(PID, "PID, Table II", "pid", "paper"),
    Contender(BACKSTEPPING, "backstepping, Table III", "backstepping", "paper"),
    Contender(POLES, "linear PD with backstepping's poles", "pid", "backstepping_poles"),
    Contender(TUNED_PID, "PID, own gains", "pid", "tuned"),
    Contender(TUNED_BACKSTEPPING, "backstepping, own gains", "backstepping", "tuned"),
    Contender(RATE_FED_PID, "PID, Table II, rate fed ahead", "pid", "paper_rate_fed"),
)

CONDITIONS = (
    Condition(PLAIN, "Table I, motors of 5 ms, thrust to weight 2", {}),
    Condition(NO_LIMITS, "no rotor limits, motors of 5 ms", {"limits": False}),
    Condition(
        IDEAL,
        "ideal rotors, as the paper assumes: no limits, no lag, no spin-up torque",
        {"limits": False, "lag_s": 0.0},
    ),
    Condition("force", "sustained wind force of 0.5 N to the north", {"force_ned_n": Vector3(0.5, 0.0, 0.0)}),
    Condition(
        "torque",
        "constant torque of 20 mN m about roll and pitch, 4 mN m about yaw",
        {"torque_frd_n_m": Vector3(0.02, 0.02, 0.004)},
    ),
    Condition("mass_more", "mass +20 %", {"mass_factor": 1.2}),
    Condition("inertia_more", "inertia +30 %", {"inertia_factor": 1.3}),
    Condition("inertia_less", "inertia −30 %", {"inertia_factor": 0.7}),
    Condition(NO_LAG, "rotor speeds imposed: no motor lag, no spin-up torque", {"lag_s": 0.0}),
    Condition("lag_10", "motor lag of 10 ms", {"lag_s": 0.010}),
    Condition("lag_20", "motor lag of 20 ms", {"lag_s": 0.020}),
    Condition("delay", "one more inner period of delay, 1 ms", {"delay_steps": 1}),
    Condition("slow", "inner loop at 500 Hz", {"inner_hz": 500}),
    Condition("twice", "the trajectory at twice its size", {"scale": 2.0}),
    Condition(DRIVE, "motors of at most 0.2 N m, six times what hover takes", {"drive_torque_n_m": 0.2}),
    Condition(SHAPED, "setpoints through a reference model: 3 rad/s, damping 1, 4.5 m/s²", {"shaped": True}),
)
NUDGE = Condition("nudge", "a push of 10⁻¹² N", {"force_ned_n": Vector3(1e-12, 0.0, 0.0)})
"""Compared with the plain flight it shows how the loops amplify a difference as small as rounding."""
_PAIR = [contender for contender in CONTENDERS if contender.name in (PID, BACKSTEPPING)]


_PARTS = (
    frozenset(contender.name for contender in CONTENDERS),
    frozenset((*PATHS, *STEPS)),
    frozenset(condition.name for condition in (*CONDITIONS, NUDGE)),
    frozenset((SMALL_ANGLE, RIGID, MULTIBODY)),
)


def key(contender: str, trajectory: str, condition: str = PLAIN, plant: str = SMALL_ANGLE) -> str:
    """Return the name of a case in results.json; raise ValueError for a part that no case has."""
    for part, known in zip((contender, trajectory, condition, plant), _PARTS, strict=True):
        if part not in known:
            raise ValueError(f"{part!r} is none of {', '.join(sorted(known))}")
    return f"{contender}/{trajectory}/{condition}/{plant}"


def condition_of(case: Case) -> str:
    """Return the condition in a case's key; a case outside the matrix is plain."""
    parts = case.key.split("/")
    return parts[2] if len(parts) == 4 else PLAIN


def make_case(contender: Contender, trajectory: str, condition: Condition, plant: str) -> Case:
    """Return one case of the matrix."""
    name = key(contender.name, trajectory, condition.name, plant)
    return Case(
        name,
        trajectory,
        controller=contender.controller,
        gains=contender.gains,
        plant=plant,
        **condition.changes,
    )


def matrix(
    trajectories: Iterable[str],
    plants: Iterable[str],
    contenders: Sequence[Contender] = CONTENDERS,
    conditions: Sequence[Condition] = CONDITIONS,
) -> list[Case]:
    """Return the cases of every combination."""
    return [
        make_case(contender, trajectory, condition, plant)
        for plant, trajectory, condition, contender in product(plants, trajectories, conditions, contenders)
    ]


def all_cases(multibody: bool) -> list[Case]:
    """Return every experiment of ``gcs paper``.

    Smooth and hard profile in all conditions; the desired trajectory and steps plain and with ideal rotors; hard
    profile and position steps through the reference model; on the multibody plant the desired trajectory, and with the
    paper's gains all other plain flights. The motor torque is limited on the rigid body only, because the small-angle
    plant has no spin-up torque.
    """
    plants = (SMALL_ANGLE, RIGID)
    simple = [condition for condition in CONDITIONS if condition.name in (PLAIN, IDEAL)]
    shaped = [condition for condition in CONDITIONS if condition.name == SHAPED]
    drive = [condition for condition in CONDITIONS if condition.name == DRIVE]
    others = [condition for condition in CONDITIONS if condition.name not in (SHAPED, DRIVE)]
    cases = matrix((SMOOTH, HARD), plants, conditions=others)
    cases += matrix((SMOOTH, HARD), (RIGID,), conditions=drive)
    cases += matrix((DESIRED, *STEPS), plants, conditions=simple)
    cases += matrix((HARD, *POSITION_STEPS), plants, conditions=shaped)
    cases += matrix((DESIRED,), (RIGID,), conditions=(NUDGE,))
    if multibody:
        cases += matrix((DESIRED,), (MULTIBODY,), conditions=simple[:1])
        cases += matrix((SMOOTH, HARD, *STEPS), (MULTIBODY,), _PAIR, simple[:1])
    return cases
