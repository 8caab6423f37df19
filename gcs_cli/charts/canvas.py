"""A canvas of braille characters: 2 × 4 dots a cell, one colour a cell, text above the dots.

Dots are square on a terminal whose cells are twice as high as wide. Coordinates are in dots, x to the right and y
down from the upper left corner, so that dot i covers i to i + 1; all drawing is clipped to the canvas.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray
from rich.segment import Segment
from rich.style import Style
from rich.text import Text

from flightstack.core.contract import FloatArray

Run: TypeAlias = tuple[str, str | Style]


class Runs(tuple[Run, ...]):
    """The runs of a line, from left to right."""

    __slots__ = ()

    @property
    def plain(self) -> str:
        """The characters."""
        return "".join(text for text, _ in self)


DOTS_X, DOTS_Y = 2, 4
"""Dots in a cell."""
Mask: TypeAlias = np.ndarray[Any, np.dtype[np.bool_]]
_BRAILLE, _SPACE = 0x2800, 0x20
_WEIGHTS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]], dtype=np.uint8)
"""Bit of each dot in the code point of its cell."""
_MOST_CIRCLE_SIDES = 4096
_CHORD_ERROR = 0.3  # dots


class Dash(NamedTuple):
    """A line of ``on`` dots and ``off`` dots in turn."""

    on: int
    off: int


SOLID = Dash(1, 0)
DASHED = Dash(4, 4)
DOTTED = Dash(1, 3)


@cache
def parse_style(style: str) -> Style:
    """Return rich's style of a description such as ``bold red``."""
    return Style.parse(style)


