"""Charts of two free axes as SVG text: linear or logarithmic, square metres where wanted, marks beside curves. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from html import escape
from typing import NamedTuple

import numpy as np

from flightstack.core.contract import FloatArray
from gcs_cli.experiments.paper.report_curves import Frame, Mark, curve, drawn_mark, inside
from gcs_cli.report.chart import Line
from gcs_cli.report.svg import (
    Scale,
    decade_ticks,
    multiples,
    nice_ticks,
    segment,
    text,
    tick_text,
    upright_text,
)

SIZE = (480, 250)
"""Of a chart that shares its row with another one; on a phone it has the row for itself and is still read."""
LEFT, RIGHT, TOP, BOTTOM = 60, 16, 12, 38
_PIXELS_PER_X_TICK, _PIXELS_PER_Y_TICK = 62.0, 40.0


class Axis(NamedTuple):
    """One axis of a chart; ``label`` names quantity and unit."""

    label: str
    low: float
    high: float
    log: bool = False


class Guide(NamedTuple):
    """A straight line across the chart at one value, with a label at its end."""

    label: str
    at: float
    upright: bool = False


def spanning(
    label: str, values: Iterable[FloatArray], *, least: float = 1e-3, margin: float = 0.06, log: bool = False
) -> Axis:
    """Return an axis that holds all finite values, and at least ``least`` from end to end.

    A logarithmic one ends at full decades and leaves out what is not positive.
    """
    finite = [array[np.isfinite(array)] for array in values]
    joined = np.concatenate([*finite, np.zeros(0)])
    if log:
        joined = joined[joined > 0.0]
        if not len(joined):
            return Axis(label, 0.1, 10.0, log=True)
        low, high = (math.log10(float(end)) for end in (joined.min(), joined.max()))
        return Axis(
            label, 10.0 ** math.floor(low), 10.0 ** max(math.ceil(high), math.floor(low) + 1), log=True
        )
    if not len(joined):
        return Axis(label, 0.0, 1.0)
    low, high = float(joined.min()), float(joined.max())
    middle, half = 0.5 * (low + high), max(0.5 * (high - low), 0.5 * least)
    return Axis(label, middle - half * (1.0 + 2.0 * margin), middle + half * (1.0 + 2.0 * margin))


def chart(
    name: str,
    x: Axis,
    y: Axis,
    lines: Sequence[Line],
    *,
    marks: Sequence[Mark] = (),
    guides: Sequence[Guide] = (),
    size: tuple[int, int] = SIZE,
    equal: bool = False,
) -> str:
    """Return a chart; a curve ends with a cross where it leaves the axes and is drawn no further.

    ``equal``: a unit is as long in x as in y; the axis with room to spare shows more than it was asked for.
    """
    if not any(len(line.x) for line in lines) and not marks:
        return '<p class="none">No data.</p>'
    frame = _equal(x, y, size) if equal else _frame(x, y, size)
    return "".join(
        (
            f'<svg viewBox="0 0 {size[0]} {size[1]}" role="img" aria-label="{escape(name)}">',
            *_grid(frame, size, (x.label, y.label)),
            *_guides(guides, frame, size),
            *(part for line in lines for part in curve(line, frame)),
            *(drawn_mark(mark, frame) for mark in marks if inside(mark, frame)),
            "</svg>",
        )
    )


def _frame(x: Axis, y: Axis, size: tuple[int, int]) -> Frame:
    return Frame(
        Scale(x.low, x.high, LEFT, size[0] - RIGHT, x.log), Scale(y.low, y.high, size[1] - BOTTOM, TOP, y.log)
    )


def _equal(x: Axis, y: Axis, size: tuple[int, int]) -> Frame:
    width, height = size[0] - RIGHT - LEFT, size[1] - BOTTOM - TOP
    unit = max((x.high - x.low) / width, (y.high - y.low) / height)
    x_middle, y_middle = 0.5 * (x.low + x.high), 0.5 * (y.low + y.high)
    return _frame(
        Axis(x.label, x_middle - 0.5 * unit * width, x_middle + 0.5 * unit * width),
        Axis(y.label, y_middle - 0.5 * unit * height, y_middle + 0.5 * unit * height),
        size,
    )


def _ticks(scale: Scale, pixels: float) -> list[float]:
    if scale.log:
        return decade_ticks(scale.low, scale.high)
    wanted = max(3, round(abs(scale.end - scale.start) / pixels))
    for count in (wanted, wanted + 1, wanted + 2):  # steps of 1, 2 and 5 may be far from the one that fits
        ticks = nice_ticks(scale.low, scale.high, count)
        if len(ticks) >= wanted:
            break
    return ticks


def _grid(frame: Frame, size: tuple[int, int], labels: tuple[str, str]) -> Iterator[str]:
    bottom, right = size[1] - BOTTOM, size[0] - RIGHT
    per_metre = abs(frame.x.end - frame.x.start) / (frame.x.high - frame.x.low)
    same_unit = abs(per_metre * (frame.y.high - frame.y.low) / (bottom - TOP) - 1.0) < 1e-6
    rows = _ticks(frame.y, _PIXELS_PER_Y_TICK)
    for value in rows:
        at = frame.y.pixel(value)
        yield segment("grid", LEFT, at, right, at)
        yield text("tick y", LEFT - 6, at + 4, tick_text(value))
    columns = _ticks(frame.x, _PIXELS_PER_X_TICK)
    if same_unit and not frame.x.log and len(rows) > 1:  # squares, not rectangles, where lengths are compared
        columns = multiples(rows[1] - rows[0], frame.x.low, frame.x.high)
    for value in columns:
        at = frame.x.pixel(value)
        yield segment("grid", at, TOP, at, bottom)
        yield text("tick x", at, bottom + 16, tick_text(value))
    yield segment("axis", LEFT, bottom, right, bottom)
    yield segment("axis", LEFT, TOP, LEFT, bottom)
    yield upright_text("label", 13, 0.5 * (TOP + bottom), labels[1])
    yield text("label", 0.5 * (LEFT + right), size[1] - 5, labels[0])


def _guides(guides: Sequence[Guide], frame: Frame, size: tuple[int, int]) -> Iterator[str]:
    for guide in guides:
        scale = frame.x if guide.upright else frame.y
        if not scale.low <= guide.at <= scale.high:
            continue
        at = scale.pixel(guide.at)
        if guide.upright:
            yield segment("level", at, TOP, at, size[1] - BOTTOM)
            yield text("level-label upright", at + 4, TOP + 10, guide.label)
        else:
            yield segment("level", LEFT, at, size[0] - RIGHT, at)
            yield text("level-label", size[0] - RIGHT - 3, at - 4, guide.label)
