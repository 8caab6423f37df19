"""Tables of a PIL report as HTML, for the paper's report. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape
from typing import Any

from gcs_cli.pil.signals import BY_NAME, STAGES
from gcs_cli.report.plots import section

UNKNOWN = "–"


def shown(value: Any, spec: str = "", unit: str = "") -> str:
    """Return a value as text for HTML."""
    return UNKNOWN if value is None else escape(f"{value:{spec}}{unit}")


def checks_section(checks: Sequence[dict[str, Any]]) -> str:
    """Return the verdict's checks, each limit beside what was measured."""
    head = (
        '<tr><th>check</th><th class="n">measured</th><th class="n">limit</th><th class="n">margin</th>'
        "<th>passed</th><th>where</th></tr>"
    )
    note = (
        "ulp: unit in the last place of a float32 as large as the signal's largest value in the flight. Margin: how "
        "many times larger the measured value might be."
    )
    return section("Verdict", f"<table>{head}{''.join(map(_check_row, checks))}</table>", note=note)


def _check_row(check: dict[str, Any]) -> str:
    passed = '<td class="good">yes</td>' if check["passed"] else '<td class="bad">no</td>'
    unit = f" {check['unit']}" if check["unit"] else ""
    measured = "not a number" if check["measured"] is None else f"{check['measured']:.4g}{unit}"
    return (
        f'<tr><td>{escape(check["name"])}</td><td class="n">{escape(measured)}</td>'
        f'<td class="n">{check["limit"]:g}{escape(unit)}</td>'
        f'<td class="n">{shown(check["margin"], ".3g", "×")}</td>{passed}<td>{escape(check["about"])}</td></tr>'
    )


def differences_section(differences: Sequence[dict[str, Any]], compared: str) -> str:
    """Return signals beside pairs of flights: the largest difference and the root mean square, units and ulps."""
    pairs = list(dict.fromkeys(row["pair"] for row in differences))
    by_signal = {(row["signal"], row["pair"]): row for row in differences}
    head = "".join(f'<th class="pair" colspan="2">{escape(pair)}</th>' for pair in pairs)
    under = '<th class="n first">largest</th><th class="n">rms</th>' * len(pairs)
    rows = "".join(_stage_rows(by_signal, pairs))
    note = (
        f"{compared} Under each value: the same in units of the last place of a float32 as large as the signal's "
        "largest value. “Same bits”: no sample differs."
    )
    table = f"<table><tr><th></th>{head}</tr><tr><th>signal</th>{under}</tr>{rows}</table>"
    return section("Differences", table, note=note)


def _stage_rows(by_signal: dict[tuple[str, str], dict[str, Any]], pairs: Sequence[str]) -> Iterator[str]:
    for stage in STAGES:
        names = [name for name, signal in BY_NAME.items() if signal.stage == stage]
        names = [name for name in names if any((name, pair) in by_signal for pair in pairs)]
        if names:
            yield f'<tr class="stage"><th colspan="{1 + 2 * len(pairs)}">{stage}</th></tr>'
        for name in names:
            cells = "".join(_cells(by_signal.get((name, pair))) for pair in pairs)
            unit = f" [{BY_NAME[name].unit}]" if BY_NAME[name].unit != "1" else ""
            yield f"<tr><td>{escape(BY_NAME[name].title + unit)}</td>{cells}</tr>"


def _cells(row: dict[str, Any] | None) -> str:
    if row is None or not row["samples"]:
        return f'<td class="n first">{UNKNOWN}</td><td class="n">{UNKNOWN}</td>'
    if row["largest"] == 0.0:
        return '<td class="n first good">same bits</td><td class="n"></td>'
    where = "" if row["at_s"] is None else f' title="largest at {row["at_s"]:.3f} s"'
    return (
        f'<td class="n first two"{where}>{_figure(row["largest"])}<span>{_figure(row["ulps"])} ulp</span></td>'
        f'<td class="n two">{_figure(row["rms"])}<span>{_figure(row["rms_ulps"])} ulp</span></td>'
    )


def _figure(value: float | None) -> str:
    return UNKNOWN if value is None else f"{value:.3g}"
