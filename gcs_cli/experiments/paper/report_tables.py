"""Tables I to III as used, with what is printed beside it, and the list of corrections. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from typing import Any

from gcs_cli.experiments.paper.report_labels import UNKNOWN, anchored, label_of, row, wide_table
from gcs_cli.report.plots import section

_TITLES = {
    "table_1": "Table I: the vehicle",
    "table_2": "Table II: the PID",
    "table_3": "Table III: backstepping",
}


def tables_section(vehicle: Mapping[str, Any], gains: Mapping[str, Any]) -> str:
    """Return the three tables; what flies in place of a printed value is marked."""
    tables = {"table_1": vehicle, **gains}
    parts = "".join(
        f'<div id="{name.replace("_", "-")}"><h3>{escape(_TITLES.get(name, name))}</h3>{_table(entries)}</div>'
        for name, entries in tables.items()
    )
    note = (
        "Read from the vehicle and gains files that fly. ≠: what flies is another number than what is printed. "
        "–: the paper does not give it."
    )
    return anchored(
        "tables", section("Tables I to III as used", f'<div class="tables">{parts}</div>', note=note)
    )


def _table(entries: Mapping[str, Any]) -> str:
    return wide_table(("", "meaning", "#printed", "#used", "unit", "note"), _rows(entries))


def _rows(entries: Mapping[str, Any]) -> Iterator[str]:
    for symbol, entry in entries.items():
        corrected = entry["corrected"]
        used = f"≠ {plain(entry['used'])}" if corrected else plain(entry["used"])
        style = "n corrected" if corrected else "n"
        yield row(
            f'<th class="symbol">{escape(symbol)}</th><td>{escape(entry["meaning"])}</td>'
            f'<td class="n">{escape(plain(entry["printed"]))}</td><td class="{style}">{escape(used)}</td>'
            f"<td>{escape(entry['unit'])}</td><td>{escape(entry['note'])}</td>"
        )


def plain(value: float | None) -> str:
    """Return a value of a table as people write it: no rounding that would show, powers of ten beyond 10⁵ and 10⁻³."""
    if value is None:
        return UNKNOWN
    shown = f"{value:.6g}"
    if "e" not in shown and not (value and abs(value) < 1e-2) and abs(value) < 1e5:
        return shown.replace("-", "−")
    mantissa, power = f"{value:.5e}".split("e")
    mantissa = mantissa.rstrip("0").rstrip(".")
    superscript = str(int(power)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"{mantissa}·10{superscript}".replace("-", "−")


def corrections_section(corrections: Sequence[Mapping[str, Any]]) -> str:
    """Return what is printed and cannot be right, with what flies in its place, why, and in which file."""
    rows = (
        row(
            f"<th>{escape(one['where'])}</th>"
            + "".join(f"<td{label_of(name)}>{escape(one[name])}</td>" for name in ("printed", "used", "why"))
            + f"<td{label_of('lives in')}><code>{_breakable(one['place'])}</code></td>"
        )
        for one in corrections
    )
    table = wide_table(("where", "printed", "used", "why", "lives in"), rows, style="text stacked")
    return anchored("corrections", section("Corrections of the paper", table))


def _breakable(place: str) -> str:
    """Let the name of a file break where it has a joint, and nowhere else."""
    return escape(place).replace("/", "/<wbr>").replace("_", "_<wbr>")
