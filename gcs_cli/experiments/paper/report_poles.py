"""Maps of the poles of all loops: a shape for each controller, and slow poles once more by themselves. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from gcs_cli.experiments.paper.report_axes import Guide, chart, spanning
from gcs_cli.experiments.paper.report_curves import Mark
from gcs_cli.experiments.paper.report_flights import STEP_SIZE
from gcs_cli.experiments.paper.report_labels import AXIS_TITLES, OTHER_STYLE, STYLES, number
from gcs_cli.experiments.paper.report_onset import loop_name, loop_title

Loops = Sequence[Mapping[str, Any]]

SLOW_RAD_S = 8.0
"""x and y have poles a hundred times apart: those slower than this are drawn once more, by themselves."""
_SPREAD = 4.0
"""So many times farther out the fastest pole lies where a map needs the closer look."""
_LEAST_SPAN = 4.0  # /s: of a map whose poles are all real
_ORDER = ("roll", "pitch", "yaw", "z", "x", "y")  # a map and the closer look at it share a row


def pole_maps(loops: Loops) -> str:
    """Return a map for each axis, those of x and y with their slow poles beside them."""
    return "".join(drawn for axis in _ORDER for drawn in _maps(loops, axis))


def loop_style(loop: Mapping[str, Any]) -> str:
    """Return the colour and shape of a loop: those of the contender that has its controller and gains."""
    return STYLES.get(loop_name(loop), OTHER_STYLE)


def _maps(loops: Loops, axis: str) -> Iterator[str]:
    marks = [mark for loop in loops for mark in _marks(loop, axis)]
    yield _map(marks, axis, AXIS_TITLES[axis])
    slow = [mark for mark in marks if _speed(mark) < SLOW_RAD_S]
    if axis in ("x", "y") and slow and max(map(_speed, marks)) > _SPREAD * SLOW_RAD_S:
        yield _map(slow, axis, f"{AXIS_TITLES[axis]}: poles slower than {SLOW_RAD_S:g} rad/s")


def _marks(loop: Mapping[str, Any], axis: str) -> Iterator[Mark]:
    for real, imaginary in loop["axes"][axis]["poles"]:
        sign = "+" if imaginary >= 0.0 else "−"
        hint = f"{loop_title(loop)}: {number(real)} {sign} {number(abs(imaginary))} j /s"
        yield Mark(real, imaginary, loop_style(loop), hint, own_shape=True)


def _speed(mark: Mark) -> float:
    return float(np.hypot(mark.x, mark.y))


def _map(marks: Sequence[Mark], axis: str, title: str) -> str:
    real, imaginary = (np.array([mark[index] for mark in marks]) for index in (0, 1))
    drawn = chart(
        f"Poles of {axis}",
        spanning("real part [1/s]", [real, np.zeros(1)], least=_LEAST_SPAN),
        spanning("imaginary part [1/s]", [imaginary], least=_LEAST_SPAN),
        [],
        marks=marks,
        guides=[Guide("", 0.0, upright=True)],
        size=STEP_SIZE,
    )
    return f'<div><h3 class="plant">{escape(title)}</h3>{drawn}</div>'
