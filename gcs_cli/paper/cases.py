"""The matrix of experiments: who flies, what, in which conditions, on which plant. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import product
from typing import Any, NamedTuple

from flightstack.contract import Vector3
from gcs_cli.paper.types import Case

SMALL_ANGLE, RIGID, MULTIBODY = "paper", "rigid", "multibody"
DESIRED, SMOOTH, HARD = "desired", "smooth", "hard"
PATHS = (DESIRED, SMOOTH, HARD)
STEPS = ("step_roll", "step_pitch", "step_yaw", "step_x", "step_y", "step_z")
PLAIN, IDEAL = "plain", "ideal"


class Contender(NamedTuple):
    """A controller with its gains."""

    name: str
    label: str
    controller: str
    gains: str


class Condition(NamedTuple):
    """What differs from the plain flight."""

    name: str
    label: str
    changes: dict[str, Any]
    """Fields of ``Case``."""


PID, BACKSTEPPING, POLES = "pid", "backstepping", "poles"
TUNED_PID, TUNED_BACKSTEPPING = "tuned_pid", "tuned_backstepping"

CONTENDERS = (
    Contender(PID, "PID, Table II", "pid", "paper"),
    Contender(BACKSTEPPING, "backstepping, Table III", "backstepping", "paper"),
    Contender(POLES, "linear PD with backstepping's poles", "pid", "backstepping_poles"),
    Contender(TUNED_PID, "PID, own gains", "pid", "tuned"),
    Contender(TUNED_BACKSTEPPING, "backstepping, own gains", "backstepping", "tuned"),
)

CONDITIONS = (
    Condition(PLAIN, "Table I, motors of 5 ms, thrust to weight 2", {}),
    Condition(IDEAL, "no rotor limits, no motor lag: as the paper assumes", {"limits": False, "lag_s": 0.0}),
    Condition("force", "sustained wind force of 0.5 N to the north", {"force_ned_n": Vector3(0.5, 0.0, 0.0)}),
    Condition(
        "torque",
        "constant torque of 20 mN m about roll and pitch, 4 mN m about yaw",
        {"torque_frd_n_m": Vector3(0.02, 0.02, 0.004)},
    ),
    Condition("mass_more", "mass +20 %", {"mass_factor": 1.2}),
    Condition("inertia_more", "inertia +30 %", {"inertia_factor": 1.3}),
    Condition("inertia_less", "inertia −30 %", {"inertia_factor": 0.7}),
    Condition("lag_0", "motors without lag", {"lag_s": 0.0}),
    Condition("lag_10", "motor lag of 10 ms", {"lag_s": 0.010}),
    Condition("lag_20", "motor lag of 20 ms", {"lag_s": 0.020}),
    Condition("delay", "one more inner period of delay, 1 ms", {"delay_steps": 1}),
    Condition("slow", "inner loop at 500 Hz", {"inner_hz": 500}),
    Condition("twice", "the trajectory at twice its size", {"scale": 2.0}),
)


def key(contender: str, trajectory: str, condition: str = PLAIN, plant: str = SMALL_ANGLE) -> str:
    """Return the name of a case in results.json."""
    return f"{contender}/{trajectory}/{condition}/{plant}"


def condition_of(case: Case) -> str:
    """Return the name of the condition that a case's key tells; a case outside the matrix is plain."""
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
    """Return every experiment of ``gcs paper``: paths in all conditions, steps plain and with ideal rotors."""
    simple = [condition for condition in CONDITIONS if condition.name in (PLAIN, IDEAL)]
    cases = matrix(PATHS, (SMALL_ANGLE, RIGID))
    cases += matrix(STEPS, (SMALL_ANGLE, RIGID), conditions=simple)
    if multibody:
        cases += matrix((DESIRED,), (MULTIBODY,), conditions=simple[:1])
    return cases