class Canvas:
    """Dots and text of ``width`` × ``height`` cells, drawn by methods and read by ``text`` or ``rows``.

    Where lines of several colours meet in a cell, the last one gives the colour.
    """

    def __init__(self, width: int, height: int) -> None:
        self.width, self.height = max(0, width), max(0, height)
        self.dots_wide, self.dots_high = DOTS_X * self.width, DOTS_Y * self.height
        self._dots = np.zeros((self.dots_high, self.dots_wide), dtype=np.bool_)
        self._dot_styles = np.zeros((self.height, self.width), dtype=np.int16)
        self._codes = np.zeros((self.height, self.width), dtype=np.uint32)  # 0: no text
        self._text_styles = np.zeros((self.height, self.width), dtype=np.int16)
        self._styles = [Style.null()]
        self._index_of: dict[str, int] = {"": 0}

    def points(self, x: ArrayLike, y: ArrayLike, style: str = "") -> None:
        """Set dots; x and y have shape (n,)."""
        across, down = np.floor(np.asarray(x, np.float64)), np.floor(np.asarray(y, np.float64))
        inside = (across >= 0) & (across < self.dots_wide) & (down >= 0) & (down < self.dots_high)
        columns, rows = across[inside].astype(np.intp), down[inside].astype(np.intp)
        self._dots[rows, columns] = True
        self._dot_styles[rows // DOTS_Y, columns // DOTS_X] = self._style_index(style)

    def line(self, x: ArrayLike, y: ArrayLike, style: str = "", dash: Dash = SOLID) -> None:
        """Draw straight lines from each vertex to the next; x and y have shape (n,), NaN separates lines."""
        across, down = np.asarray(x, np.float64), np.asarray(y, np.float64)
        starts, ends = self._clipped(across[:-1], down[:-1], across[1:], down[1:])
        steps = np.ceil(np.abs(ends - starts).max(axis=0, initial=0.0)).astype(np.intp) + 1
        total = int(steps.sum())
        if not total:
            return
        segment = np.repeat(np.arange(len(steps)), steps)
        step = np.arange(total) - np.repeat(np.cumsum(steps) - steps, steps)
        share = step / np.maximum(1, steps - 1)[segment]
        places = starts[:, segment] + share * (ends - starts)[:, segment]
        if dash.off:
            # consecutive segments share a vertex, which must not advance the pattern
            places = places[:, (np.arange(total) - segment) % (dash.on + dash.off) < dash.on]
        self.points(places[0], places[1], style)

    def polygon(self, x: ArrayLike, y: ArrayLike, style: str = "", dash: Dash = SOLID) -> None:
        """Draw a closed line through the vertices."""
        across, down = np.asarray(x, np.float64), np.asarray(y, np.float64)
        self.line(np.append(across, across[:1]), np.append(down, down[:1]), style, dash)

    def circle(self, x: float, y: float, radius: float, style: str = "", dash: Dash = SOLID) -> None:
        """Draw a circle around (x, y)."""
        self.polygon(*circle_vertices(x, y, radius), style, dash)

    def hatch(self, x: ArrayLike, y: ArrayLike, style: str = "", spacing: int = 6) -> None:
        """Fill a polygon with diagonal lines, ``spacing`` dots apart, by the even-odd rule."""
        inside = self._inside(np.asarray(x, np.float64), np.asarray(y, np.float64))
        rows, columns = np.nonzero(inside)
        lined = (rows + columns) % spacing == 0
        self.points(columns[lined], rows[lined], style)

    def label(self, column: int, row: int, text: str, style: str = "") -> None:
        """Write ``text`` from a cell to the right, above all dots; control and wide characters become ``·``."""
        if not 0 <= row < self.height:
            return
        index = self._style_index(style)
        for offset, mark in enumerate(text, column):
            if 0 <= offset < self.width:
                self._codes[row, offset] = ord(mark if _is_narrow(mark) else "·")
                self._text_styles[row, offset] = index

    def label_near(self, column: int, row: int, text: str, style: str = "") -> None:
        """Write ``text`` at a cell of the canvas, or around it if other text is there; nowhere if all is taken.

        A cell between two labels stays free: 1 beside 18 is not 118.
        """
        if not (0 <= column < self.width and 0 <= row < self.height):
            return
        length = len(text)
        for dx, dy in ((0, 0), (2, 0), (-length - 1, 0), (0, -1), (0, 1), (2, -1), (2, 1), (4, 0)):
            if self._is_free(column + dx, row + dy, length):
                self.label(column + dx, row + dy, text, style)
                return

    def _is_free(self, column: int, row: int, length: int) -> bool:
        """True if cells from (column, row) to the right are on the canvas, without text in or beside them."""
        if not (0 <= row < self.height and column >= 0 and column + length <= self.width):
            return False
        return not self._codes[row, max(0, column - 1) : column + length + 1].any()

    def rows(self) -> list[Runs]:
        """Return the rows, each as runs of equal style that fill the width.

        Blank cells belong to the run before them if its style does not show on them.
        """
        cells = self._dots.reshape(self.height, DOTS_Y, self.width, DOTS_X)
        bits = np.einsum("ijkl,jl->ik", cells, _WEIGHTS, dtype=np.uint8, casting="unsafe")
        has_text = self._codes > 0
        codes = np.where(has_text, self._codes, np.where(bits > 0, _BRAILLE + bits.astype(np.uint32), _SPACE))
        styles = self._continued(
            np.where(has_text, self._text_styles, np.where(bits > 0, self._dot_styles, 0)),
            has_text | (bits > 0),
        )
        marks = codes.astype("<u4").tobytes().decode("utf-32-le")
        is_start = np.ones((self.height, self.width), dtype=np.bool_)
        is_start[:, 1:] = styles[:, 1:] != styles[:, :-1]
        starts = np.flatnonzero(is_start)
        ends = np.append(starts[1:], styles.size)[: len(starts)]
        rows: list[list[Run]] = [[] for _ in range(self.height)]
        runs = zip(starts.tolist(), ends.tolist(), styles.ravel()[starts].tolist(), strict=True)
        for start, end, style in runs:
            rows[start // self.width].append((marks[start:end], self._styles[style]))
        return [Runs(row) for row in rows]

    def _continued(self, styles: NDArray[np.int16], has_mark: Mask) -> NDArray[np.int16]:
        """Return the styles of cells, those of blank ones continued from the left."""
        columns = np.where(has_mark, np.arange(self.width), 0)
        continued = np.take_along_axis(styles, np.maximum.accumulate(columns, axis=1), axis=1)
        is_of_marks = np.array(
            [not (s.bgcolor or s.reverse or s.underline or s.strike) for s in self._styles]
        )
        kept: NDArray[np.int16] = np.where(has_mark | is_of_marks[continued], continued, 0)
        return kept

    def text(self) -> Text:
        """Return the canvas as one text, a line a row."""
        text = Text(no_wrap=True, end="")
        for row, runs in enumerate(self.rows()):
            text.append("\n" if row else "")
            text.append_tokens(runs)
        return text

    def _style_index(self, style: str) -> int:
        if style not in self._index_of:
            self._index_of[style] = len(self._styles)
            self._styles.append(parse_style(style))
        return self._index_of[style]

    def _clipped(
        self, x0: FloatArray, y0: FloatArray, x1: FloatArray, y1: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the parts of segments on the canvas as start and end points, each of shape (2, m)."""
        starts, along = np.array((x0, y0)), np.array((x1 - x0, y1 - y0))
        known = np.isfinite(starts).all(axis=0) & np.isfinite(along).all(axis=0)
        starts, along = starts[:, known], along[:, known]
        limits = np.array([[self.dots_wide], [self.dots_high]]) - 1e-6
        with np.errstate(divide="ignore", invalid="ignore"):
            low, high = (0.0 - starts) / along, (limits - starts) / along
        outside = (along == 0.0) & ((starts < 0.0) | (starts > limits))
        is_level = along == 0.0
        enters = np.where(is_level, 0.0, np.minimum(low, high)).max(axis=0, initial=0.0)
        leaves = np.where(is_level, 1.0, np.maximum(low, high)).min(axis=0, initial=1.0)
        shown = (enters <= leaves) & ~outside.any(axis=0)
        starts, along, enters, leaves = starts[:, shown], along[:, shown], enters[shown], leaves[shown]
        return starts + enters * along, starts + leaves * along

    def _inside(self, x: FloatArray, y: FloatArray) -> Mask:
        """Return for each dot whether its middle is inside a polygon."""
        crossings = np.zeros((self.dots_high, self.dots_wide + 1), dtype=np.uint8)
        for x0, y0, x1, y1 in zip(x, y, np.roll(x, -1), np.roll(y, -1), strict=True):
            if not np.isfinite((x0, y0, x1, y1)).all() or y0 == y1:
                continue
            first, last = np.clip(np.ceil(np.sort((y0, y1)) - 0.5), 0, self.dots_high).astype(np.intp)
            rows = np.arange(first, last)
            columns = np.ceil(x0 + (rows + 0.5 - y0) * ((x1 - x0) / (y1 - y0)) - 0.5)
            crossings[rows, np.clip(columns, 0, self.dots_wide).astype(np.intp)] += 1
        inside: Mask = np.cumsum(crossings, axis=1, dtype=np.uint32)[:, :-1] % 2 == 1
        return inside


def circle_vertices(x: float, y: float, radius: float) -> tuple[FloatArray, FloatArray]:
    """Return the vertices of a polygon that differs from a circle by less than a dot."""
    sides = np.clip(np.pi * np.sqrt(max(radius, 0.0) / (2.0 * _CHORD_ERROR)), 12, _MOST_CIRCLE_SIDES)
    angles = np.linspace(0.0, 2.0 * np.pi, int(sides), endpoint=False)
    return x + radius * np.cos(angles), y + radius * np.sin(angles)


def rows_of_text(rows: Iterable[Runs]) -> str:
    """Return the characters of rows, without trailing spaces."""
    return "\n".join(row.plain.rstrip() for row in rows)


@cache
def _is_narrow(mark: str) -> bool:
    return len(mark) == 1 and mark.isprintable() and Segment(mark).cell_length == 1
