"""Properties of a whole flight in signal temporal logic, with the margin and the first violation."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.ndimage import maximum_filter1d

from flightstack.core.contract import FloatArray
from flightstack.core.errors import ConfigError
from flightstack.testing.expression import SMALLEST, Expression

_AROUND = (-0.2, -0.1, -0.02, 0.0, 0.02, 0.1, 0.2)
"""Times of the values that a failure shows, relative to the violation [s]."""
_TEXT = re.compile(
    r"(?P<what>.*?)(?:\s+within\s+(?P<within>\d+\.?\d*|\.\d+)\s*s)?(?:\s+(?:of|after)\s+(?P<event>\w+))?",
    re.DOTALL,
)


class Signals(NamedTuple):
    """Sampled signals of a flight: ``values`` by the names of ``SIGNALS``, each of shape (n,)."""

    time_s: FloatArray
    values: Mapping[str, Any]
    events: Mapping[str, Sequence[float]]
    """Times of each event [s]."""


class Margin(NamedTuple):
    """How far a property is from its violation. It holds if ``margin`` is not negative."""

    prop: str
    margin: float
    """The smallest margin, in the unit of the compared values; infinite for modes and flags."""
    time_s: float
    """Time of the smallest margin, or of the first violation."""
    detail: str = ""
    """The values around the first violation, a line for each time."""
    limit: float | None = None
    """The number of the comparison that has this margin, 12 in ``altitude_m < 12``; of always and eventually."""

    @property
    def holds(self) -> bool:
        """True if the property is not violated."""
        return self.margin >= 0.0


class PropertyViolationError(AssertionError):
    """A property does not hold; the message has the first violation and the values around it."""

    def __init__(self, margin: Margin) -> None:
        size = -margin.margin
        amount = "" if math.isinf(size) else f" by {size:.3g}" if size > SMALLEST else ", at the limit"
        super().__init__(
            f"{margin.prop}: violated at t = {margin.time_s:.2f} s{amount}\n{margin.detail}".rstrip()
        )
        self.margin = margin


class Window(NamedTuple):
    """Where a property counts: for ``within_s`` after each time of ``event``, or of the start of the flight."""

    event: str | None = None
    within_s: float = math.inf


def parse_window(text: str) -> tuple[str, Window]:
    """Split ``EXPRESSION within 20 s of EVENT`` into expression and window; both parts of the end are optional.

    >>> parse_window("mode == 'RETURN' within 20 s of link_cut")
    ("mode == 'RETURN'", Window(event='link_cut', within_s=20.0))
    """
    match = _TEXT.fullmatch(text.strip())
    assert match is not None  # the pattern matches any text
    within = math.inf if match["within"] is None else float(match["within"])
    return match["what"], Window(match["event"], within)


def always(signals: Signals, text: str, window: Window = Window()) -> Margin:  # noqa: B008  (immutable)
    """Return the margin of ``text`` at every sample of the window."""
    name = _name("always", text, window)
    expression = Expression(text)
    margin = expression.margin(signals.values)
    inside = np.zeros(len(signals.time_s), bool)
    for begin_s, end_s in _spans(signals, window):
        inside |= (signals.time_s >= begin_s) & (signals.time_s <= end_s)
    return _worst(name, signals, expression, np.where(inside, margin, math.inf))


def eventually(signals: Signals, text: str, window: Window = Window()) -> Margin:  # noqa: B008
    """Return the margin of ``text`` at the best sample of each window: the smallest of all windows."""
    name = _name("eventually", text, window)
    expression = Expression(text)
    margin = expression.margin(signals.values)
    worst = Margin(name, math.inf, math.nan)
    for begin_s, end_s in _spans(signals, window):
        inside = np.flatnonzero((signals.time_s >= begin_s) & (signals.time_s <= end_s))
        best = inside[np.argmax(margin[inside])] if len(inside) else None
        found = -math.inf if best is None else float(margin[best])
        if found < worst.margin or math.isnan(worst.time_s):
            last = int(inside[-1]) if len(inside) else len(signals.time_s) - 1
            at = last if best is None or found == -math.inf else int(best)
            detail = "" if found >= 0.0 else values_around(signals, expression.names, at)
            limit = _limit(expression, signals, at, found)
            worst = Margin(name, _plain(found), float(signals.time_s[at]), detail, limit)
    return worst


def until(signals: Signals, text: str, end: str) -> Margin:
    """Return the margin of "``text`` holds at every sample until ``end`` holds, which it does once"."""
    name = f"{text} until {end}"
    expression, ending = Expression(text), Expression(end)
    first, last = expression.margin(signals.values), ending.margin(signals.values)
    before = np.minimum.accumulate(np.concatenate(([math.inf], first[:-1])))
    joined = np.minimum(last, before)
    best = int(np.argmax(joined))
    margin = float(joined[best])
    bad = np.flatnonzero(first < 0.0)
    at = best if margin >= 0.0 else int(bad[0]) if len(bad) else len(first) - 1
    names = tuple(sorted({*expression.names, *ending.names}))
    detail = "" if margin >= 0.0 else values_around(signals, names, at)
    return Margin(name, _plain(margin), float(signals.time_s[at]), detail)


def within(signals: Signals, trigger: str, reaction: str, limit_s: float) -> Margin:
    """Return the margin of "whenever ``trigger`` holds, ``reaction`` holds at most ``limit_s`` later"."""
    name = f"{reaction} within {limit_s:g} s of {trigger}"
    cause, effect = Expression(trigger), Expression(reaction)
    step_s = float(np.median(np.diff(signals.time_s))) if len(signals.time_s) > 1 else 1.0
    samples = round(min(limit_s / step_s, len(signals.time_s))) + 1
    reached = effect.margin(signals.values)
    best = maximum_filter1d(reached, samples, origin=-(samples // 2), mode="constant", cval=-math.inf)
    margin = np.maximum(-cause.margin(signals.values), best)
    names = Expression(f"({trigger}) and ({reaction})").names
    return _worst(name, signals, names, margin)


def _name(kind: str, text: str, window: Window) -> str:
    end = "" if math.isinf(window.within_s) else f" within {window.within_s:g} s"
    return f"{kind} {text}{end}{'' if window.event is None else f' after {window.event}'}"


def _spans(signals: Signals, window: Window) -> list[tuple[float, float]]:
    if window.event is None:
        begins: Sequence[float] = (float(signals.time_s[0]),)
    else:
        begins = signals.events.get(window.event, ())
        if not begins:
            known = ", ".join(signals.events) or "none"
            raise ConfigError("event", window.event, f"did not happen in this flight; its events are {known}")
    spans = [(begin_s, begin_s + window.within_s) for begin_s in begins]
    first_s, last_s = signals.time_s[0], signals.time_s[-1]
    within_flight = [(begin_s, end_s) for begin_s, end_s in spans if begin_s <= last_s and end_s >= first_s]
    if not within_flight:
        raise ConfigError("event", str(window.event), "has no sample of this flight in its window")
    return within_flight


def _worst(name: str, signals: Signals, names: Expression | tuple[str, ...], margin: FloatArray) -> Margin:
    """Return the margin of a property that holds at every sample."""
    violated = np.flatnonzero(margin < 0.0)
    at = int(violated[0]) if len(violated) else int(np.argmin(margin))
    shown = names.names if isinstance(names, Expression) else names
    detail = values_around(signals, shown, at) if len(violated) else ""
    worst = int(np.argmin(margin))
    limit = _limit(names, signals, worst, float(margin[worst])) if isinstance(names, Expression) else None
    return Margin(name, _plain(float(margin[worst])), float(signals.time_s[at]), detail, limit)


def _limit(expression: Expression, signals: Signals, at: int, margin: float) -> float | None:
    """Return the number of the comparison that has ``margin`` at sample ``at``."""
    return expression.limit({name: signals.values[name][at] for name in expression.names}, margin)


def _plain(margin: float) -> float:
    """Return 0 for the margin of equal values where the comparison is true."""
    return 0.0 if margin == SMALLEST else margin


def values_around(signals: Signals, names: Sequence[str], at: int) -> str:
    """Return a table of signals around sample ``at``, a line for each time."""
    centre_s = float(signals.time_s[at])
    rows = sorted({int(i) for i in np.searchsorted(signals.time_s, [centre_s + d - 1e-9 for d in _AROUND])})
    lines = []
    for row in rows:
        if row < len(signals.time_s):
            values = ", ".join(f"{name} = {_shown(signals.values[name][row])}" for name in names)
            mark = ">" if row == at else " "
            lines.append(f"{mark} t = {signals.time_s[row]:7.2f} s: {values}")
    return "\n".join(lines)


def _shown(value: Any) -> str:
    return f"{value:.3f}" if isinstance(value, float) else str(value)
