"""The application of ``gcs watch``, driven by keys."""

from __future__ import annotations

import itertools
import time

import pytest
import textual._time
from textual.pilot import Pilot

from flightstack.core.enums import Severity
from gcs_cli.tui.app import REDRAWS_HZ, WatchApp
from gcs_cli.tui.feed import Notice
from gcs_cli.tui.orders.form import Confirm
from gcs_cli.tui.orders.orders import ORDERS
from gcs_cli.tui.screens import SCREENS, ScreenEntry
from gcs_cli.vehicle.view_types import Identity, VehicleView
from tests.support.pictures import check_picture
from tests.support.screens import shown
from tests.support.watch_plays import GROUNDED, Story, asked, play
from tests.support.watch_states import FULL, flown_history


@pytest.mark.parametrize("entry", SCREENS, ids=lambda entry: entry.mode)
def test_a_digit_opens_a_screen(entry: ScreenEntry) -> None:
    async def story(app: WatchApp, pilot: Pilot) -> None:
        await pilot.press(entry.key)
        await pilot.pause()
        assert app.current_mode == entry.mode
        assert f"{entry.key} {entry.title}" in shown(app)[1]
        assert "q Quit" in shown(app)[-1]

    play(story, size=(120, 24))


@pytest.mark.parametrize("entry", SCREENS, ids=lambda entry: entry.mode)
@pytest.mark.parametrize("size", [(20, 5), (80, 24), (200, 50)], ids=str)
def test_every_screen_survives_any_size(entry: ScreenEntry, size: tuple[int, int]) -> None:
    async def story(app: WatchApp, pilot: Pilot) -> None:
        await pilot.press(entry.key)
        await pilot.resize_terminal(20, 5)
        await pilot.resize_terminal(*size)
        await pilot.pause()
        assert len(shown(app)) == size[1]

    play(story, size=size)


def test_a_new_size_is_followed_when_the_process_is_held_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """A busy machine may stop the process for 20 ms anywhere; Textual's timer of 8 ms for the new size is lost then."""
    calls = itertools.count()
    monkeypatch.setattr(textual._time, "get_time", lambda: time.monotonic() + 0.02 * next(calls))

    async def story(app: WatchApp, pilot: Pilot) -> None:
        await pilot.resize_terminal(200, 50)
        await pilot.pause(2 / REDRAWS_HZ)
        assert len(shown(app)) == 50

    play(story, size=(80, 24))


def test_a_click_on_a_tab_opens_its_screen() -> None:
    async def story(app: WatchApp, pilot: Pilot) -> None:
        at = shown(app)[1].index("Messages")
        await pilot.click("#tabs", offset=(at, 0))
        await pilot.pause()
        assert app.current_mode == "messages"

    play(story, size=(120, 24))


def test_waiting_for_a_vehicle_names_the_link() -> None:
    async def story(app: WatchApp, pilot: Pilot) -> None:
        text = "\n".join(shown(app))
        assert "Waiting for a vehicle's heartbeat" in text
        assert "UDP 127.0.0.1:14550" in text
        assert "Arm" not in shown(app)[-1]

    play(story, VehicleView())


def test_the_footer_shows_the_keys_that_work_now() -> None:
    async def story(app: WatchApp, pilot: Pilot) -> None:
        assert all(word in shown(app)[-1] for word in ("D Disarm", "L Land", "R Return", "H Hold"))
        assert "Take off" not in shown(app)[-1]
        app.feed.shown = GROUNDED
        app.redraw()
        await pilot.pause()
        assert all(word in shown(app)[-1] for word in ("A Arm", "T Take off"))
        assert "Land" not in shown(app)[-1]

    play(story, size=(120, 24))


def test_a_terminated_flight_has_no_keys_of_a_flight_and_no_question() -> None:
    async def story(app: WatchApp, pilot: Pilot) -> None:
        app.redraw()
        await pilot.pause()
        assert "L Land" in shown(app)[-1]
        app.feed.shown = FULL._replace(system_status=8, custom_mode=10 << 16)
        app.redraw()
        await pilot.pause()
        assert not any(word in shown(app)[-1] for word in ("Land", "Return", "Hold", "Arm", "Take off"))
        await pilot.press("X", "C", "S", "M", "H")
        await pilot.pause()

    assert asked(play(story, size=(120, 24))) == ["terminate"]


