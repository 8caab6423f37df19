"""The report of ``gcs paper``: section IV of the paper, redone; one HTML file that needs nothing else.

What it says is in ``results``, the content of results.json; curves come from the recordings.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from gcs_cli.experiments.paper import cases
from gcs_cli.experiments.paper.report_compare import claims_section, hard_over_time, xy_figures
from gcs_cli.experiments.paper.report_flights import (
    PAIR,
    Recordings,
    beside,
    desired_figure,
    response_figures,
)
from gcs_cli.experiments.paper.report_labels import LABELS, anchored
from gcs_cli.experiments.paper.report_linear import linear_sections
from gcs_cli.experiments.paper.report_matrix import matrix_sections
from gcs_cli.experiments.paper.report_metrics import metrics_table
from gcs_cli.experiments.paper.report_moves import move_sections
from gcs_cli.experiments.paper.report_pictures import Picture, pictures_section
from gcs_cli.experiments.paper.report_pil import pil_sections
from gcs_cli.experiments.paper.report_plants import plants_section
from gcs_cli.experiments.paper.report_steps import step_sections
from gcs_cli.experiments.paper.report_summary import summary_section, tiles
from gcs_cli.experiments.paper.report_tables import corrections_section, tables_section
from gcs_cli.report.plots import section

TITLE = "The paper, reproduced"
PAPER = "Quadcopter Modelling, Control Design and PIL Verification Based on DSP F28377s"
_HERE = Path(__file__).parent
_GCS = _HERE.parents[1]
_STYLE_SHEETS = (_GCS / "report" / "report.css", _GCS / "pil" / "pil.css", _HERE / "paper.css")
_NAVIGATION = (
    ("summary", "What came out"),
    ("claims", "Does it hold?"),
    ("pictures", "Pictures"),
    ("tables", "Tables I–III"),
    ("corrections", "Corrections"),
    ("fig-7", "Fig. 7"),
    ("fig-8", "Figs. 8–13"),
    ("metrics", "Figures of the responses"),
    ("steps", "Steps"),
    ("plants", "Plants"),
    ("fig-14", "Fig. 14"),
    ("hard", "Hard profile"),
    ("moves-hard-paper", "Overshoot"),
    ("matrix-hard-paper", "Disturbances"),
    ("fig-15", "Fig. 15, PIL"),
    ("linear", "Poles"),
    ("bode", "Open loops"),
    ("margins", "Margins"),
    ("margins-outer", "x, y, z"),
    ("onset", "Lowest rate"),
    ("conditions", "How it was made"),
)


def render(results: Mapping[str, Any], recordings: Recordings, pictures: Sequence[Picture] = ()) -> str:
    """Return the report as HTML; parts that ``results`` does not have say why they are left out."""
    body = "".join(_sections(results, recordings, pictures))
    style = "".join(sheet.read_text(encoding="utf-8") for sheet in _STYLE_SHEETS)
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{TITLE}</title><style>{style}</style></head>"
        f"<body><main>{_header(results)}{_navigation(body)}{tiles(results)}{body}</main></body></html>\n"
    )


def _header(results: Mapping[str, Any]) -> str:
    return (
        f'<header><h1>{TITLE}</h1><div class="about">“{escape(PAPER)}”, section IV, flown again by '
        f"flightstack {escape(results['version'])}: every table and figure from one command, with figures in place of "
        "impressions.</div></header>"
    )


def _navigation(body: str) -> str:
    links = "".join(
        f'<a href="#{name}">{escape(title)}</a>' for name, title in _NAVIGATION if f'id="{name}"' in body
    )
    return f"<nav>{links}</nav>"


def _sections(
    results: Mapping[str, Any], recordings: Recordings, pictures: Sequence[Picture]
) -> Iterator[str]:
    left_out, found = results["left_out"], results["cases"]
    yield summary_section(results)
    yield claims_section(results["comparisons"]["claims"])
    yield pictures_section(pictures)
    yield tables_section(results["vehicle"], results["gains"])
    yield corrections_section(results["corrections"])
    yield desired_figure(recordings)
    yield from response_figures(recordings)
    yield _metrics(found, recordings)
    yield from step_sections(results, recordings)
    yield plants_section(results, recordings, left_out.get(cases.MULTIBODY, ""))
    yield from xy_figures(recordings)
    yield hard_over_time(recordings)
    yield from move_sections(found)
    yield from matrix_sections(found)
    yield from pil_sections(results["pil"], left_out.get("pil", ""))
    yield from linear_sections(results["linear"], results["onset"] or (), left_out.get("linear", ""))
    yield _conditions(results)


def _metrics(found: Mapping[str, Any], recordings: Recordings) -> str:
    plants = beside(recordings)
    table = metrics_table(found, cases.DESIRED, plants, PAIR)
    if not table:
        return ""
    others = metrics_table(found, cases.DESIRED, plants, [name for name in LABELS if name not in PAIR])
    if others:
        table += f"<details><summary>The same of the other gains</summary>{others}</details>"
    note = (
        "Of figures 8 to 13. Overshoot is that of the worst move that began at rest; rise and settling time are those "
        "of the last one that is watched for 4 s, from its begin: on this smooth trajectory they tell of the "
        "reference as much as of the controller. Roll and pitch have no rests, so errors alone."
    )
    title = "Figures of the responses along the desired trajectory"
    return anchored("metrics", section(title, table, note=note))


def _conditions(results: Mapping[str, Any]) -> str:
    conditions = dict(results["conditions"])
    if any(f"/{cases.NUDGE.name}/" in key for key in results["cases"]):
        conditions[cases.NUDGE.name] = cases.NUDGE.label
    rows = "".join(
        f"<tr><th>{escape(name)}</th><td>{escape(label)}</td></tr>" for name, label in conditions.items()
    )
    trajectories = "".join(
        f"<tr><th>{escape(name)}</th><td>{escape(of['description'])}; {of['duration_s']:g} s</td></tr>"
        for name, of in results["trajectories"].items()
    )
    words = (
        "<p>Made by <code>gcs paper</code>. Loops and plants are those of the flight stack and its simulator, joined "
        "tick by tick in one process: inner loop at 1 kHz, outer loop at 250 Hz, unless a condition says otherwise. "
        "Flights begin in hover, and there is no ground. Motors without lag take the commanded speed at once; a jump "
        "of speed would need an impulse of torque, so their spin-up torque is left out on every plant. The same "
        'command gives the same <a href="results.json">results.json</a>, which holds every number of this page. '
        "Model, derivation and corrections: docs/paper.md.</p>"
    )
    body = (
        f"{words}<h3>Conditions</h3><table>{rows}</table><h3>Trajectories</h3><table>{trajectories}</table>"
    )
    return anchored("conditions", section("How it was made", body))
