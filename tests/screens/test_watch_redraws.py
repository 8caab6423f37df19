"""What a redraw of ``gcs watch`` computes and sends: only what changed."""

from __future__ import annotations

import pytest
from rich.text import Text
from textual.geometry import Region
from textual.pilot import Pilot
from textual.screen import Screen
from textual.strip import Strip
from textual.widget import Widget

from gcs_cli.tui.app import COVERED_EVERY, REDRAWS_HZ, WatchApp
from gcs_cli.tui.fly.screen import FlyScreen
from gcs_cli.tui.key_bar import KeyBar
from gcs_cli.tui.plot import field_picker
from gcs_cli.tui.plot.field_picker import FieldPicker
from gcs_cli.tui.screens import SCREENS, ScreenEntry
from gcs_cli.tui.widgets.drawing import KeepsLines, LinesWidget
from gcs_cli.tui.widgets.line_list import LineList
from gcs_cli.vehicle.view_types import Vector
from tests.support.watch_plays import play
from tests.support.watch_states import FULL, flown_history


@pytest.mark.parametrize("entry", SCREENS, ids=lambda entry: entry.mode)
def test_redraws_of_a_moving_vehicle_compute_no_layout(
    entry: ScreenEntry, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A layout takes several times as long as the lines that change."""
    layouts: list[Screen[object]] = []

    def count(screen: Screen[object], *_: object, **__: object) -> None:
        layouts.append(screen)

    async def story(app: WatchApp, pilot: Pilot) -> None:
        app.feed.history = flown_history()
        await pilot.press(entry.key)
        await pilot.pause(4 / REDRAWS_HZ)
        app.redraw()
        await pilot.pause()
        monkeypatch.setattr(Screen, "_refresh_layout", count)
        for step in range(1, 9):
            app.feed.time_s += 1 / REDRAWS_HZ
            place = Vector(FULL.position_ned_m.x + step, 0.0, -5.0)
            app.feed.shown = FULL._replace(position_ned_m=place, time_s=100.0 + step)
            app.redraw()
            await pilot.pause()
        assert not layouts

    play(story, size=(120, 35))


@pytest.mark.parametrize("size", [(200, 50), (120, 35), (80, 24), (60, 10)])
@pytest.mark.parametrize("entry", SCREENS, ids=lambda entry: entry.mode)
def test_changed_lines_equal_those_that_textual_renders(entry: ScreenEntry, size: tuple[int, int]) -> None:
    """Changed lines are put between borders and padding that were rendered before."""

    async def story(app: WatchApp, pilot: Pilot) -> None:
        app.feed.history = flown_history()
        await pilot.press(entry.key)
        await pilot.pause(4 / REDRAWS_HZ)
        for step in range(1, 7):  # the mission and the texts end: fewer lines
            place = Vector(FULL.position_ned_m.x + step, 0.0, -5.0)
            texts = FULL.texts if step % 2 else ()
            app.feed.shown = FULL._replace(position_ned_m=place, time_s=100.0 + step, texts=texts)
            app.redraw()
            await pilot.pause()
            framed = [widget for widget in app.screen.query(LinesWidget) if widget.replaces_lines]
            assert framed
            for widget in framed:
                _check_kept(widget)

    play(story, size=size)


@pytest.mark.parametrize("sizes", [((72, 30), (109, 30)), ((110, 40), (150, 40)), ((200, 50), (80, 24))])
def test_no_line_is_left_over_when_lines_become_fewer_in_a_new_size(
    sizes: tuple[tuple[int, int], ...],
) -> None:
    """Long texts take fewer lines in a wider terminal."""
    texts = tuple(text._replace(text=f"{text.text} {'word ' * 30}") for text in FULL.texts[:2])

    async def story(app: WatchApp, pilot: Pilot) -> None:
        app.feed.shown = FULL._replace(texts=texts)
        await pilot.pause(4 / REDRAWS_HZ)
        await pilot.resize_terminal(*sizes[1])
        for _ in range(6):
            app.redraw()
            await pilot.pause()
        for widget in app.screen.query(LinesWidget):
            _check_kept(widget)

    play(story, size=sizes[0])


def _check_kept(widget: LinesWidget) -> None:
    crop = widget.outer_size.region
    kept = widget.render_lines(crop)
    widget._styles_cache.clear()
    rendered = Widget.render_lines(widget, crop)
    assert [list(strip.simplify()) for strip in kept] == [list(strip.simplify()) for strip in rendered]


def test_list_draws_only_changed_lines_again(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[int] = []

    async def story(app: WatchApp, pilot: Pilot) -> None:
        app.feed.history = flown_history()
        await pilot.press("6")
        await pilot.pause(4 / REDRAWS_HZ)
        lines = app.screen.query_one(LineList)
        monkeypatch.setattr(lines, "refresh_line", drawn.append)
        keys, texts = range(9), [Text(f"line {number}") for number in range(9)]
        lines.set_lines(keys, texts)
        drawn.clear()
        lines.set_lines(keys, [*texts[:4], Text("other"), *texts[5:]])
        assert drawn == [4]

    play(story, size=(80, 24))


@pytest.mark.parametrize("entry", SCREENS, ids=lambda entry: entry.mode)
def test_redraw_renders_only_widgets_that_changed(
    entry: ScreenEntry, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Textual asks all widgets between the first and the last changed line of the screen."""
    rendered: list[Widget] = []
    render_lines = Widget.render_lines

    def count(widget: Widget, crop: Region) -> list[Strip]:
        rendered.append(widget)
        return render_lines(widget, crop)

    async def story(app: WatchApp, pilot: Pilot) -> None:
        await pilot.press(entry.key)
        await pilot.pause(4 / REDRAWS_HZ)
        monkeypatch.setattr(Widget, "render_lines", count)
        top, bottom = app.screen.query_one("#status"), app.screen.query_one(KeyBar)
        top.refresh()
        bottom.refresh()
        await pilot.pause()
        assert {widget for widget in rendered if isinstance(widget, KeepsLines)} == {top, bottom}

    play(story, size=(120, 35))


def test_a_covered_screen_is_drawn_less_often(monkeypatch: pytest.MonkeyPatch) -> None:
    """Textual composes the dialog and all below it for each change."""
    drawn = []
    monkeypatch.setattr(FlyScreen, "show", lambda *_: drawn.append(0))

    async def story(app: WatchApp, pilot: Pilot) -> None:
        await pilot.pause()
        drawn.clear()
        for _ in range(COVERED_EVERY):
            app.redraw()
        assert len(drawn) == COVERED_EVERY
        await pilot.press("X")
        await pilot.pause()
        drawn.clear()
        for _ in range(3 * COVERED_EVERY):
            app.redraw()
        assert len(drawn) == 3

    play(story)


def test_a_dialog_with_live_values_follows_at_its_own_rate(monkeypatch: pytest.MonkeyPatch) -> None:
    searched = []
    monkeypatch.setattr(field_picker, "search", lambda *_: searched.append(0) or [])

    async def story(app: WatchApp, pilot: Pilot) -> None:
        await pilot.press("4", "enter")
        await pilot.pause()
        assert isinstance(app.screen, FieldPicker)
        searched.clear()
        for _ in range(10):
            app.redraw()
        assert len(searched) == 5

    play(story)
