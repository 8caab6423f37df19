"""The message inspector: rows, fields and filters, and the screen driven by keys and mouse."""

from __future__ import annotations

import math
from collections.abc import Awaitable, Callable

import pytest
from textual.pilot import Pilot
from textual.widgets import Input

from flightstack.mavlink.dialect import mavlink
from gcs_cli.actions import on_vehicle
from gcs_cli.tui.app import WatchApp
from gcs_cli.tui.fly.history import History
from gcs_cli.tui.messages.inspector_lines import (
    field_texts,
    filtered,
    lines,
    message_rows,
    source_name,
    summary,
)
from gcs_cli.tui.messages.inspector_screen import InspectorScreen
from gcs_cli.tui.orders.form import OrderForm
from gcs_cli.tui.palette import DARK
from tests.support.map_views import VIEW
from tests.support.pictures import check_picture
from tests.support.pilots import run_story
from tests.support.screens import shown
from tests.support.still_feed import StillFeed
from tests.support.telemetry_frames import attitude, received

END_S = 20.0
HEARTBEAT = received(mavlink.MAVLink_heartbeat_message(2, 12, 129, 0, 4, 3))
CELLS = [4200, 4100, 4000, 65535, 65535, 65535, 65535, 65535, 65535, 65535]
BATTERY = received(mavlink.MAVLink_battery_status_message(0, 0, 1, 2500, CELLS, 1500, 120, -1, 76))
TEXT = received(mavlink.MAVLink_statustext_message(6, b"Takeoff detected"))


def recorded() -> History:
    history = History()
    for step in range(100):
        history.record(attitude(0.1), 10.0 + 0.1 * step)
    for second in range(10, 20):
        history.record(HEARTBEAT, float(second))
    history.record(BATTERY, 12.0)
    history.record(TEXT, 19.0)
    return history


def row_named(name: str):
    return next(row for row in message_rows(recorded(), END_S) if row.name == name)


def texts(rows, expanded=frozenset(), plotted=(), width=80) -> list[str]:
    return [line.text.plain for line in lines(rows, expanded, plotted, width, DARK)]


def test_rows_have_rate_count_age_and_source():
    assert texts(message_rows(recorded(), END_S)) == [
        "▸ ATTITUDE                               10.0      100    0.1  1 AUTOPILOT1",
        "▸ BATTERY_STATUS[0]                       0.0        1    8.0  1 AUTOPILOT1",
        "▸ HEARTBEAT                               1.0       10    1.0  1 AUTOPILOT1",
        "▸ STATUSTEXT                              0.0        1    1.0  1 AUTOPILOT1",
    ]


def test_silent_messages_are_known():
    silent = {row.name for row in message_rows(recorded(), END_S) if row.is_silent}
    assert silent == {"BATTERY_STATUS[0]"}


def test_sources_are_sorted_and_named():
    history = recorded()
    history.record(attitude(0.0, 2, 66), 1.0)
    history.record(attitude(0.0, 1, 100), 1.0)
    names = list(dict.fromkeys(source_name(row.key) for row in message_rows(history, END_S)))
    assert names == ["1 AUTOPILOT1", "1 CAMERA", "2 USER42"]


@pytest.mark.parametrize(
    ("message", "field", "expected"),
    [
        (HEARTBEAT, "system_status", ("4", "ACTIVE")),
        (HEARTBEAT, "base_mode", ("129", "CUSTOM_MODE_ENABLED | SAFETY_ARMED")),
        (BATTERY, "temperature", ("2500 cdegC", "25.00 degC")),
        (BATTERY, "voltages[0]", ("4200 mV", "4.200 V")),
        (BATTERY, "voltages[3]", ("65535 mV", "unknown")),
        (BATTERY, "battery_remaining", ("76 %", "")),
        (TEXT, "text", ("Takeoff detected", "")),
    ],
)
def test_fields_have_units_and_names(message, field, expected):
    name, _, index = field.partition("[")
    value = getattr(message, name)
    assert field_texts(message, field, value[int(index[:-1])] if index else value) == expected


def test_floats_that_are_not_finite_are_shown():
    assert field_texts(attitude(math.nan), "roll", math.nan) == ("nan rad", "— deg")


def test_expanded_message_lists_its_fields_in_order():
    row = row_named("ATTITUDE")
    listed = texts([row], frozenset({row.key}), ("ATTITUDE.roll",))
    assert listed[0].startswith("▾ ATTITUDE")
    assert [line.split()[0] for line in listed[1:3]] == ["time_boot_ms", "●"]
    assert listed[2].split()[1:] == ["roll", "0.1", "rad", "5.730", "deg"]
    assert len(listed) == 8


def test_only_numeric_fields_can_be_plotted():
    battery, text = row_named("BATTERY_STATUS[0]"), row_named("STATUSTEXT")
    listed = lines([battery, text], frozenset({battery.key, text.key}), (), 80, DARK)
    names = {line.field: line.plot_name for line in listed}
    assert names["voltages[2]"] == "BATTERY_STATUS[0].voltages[2]"
    assert names["text"] is None
    assert names[None] is None


def test_filter_finds_messages_fields_and_sources():
    rows = message_rows(recorded(), END_S)
    assert [row.name for row in filtered(rows, "yawspeed")] == ["ATTITUDE"]
    assert [row.name for row in filtered(rows, "BATT autopilot1")] == ["BATTERY_STATUS[0]"]
    assert filtered(rows, "nothing") == []
    assert summary(rows, 1, "yaw", True, DARK).plain == " PAUSED  4 messages, 11 a second, 1 with “yaw”"


