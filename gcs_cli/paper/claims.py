"""What the flights say about the paper's claims: verdicts by stated thresholds, sentences filled from figures. Pure."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from typing import Any

from gcs_cli.paper.cases import (
    BACKSTEPPING,
    CONDITIONS,
    DESIRED,
    HARD,
    IDEAL,
    PID,
    PLAIN,
    POLES,
    RIGID,
    SMALL_ANGLE,
    SMOOTH,
    key,
)
from gcs_cli.paper.comparisons import Cases, xy_figures

SIMILAR_PERCENT = 10.0
"""Errors that differ by less are called similar."""
CLEARLY_POINTS = 1.0
"""An overshoot lower by less is no lower."""
RARELY_PERCENT = 1.0
"""Rotors that are at their limits in less of the time are not driven there."""
SAME_POINTS = 0.5
"""Overshoots that differ by less are the same."""


def claims(cases: Cases) -> list[dict[str, Any]]:
    """Return the paper's claims and ours, each with verdict, threshold and a sentence with the figures.

    A claim whose flights are not among the cases is left out.
    """
    found = []
    for judge in (
        _similar,
        _lower_overshoot,
        _limits_matter,
        _method_or_gains,
        _torque,
        _stays_stable,
        _spin_up,
    ):
        for plant, where in ((SMALL_ANGLE, "on the small-angle plant"), (RIGID, "on the rigid-body plant")):
            with contextlib.suppress(KeyError):  # of a case that was not flown
                found.append({"plant": plant, **judge(cases, plant, where)})
    return found


def _figures(
    cases: Cases, contender: str, trajectory: str, condition: str, plant: str
) -> dict[str, Any] | None:
    return xy_figures(cases[key(contender, trajectory, condition, plant)])


def _claim(
    name: str, text: str, source: str, holds: bool, threshold: str, words: str, **figures: Any
) -> dict[str, Any]:
    return {
        "name": name, "claim": text, "source": source, "holds": holds, "threshold": threshold, "words": words,
        "figures": figures,
    }  # fmt: skip


def _crashed(name: str, text: str, source: str, threshold: str, who: str, where: str) -> dict[str, Any]:
    return _claim(name, text, source, False, threshold, f"{who} crashed {where}: nothing to compare.")


def _both(cases: Cases, trajectory: str, condition: str, plant: str, second: str = BACKSTEPPING) -> Any:
    """Figures of the PID and of ``second``, or the name of who crashed."""
    first = PID if second == BACKSTEPPING else BACKSTEPPING
    a, b = (_figures(cases, who, trajectory, condition, plant) for who in (first, second))
    return (first if a is None else second) if a is None or b is None else (a, b)


def _percent(new: float, old: float) -> float:
    return 100.0 * (new / old - 1.0)


def _similar(cases: Cases, plant: str, where: str) -> dict[str, Any]:
    head = ("similar", "the results of both controllers are quite similar", "paper, IV.B")
    threshold = f"RMS error in XY within {SIMILAR_PERCENT:g} % on the smooth profile"
    pair = _both(cases, SMOOTH, PLAIN, plant)
    if isinstance(pair, str):
        return _crashed(*head, threshold, pair, where)
    pid, back = pair
    more = _percent(back["rms_m"], pid["rms_m"])
    words = (
        f"On the smooth profile {where} the RMS error in XY is {1e3 * pid['rms_m']:.1f} mm with the PID and "
        f"{1e3 * back['rms_m']:.1f} mm with backstepping, {abs(more):.1f} % {'less' if more < 0.0 else 'more'}."
    )
    share = yaw_saturated_percent(cases[key(PID, SMOOTH, PLAIN, plant)])
    if share > RARELY_PERCENT:
        words += f" The PID's yaw loop is at the rotors' limits in {share:.0f} % of the time."
    figures = {"pid_m": pid["rms_m"], "backstepping_m": back["rms_m"], "difference_percent": more}
    return _claim(*head, abs(more) <= SIMILAR_PERCENT, threshold, words, **figures)


def _lower_overshoot(cases: Cases, plant: str, where: str) -> dict[str, Any]:
    head = ("overshoot", "backstepping overshoots less on hard profiles", "paper, IV.B")
    threshold = f"largest overshoot of x and y lower by {CLEARLY_POINTS:g} point or more"
    pair = _both(cases, HARD, PLAIN, plant)
    if isinstance(pair, str):
        return _crashed(*head, threshold, pair, where)
    pid, back = pair
    less = pid["overshoot_percent"] - back["overshoot_percent"]
    words = (
        f"On the hard profile {where} the worst overshoot of x and y is {pid['overshoot_percent']:.1f} % with the "
        f"PID and {back['overshoot_percent']:.1f} % with backstepping; beyond the corners of the path they fly "
        f"{100 * pid['beyond_m']:.0f} and {100 * back['beyond_m']:.0f} cm."
    )
    figures = {"pid_percent": pid["overshoot_percent"], "backstepping_percent": back["overshoot_percent"]}
    return _claim(*head, less >= CLEARLY_POINTS, threshold, words, **figures)


def _limits_matter(cases: Cases, plant: str, where: str) -> dict[str, Any]:
    head = ("limits", "the lower overshoot comes from how the laws meet the rotors' limits", "our question")
    threshold = f"without limits and lag the advantage shrinks by {CLEARLY_POINTS:g} point or more"
    limited, ideal = (_both(cases, HARD, condition, plant) for condition in (PLAIN, IDEAL))
    for pair in (limited, ideal):
        if isinstance(pair, str):
            return _crashed(*head, threshold, pair, where)
    with_limits, without = (
        pair[0]["overshoot_percent"] - pair[1]["overshoot_percent"] for pair in (limited, ideal)
    )
    words = (
        f"Backstepping's advantage on the hard profile {where} is {with_limits:.1f} points of overshoot with "
        f"limited rotors and {without:.1f} points with ideal ones."
    )
    holds = with_limits - without >= CLEARLY_POINTS
    return _claim(*head, holds, threshold, words, limited_points=with_limits, ideal_points=without)


def _method_or_gains(cases: Cases, plant: str, where: str) -> dict[str, Any]:
    head = ("method", "the advantage is due to the method, not to its gains", "our question")
    threshold = f"a linear PD with the same poles overshoots more by {SAME_POINTS:g} point or more"
    pair = _both(cases, HARD, PLAIN, plant, POLES)
    if isinstance(pair, str):
        return _crashed(*head, threshold, pair, where)
    back, poles = pair
    more = poles["overshoot_percent"] - back["overshoot_percent"]
    words = (
        f"On the hard profile {where} the linear PD with backstepping's poles overshoots by "
        f"{poles['overshoot_percent']:.1f} %, backstepping by {back['overshoot_percent']:.1f} %."
    )
    figures = {"backstepping_percent": back["overshoot_percent"], "poles_percent": poles["overshoot_percent"]}
    return _claim(*head, more >= SAME_POINTS, threshold, words, **figures)


def _torque(cases: Cases, plant: str, where: str) -> dict[str, Any]:
    head = ("torque", "backstepping rejects a sustained disturbance better", "implied by the paper, I and V")
    threshold = "smaller steady-state error in XY under a constant torque"
    pair = _both(cases, SMOOTH, "torque", plant)
    if isinstance(pair, str):
        return _crashed(*head, threshold, pair, where)
    pid, back = pair
    words = (
        f"Under the constant torque the vehicle comes to rest {1e3 * pid['steady_m']:.1f} mm beside its place with "
        f"the PID and {1e3 * back['steady_m']:.1f} mm with backstepping {where}."
    )
    figures = {"pid_m": pid["steady_m"], "backstepping_m": back["steady_m"]}
    return _claim(*head, back["steady_m"] < pid["steady_m"], threshold, words, **figures)


def _stays_stable(cases: Cases, plant: str, where: str) -> dict[str, Any]:
    head = ("stable", "backstepping does so without coming nearer to instability", "paper, IV.B")
    threshold = "it crashes in no condition of the hard profile in which the PID flies"
    crashed = {
        who: [c.label for c in CONDITIONS if _figures(cases, who, HARD, c.name, plant) is None]
        for who in (PID, BACKSTEPPING)
    }
    told = {who: "; ".join(labels) or "nowhere" for who, labels in crashed.items()}
    words = f"On the hard profile {where} the PID crashes: {told[PID]}. Backstepping crashes: {told[BACKSTEPPING]}."
    holds = set(crashed[BACKSTEPPING]) <= set(crashed[PID])
    return _claim(*head, holds, threshold, words, pid=crashed[PID], backstepping=crashed[BACKSTEPPING])


def yaw_saturated_percent(case: Mapping[str, Any]) -> float:
    """Return in what share of a flight the rotors could not give the yaw torque that was asked for."""
    share: float = case["effort"]["saturated_percent"]["yaw"]
    return share


def _spin_up(cases: Cases, plant: str, where: str) -> dict[str, Any]:
    """Judge the one torque that the rigid body has and the paper leaves out; no plant without it can tell."""
    if plant != RIGID:
        raise KeyError(plant)
    without, there, other = (
        cases[key(who, DESIRED, PLAIN, which)]
        for who, which in ((PID, SMALL_ANGLE), (PID, RIGID), (BACKSTEPPING, RIGID))
    )
    shares = [yaw_saturated_percent(case) for case in (without, there, other)]
    drop_m = there["metrics"]["z"]["max_error"]
    words = (
        f"Along the desired trajectory the PID's yaw loop is at the rotors' limits in {shares[1]:.0f} % of the time "
        f"{where}, which has this torque, and in {shares[0]:.0f} % without it; it costs up to "
        f"{100 * drop_m:.0f} cm of height. Backstepping's is there in {shares[2]:.0f} %."
    )
    return _claim(
        "spin_up",
        "the torque that spins the rotors up may be left out",
        "implied by the paper, equations 5 and 6",
        shares[1] <= RARELY_PERCENT,
        f"the PID's yaw loop saturates in at most {RARELY_PERCENT:g} % of the ticks with it",
        words,
        pid_without_percent=shares[0],
        pid_percent=shares[1],
        backstepping_percent=shares[2],
    )
