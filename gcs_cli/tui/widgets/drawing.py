"""Widgets that show lines, of which only the changed ones are drawn again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from itertools import pairwise, zip_longest
from typing import TYPE_CHECKING, NamedTuple, TypeAlias, cast

from rich.segment import Segment
from rich.style import Style
from rich.text import Text
from textual.events import Resize
from textual.filter import ANSIToTruecolor, LineFilter
from textual.geometry import Region
from textual.strip import Strip
from textual.widget import Widget

from gcs_cli.charts.canvas import Canvas, Runs
from gcs_cli.tui.palette import Palette
from gcs_cli.vehicle.view_types import VehicleView

if TYPE_CHECKING:
    from gcs_cli.tui.app import WatchApp

Draw: TypeAlias = Callable[[VehicleView, float, int, int, Palette], Sequence[Text | Runs]]
"""Draws a vehicle's state as of a time [s] in a number of columns and rows."""


class KeepsLines(Widget):
    """Renders its lines again only after a change of itself.

    Textual asks every widget between the first and the last changed line of the screen for all of its lines. What it
    computes for them, such as the background, takes longer than most drawings.
    """

    _kept: tuple[Region, list[Strip]] | None = None

    def render_lines(self, crop: Region) -> list[Strip]:
        """Return the lines in ``crop``."""
        if self._kept is None or self._kept[0] != crop:
            self._kept = (crop, super().render_lines(crop))
        return self._kept[1]

    def notify_style_update(self) -> None:
        """Render in the new style."""
        self._kept = None
        super().notify_style_update()

    def _set_dirty(self, *regions: Region) -> None:
        self._kept = None
        super()._set_dirty(*regions)


class _Frame(NamedTuple):
    """What surrounds the content of a widget: rows above it, its rows, and the border and padding beside them."""

    top: int
    rows: int
    left: list[Segment]
    right: list[Segment]
    left_cells: int


class LinesWidget(KeepsLines):
    """Shows lines in the colours of the palette; a line is sent to the terminal only if it changed.

    A changed line is put between the borders of the rendered lines. Textual would compute border, padding and
    background anew, which takes longer than the drawing. The stylesheet has no effects, such as opacity, for it.
    """

    ALLOW_SELECT = False

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self._lines: Sequence[Text | Runs] = []
        self._rows: list[list[Segment]] = []
        """The segments of the lines, as wide as the content."""
        self._width = 0
        self._background = Style()
        self._palette: Palette | None = None
        """The palette of ``_background``; None if the style has changed since."""
        self._frame: _Frame | None = None
        """The frame of the kept lines; None if they cannot be replaced one by one."""

    @property
    def replaces_lines(self) -> bool:
        """True if changed lines are put between the borders that are rendered."""
        return self._frame is not None

    def show_lines(self, lines: Sequence[Text | Runs], width: int | None = None) -> None:
        """Show ``lines`` from the top; ``width`` is that of the content, if it is known."""
        if width is None:
            width = self.content_size.width
        colours, is_anew = watch_app(self).palette, width != self._width
        self._width = width
        if colours is not self._palette:  # rich_style collects the styles of all ancestors
            self._palette, background = colours, self.rich_style
            is_anew = is_anew or background != self._background
            self._background = background
        background = self._background
        rows: list[list[Segment]] = []
        changed = []
        for y, (new, old) in enumerate(zip_longest(lines, self._lines)):
            if not is_anew and new is not None and new == old:
                rows.append(self._rows[y])
                continue
            changed.append(y)
            if new is not None:
                rows.append(Segment.adjust_line_length(segments_of(new, background), width, background))
        self._lines, self._rows = lines, rows
        if changed:
            self._redraw(changed)

    def _redraw(self, changed: Sequence[int]) -> None:
        """Draw lines of the content again."""
        kept, frame = self._kept, self._frame
        if kept is None or frame is None:
            self.refresh(*_regions(changed, 0, self._width))
            return
        width, strips = kept[0].width, kept[1]
        visible = [y for y in changed if y < frame.rows]
        if not visible:  # a refresh without regions is one of the whole widget
            return
        self.refresh(*_regions(visible, -frame.left_cells, width))  # strips that are not whole are cut anew
        self._kept = kept
        blank = [Segment(" " * self._width, self._background)]
        for y in visible:
            row = self._rows[y] if y < len(self._rows) else blank
            strips[frame.top + y] = Strip([*frame.left, *row, *frame.right], width)

    def render_lines(self, crop: Region) -> list[Strip]:
        """Return the lines in ``crop``."""
        if self._kept is None or self._kept[0] != crop:
            self._frame = self._frame_of(crop, super().render_lines(crop))
        return super().render_lines(crop)

    def _frame_of(self, crop: Region, strips: Sequence[Strip]) -> _Frame | None:
        top, right, bottom, left = self.styles.gutter
        rows = crop.height - top - bottom
        is_whole = crop == self.outer_size.region and left + self._width + right == crop.width
        if not is_whole or rows <= 0 or self.get_line_filters():
            return None
        line = strips[top]
        return _Frame(top, rows, list(line.crop(0, left)), list(line.crop(crop.width - right)), left)

    def get_line_filters(self) -> Sequence[LineFilter]:
        """Return the filters that the colours of the palette need."""
        return palette_filters(super().get_line_filters())

    def notify_style_update(self) -> None:
        """Read the style again at the next drawing."""
        self._palette = None
        super().notify_style_update()

    def render_line(self, y: int) -> Strip:
        """Return a line of the content."""
        if y < len(self._rows):
            return Strip(self._rows[y], self._width)
        return Strip.blank(self.content_size.width, self.rich_style)