@pytest.mark.parametrize("width", [20, 30, 60, 200])
def test_lines_fit_the_width(width):
    rows = message_rows(recorded(), END_S)
    assert all(len(text) <= width for text in texts(rows, frozenset(row.key for row in rows), (), width))


@pytest.mark.parametrize(("rate_hz", "interval_us"), [(10.0, 1e5), (0.0, -1.0), (None, 0.0)])
def test_rate_is_requested_as_an_interval(rate_hz, interval_us):
    (step,) = on_vehicle.set_message_rate(30, "ATTITUDE", rate_hz).plan(VIEW)
    assert step.command[:2] == (mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, (30.0, interval_us))


def drive(story: Callable[[Pilot[None], WatchApp, InspectorScreen], Awaitable[None]], size=(80, 24)) -> None:
    app = WatchApp(StillFeed(VIEW, END_S, recorded()), "inspector")

    async def begin(pilot: Pilot[None]) -> None:
        await pilot.pause()
        assert isinstance(app.screen, InspectorScreen)
        app.redraws = 0
        app.screen.show(VIEW, END_S)
        await pilot.pause()
        await story(pilot, app, app.screen)

    run_story(app, begin, size=size)


@pytest.mark.parametrize("size", [(80, 24), (120, 35), (200, 50)], ids=str)
def test_inspector_shows_messages_and_fields(size):
    async def story(pilot, app, _screen):
        await pilot.press("enter", "down", "down")
        await pilot.pause()
        check_picture(f"inspector-{size[0]}x{size[1]}", shown(app)[2:-1])

    drive(story, size)


def test_cursor_stays_on_its_line_while_messages_appear():
    async def story(pilot, app, screen):
        await pilot.press("down", "down")
        assert screen.selected.row.name == "HEARTBEAT"
        app.feed.history.record(received(mavlink.MAVLink_altitude_message(0, 0, 0, 0, 0, 0, 0)), END_S)
        app.redraws = 0
        screen.show(VIEW, END_S)
        assert screen.selected.row.name == "HEARTBEAT"
        await pilot.press("end")
        assert screen.selected.row.name == "STATUSTEXT"
        await pilot.press("home", "up")
        assert screen.selected.row.name == "ALTITUDE"

    drive(story)


def test_list_scrolls_with_the_cursor():
    async def story(pilot, app, screen):
        await pilot.press("down", "enter", *["down"] * 20)
        await pilot.pause()
        assert screen.line_list.scroll_y > 0
        assert screen.selected.field in "\n".join(shown(app))
        await pilot.press("pageup", "pageup", "pageup")
        await pilot.pause()
        assert screen.line_list.scroll_y == 0

    drive(story)


def test_click_opens_a_message():
    async def story(pilot, app, screen):
        await pilot.click(screen.line_list, (5, 2))
        await pilot.pause()
        assert any("system_status" in line for line in shown(app))
        await pilot.click(screen.line_list, (5, 2))
        await pilot.pause()
        assert not any("system_status" in line for line in shown(app))

    drive(story)


def test_field_is_sent_to_the_plot_and_back():
    async def story(pilot, app, screen):
        await pilot.press("p")
        assert app._notifications
        await pilot.press("enter", *["down"] * 4, "p")
        assert screen.selected.field == "yaw"
        assert "ATTITUDE.yaw" in app.plot_fields.names
        await pilot.press("p")
        assert "ATTITUDE.yaw" not in app.plot_fields.names

    drive(story)


def test_another_rate_is_asked_for_and_requested():
    async def story(pilot, app, _screen):
        app.feed.rates_hz = {mavlink.MAVLINK_MSG_ID_ATTITUDE: 10.0}
        await pilot.press("r")
        await pilot.pause()
        assert isinstance(app.screen, OrderForm)
        await pilot.press("2", "5", "enter")
        await pilot.pause()
        (action,) = app.feed.actions
        assert action.facts == {"message": "ATTITUDE", "rate_hz": 25.0}
        assert app.feed.rates_hz == {mavlink.MAVLINK_MSG_ID_ATTITUDE: 25.0}
        await pilot.press("r")
        await pilot.pause()
        await pilot.press("enter")
        await pilot.pause()
        assert app.feed.actions[1].facts["rate_hz"] is None
        assert app.feed.rates_hz == {}

    drive(story)


def test_pause_keeps_figures_but_opens_messages():
    async def story(pilot, app, screen):
        await pilot.press("space")
        app.feed.history.record(attitude(0.9), END_S)
        app.redraws = 0
        screen.show(VIEW, END_S + 5.0)
        await pilot.press("enter")
        await pilot.pause()
        lines_shown = shown(app)
        assert lines_shown[2].startswith(" PAUSED  4 messages")
        assert "     100    0.1" in lines_shown[4]
        assert any("0.1 rad" in line for line in lines_shown)

    drive(story)


def test_search_hides_other_messages():
    async def story(pilot, app, screen):
        await pilot.press("slash", *"batt", "enter")
        await pilot.pause()
        assert [line.row.name for line in screen.lines_shown] == ["BATTERY_STATUS[0]"]
        assert "1 with “batt”" in shown(app)[2]
        await pilot.press("escape")
        await pilot.pause()
        assert len(screen.lines_shown) == 4
        assert not screen.query_one(Input).display

    drive(story)
