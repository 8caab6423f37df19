"""The screen Plot, driven by keys and mouse."""

from __future__ import annotations

import math
from collections.abc import Awaitable, Callable

import numpy as np
import pytest
from textual.events import MouseScrollDown
from textual.pilot import Pilot
from textual.widgets import Input

from flightstack.mavlink.dialect import mavlink
from gcs_cli.tui.app import WatchApp
from gcs_cli.tui.fly.history import History
from gcs_cli.tui.plot.field_picker import FieldPicker
from gcs_cli.tui.plot.screen import PlotScreen
from gcs_cli.tui.widgets.row_list import RowList
from tests.support.map_views import VIEW
from tests.support.pictures import check_picture
from tests.support.pilots import run_story
from tests.support.screens import shown
from tests.support.still_feed import StillFeed
from tests.support.telemetry_frames import received

END_S = 60.0


def record(history: History, time_s: float) -> None:
    roll = 0.2 * math.sin(time_s / 3.0)
    history.record(received(mavlink.MAVLink_attitude_message(0, roll, roll / 2, 0, 0, 0, 0)), time_s)
    height = 488.0 + 10.0 * (1.0 - math.exp(-time_s / 20.0))
    history.record(received(mavlink.MAVLink_vfr_hud_message(0, 3.0, 0, 50, height, 0.0)), time_s)


def drive(story: Callable[[Pilot[None], WatchApp, PlotScreen], Awaitable[None]], size=(80, 24)) -> None:
    history = History()
    for time_s in np.arange(0.0, END_S, 0.2):
        record(history, float(time_s))

    feed = StillFeed(VIEW, END_S)
    feed.history = history
    app = WatchApp(feed)

    async def begin(pilot: Pilot[None]) -> None:
        await pilot.press("4")
        await pilot.pause()
        assert isinstance(app.screen, PlotScreen)
        app.redraws = 0
        app.screen.show(VIEW, END_S)
        await pilot.pause()
        await story(pilot, app, app.screen)

    run_story(app, begin, size=size)


@pytest.mark.parametrize("size", [(80, 24), (120, 35), (200, 50)], ids=str)
def test_plot_shows_the_first_fields_by_unit(size):
    async def story(_pilot, app, _screen):
        check_picture(f"plot-{size[0]}x{size[1]}", shown(app)[2:-1])

    drive(story, size)


def test_cursor_moves_by_keys_and_mouse():
    async def story(pilot, app, screen):
        newest = shown(app)[2]
        await pilot.press("left", "shift+left", "left", "right")
        assert screen.plot.cursor_column == 68
        await pilot.pause()
        assert shown(app)[2] != newest
        await pilot.hover(screen.plot, (20, 5))
        assert screen.plot.cursor_column == 20
        await pilot.press("escape")
        await pilot.pause()
        assert screen.plot.cursor_column is None
        assert shown(app)[2] == newest

    drive(story)


def test_keys_and_wheel_change_the_time_span():
    async def story(pilot, _app, screen):
        await pilot.press("+")
        assert screen.plot.span.end_s - screen.plot.span.start_s == 30.0
        await pilot._post_mouse_events([MouseScrollDown], screen.plot, (20, 5))
        await pilot.press("-")
        assert screen.plot.span.end_s - screen.plot.span.start_s == 120.0
        await pilot.press(*["-"] * 9)
        assert screen.plot.span.end_s - screen.plot.span.start_s == 1200.0
        await pilot.press(*["+"] * 12)
        assert screen.plot.span.end_s - screen.plot.span.start_s == 5.0

    drive(story)


def test_pause_keeps_the_picture_while_messages_arrive():
    async def story(pilot, app, screen):
        await pilot.press("space")
        picture = shown(app)[2:-2]
        for time_s in (61.0, 62.0, 63.0):
            record(app.feed.history, time_s)
            app.feed.time_s = time_s
            app.redraws = 0
            screen.show(VIEW, time_s)
        await pilot.pause()
        assert shown(app)[2:-2] == picture
        await pilot.press("space")
        await pilot.pause()
        assert screen.plot.end_s == pytest.approx(63.0, abs=0.75)  # a cell of the time axis

    drive(story)


