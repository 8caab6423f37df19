"""One screen of the terminal view without a terminal: as lines of text, or printed."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from rich.console import Console
from rich.segment import Segment, Segments
from textual.pilot import Pilot

from gcs_cli.tui.app import WatchApp
from gcs_cli.tui.feed import Feed

_POLL_S = 0.05


def screen_segments(app: WatchApp) -> list[list[Segment]]:
    """Return the lines of the visible screen."""
    return [list(strip) for strip in app.screen._compositor.render_strips()]


def print_once(
    feed: Feed, mode: str, size: tuple[int, int], is_full: Callable[[], bool], limit_s: float
) -> None:
    """Print one screen once ``is_full``, after ``limit_s`` at the latest."""
    app = WatchApp(feed)
    lines: list[list[Segment]] = []

    async def take(pilot: Pilot[object]) -> None:
        app.switch_mode(mode)
        end_s = feed.now_s + limit_s
        while not is_full() and feed.now_s < end_s and feed.error is None:
            await asyncio.sleep(_POLL_S)
        app.redraws = 0
        app.redraw()
        await pilot.pause()
        lines.extend(screen_segments(app))
        app.exit()

    app.run(headless=True, size=size, auto_pilot=take)
    console = Console(width=size[0], emoji=False)
    for line in lines:
        console.print(Segments([*line, Segment.line()]), end="")