def test_a_kill_switch_of_px4_is_no_termination() -> None:
    """PX4 reports both by the same state; a killed vehicle may fly on."""

    async def story(app: WatchApp, pilot: Pilot) -> None:
        await pilot.pause()
        assert "rotors switched off" in "\n".join(shown(app))
        assert "L Land" in shown(app)[-1]
        await pilot.press("X")
        await pilot.pause()
        assert isinstance(app.screen, Confirm)

    assert asked(play(story, FULL._replace(system_status=8), size=(120, 24))) == []


def test_a_safe_order_is_performed_at_once() -> None:
    async def story(_app: WatchApp, pilot: Pilot) -> None:
        await pilot.press("H")
        await pilot.pause()

    assert asked(play(story)) == ["hold"]


@pytest.mark.parametrize(
    ("key", "view", "name"), [("A", GROUNDED, "arm"), ("D", FULL, "disarm"), ("X", FULL, "terminate")]
)
def test_a_dangerous_order_asks_first(key: str, view: VehicleView, name: str) -> None:
    async def refuse(_app: WatchApp, pilot: Pilot) -> None:
        await pilot.press(key)
        await pilot.pause()
        await pilot.press("enter")  # the harmless answer is selected
        await pilot.pause()

    async def confirm(_app: WatchApp, pilot: Pilot) -> None:
        await pilot.press(key)
        await pilot.pause()
        await pilot.press("y")
        await pilot.pause()

    assert asked(play(refuse, view)) == []
    assert asked(play(confirm, view)) == [name]


def test_a_disarm_on_the_ground_does_not_ask() -> None:
    async def story(_app: WatchApp, pilot: Pilot) -> None:
        await pilot.press("D")
        await pilot.pause()

    feed = play(story, FULL._replace(landed_state=1))
    assert feed.actions[0].facts == {"force": False}


OTHER = FULL._replace(identity=Identity(7, 1, 13, 3), mode="GUIDED")


def keys(*pressed: str, others: tuple[VehicleView, ...] = (), to_all: bool = False) -> Story:
    """Return the story of a user at several vehicles."""

    async def story(app: WatchApp, pilot: Pilot) -> None:
        app.feed.others += others
        app.feed.commands_all = to_all
        app.redraw()
        for key in pressed:
            await pilot.press(key)
            await pilot.pause()

    return story


@pytest.mark.parametrize("key", ["X", "D"])
def test_order_goes_to_the_vehicle_of_its_question(key: str) -> None:
    async def story(app: WatchApp, pilot: Pilot) -> None:
        app.feed.others.append(OTHER)
        await pilot.press(key)
        await pilot.pause()
        app.feed.shown = OTHER  # the selection moves while the question waits
        await pilot.press("y")
        await pilot.pause()

    assert play(story).acted_on == [1]


def test_orders_to_all_vehicles_always_ask_and_name_them() -> None:
    async def story(app: WatchApp, pilot: Pilot) -> None:
        await keys("L", others=(OTHER,), to_all=True)(app, pilot)
        assert "Land: all 2 vehicles (1, 7)?" in "\n".join(shown(app))
        assert not app.feed.actions
        await pilot.press("y")
        await pilot.pause()

    assert play(story).acted_on == [1, 7]


def test_order_to_all_goes_to_the_vehicles_it_applies_to() -> None:
    async def story(app: WatchApp, pilot: Pilot) -> None:
        await keys("R", others=(OTHER,), to_all=True)(app, pilot)
        assert "Return: 1 of 2 vehicles (7)?" in "\n".join(shown(app))
        await pilot.press("y")
        await pilot.pause()

    assert play(story, GROUNDED).acted_on == [7]


def test_disarm_of_all_is_forced_only_in_the_air() -> None:
    landed = OTHER._replace(landed_state=1)
    feed = play(keys("D", "y", others=(landed,), to_all=True))
    assert dict(zip(feed.acted_on, [action.facts["force"] for action in feed.actions], strict=True)) == {
        1: True,
        7: False,
    }


@pytest.mark.parametrize("key", ["C", "O"])
def test_order_on_the_ground_asks_although_armed(key: str) -> None:
    assert asked(play(keys(key, "enter"), FULL._replace(landed_state=1))) == []


def test_set_home_asks_in_flight() -> None:
    assert asked(play(keys("O"))) == []
    assert asked(play(keys("O", "y"))) == ["set-home"]


def test_orders_are_in_the_command_palette() -> None:
    async def story(app: WatchApp, pilot: Pilot) -> None:
        await pilot.press("ctrl+p")
        await pilot.pause()
        await pilot.press(*"hold")
        await pilot.pause(0.5)
        await pilot.press("enter", "enter")
        await pilot.pause()

    assert asked(play(story)) == ["hold"]