def test_field_is_found_added_and_removed():
    async def story(pilot, app, screen):
        await pilot.press("enter")
        await pilot.pause()
        assert isinstance(app.screen, FieldPicker)
        await pilot.press(*"yawsp")
        await pilot.pause()
        assert app.screen.shown == ["ATTITUDE.yawspeed"]
        await pilot.press("enter")
        assert "ATTITUDE.yawspeed" in app.plot_fields.names
        await pilot.press("enter")
        assert "ATTITUDE.yawspeed" not in app.plot_fields.names
        await pilot.press("down", "up", "escape")
        await pilot.pause()
        assert app.screen is screen

    drive(story)


def test_field_list_shows_fields_and_values_that_arrive_while_it_is_open():
    async def story(pilot, app, screen):
        await pilot.press("enter")
        await pilot.pause()
        await pilot.press(*"roll", "down")
        picker = app.screen
        selected = picker.shown[picker.query_one(RowList).cursor]
        for name, value in ((b"a roll", 1.5), (b"a roll", 2.5)):
            named = mavlink.MAVLink_named_value_float_message(0, name, value)
            app.feed.history.record(received(named), END_S)
            app.redraws = 0
            picker.follow()
            await pilot.pause()
            assert any(f"{value:.3f}" in line for line in shown(app)), shown(app)
        assert picker.shown[picker.query_one(RowList).cursor] == selected

    drive(story)


def test_field_list_reads_the_values_of_the_visible_names_only(monkeypatch):
    read = []

    async def story(pilot, app, _screen):
        for number in range(200):
            named = mavlink.MAVLink_named_value_float_message(0, f"v{number}".encode(), 0.0)
            app.feed.history.record(received(named), END_S)
        await pilot.press("enter")
        await pilot.pause()
        names = len(app.screen.shown)
        monkeypatch.setattr("gcs_cli.tui.plot.fields.value_note", lambda *_: read.append(1) or "")
        await pilot.press(*"va", "backspace", "pagedown")
        await pilot.pause()
        assert names > 10 * 15
        assert 0 < len(read) <= 4 * 24

    drive(story)


def test_click_on_a_name_adds_it():
    async def story(pilot, app, _screen):
        await pilot.press("enter")
        await pilot.pause()
        await pilot.press(*"yawsp")
        await pilot.pause()
        await pilot.click(RowList)
        await pilot.pause()
        assert "ATTITUDE.yawspeed" in app.plot_fields.names

    drive(story)


def test_more_fields_than_colours_are_refused():
    async def story(pilot, app, screen):
        names = ["ATTITUDE.yaw", "ATTITUDE.rollspeed", "ATTITUDE.pitchspeed", "ATTITUDE.yawspeed"]
        assert [screen.toggle(name) for name in names] == [None] * 4
        await pilot.press("enter")
        await pilot.pause()
        app.screen.query_one(Input).value = "throttle"
        await pilot.pause()
        await pilot.press("enter")
        assert [note.message for note in app._notifications] == [
            "at most 8 fields are plotted: remove one first"
        ]
        assert "VFR_HUD.throttle" not in app.plot_fields.names

    drive(story)


def test_cleared_plot_says_how_to_add_fields():
    async def story(pilot, app, _screen):
        await pilot.press("c")
        await pilot.pause()
        assert "press Enter to add fields" in shown(app)[3]

    drive(story)


def test_pause_before_the_first_message_is_harmless():
    app = WatchApp(StillFeed(VIEW))

    async def begin(pilot: Pilot[None]) -> None:
        await pilot.press("4", "space", "left", "enter", "escape", "space")
        await pilot.pause()
        assert isinstance(app.screen, PlotScreen)

    run_story(app, begin)
