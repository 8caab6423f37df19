"""Labels, colours and number formats of the report. Pure."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from gcs_cli.charts.figure import Dash
from gcs_cli.experiments.paper.flights import cases
from gcs_cli.experiments.paper.flights.cases import CONTENDERS

UNKNOWN = "–"
LABELS = {
    cases.PID: "PID",
    cases.BACKSTEPPING: "backstepping",
    cases.POLES: "PD, same poles",
    cases.TUNED_PID: "own PID",
    cases.TUNED_BACKSTEPPING: "own backstepping",
    cases.RATE_FED_PID: "PID with rate",
}
"""Contenders; PID and backstepping fly Tables II and III; "PD, same poles" has the poles of backstepping."""
COLOURS = {contender.name: f"s{index + 1}" for index, contender in enumerate(CONTENDERS)}
DASHES: dict[str, Dash] = dict(
    zip(COLOURS, ("solid", "dash", "dashdot", "longdash", "dot", "solid"), strict=True)
)
REFERENCE_COLOUR = "s8"
PLANTS = {cases.SMALL_ANGLE: "small-angle", cases.RIGID: "rigid body", cases.MULTIBODY: "multibody"}
AXES = ("roll", "pitch", "yaw", "x", "y", "z")
ANGLES = AXES[:3]
AXIS_TITLES = {
    "x": "x (north)", "y": "y (east)", "z": "height −z", "roll": "roll φ", "pitch": "pitch θ", "yaw": "yaw ψ",
}  # fmt: skip
AXIS_NAMES = {**{axis: axis for axis in AXES}, "z": "height"}
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_NAMES = {(contender.controller, contender.gains): contender.name for contender in CONTENDERS}


def loop_name(loop: Mapping[str, Any]) -> str:
    """Return the contender that has the controller and gains of a loop or onset; empty if none has."""
    return _NAMES.get((loop["controller"], loop["gains"]), "")


def loop_title(loop: Mapping[str, Any]) -> str:
    """Return the label of a loop or onset."""
    return LABELS.get(loop_name(loop), f"{loop['controller']}, {loop['gains']}")


def fixed(value: float | None, places: int = 1) -> str:
    """Return a number with ``places`` decimals and a true minus sign; a dash for None and non-finite values."""
    if value is None or not math.isfinite(value):
        return UNKNOWN
    return f"{round(value, places) + 0.0:.{places}f}".replace("-", "−")


def number(value: float | None, digits: int = 3) -> str:
    """Return a number with ``digits`` significant digits; powers of ten below 10⁻⁴ and from 10⁶ on."""
    if value is None or not math.isfinite(value):
        return UNKNOWN
    if value and not 1e-4 <= abs(value) < 1e6:
        return _with_power(value, digits - 1)
    places = max(0, digits - 1 - math.floor(math.log10(abs(value)))) if value else 0
    return f"{value:.{min(places, 8)}f}".replace("-", "−")


def plain(value: float | None) -> str:
    """Return a table value without visible rounding; powers of ten below 10⁻² and from 10⁵ on."""
    if value is None:
        return UNKNOWN
    shown = f"{value:.6g}"
    if "e" not in shown and not (value and abs(value) < 1e-2) and abs(value) < 1e5:
        return shown.replace("-", "−")
    return _with_power(value, 5)


def _with_power(value: float, places: int) -> str:
    mantissa, power = f"{value:.{places}e}".split("e")
    mantissa = mantissa.rstrip("0").rstrip(".") if "." in mantissa else mantissa
    return f"{mantissa}·10{str(int(power)).translate(_SUPERSCRIPTS)}".replace("-", "−")
