"""Where instability sets in, predicted and simulated, as a part of the report. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from gcs_cli.experiments.paper.cases import CONTENDERS
from gcs_cli.experiments.paper.report_labels import (
    AXES,
    AXIS_TITLES,
    LABELS,
    UNKNOWN,
    anchored,
    cell,
    fixed,
    row,
    wide_table,
)
from gcs_cli.report.plots import section

_NAMES = {(contender.controller, contender.gains): contender.name for contender in CONTENDERS}
_COLUMNS = ("axis", "controller", "#predicted", "#simulated", "#difference")
_ONSET_NOTE = (
    "Predicted: the rate at which an eigenvalue of the sampled loop leaves the unit circle. Simulated: real loops and "
    "plant in flight, kicked by 10⁻⁷ rad/s about one axis, or told to go 10⁻⁷ m; the lowest rate at which that dies "
    "away, found by bisection without knowing the prediction. Roll, pitch, yaw: the rate of the inner loop. x, y, z: "
    "that of the outer loop, whose period is a whole number of inner ticks; between the last that is stable and the "
    "first that is not, the growth is interpolated."
)


def onset_section(onset: Sequence[Mapping[str, Any]]) -> str:
    """Return predicted and simulated rates as a section."""
    return anchored(
        "onset", section("Lowest stable rates, predicted and simulated", onset_table(onset), note=_ONSET_NOTE)
    )


def loop_name(loop: Mapping[str, Any]) -> str:
    """Return the contender that has the controller and gains of a loop or onset; empty if none has."""
    return _NAMES.get((loop["controller"], loop["gains"]), "")


def loop_title(loop: Mapping[str, Any]) -> str:
    """Return what a loop, or an onset, is called: the contender that has its controller and gains."""
    return LABELS.get(loop_name(loop), f"{loop['controller']}, {loop['gains']}")


def onset_table(onset: Sequence[Mapping[str, Any]]) -> str:
    """Return predicted and simulated rates of each axis and loop, below a line for each setting of rotors and delay."""
    if not onset:
        return '<p class="none">Left out.</p>'
    rows, before, last = [], "", ""
    for entry in sorted(onset, key=lambda entry: _place(onset, entry)):
        if entry["setting"] != before:
            before, last = entry["setting"], ""
            rows.append(row(f'<th colspan="{len(_COLUMNS)}">{escape(before)}</th>', begins=True))
        turn, last = entry["axis"] != last, entry["axis"]
        head = f"<th>{escape(AXIS_TITLES[last] if turn else '')}</th>"
        rates = _rate_cell(entry["predicted_hz"]) + _rate_cell(entry["simulated_hz"])
        apart = cell(_percent(entry["difference_percent"]))
        rows.append(row(f"{head}<td>{escape(loop_title(entry))}</td>{rates}{apart}"))
    return wide_table(_COLUMNS, rows, style="grouped")


def _place(onset: Sequence[Mapping[str, Any]], entry: Mapping[str, Any]) -> tuple[int, int]:
    settings = list(dict.fromkeys(one["setting"] for one in onset))
    return settings.index(entry["setting"]), AXES.index(entry["axis"])


def _rate_cell(rate_hz: float | None) -> str:
    return '<td class="n bad">none up to 2 kHz</td>' if rate_hz is None else cell(f"{fixed(rate_hz, 2)} Hz")


def _percent(value: float | None) -> str:
    return UNKNOWN if value is None else f"{fixed(value, 3)} %"
