"""What the report calls things, in which colour, and how it writes numbers. Pure."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from html import escape

from gcs_cli.experiments.paper import cases
from gcs_cli.experiments.paper.cases import CONTENDERS, Condition

UNKNOWN = "–"
LABELS = {contender.name: contender.label for contender in CONTENDERS}
STYLES = {contender.name: f"s{index + 1}" for index, contender in enumerate(CONTENDERS)}
"""A colour and a dash pattern of its own for each contender."""
OTHER_STYLE = "s8"
"""Of what is no contender."""
REFERENCE = "ref"
PLANTS = {
    cases.SMALL_ANGLE: "small-angle model",
    cases.RIGID: "rigid body",
    cases.MULTIBODY: "multibody assembly",
}
ABOUT_PLANTS = {
    cases.SMALL_ANGLE: "the paper's equation 7, corrected: φ' = p, θ' = q, ψ' = r, no rotor spin-up torque",
    cases.RIGID: "all angles, and the torque by which rotors react when they spin up",
    cases.MULTIBODY: "parts with geometry and density, rotors as spinning bodies on hinges, in MuJoCo",
}
TRAJECTORIES = {cases.DESIRED: "desired", cases.SMOOTH: "smooth", cases.HARD: "hard"}
AXES = ("roll", "pitch", "yaw", "x", "y", "z")
AXIS_TITLES = {
    "x": "x (north)",
    "y": "y (east)",
    "z": "height −z",
    "roll": "roll φ",
    "pitch": "pitch θ",
    "yaw": "yaw ψ",
}
ANGLES = ("roll", "pitch", "yaw")
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

Legend = Sequence[tuple[str, str, bool]]


def legend_of(contenders: Sequence[str], reference: str = "reference") -> Legend:
    """Return the legend of a picture of these contenders against their reference."""
    entries = [(LABELS[name], STYLES[name], False) for name in contenders]
    return [(reference, REFERENCE, True), *entries] if reference else entries


def condition_label(condition: Condition) -> str:
    """Return a condition as the head of a row."""
    return condition.label[:1].upper() + condition.label[1:]


def number(value: float | None, digits: int = 3) -> str:
    """Return a number with so many significant digits and a true minus sign; a dash for None and what is not finite."""
    if value is None or not math.isfinite(value):
        return UNKNOWN
    if value and not 1e-4 <= abs(value) < 1e6:
        mantissa, power = f"{value:.{digits - 1}e}".split("e")
        mantissa = mantissa.rstrip("0").rstrip(".") if "." in mantissa else mantissa
        return f"{mantissa.replace('-', '−')}·10{str(int(power)).translate(_SUPERSCRIPTS)}"
    places = max(0, digits - 1 - math.floor(math.log10(abs(value)))) if value else 0
    return f"{value:.{min(places, 8)}f}".replace("-", "−")


def fixed(value: float | None, places: int) -> str:
    """Return a number with so many places: the way to write a column. A dash for None and what is not finite."""
    if value is None or not math.isfinite(value):
        return UNKNOWN
    return f"{round(value, places) + 0.0:.{places}f}".replace("-", "−")


def minus(words: str) -> str:
    """Give negative numbers in a sentence a true minus sign."""
    return re.sub(r"(?<![\w.])-(?=\d)", "−", words)


def cell(shown: str, style: str = "") -> str:
    """Return a table cell of a number that was written before."""
    return f'<td class="{f"n {style}".strip()}">{escape(shown)}</td>'


def wide_table(columns: Sequence[str], rows: Iterable[str], style: str = "", caption: str = "") -> str:
    """Return a table that scrolls by itself on a narrow screen; a column whose name begins with # holds numbers."""
    heads = "".join(
        f'<th class="n">{escape(name[1:])}</th>' if name.startswith("#") else f"<th>{escape(name)}</th>"
        for name in columns
    )
    named = f' class="{style}"' if style else ""
    above = f"<caption>{escape(caption)}</caption>" if caption else ""
    return f'<div class="wide"><table{named}>{above}<tr>{heads}</tr>{"".join(rows)}</table></div>'


def label_of(column: str) -> str:
    """Return the attribute by which a cell of a ``stacked`` table tells its column where a phone stacks the cells."""
    return f' data-label="{escape(column)}"'


def row(cells: str, begins: bool = False) -> str:
    """Return a row of a table; ``begins``: it is the first one of a group."""
    return f"<tr{' class=stage' if begins else ''}>{cells}</tr>"


def anchored(name: str, html: str) -> str:
    """Give a part of the page a name that the navigation leads to."""
    return f'<div class="part" id="{escape(name)}">{html}</div>'