def test_notices_become_toasts() -> None:
    async def story(app: WatchApp, pilot: Pilot) -> None:
        app.feed.notices.append(Notice("takeoff refused: no home position", Severity.ERROR))
        app.redraw()
        await pilot.pause()
        assert "no home position" in "\n".join(shown(app))

    play(story, size=(120, 40))


def test_keys_without_a_vehicle_do_nothing() -> None:
    async def story(_app: WatchApp, pilot: Pilot) -> None:
        await pilot.press("L", "H", "X", "y")
        await pilot.pause()

    assert asked(play(story, VehicleView())) == []


def test_a_lost_link_ends_the_application() -> None:
    async def story(app: WatchApp, pilot: Pilot) -> None:
        app.feed.error = OSError("gone")
        app.redraw()
        await pilot.pause()
        assert app.return_code == 1

    play(story)


def test_messages_are_filtered_by_severity_and_searched() -> None:
    async def story(app: WatchApp, pilot: Pilot) -> None:
        await pilot.press("5")
        await pilot.pause()
        assert "text number 7" in "\n".join(shown(app))
        await pilot.press("s", "s")
        await pilot.pause()
        text = "\n".join(shown(app))
        assert "warnings and worse: 5 of 8" in text
        assert "text number 5" not in text
        await pilot.press("slash", *"number 2")
        await pilot.pause()
        text = "\n".join(shown(app))
        assert "1 of 8" in text
        assert "text number 3" not in text
        await pilot.press("escape")
        await pilot.pause()
        assert "5 of 8" in "\n".join(shown(app))

    play(story)


def test_keys_of_orders_and_screens_are_unique() -> None:
    keys = [order.key for order in ORDERS] + [entry.key for entry in SCREENS]
    assert len(keys) == len(set(keys))
    assert all(order.key.isupper() for order in ORDERS)


def test_vehicles_are_listed_selected_and_commanded_together() -> None:
    async def story(app: WatchApp, pilot: Pilot) -> None:
        app.feed.others.append(OTHER)
        app.redraw()
        await pilot.pause()
        assert "v Vehicles" in shown(app)[-1]
        await pilot.press("v")
        await pilot.pause()
        assert "hexarotor  GUIDED" in "\n".join(shown(app))
        await pilot.press("end", "enter")
        await pilot.pause(2 / REDRAWS_HZ)
        assert app.feed.commands_all
        assert "COMMANDS TO ALL 2" in shown(app)[0]
        await pilot.press("v", "down", "enter")
        await pilot.pause()
        assert not app.feed.commands_all
        assert app.feed.view.identity.system_id == 7

    play(story, size=(120, 24))


def test_open_list_of_vehicles_shows_changes_and_keeps_the_selected_one() -> None:
    async def story(app: WatchApp, pilot: Pilot) -> None:
        app.feed.others.append(OTHER)
        app.redraw()
        await pilot.press("v", "down")
        app.feed.others[0] = OTHER._replace(mode="LAND")
        app.feed.others.append(FULL._replace(identity=Identity(9, 1, 2, 12), mode="RTL"))
        app.redraw()
        await pilot.pause()
        lines = "\n".join(shown(app))
        assert "hexarotor  LAND" in lines
        assert "quadrotor  RTL" in lines
        await pilot.press("enter")
        await pilot.pause()
        assert app.feed.view.identity.system_id == 7

    play(story, size=(120, 24))


def test_messages_say_that_there_are_none() -> None:
    async def story(app: WatchApp, pilot: Pilot) -> None:
        await pilot.press("5")
        app.redraw()
        await pilot.pause()
        assert shown(app)[2] == " no messages yet"

    play(story, FULL._replace(texts=()))


@pytest.mark.parametrize("size", [(80, 24), (120, 35), (200, 50)], ids=str)
@pytest.mark.parametrize(
    "entry", [entry for entry in SCREENS if entry.mode in ("fly", "messages")], ids=lambda entry: entry.mode
)
def test_screens_look_like_their_pictures(entry: ScreenEntry, size: tuple[int, int]) -> None:
    async def story(app: WatchApp, pilot: Pilot) -> None:
        app.feed.history = flown_history()
        await pilot.press(entry.key)
        await pilot.pause()
        app.redraws = 0
        app.redraw()
        await pilot.pause()
        check_picture(f"{entry.mode}-{size[0]}x{size[1]}", shown(app))

    play(story, size=size)
