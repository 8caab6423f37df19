"""The report of a campaign: pass probability, distributions, sensitivities, worst cases."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from gcs_cli.campaign.definition import GRID, MONTE_CARLO, Campaign
from gcs_cli.campaign.display import inputs_text
from gcs_cli.campaign.figures import input_figure, margin_figure, metric_figure
from gcs_cli.campaign.options import CampaignOptions, only_command
from gcs_cli.campaign.rows import Row
from gcs_cli.campaign.statistics import pass_probability, quantiles, sensitivities, worst
from gcs_cli.charts.figure import AnyFigure
from gcs_cli.charts.pages import UNKNOWN, render_page
from gcs_cli.scenarios.figures import METRICS

TEMPLATES = Path(__file__).parent / "templates"
_WORST = 20
_NOTES = {
    MONTE_CARLO: "The interval holds with 95 % confidence for independent flights (Clopper and Pearson).",
    GRID: "The share of the grid's flights that pass: no probability, because its points are not random.",
}
_STRATIFIED = (
    "The interval is that of independent flights (Clopper and Pearson); samples spread evenly vary less."
)


def render_campaign(
    campaign: Campaign, rows: Sequence[Row], options: CampaignOptions, first: Iterable[AnyFigure] = (),
    found: Sequence[str] = (),
) -> str:  # fmt: skip
    """Return the report as HTML. ``first`` and ``found``: figures and sentences of a search."""
    failed = sum(not row["passed"] for row in rows)
    plan, is_search = campaign.plan, options.seek is not None
    method = f"search with --seek {options.seek}" if is_search else plan.method
    description = str(campaign.values.get("description", ""))
    return render_page(
        TEMPLATES,
        "campaign.html",
        title=f"Campaign: {campaign.path.stem}",
        verdict=f"{failed} of {len(rows)} failed" if failed else "all passed",
        is_good=not failed,
        lines=[description, f"{method}, seed {plan.seed}, inputs {', '.join(campaign.vary)}"],
        tiles=_tiles(rows, len(rows) - failed, is_search),
        note="" if is_search else _NOTES.get(plan.method, _STRATIFIED),
        found=found,
        figures=[*first, margin_figure(rows), input_figure(rows), metric_figure(rows)],
        sensitivities=[
            (each.name, f"{each.correlation:+.2f}", f"{each.p_value:.2g}") for each in sensitivities(rows)
        ],
        distributions=list(_distributions(rows)),
        worst=[_worst_row(row, options) for row in worst(rows, _WORST)],
    )


def _tiles(rows: Sequence[Row], passed: int, is_search: bool) -> list[tuple[str, str]]:
    least = f"{100.0 * min(row['robustness'] for row in rows):.1f} %"
    tiles = [("flights", str(len(rows))), ("passed", str(passed)), ("failed", str(len(rows) - passed))]
    if not is_search:
        chance = pass_probability(passed, len(rows))
        interval = f"{100.0 * chance.low:.1f} to {100.0 * chance.high:.1f} %"
        tiles += [
            ("pass probability", f"{100.0 * chance.share:.1f} %"),
            ("95 % confidence interval", interval),
        ]
    return [*tiles, ("least margin of its limit", least)]


def _distributions(rows: Sequence[Row]) -> Iterable[tuple[str, list[str]]]:
    """Yield name and quantiles of each metric and each margin."""
    margins = list(dict.fromkeys(name for row in rows for name in row["margins"]))
    values = {name: [row["metrics"].get(name) for row in rows] for name in METRICS}
    values |= {f"margin of {name}": [row["margins"].get(name) for row in rows] for name in margins}
    for name, numbers in values.items():
        found = quantiles(numbers)
        yield name, [UNKNOWN] * 5 if found is None else [f"{number:.3g}" for number in found]


def _worst_row(row: Row, options: CampaignOptions) -> dict[str, Any]:
    return {
        "flight": row["flight"],
        "seed": row["seed"],
        "passed": row["passed"],
        "margin": f"{100.0 * row['robustness']:.1f} %",
        "reason": "; ".join(row["failed"]) or row["closest"] or "",
        "inputs": inputs_text(row),
        "command": only_command(options, row["flight"]),
    }
