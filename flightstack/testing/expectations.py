"""Evaluate a flight by the expectations of a scenario."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from flightstack.core.contract import FloatArray
from flightstack.core.enums import Mode
from flightstack.core.errors import ConfigError
from flightstack.plan import NAV_COMMANDS
from flightstack.testing import properties
from flightstack.testing.expression import Expression
from flightstack.testing.flight import Event, Flight, start_ned_m
from flightstack.testing.properties import Margin, parse_window, values_around
from flightstack.testing.scenario import SEVERITIES, Expect
from flightstack.testing.state import State
from gcs_cli.report.flight_outcome import Code
from gcs_cli.report.summary import item_ned_m

_UNEXPECTED = ("unexpected", "not refused")
_SHOWN_EVENTS = 8
_BEFORE_LANDING_S = 0.05
"""Time before the landing detection at which the mode counts: the vehicle may change it upon landing."""


@dataclass(frozen=True)
class Check:
    """One expectation and whether it holds."""

    name: str
    passed: bool
    found: str
    margin: float | None = None
    """How far from failing, in the unit of the expectation; None without a number."""
    limit: float | None = None
    time_s: float | None = None
    """Time of a violation."""

    @property
    def share(self) -> float | None:
        """The margin as a share of the limit; None without either, and for a limit of 0."""
        if self.margin is None or not self.limit or not math.isfinite(self.margin):
            return None
        return self.margin / abs(self.limit)

    def __str__(self) -> str:
        return f"{self.name}: {self.found}"


def evaluate(expect: Expect, flight: Flight, last: State, events: Sequence[Event]) -> tuple[Check, ...]:
    """Return a check for each expectation."""
    return tuple(_checks(expect, flight, last, events))


def _checks(expect: Expect, flight: Flight, last: State, events: Sequence[Event]) -> Iterator[Check]:
    yield _outcome(expect, flight, last, events)
    for event in events:
        if event.name.startswith(_UNEXPECTED):
            found = f"{event.name} at t = {event.time_s:.2f} s"
            yield Check("answers", False, found, time_s=event.time_s)
    if flight.log:
        yield from _of_flight(expect, flight)
    elif _needs_flight(expect):
        yield Check("a flight", False, f"the vehicle did not arm; {last}")
    for text in expect.at_end:
        yield Check(f"at end {text}", Expression(text).of_state(last), str(last))


def _needs_flight(expect: Expect) -> bool:
    """Return True for an expectation that is checked in the log of a flight."""
    figures = (getattr(expect, name) for name in (*_FIGURES, "reached", "duration_s", "no_text_above"))
    texts = expect.always + expect.eventually + expect.texts
    return bool(texts) or any(value is not None for value in figures)


def _of_flight(expect: Expect, flight: Flight) -> Iterator[Check]:
    if expect.reached is not None:
        yield Check(
            f"reached = {list(expect.reached)}", flight.reached == list(expect.reached), f"{flight.reached}"
        )
    yield from _limits(expect, flight)
    for kind, texts in (("always", expect.always), ("eventually", expect.eventually)):
        for text in texts:
            yield _property(kind, text, flight)
    yield from _texts(expect, flight)


def _outcome(expect: Expect, flight: Flight, last: State, events: Sequence[Event]) -> Check:
    """Compare the outcome: a code, the mode of the landing, or a failsafe that was active."""
    if expect.refusal is not None:
        is_refused = flight.outcome == Code.REFUSED and expect.refusal in flight.outcome_text
        return Check(f"refused: {expect.refusal}", is_refused, flight.outcome_text or "not refused")
    wanted = expect.outcome or ("completed" if flight.outcome else "any")
    name = f"outcome {wanted}"
    if wanted == "any":
        return Check(name, True, flight.outcome)
    if wanted in Mode.__members__:
        mode = _landing_mode(flight)
        ending = f"ended in mode {last.mode} without a landing" if mode is None else f"landed in mode {mode}"
        return Check(name, mode == wanted, f"it {ending}")
    if wanted in tuple(Code):
        return Check(name, flight.outcome == wanted, f"{flight.outcome}: {flight.outcome_text}")
    failsafes = [
        event.name.removeprefix("failsafe_") for event in events if event.name.startswith("failsafe_")
    ]
    return Check(name, wanted in failsafes, f"active failsafes: {', '.join(failsafes) or 'none'}")


def _landing_mode(flight: Flight) -> str | None:
    """Return the mode in which the vehicle landed at last; None if the flight does not end on the ground."""
    moves = [event for event in flight.events if event.name in ("takeoff", "landing")]
    if not moves or moves[-1].name != "landing":
        return None
    return flight.at(moves[-1].time_s - _BEFORE_LANDING_S).mode


def _limits(expect: Expect, flight: Flight) -> Iterator[Check]:
    for name, figure in _FIGURES.items():
        limit = getattr(expect, name)
        if limit is not None:
            value = figure(flight)
            passed = value <= limit
            at_s = None if passed or name not in _DISTANCES else _farthest(flight, *_DISTANCES[name](flight))
            where = "" if at_s is None else _place_at(flight, at_s)
            yield Check(f"{name} ≤ {limit:g}", passed, f"{value:.3f} m{where}", limit - value, limit, at_s)
    if expect.duration_s is not None:
        low, high = expect.duration_s
        value = flight.duration_s
        margin = min(value - low, high - value)
        yield Check(f"duration_s {low:g} to {high:g}", margin >= 0.0, f"{value:.1f} s", margin, high - low)


def _property(kind: str, text: str, flight: Flight) -> Check:
    check = properties.always if kind == "always" else properties.eventually
    try:
        margin: Margin = check(flight.signals, *parse_window(text))
    except ConfigError as error:
        return Check(f"{kind} {text}", False, str(error))
    amount = "holds" if math.isinf(margin.margin) else f"margin {margin.margin:.3g}"
    found = f"{amount} at t = {margin.time_s:.2f} s"
    if not margin.holds:
        found = f"violated at t = {margin.time_s:.2f} s\n{margin.detail}"
    at_s = None if margin.holds else margin.time_s
    return Check(margin.prop, margin.holds, found, margin.margin, margin.limit, at_s)


def _texts(expect: Expect, flight: Flight) -> Iterator[Check]:
    if expect.no_text_above is not None:
        worse = flight.texts_above(SEVERITIES.index(expect.no_text_above))
        shown = (f"t = {text.time_s:.2f} s, {SEVERITIES[text.severity]}: {text.text}" for text in worse)
        found = "; ".join(list(shown)[:_SHOWN_EVENTS])
        at_s = worse[0].time_s if worse else None
        yield Check(f"no text above {expect.no_text_above}", not worse, found or "none", time_s=at_s)
    for text in expect.texts:
        yield Check(f"text {text!r}", any(text in said for said in flight.texts), "; ".join(flight.texts))


def corridor_m(flight: Flight) -> float:
    """Return the largest distance of the flight from the path of its plan, from its start; NaN without a path."""
    _, distance_m = _off_path(flight)
    return float(distance_m.max()) if len(distance_m) else math.nan


def _off_path(flight: Flight) -> tuple[FloatArray, FloatArray]:
    """Return times and distances from the path of the plan in flight."""
    data = flight.data
    time_s, position = data.actual_position
    flying = data.flying(time_s)
    places = [start_ned_m(flight)]
    for item in flight.plan.items:
        place = item_ned_m(item, data) if item.command in NAV_COMMANDS else None
        if place is not None:
            places.append(place)
    if len(places) < 2:
        return np.zeros(0), np.zeros(0)
    return time_s[flying], _distances_m(position[flying], np.array(places))


def _off_setpoint(flight: Flight) -> tuple[FloatArray, FloatArray]:
    """Return times and distances from the position setpoint in flight."""
    error = flight.data.actual_error()
    return error.time_s, error.values[:, 0]


def _farthest(flight: Flight, time_s: FloatArray, distance_m: FloatArray) -> float | None:
    """Return when a distance is largest."""
    return flight.data.start_s + float(time_s[np.argmax(distance_m)]) if len(time_s) else None


def _place_at(flight: Flight, at_s: float) -> str:
    """Return a time, and the values around it."""
    signals = flight.signals
    at = min(int(np.searchsorted(signals.time_s, at_s - 1e-9)), len(signals.time_s) - 1)
    return f" at t = {at_s:.2f} s\n{values_around(signals, _PLACE, at)}"


def _distances_m(points: FloatArray, path: FloatArray) -> FloatArray:
    """Return the distance of each point, shape (n, 3), from a line through ``path``, shape (m, 3)."""
    smallest = np.full(len(points), math.inf)
    for begin, end in pairwise(path):
        leg = end - begin
        along = np.clip((points - begin) @ leg / max(float(leg @ leg), 1e-30), 0.0, 1.0)
        smallest = np.minimum(smallest, np.linalg.norm(begin + along[:, None] * leg - points, axis=1))
    return smallest


_FIGURES: dict[str, Callable[[Flight], float]] = {
    "corridor_m": corridor_m,
    "max_error_m": lambda flight: flight.max_error_m,
    "rms_error_m": lambda flight: flight.rms_error_m,
    "landing_error_m": lambda flight: flight.landing_error_m,
}
"""Figures with a largest value."""
_DISTANCES: dict[str, Callable[[Flight], tuple[FloatArray, FloatArray]]] = {
    "corridor_m": _off_path,
    "max_error_m": _off_setpoint,
}
"""Figures that are the largest of a distance over time."""
_PLACE = ("mode", "north_m", "east_m", "altitude_m", "error_m")
"""Signals that a failure of a distance shows."""
