"""The PIL report: one HTML file that needs nothing else."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gcs_cli.pil.compare import Deviation
from gcs_cli.pil.histogram_chart import histogram_chart
from gcs_cli.pil.profile import StageProfile
from gcs_cli.pil.report_tables import (
    checks_section,
    differences_section,
    facts_section,
    profile_table,
    shown,
)
from gcs_cli.pil.signals import Signal
from gcs_cli.pil.target_record import status_words
from gcs_cli.report.chart import Line, time_chart
from gcs_cli.report.plots import section

_STYLE_SHEETS = (Path(__file__).parents[1] / "report" / "report.css", Path(__file__).with_name("pil.css"))
_PAIR_STYLES = ("s1 target", "s2 thin", "s4")
_DECADES = 4.0
"""Of a chart: what is smaller than the largest difference by more is drawn at the bottom."""
_STRETCHES = 300
_STAGE_STYLES = {"outer": "s2", "inner": "s1", "mixer": "s3", "whole": "s5"}

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


class DeviationChart(NamedTuple):
    """How far one signal is apart over time, for each pair of flights."""

    signal: Signal
    pairs: dict[str, Deviation]


def render_report(
    result: Mapping[str, Any], charts: Sequence[DeviationChart], profiles: Sequence[StageProfile]
) -> str:
    """Return the report as HTML; ``result`` is what ``pil.json`` holds."""
    title = escape(result["title"])
    style = "".join(sheet.read_text(encoding="utf-8") for sheet in _STYLE_SHEETS)
    body = "".join(
        (
            _header(title, result),
            _tiles(result),
            checks_section(result["checks"]),
            differences_section(result["differences"], result["compared"]),
            *_deviations(charts),
            *_profile(result, profiles),
            *_target(result),
            *_link(result),
            *_flights(result),
            facts_section(
                "Conditions", [(name, shown(value)) for name, value in result["conditions"].items()]
            ),
        )
    )
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{title}</title><style>{style}</style></head>"
        f"<body><main>{body}</main></body></html>\n"
    )


def _header(title: str, result: Mapping[str, Any]) -> str:
    good = "good" if result["verdict"] == "passed" else "bad"
    return (
        f'<header><h1>{title}</h1><span class="outcome {good}">{escape(result["verdict"])}</span>'
        f'<div class="about">{escape(result["about"])}</div></header>'
        f'<p class="what">{escape(result["meaning"])}</p>'
    )


def _tiles(result: Mapping[str, Any]) -> str:
    cells = "".join(
        f'<div class="tile"><b>{shown(tile["value"])}</b><span>{escape(tile["name"])}</span></div>'
        for tile in result["tiles"]
    )
    return f'<div class="tiles">{cells}</div>'


def _deviations(charts: Sequence[DeviationChart]) -> Iterator[str]:
    for signal, pairs in charts:
        unit = "" if signal.unit == "1" else f" [{signal.unit}]"
        title = f"Difference over time: {signal.title}{unit}"
        lines, same = [], []
        for (pair, apart), style in zip(pairs.items(), _PAIR_STYLES, strict=False):
            if not len(apart.size):
                continue
            if np.any(apart.size > 0.0):
                time_s, size = _envelope(apart)
                lines.append(Line(pair, time_s, size, style))
            else:
                same.append(pair)
        note = f"Not drawn, because no bit differs: {', '.join(same)}." if same else ""
        if not lines:
            yield section(title, f'<p class="none">{escape(note or "No data.")}</p>')
            continue
        span = (0.0, max(float(line.x[-1]) for line in lines))
        chart = time_chart(title, "", lines, span, log=True, height=200)
        yield section(title, chart, [(line.label, line.style, False) for line in lines], note)


def _envelope(apart: Deviation) -> Deviation:
    """Return the largest difference of each stretch of time: between two samples that differ, many do not at all."""
    count = len(apart.size)
    starts = np.unique(np.arange(_STRETCHES) * count // _STRETCHES)
    size = np.maximum.reduceat(apart.size, starts)
    return Deviation(apart.time_s[starts], np.maximum(size, 10.0**-_DECADES * size.max()))


def _profile(result: Mapping[str, Any], profiles: Sequence[StageProfile]) -> Iterator[str]:
    profile = result["profile"]
    if not profiles:
        return
    histograms = "".join(
        histogram_chart(stage, profile["unit"], _STAGE_STYLES[stage.stage]) for stage in profiles
    )
    body = f'{profile_table(profile)}<div class="histograms">{histograms}</div>'
    yield section("What a step costs", body, note=profile["about"])


def _target(result: Mapping[str, Any]) -> Iterator[str]:
    target, stack = result["target"], result["stack"]
    if target is None:
        return
    clock = f"{target['clock_hz'] / 1e6:g} MHz" if target["clock_hz"] else "none: emulated, or unknown"
    high_water = "unknown"
    if stack is not None and stack["high_water"]:
        unit = "octets" if target["char_bits"] == 8 else f"words of {target['char_bits']} bits"
        high_water = f"{stack['high_water']} of {stack['size']} {unit}"
    facts = [
        ("board", shown(target["board"])),
        ("compiler", shown(target["compiler"])),
        ("firmware", f'<span class="mono">{shown(target["source_hash"])}</span>'),
        ("clock", clock),
        ("arithmetic", f"{8 * target['real_octets']}-bit floating point"),
        ("stack high water", escape(high_water)),
        ("before the flight", escape(status_words(result["target_status_before"]))),
    ]
    yield facts_section("Target", facts, "The firmware is named by the first octets of its sources' SHA-256.")


def _link(result: Mapping[str, Any]) -> Iterator[str]:
    link = result["link"]
    if link:
        facts = [
            (name.replace("_us", " [µs]").replace("_", " "), shown(value)) for name, value in link.items()
        ]
        told = result["target_counters"]
        facts += [
            (f"target: {name.replace('_', ' ')}", shown(told[name])) for name in _OF_TARGET if name in told
        ]
        note = (
            "Lost: sendings of which nothing came, in either direction. Target: what its own counters counted in this "
            f"flight{'' if told else '; it did not tell them in the end'}."
        )
        yield facts_section("Link", facts, note)


def _flights(result: Mapping[str, Any]) -> Iterator[str]:
    flights = result["flights"]
    if not flights:
        return
    head = (
        '<tr><th></th><th>loops</th><th>outcome</th><th class="n">simulated</th><th class="n">wall time</th>'
        '<th class="n">ticks flown</th><th>report</th></tr>'
    )
    rows = "".join(
        f"<tr><td>{escape(stage)}</td><td>{shown(flight['loops'])}</td>"
        f'<td class="{"good" if flight["outcome"] == "completed" else "bad"}">{shown(_ending(flight))}</td>'
        f'<td class="n">{shown(flight["sim_time_s"], ".2f", " s")}</td>'
        f'<td class="n">{shown(flight["wall_time_s"], ".2f", " s")}</td>'
        f'<td class="n">{shown(flight["ticks"])}</td>'
        f'<td><a href="{escape(flight["directory"])}/report.html">{escape(flight["directory"])}</a></td></tr>'
        for stage, flight in flights.items()
    )
    yield section("Flights", f"<table>{head}{rows}</table>")


def _ending(flight: Mapping[str, Any]) -> str:
    """Return the outcome of a flight, with its reason if it was not completed."""
    return str(flight["outcome"] if flight["outcome"] == "completed" else flight["outcome_text"])
