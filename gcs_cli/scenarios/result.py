"""The result of one flight of a scenario, as it comes from a worker process."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from flightstack.testing.expectations import Check
from gcs_cli.charts.figure import Figure
from gcs_cli.scenarios.selection import Case


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
        "command": case.command,
        "log_sha256": result.log_sha256,
        "kept": row.kept,
        "wall_time_s": round(result.wall_s, 3),
    }


def _check(check: Check) -> dict[str, Any]:
    finite = check.share is not None
    return {
        "expectation": check.name,
        "passed": check.passed,
        "found": check.found,
        "margin": check.margin if finite else None,
        "limit": check.limit if finite else None,
        "share": check.share,
    }
