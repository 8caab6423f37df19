"""The page of a run: each flight with its verdict, margin, pictures and the command that repeats it."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from flightstack.testing.expectations import Check
from gcs_cli.charts.pages import UNKNOWN, render_page
from gcs_cli.scenarios.result import Row, margin_text, percent

TEMPLATES = Path(__file__).parent / "templates"
_MOST_OPEN = 12
"""Failed flights whose charts are drawn at once; the others open with a click."""


def render_results(rows: Sequence[Row], wall_s: float, interrupted: bool = False) -> str:
    """Return the page as HTML: failed flights first and open."""
    failed = [row for row in rows if not row.result.passed]
    ordered = [*failed, *(row for row in rows if row.result.passed)]
    verdict = f"{len(failed)} failed" if failed else "all passed"
    return render_page(
        TEMPLATES,
        "scenarios.html",
        title=f"Scenarios: {verdict}",
        verdict=verdict,
        is_good=not failed,
        lines=["interrupted: only the flights that were over are shown" if interrupted else ""],
        tiles=_tiles(rows, len(failed), wall_s),
        rows=[_row(index, row) for index, row in enumerate(ordered)],
    )


def _tiles(rows: Sequence[Row], failed: int, wall_s: float) -> list[tuple[str, str]]:
    passed = [row.result.closest for row in rows if row.result.passed]
    shares = [check.share for check in passed if check is not None and check.share is not None]
    return [
        ("flights", str(len(rows))),
        ("passed", str(len(rows) - failed)),
        ("failed", str(failed)),
        ("closest margin of its limit", percent(min(shares)) if shares else UNKNOWN),
        ("median of these margins", percent(statistics.median(shares)) if shares else UNKNOWN),
        ("wall time", f"{wall_s:.1f} s"),
    ]


def _row(index: int, row: Row) -> dict[str, Any]:
    case, result = row.case, row.result
    file = case.name.replace("/", "-")  # of a saved chart
    share = None if result.closest is None else result.closest.share
    return {
        "label": case.label,
        "seed": case.seed,
        "passed": result.passed,
        "open": not result.passed and index < _MOST_OPEN,
        "share": None if share is None else round(100.0 * min(max(share, 0.0), 1.0)),
        "margin": margin_text(result.closest) if result.passed else result.failures[0].name,
        "duration_s": result.duration_s or None,
        "description": case.scenario.description,
        "outcome": result.outcome,
        "outcome_text": result.outcome_text,
        "checks": [_check(check) for check in sorted(result.checks, key=lambda check: check.passed)],
        "figures": [replace(figure, name=f"{figure.name}-{file}") for figure in result.figures],
        "texts": result.texts,
        "kept": row.kept,
        "command": case.command,
    }


def _check(check: Check) -> dict[str, Any]:
    found, _, values = check.found.partition("\n")
    return {"name": check.name, "passed": check.passed, "found": found, "around": values}
