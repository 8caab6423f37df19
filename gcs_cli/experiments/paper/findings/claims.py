"""Verdicts on the paper's claims by stated thresholds, with sentences built from figures. Pure."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from gcs_cli.experiments.paper.findings.claims_stability import (
    RARELY_PERCENT,
    spin_up,
    stays_stable,
    survives,
    yaw_saturated_percent,
)
from gcs_cli.experiments.paper.findings.comparisons import Cases, Overshoots, shared_overshoots, steady_m
from gcs_cli.experiments.paper.findings.verdicts import (
    NAMES,
    NotFlownError,
    NothingToCompareError,
    Question,
    flights,
    less_or_more,
    require_complete,
    where_of,
    who_ended,
)
from gcs_cli.experiments.paper.flights.cases import (
    BACKSTEPPING,
    HARD,
    IDEAL,
    NO_LIMITS,
    PID,
    PLAIN,
    POLES,
    RATE_FED_PID,
    RIGID,
    SMALL_ANGLE,
    SMOOTH,
)

SIMILAR_PERCENT = 10.0
"""Errors that differ by less are called similar."""
CLEARLY_POINTS = 1.0
"""An overshoot lower by less is no lower."""
SAME_POINTS = 0.5
"""Overshoots that differ by less are the same."""
_READINGS = (PID, RATE_FED_PID)
"""Table II without and with the reference rate: the paper does not define it."""
_ALL = (*_READINGS, BACKSTEPPING)

_SIMILAR = Question(
    "similar",
    "the results of both controllers are quite similar",
    "paper, IV.B",
    f"RMS error in XY on the smooth profile within {SIMILAR_PERCENT:g} % of the PID's, "
    "whether its rate is fed ahead or not",
)
_OVERSHOOT = Question(
    "overshoot",
    "backstepping overshoots less on hard profiles",
    "paper, IV.B",
    f"median overshoot of x and y lower than the PID's by {CLEARLY_POINTS:g} point or more, "
    "whether its rate is fed ahead or not",
)
_LIMITS = Question(
    "limits",
    "the lower overshoot comes from how the laws meet the rotors' limits",
    "our question",
    f"there is an advantage of {CLEARLY_POINTS:g} point or more over the PID as flown, and without the limits, all "
    f"else alike, it shrinks by {CLEARLY_POINTS:g} point or more",
)
_METHOD = Question(
    "method",
    "the advantage is due to the method, not to its gains",
    "our question",
    f"on the hard profile both a linear PD with the same poles and the PID with its rate fed ahead overshoot more, "
    f"by {SAME_POINTS:g} point or more",
)
_TORQUE = Question(
    "torque",
    "backstepping rejects a sustained disturbance better",
    "implied by the paper, I and V",
    "smaller steady-state error in XY under a constant torque",
)


def claims(cases: Cases, linear: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the paper's claims and ours, each with verdict, threshold and a sentence with the figures.

    ``cases`` and ``linear`` are those of results.json. A claim whose flights or analysis are not part of this run is
    left out; any other missing figure raises KeyError.
    """
    both = (SMALL_ANGLE, RIGID)
    evaluations: tuple[tuple[Callable[[str], dict[str, Any]], Sequence[str]], ...] = (
        (lambda plant: _compared(_similar, _SIMILAR, cases, plant), both),
        (lambda plant: _compared(_lower_overshoot, _OVERSHOOT, cases, plant), both),
        (lambda plant: _compared(_limits_matter, _LIMITS, cases, plant), both),
        (lambda plant: _compared(_method_or_gains, _METHOD, cases, plant), both),
        (lambda plant: _compared(_torque, _TORQUE, cases, plant), both),
        (lambda plant: stays_stable(linear, plant), both),
        (lambda plant: survives(cases, plant), both),
        (lambda _: spin_up(cases), (RIGID,)),
    )
    found = []
    for evaluate, plants in evaluations:
        for plant in plants:
            with contextlib.suppress(NotFlownError):
                found.append({"plant": plant, **evaluate(plant)})
    return found


def _compared(
    evaluate: Callable[[Question, Cases, str], dict[str, Any]], question: Question, cases: Cases, plant: str
) -> dict[str, Any]:
    try:
        return evaluate(question, cases, plant)
    except NothingToCompareError as why:
        return question.nothing_to_compare(str(why), where_of(plant))


def _overshoots(found: Sequence[Mapping[str, Any]], where: str) -> Overshoots:
    over = shared_overshoots(found)
    if over is None:
        raise NothingToCompareError(f"no move began at rest {where}")
    return over


