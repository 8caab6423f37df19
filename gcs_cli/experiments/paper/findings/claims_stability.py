"""Claims about stability: margins, survived conditions, and the spin-up torque that the paper leaves out. Pure."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from gcs_cli.experiments.paper.findings.comparisons import Cases
from gcs_cli.experiments.paper.findings.verdicts import NotFlownError, Question, flight, how_ended, where_of
from gcs_cli.experiments.paper.flights.cases import (
    BACKSTEPPING,
    CONDITIONS,
    DESIRED,
    HARD,
    PID,
    PLAIN,
    RATE_FED_PID,
    RIGID,
    SMALL_ANGLE,
    key,
)
from gcs_cli.experiments.paper.flights.types import Case

RARELY_PERCENT = 1.0
"""A smaller share of saturated ticks counts as none."""
NEARER_DB, NEARER_DEG, NEARER_PERCENT = 0.5, 2.0, 5.0
"""Smaller differences of margins and lowest rates count as equal."""
ATTITUDES = ("roll", "pitch", "yaw")
_FLOWN, _SPIN_UP = "motor lag", "motor lag with spin-up torque"
_RATE_HZ = Case("", "").inner_hz


class Nearness(NamedTuple):
    """Margins and lowest rate of a loop; a loop without margins is unstable."""

    axis: str
    gain_db: float
    phase_deg: float
    lowest_hz: float
    """Infinite where no rate is stable."""

    @property
    def words(self) -> str:
        """The figures as text."""
        if self.gain_db < 0.0:
            margins = f"unstable at {_RATE_HZ} Hz"
        else:
            gain = f"{self.gain_db:.1f} dB" if math.isfinite(self.gain_db) else "any gain"
            phase = f"{self.phase_deg:.0f}°" if math.isfinite(self.phase_deg) else "any phase"
            margins = f"{gain} and {phase}"
        rate = f"at least {self.lowest_hz:.0f} Hz" if math.isfinite(self.lowest_hz) else "no rate is enough"
        return f"{margins}, {rate}"


def stays_stable(linear: Mapping[str, Any], plant: str) -> dict[str, Any]:
    """Evaluate margins and lowest rates of the attitude loops as they fly; raise NotFlownError without the analysis."""
    if not linear:
        raise NotFlownError("linear analysis")
    question = Question(
        "stable",
        "backstepping does so without coming nearer to instability",
        "paper, IV.B",
        f"of no attitude loop, as flown, is the gain margin smaller by {NEARER_DB:g} dB, the phase margin by "
        f"{NEARER_DEG:g}°, or the lowest stable rate higher by {NEARER_PERCENT:g} % than with the PID",
    )
    pairs = [
        tuple(_nearness(linear, controller, axis, plant) for controller in (PID, BACKSTEPPING))
        for axis in ATTITUDES
    ]
    nearer = [second.axis for first, second in pairs if _is_nearer(second, first)]
    told = "; ".join(f"{a.axis} {a.words} with the PID, {b.words} with backstepping" for a, b in pairs)
    verdict = f"nearer in {' and '.join(nearer)}" if nearer else "nearer in none"
    words = f"Margins and lowest rates of the attitude loops {where_of(plant)}: {told}. Backstepping is {verdict}."
    return question.answer(not nearer, words, nearer=nearer)


def _nearness(linear: Mapping[str, Any], controller: str, axis: str, plant: str) -> Nearness:
    loops = {(one["controller"], one["gains"]): one for one in linear["loops"]}
    of: Mapping[str, Any] = loops[controller, "paper"]
    wanted = _SPIN_UP if plant == RIGID and axis == "yaw" else _FLOWN
    sampled = {one["actuators"]: one for one in of["axes"][axis]["sampled"]}[wanted]
    margins, lowest_hz = sampled["margins"][str(_RATE_HZ)], sampled["lowest_stable_hz"]
    return Nearness(
        axis,
        -1.0 if margins is None else _or_infinite(margins["gain_db"]),
        0.0 if margins is None else _or_infinite(margins["phase_deg"]),
        _or_infinite(lowest_hz),
    )


def _or_infinite(value: float | None) -> float:
    return math.inf if value is None else value


def _is_nearer(one: Nearness, than: Nearness) -> bool:
    return (
        one.gain_db < than.gain_db - NEARER_DB
        or one.phase_deg < than.phase_deg - NEARER_DEG
        or one.lowest_hz > than.lowest_hz * (1.0 + NEARER_PERCENT / 100.0)
    )


def survives(cases: Cases, plant: str) -> dict[str, Any]:
    """Evaluate the conditions of the hard profile in which a flight ends early."""
    question = Question(
        "survives",
        "backstepping survives whatever the PID survives",
        "our question",
        "it comes to its end in every condition of the hard profile in which the PID as flown does",
    )
    ended: dict[str, list[str]] = {PID: [], BACKSTEPPING: [], RATE_FED_PID: []}
    labels: dict[str, list[str]] = {name: [] for name in ended}
    flown = 0
    for condition in CONDITIONS:
        for name, where in ended.items():
            case = cases.get(key(name, HARD, condition.name, plant))
            if case is None:
                continue
            flown += 1
            if case["ended"] is not None:
                where.append(condition.name)
                labels[name].append(f"{condition.label} ({how_ended(case)})")
    if not flown:
        raise NotFlownError(f"{HARD} on {plant}")
    words = (
        f"On the hard profile {where_of(plant)} the PID does not come to its end with: {_listed(labels[PID])}. "
        f"Backstepping does not with: {_listed(labels[BACKSTEPPING])}. The PID with its rate fed ahead does not with: "
        f"{_listed(labels[RATE_FED_PID])}."
    )
    holds = set(ended[BACKSTEPPING]) <= set(ended[PID])
    return question.answer(holds, words, **ended)


def _listed(labels: list[str]) -> str:
    return "; ".join(labels) or "nothing"


def yaw_saturated_percent(case: Mapping[str, Any]) -> float:
    """Return the share of a flight in which the rotors could not give the demanded yaw torque."""
    share: float = case["effort"]["saturated_percent"]["yaw"]
    return share


def spin_up(cases: Cases) -> dict[str, Any]:
    """Evaluate the spin-up torque of the rotors, which only the rigid body and the multibody plant have."""
    question = Question(
        "spin_up",
        "the torque that spins the rotors up may be left out",
        "implied by the paper, equations 5 and 6",
        f"the PID's yaw loop saturates in at most {RARELY_PERCENT:g} % of the ticks with it",
    )
    without, there, other = (
        flight(cases, key(name, DESIRED, PLAIN, which))
        for name, which in ((PID, SMALL_ANGLE), (PID, RIGID), (BACKSTEPPING, RIGID))
    )
    shares = [yaw_saturated_percent(case) for case in (without, there, other)]
    drop_m = there["metrics"]["z"]["max_error"]
    words = (
        f"Along the desired trajectory the PID's yaw loop is at the rotors' limits in {shares[1]:.0f} % of the time "
        f"{where_of(RIGID)}, which has this torque, and in {shares[0]:.0f} % without it; the height is off by up to "
        f"{100 * drop_m:.0f} cm with it. Backstepping's is there in {shares[2]:.0f} %."
    )
    return question.answer(
        shares[1] <= RARELY_PERCENT, words,
        pid_without_percent=shares[0], pid_percent=shares[1], backstepping_percent=shares[2],
    )  # fmt: skip
