"""The processor in the loop as parts of the report: figure 15 and the numerical equivalence. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from html import escape
from typing import Any

from gcs_cli.experiments.paper.pil_section import EMULATED, folder_name
from gcs_cli.experiments.paper.report_findings import pil_flights
from gcs_cli.experiments.paper.report_labels import (
    LABELS,
    OTHER_STYLE,
    PLANTS,
    STYLES,
    anchored,
    cell,
    fixed,
    number,
    row,
    wide_table,
)
from gcs_cli.pil.histogram_chart import histogram_chart
from gcs_cli.pil.profile import STAGE_TITLES, StageProfile
from gcs_cli.pil.report_tables import checks_section, differences_section
from gcs_cli.report.plots import section

_LABELLED = {
    "instructions": "instructions on an emulated Cortex-M4F, not the F28377S",
    "cycles": "processor cycles on the board",
    "ns": "nanoseconds of this machine",
}
_COLUMNS = (
    ("count", "steps", 0),
    ("min", "least", 0),
    ("mean", "mean", 1),
    ("p99", "99 % within", 0),
    ("max", "most", 0),
)


def pil_sections(pil: Mapping[str, Any], why: str) -> Iterator[str]:
    """Yield figure 15 and the equivalence of each controller; one with the sentence ``why`` if it was left out."""
    title = "Fig. 15: execution profile on the target"
    why = (pil.get("why_left_out") or "") if pil else why
    if not pil or not pil["controllers"]:
        yield anchored("fig-15", section(title, f'<p class="none">Left out: {escape(why)}</p>'))
        return
    profiles = {name: of["profile"] for name, of in pil["controllers"].items() if of["profile"]}
    unit = next((profile["unit"] for profile in profiles.values()), "")
    about = next((profile["about"] for profile in profiles.values()), "")
    charts = "".join(
        f"<div>{_histogram(stage, profile, name)}</div>"
        for stage in STAGE_TITLES
        for name, profile in profiles.items()
        if stage in profile["stages"]
    )
    body = (
        f"<p>{escape(pil['meaning'])} Mission: {escape(pil['mission'])}; gains of the paper, {pil['inner_hz']:g} and "
        f"{pil['outer_hz']:g} Hz, on the {escape(PLANTS[pil['plant']])}. {escape(pil['why_so'])}</p>"
        f"{_profile_table(profiles, unit)}"
        f'<div class="pair histograms">{charts}</div>{_identity(pil)}'
    )
    legend = [(LABELS.get(name, name), STYLES.get(name, OTHER_STYLE), False) for name in profiles]
    yield anchored("fig-15", section(title, body, legend, about))
    yield anchored("pil", _verdicts(pil))
    for name, plant, of in pil_flights(pil):
        folded = checks_section(of["checks"]) + differences_section(of["differences"], of["compared"])
        page = escape(f"{folder_name(name, plant)}/pil.html")
        link = f'<p class="note">All of it: <a href="{page}">{page}</a></p>'
        summary = f"Numerical equivalence in full: {escape(LABELS.get(name, name))}, {escape(PLANTS[plant])}"
        yield f'<section class="folded"><details><summary>{summary}</summary>{folded}{link}</details></section>'


def _histogram(stage: str, profile: Mapping[str, Any], name: str) -> str:
    of = profile["stages"][stage]
    histogram = of["histogram"]
    one = StageProfile(
        stage, of["count"], of["min"], of["mean"], of["p99"], of["max"], tuple(histogram["edges"]),
        tuple(histogram["counts"]),
    )  # fmt: skip
    return histogram_chart(one, profile["unit"], STYLES.get(name, OTHER_STYLE))


def _profile_table(profiles: Mapping[str, Mapping[str, Any]], unit: str) -> str:
    rows = []
    for stage, title in STAGE_TITLES.items():
        for name, profile in profiles.items():
            of = profile["stages"].get(stage)
            if of is not None:
                figures = "".join(cell(fixed(of[key], places)) for key, _, places in _COLUMNS)
                rows.append(row(f"<th>{title}</th><td>{escape(LABELS.get(name, name))}</td>{figures}"))
    heads = (f"#{title}" for _, title, _ in _COLUMNS)
    return wide_table(("stage", "controller", *heads), rows, caption=_LABELLED.get(unit, unit))


def _identity(pil: Mapping[str, Any]) -> str:
    target = next((of["target"] for of in pil["controllers"].values() if of["target"]), None)
    if target is None:
        return ""
    stacks = [of["stack"]["high_water"] for of in pil["controllers"].values() if of["stack"]]
    stack = f"; stack used at most: {max(stacks)} octets" if stacks and target["char_bits"] == 8 else ""
    clock = "without a clock" if pil["target"] == EMULATED else f"at {target['clock_hz'] / 1e6:g} MHz"
    words = (
        f"Target: {target['board']} {clock}; {target['compiler']}; sources {target['source_hash']}{stack}."
    )
    return f'<p class="note">{escape(words)}</p>'


def _verdicts(pil: Mapping[str, Any]) -> str:
    """Return the equivalence of each pair of flights in one line: the largest difference of all signals."""
    rows = []
    for name, plant, of in pil_flights(pil):
        pairs = list(dict.fromkeys(one["pair"] for one in of["differences"]))
        style = "good" if of["verdict"] == "passed" else "bad"
        who, where, judged = (escape(text) for text in (LABELS.get(name, name), PLANTS[plant], of["verdict"]))
        for index, pair in enumerate(pairs):
            title, on, verdict = ("", "", "") if index else (who, where, judged)
            cells = f"<th>{title}</th><td>{on}</td><td>{escape(pair)}</td>{_difference_cells(of, pair)}"
            rows.append(row(f'{cells}<td class="{style}">{verdict}</td>', not index))
    note = (
        "MIL: the loops in Python. SIL: the C core on this machine. PIL: the C core on the target. ulp: unit in the "
        "last place of a float32 as large as the signal's largest value."
    )
    columns = (
        "controller",
        "plant",
        "flights compared",
        "#position, largest difference",
        "#of all signals, largest",
        "verdict",
    )
    return section("Numerical equivalence", wide_table(columns, rows), note=note)


def _difference_cells(of: Mapping[str, Any], pair: str) -> str:
    rows = [row for row in of["differences"] if row["pair"] == pair]
    if rows and all(row["largest"] == 0.0 for row in rows):
        return '<td class="n good" colspan="2">same bits</td>'
    position = next((row["largest"] for row in rows if row["signal"] == "position"), None)
    worst = max((row for row in rows if row["ulps"] is not None), key=lambda row: row["ulps"], default=None)
    shown = "–" if position is None else f"{number(1e6 * position)} µm"
    of_all = "–" if worst is None else f"{fixed(worst['ulps'], 0)} ulp ({worst['signal'].replace('_', ' ')})"
    return cell(shown) + cell(of_all)