def _similar(question: Question, cases: Cases, plant: str) -> dict[str, Any]:
    found = flights(cases, _ALL, SMOOTH, PLAIN, plant)
    require_complete(_ALL, found)
    flown, fed, back = (case["path"]["rms_error_m"] for case in found)
    more = [100.0 * (back / one - 1.0) for one in (flown, fed)]
    words = (
        f"On the smooth profile {where_of(plant)} the RMS error in XY is {1e3 * flown:.1f} mm with the PID as flown, "
        f"{1e3 * fed:.1f} mm with its rate fed ahead, as backstepping's is, and {1e3 * back:.1f} mm with "
        f"backstepping: {less_or_more(more[0])} than the one, {less_or_more(more[1])} than the other."
    )
    share = yaw_saturated_percent(found[0])
    if share > RARELY_PERCENT:
        words += f" The yaw loop of the PID as flown is at the rotors' limits in {share:.0f} % of the time."
    return question.answer(
        max(abs(one) for one in more) <= SIMILAR_PERCENT, words,
        pid_m=flown, rate_fed_pid_m=fed, backstepping_m=back, difference_percent=more[0],
        difference_from_rate_fed_percent=more[1],
    )  # fmt: skip


def _lower_overshoot(question: Question, cases: Cases, plant: str) -> dict[str, Any]:
    found = flights(cases, _ALL, HARD, PLAIN, plant)
    require_complete(_ALL, found)
    over = _overshoots(found, "with all of them")
    median, worst = over.median_percent, over.worst_percent
    beyond = [100.0 * case["path"]["beyond_m"] for case in found]
    words = (
        f"On the hard profile {where_of(plant)} the median overshoot of x and y is {median[0]:.1f} % with the PID as "
        f"flown, {median[1]:.1f} % with its rate fed ahead and {median[2]:.1f} % with backstepping, over the "
        f"{over.moves} moves that begin at rest with all three (worst {worst[0]:.1f}, {worst[1]:.1f} and "
        f"{worst[2]:.1f} %); beyond the corners of the path they fly {beyond[0]:.0f}, {beyond[1]:.0f} and "
        f"{beyond[2]:.0f} cm."
    )
    return question.answer(
        min(median[:2]) - median[2] >= CLEARLY_POINTS, words,
        pid_percent=median[0], rate_fed_pid_percent=median[1], backstepping_percent=median[2], moves=over.moves,
    )  # fmt: skip


def _limits_matter(question: Question, cases: Cases, plant: str) -> dict[str, Any]:
    pair = (PID, BACKSTEPPING)
    found = [
        case for condition in (PLAIN, NO_LIMITS) for case in flights(cases, pair, HARD, condition, plant)
    ]
    require_complete(pair, found[:2], "with limits ")
    require_complete(pair, found[2:], "without limits ")
    over = _overshoots(found, "in all four flights")
    a, b, c, d = over.median_percent
    words = (
        f"On the hard profile {where_of(plant)} the median overshoot, over {over.moves} moves, is {a:.1f} % with the "
        f"PID as flown and {b:.1f} % with backstepping; without limits of the rotors' speeds, with their lag, "
        f"{c:.1f} and {d:.1f} %: {a - b:.1f} points apart with limits, {c - d:.1f} without."
    )
    ideal = flights(cases, pair, HARD, IDEAL, plant)
    apart = shared_overshoots(ideal) if who_ended(pair, ideal) is None else None
    if apart is not None:
        first, second = apart.median_percent
        words += f" With ideal rotors they are {first - second:.1f} points apart."
    holds = a - b >= CLEARLY_POINTS and (a - b) - (c - d) >= CLEARLY_POINTS
    return question.answer(holds, words, limited_points=a - b, unlimited_points=c - d)


def _method_or_gains(question: Question, cases: Cases, plant: str) -> dict[str, Any]:
    names = (POLES, RATE_FED_PID, BACKSTEPPING)
    found = flights(cases, names, HARD, PLAIN, plant)
    require_complete(names, found)
    over = _overshoots(found, "with all of them")
    poles, fed, back = over.median_percent
    words = (
        f"On the hard profile {where_of(plant)} the median overshoot, over {over.moves} moves, is {poles:.1f} % with "
        f"{NAMES[POLES]}, {fed:.1f} % with {NAMES[RATE_FED_PID]} and {back:.1f} % with backstepping."
    )
    return question.answer(
        min(poles, fed) - back >= SAME_POINTS, words,
        poles_percent=poles, rate_fed_pid_percent=fed, backstepping_percent=back,
    )  # fmt: skip


def _torque(question: Question, cases: Cases, plant: str) -> dict[str, Any]:
    pair = (PID, BACKSTEPPING)
    found = flights(cases, pair, SMOOTH, "torque", plant)
    require_complete(pair, found)
    pid, back = (steady_m(case) for case in found)
    words = (
        f"Under the constant torque the vehicle comes to rest {1e3 * pid:.1f} mm beside its place with the PID and "
        f"{1e3 * back:.1f} mm with backstepping {where_of(plant)}."
    )
    return question.answer(back < pid, words, pid_m=pid, backstepping_m=back)
