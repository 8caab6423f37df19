"""The PIL report: one HTML file that needs nothing else."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from flightstack.core.contract import FloatArray
from gcs_cli.charts.figure import Figure
from gcs_cli.charts.pages import render_page, shown
from gcs_cli.pil.profile import STAGE_TITLES, StageProfile
from gcs_cli.pil.report_charts import DeviationChart, cost_over_time_figure, deviation_figures, profile_figure
from gcs_cli.pil.signals import BY_NAME, STAGES
from gcs_cli.pil.target_record import status_words

TEMPLATES = Path(__file__).parent / "templates"
_MOST_FRAMES = 12
"""Functions with the largest frames in the report; ``pil.json`` has all."""
_OF_TARGET = (
    "steps",
    "repeats",
    "out_of_order",
    "bad_frames",
    "skipped_octets",
    "uart_overruns",
    "uart_errors",
    "dropped_frames",
)


def render_report(
    result: Mapping[str, Any],
    charts: Sequence[DeviationChart],
    profiles: Sequence[StageProfile],
    costs: FloatArray | None = None,
) -> str:
    """Return the report as HTML; ``result`` is what ``pil.json`` holds."""
    profile = result["profile"]
    return render_page(
        TEMPLATES,
        "pil.html",
        result=result,
        tiles=[(tile["name"], shown(tile["value"])) for tile in result["tiles"]],
        differences=difference_table(result["differences"]),
        deviations=list(deviation_figures(charts)),
        profile=profile_figure(profiles, profile["unit"], profile["about"]) if profiles else None,
        cost_over_time=None
        if costs is None or not len(costs)
        else cost_over_time_figure(costs, profile["unit"], result["inner_hz"]),
        load=_load(result["load"]),
        frames=list((result["stack_usage"] or {"frames": {}})["frames"].items())[:_MOST_FRAMES],
        stage_titles=STAGE_TITLES,
        target=_target(result),
        link=_link(result),
        conditions=[(name, shown(value)) for name, value in result["conditions"].items()],
    )


def difference_table(differences: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return ``pairs`` of flights and ``stages``: name and rows of title and one difference, or None, for each pair."""
    pairs = list(dict.fromkeys(row["pair"] for row in differences))
    found = {(row["signal"], row["pair"]): row for row in differences}
    stages = []
    for stage in STAGES:
        rows = [
            (_titled(name), [found.get((name, pair)) for pair in pairs])
            for name, signal in BY_NAME.items()
            if signal.stage == stage and any((name, pair) in found for pair in pairs)
        ]
        if rows:
            stages.append((stage, rows))
    return {"pairs": pairs, "stages": stages}


def _titled(name: str) -> str:
    signal = BY_NAME[name]
    return signal.title if signal.unit == "1" else f"{signal.title} [{signal.unit}]"


def _cost_over_time(costs: FloatArray | None, result: Mapping[str, Any]) -> Figure | None:
    if costs is None or not len(costs):
        return None
    return cost_over_time_figure(costs, result["profile"]["unit"], result["inner_hz"])


def _load(load: Mapping[str, Any] | None) -> str:
    if load is None:
        return ""
    percent = ", ".join(f"{name} {load[f'{name}_percent']:.3g} %" for name in ("mean", "p99", "max"))
    clock = f"{load['clock_hz'] / 1e6:g} MHz"
    return f"CPU load: {percent} of a step's {load['period_us']:g} µs at {clock}; {load['about']}."


def _target(result: Mapping[str, Any]) -> list[tuple[str, str]]:
    target, stack = result["target"], result["stack"]
    if target is None:
        return []
    high_water = "unknown"
    if stack is not None and stack["high_water"]:
        unit = "octets" if target["char_bits"] == 8 else f"words of {target['char_bits']} bits"
        high_water = f"{stack['high_water']} of {stack['size']} {unit}"
    return [
        ("board", shown(target["board"])),
        ("compiler", shown(target["compiler"])),
        ("firmware", shown(target["source_hash"])),
        (
            "clock",
            f"{target['clock_hz'] / 1e6:g} MHz" if target["clock_hz"] else "none: emulated, or unknown",
        ),
        ("arithmetic", f"{8 * target['real_octets']}-bit floating point"),
        ("stack high water", high_water),
        ("before the flight", status_words(result["target_status_before"])),
    ]


def _link(result: Mapping[str, Any]) -> list[tuple[str, str]]:
    facts = [
        (name.replace("_us", " [µs]").replace("_", " "), shown(value))
        for name, value in result["link"].items()
    ]
    counted = result["target_counters"]
    if facts:
        facts += [
            (f"target: {name.replace('_', ' ')}", shown(counted[name]))
            for name in _OF_TARGET
            if name in counted
        ]
    return facts