def _regions(rows: Sequence[int], x: int, width: int) -> list[Region]:
    """Return the regions of ascending rows, one of those without a gap."""
    starts = [y for y, before in zip(rows, [-2, *rows], strict=False) if y != before + 1]
    ends = [y + 1 for y, after in zip(rows, [*rows[1:], -2], strict=True) if y + 1 != after]
    return [Region(x, start, width, end - start) for start, end in zip(starts, ends, strict=True)]


class Drawing(LinesWidget):
    """Shows the lines that ``draw`` returns for the vehicle's state.

    ``every``: draw in one of so many redraws of the screen; figures that change faster cannot be read.
    """

    def __init__(self, draw: Draw, title: str = "", *, every: int = 2, id: str | None = None) -> None:
        super().__init__(id=id)
        self.every = every
        self._draw = draw
        self.border_title = title or None

    def show(self, view: VehicleView, now_s: float) -> None:
        """Draw ``view``."""
        width, height = self.content_size
        if width > 0 and height > 0:
            self.show_lines(self._draw(view, now_s, width, height, watch_app(self).palette), width)

    def on_resize(self, _event: Resize) -> None:
        """Draw in the new size."""
        feed = watch_app(self).feed
        self.show(feed.view, feed.now_s)


class LineWidget(LinesWidget):
    """Shows one line."""

    DEFAULT_CSS = "LineWidget { height: 1; }"

    def show_line(self, line: Text) -> None:
        """Show ``line``."""
        self.show_lines([line])

    def on_resize(self, _event: Resize) -> None:
        """Draw in the new size."""
        self.show_lines(self._lines)


def palette_filters(filters: Sequence[LineFilter]) -> list[LineFilter]:
    """Return ``filters`` without the one of the terminal's 16 colours: the palette has none of them.

    It takes as long as the drawing of a plot.
    """
    return [each for each in filters if not isinstance(each, ANSIToTruecolor)]


def strip_of(line: Text | Runs, base: Style) -> Strip:
    """Return the segments of a line over the style ``base`` as a strip."""
    return Strip(segments_of(line, base))


def segments_of(line: Text | Runs, base: Style) -> list[Segment]:
    """Return the segments of a line over the style ``base``; a later span covers an earlier one."""
    if isinstance(line, Runs):
        return [Segment(text, _combined(base, style)) for text, style in line if text]
    plain, spans = line.plain, line.spans
    edges = sorted({0, len(plain), *(span.start for span in spans), *(span.end for span in spans)})
    segments = []
    for start, end in pairwise(edge for edge in edges if edge <= len(plain)):
        styles = [span.style for span in spans if span.start <= start and span.end >= end]
        segments.append(Segment(plain[start:end], _combined(base, line.style, *styles)))
    return segments


@cache
def _combined(base: Style, *styles: str | Style) -> Style:
    parsed = (Style.parse(style) if isinstance(style, str) else style for style in styles)
    return sum(parsed, start=base)


def watch_app(node: Widget) -> WatchApp:
    """Return the application of a widget."""
    return cast("WatchApp", node.app)


class CanvasWidget(LinesWidget):
    """Shows the canvas given to ``draw``; only rows that changed are drawn again."""

    DEFAULT_CSS = "CanvasWidget { width: 1fr; height: 1fr; }"

    def draw(self, canvas: Canvas) -> None:
        """Show ``canvas``."""
        self.show_lines(canvas.rows())
