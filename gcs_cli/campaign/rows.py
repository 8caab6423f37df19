"""The result of each flight as a row, and all rows as the columns of a table. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from gcs_cli.campaign.plan import PlannedFlight
from gcs_cli.scenarios.figures import METRICS
from gcs_cli.scenarios.result import Result

Row = Mapping[str, Any]
"""A flight: ``flight``, ``seed``, ``inputs``, ``passed``, ``outcome``, ``outcome_text``, ``failed`` (names of the
expectations), ``robustness``, ``closest``, ``margins`` and ``metrics`` (by name; None without a number) and
``log_sha256``.
"""
_NO_NUMBER = 1.0
_HEAD = ("flight", "seed", "passed", "outcome", "outcome_text", "failed", "robustness", "closest")


def row_of(flight: PlannedFlight, result: Result) -> Row:
    """Return the row of a flight: what depends on its inputs and its seed alone."""
    closest = min(
        (check for check in result.checks if check.share is not None),
        key=lambda check: check.share or 0.0,
        default=None,
    )
    return {
        "flight": flight.number,
        "seed": flight.seed,
        "inputs": dict(flight.inputs),
        "passed": result.passed,
        "outcome": result.outcome,
        "outcome_text": result.outcome_text,
        "failed": [check.name for check in result.failures],
        "robustness": robustness(result),
        "closest": None if closest is None else closest.name,
        "margins": {check.name: _finite(check.margin) for check in result.checks if check.limit is not None},
        "metrics": {name: _finite(result.metrics.get(name)) for name in METRICS},
        "log_sha256": result.log_sha256,
    }


def robustness(result: Result) -> float:
    """Return the smallest margin as a share of its limit, negative if an expectation fails.

    A failed expectation without a number counts as −1; a passed flight without any number as 1.
    """
    shares = [check.share for check in result.checks if check.share is not None]
    shares += [-1.0 for check in result.failures if check.share is None]
    return min(shares, default=_NO_NUMBER)


def columns(rows: Sequence[Row]) -> dict[str, list[Any]]:
    """Return the columns of the table, in the order of the flights, whatever the order of ``rows``."""
    ordered = sorted(rows, key=lambda row: int(row["flight"]))
    found: dict[str, list[Any]] = {name: [row[name] for row in ordered] for name in _HEAD}
    found["failed"] = ["; ".join(names) for names in found["failed"]]
    for group, label in (("inputs", "input"), ("margins", "margin"), ("metrics", "metric")):
        for name in _names(row[group] for row in ordered):
            found[f"{label}: {name}"] = [row[group].get(name) for row in ordered]
    found["log_sha256"] = [row["log_sha256"] for row in ordered]
    return found


def _names(tables: Iterable[Mapping[str, Any]]) -> list[str]:
    """Return every key once, in the order in which they appear."""
    return list(dict.fromkeys(name for table in tables for name in table))


def _finite(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else value
