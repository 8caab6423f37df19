"""The result of one flight of a scenario, as it comes from a worker process."""

from __future__ import annotations

import bisect
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from flightstack.testing.expectations import Check
from gcs_cli.charts.figure import Figure
from gcs_cli.scenarios.selection import Case

_MOST_EVENTS, _AFTER = 10, 4
"""Events and status texts of a failed flight that are shown, and how many of them follow the violation."""


@dataclass(frozen=True)
class Wanted:
    """Data that a worker returns besides the verdict."""

    figures: bool = False
    """Figures for the page."""
    files: bool = False
    """Log and report of a flight that failed."""
    every_file: bool = False
    """Log and report of any flight."""
    metrics: bool = False
    """Figures of the flight as numbers."""


@dataclass(frozen=True)
class Result:
    """A flown case. All but ``wall_s`` depends on scenario and seed alone."""

    checks: tuple[Check, ...]
    closest: Check | None = None
    """The check with the smallest margin relative to its limit."""
    outcome: str = ""
    outcome_text: str = ""
    duration_s: float = 0.0
    """Simulated time from arming to disarming."""
    wall_s: float = 0.0
    log_sha256: str | None = None
    texts: tuple[tuple[float, str], ...] = ()
    """Times and names of the events and status texts, oldest first."""
    figures: tuple[Figure, ...] = ()
    metrics: Mapping[str, float] = field(default_factory=dict)
    """Figures of the flight by name, with their unit; NaN where it has none."""
    log: bytes = b""
    report: str = ""

    @property
    def passed(self) -> bool:
        """True if every expectation holds."""
        return all(check.passed for check in self.checks)

    @property
    def failures(self) -> list[Check]:
        """The expectations that do not hold."""
        return [check for check in self.checks if not check.passed]

    @property
    def violated_s(self) -> float | None:
        """Time of the first violation; None if no failure has one."""
        times = [check.time_s for check in self.failures if check.time_s is not None]
        return min(times, default=None)

    @property
    def nearest(self) -> tuple[tuple[float, str], ...]:
        """The events and status texts nearest to the first violation, oldest first; without one the newest."""
        at_s = math.inf if self.violated_s is None else self.violated_s
        last = bisect.bisect_right(self.texts, at_s, key=lambda fact: fact[0]) + _AFTER
        last = min(max(last, _MOST_EVENTS), len(self.texts))
        return self.texts[max(0, last - _MOST_EVENTS) : last]


@dataclass(frozen=True)
class Row:
    """A case with its result, and the folder where its files are, if it failed."""

    case: Case
    result: Result
    kept: str | None = None


def not_flown(reason: str, wall_s: float = 0.0) -> Result:
    """Return the result of a flight that ended by an error."""
    return Result((Check("flight", False, reason),), outcome="error", outcome_text=reason, wall_s=wall_s)


def percent(share: float) -> str:
    """Return a share as a percentage."""
    return f"{100.0 * share:.0f} %"


def margin_text(check: Check | None) -> str:
    """Return how far a check is from its limit; empty without a number."""
    if check is None or check.margin is None or check.share is None:
        return ""
    if check.passed:
        return f"{check.name}: margin {check.margin:.3g} ({percent(check.share)})"
    return f"{check.name}: exceeded by {-check.margin:.3g}"


def summary_text(result: Result) -> str:
    """Return the closest margin of a flight that passed, else the first failure, in one line."""
    if result.passed:
        return margin_text(result.closest)
    return str(result.failures[0]).partition("\n")[0]


def as_json(rows: Sequence[Row], wall_s: float, interrupted: bool) -> dict[str, Any]:
    """Return the document of ``gcs test --json``."""
    passed = sum(row.result.passed for row in rows)
    return {
        "passed": passed,
        "failed": len(rows) - passed,
        "interrupted": interrupted,
        "wall_time_s": round(wall_s, 3),
        "flights": [_flight(row) for row in rows],
    }


def _flight(row: Row) -> dict[str, Any]:
    case, result = row.case, row.result
    return {
        "scenario": case.label,
        "file": str(case.scenario.path),
        "seed": case.seed,
        "passed": result.passed,
        "outcome": result.outcome,
        "outcome_text": result.outcome_text,
        "duration_s": round(result.duration_s, 3),
        "closest": None if result.closest is None else _check(result.closest),
        "checks": [_check(check) for check in result.checks],
        "events": [] if result.passed else [_event(*fact) for fact in result.nearest],
        "command": case.command,
        "log_sha256": result.log_sha256,
        "kept": row.kept,
        "wall_time_s": round(result.wall_s, 3),
    }


def _event(at_s: float, text: str) -> dict[str, Any]:
    return {"time_s": round(at_s, 3), "text": text}


def _check(check: Check) -> dict[str, Any]:
    finite = check.share is not None
    return {
        "expectation": check.name,
        "passed": check.passed,
        "found": check.found,
        "time_s": None if check.time_s is None else round(check.time_s, 3),
        "margin": check.margin if finite else None,
        "limit": check.limit if finite else None,
        "share": check.share,
    }
