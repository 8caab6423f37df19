"""A widget that shows a canvas."""

from __future__ import annotations

from gcs_cli.charts.canvas import Canvas
from gcs_cli.tui.widgets.drawing import LinesWidget


class CanvasWidget(LinesWidget):
    """Shows the canvas given to ``draw``; only rows that changed are drawn again."""

    DEFAULT_CSS = "CanvasWidget { width: 1fr; height: 1fr; }"

    def draw(self, canvas: Canvas) -> None:
        """Show ``canvas``."""
        self.show_lines(canvas.rows())
