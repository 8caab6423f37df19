"""The screen Map, driven by keys and mouse."""

from __future__ import annotations

from collections.abc import Awaitable, Callable

import pytest
from textual.events import MouseScrollUp
from textual.pilot import Pilot

from flightstack.plan import FenceCommand, MissionItem
from gcs_cli.errors import FAILED, CliError
from gcs_cli.tui.app import WatchApp
from gcs_cli.tui.map.scene import Place, place_of
from gcs_cli.tui.map.screen import MapScreen
from gcs_cli.tui.orders.form import Confirm
from tests.support.map_views import FRAME, VIEW, item
from tests.support.pictures import check_picture
from tests.support.pilots import run_story
from tests.support.screens import shown
from tests.support.still_feed import StillFeed

MISSION = (item(22), item(16, Place(20.0, 0.0)), item(16, Place(20.0, 30.0)), item(20))
FENCE = (item(FenceCommand.CIRCLE_EXCLUSION, Place(-10.0, 20.0), param1=8.0),)
RALLY = (item(5100, Place(-15.0, -10.0)),)
FLYING = VIEW._replace(armed=True)
PLANS: tuple[tuple[MissionItem, ...], ...] = (MISSION, FENCE, RALLY)


def drive(
    story: Callable[[Pilot[None], WatchApp, MapScreen], Awaitable[None]], size=(80, 24), view=FLYING
) -> None:
    app = WatchApp(StillFeed(view))

    async def begin(pilot: Pilot[None]) -> None:
        await pilot.press("2")
        await pilot.pause()
        screen = app.screen
        assert isinstance(screen, MapScreen)
        for items in PLANS:
            app.redraws = 0
            screen.show(view, 10.0)
            if app.feed.jobs and not app.feed.jobs[-1][1].done():
                app.feed.jobs[-1][1].set_result(items)
        app.redraws = 0
        screen.show(view, 10.0)
        await pilot.pause()
        await story(pilot, app, screen)

    run_story(app, begin, size=size)


@pytest.mark.parametrize("size", [(80, 24), (120, 35), (200, 50)], ids=str)
def test_map_shows_the_plans_of_the_vehicle(size):
    async def story(_pilot, app, screen):
        lines = shown(app)
        text = "\n".join(lines[2:-2])
        assert all(mark in text for mark in "⌂◇◎↗12")
        assert "track" not in lines[-2]
        assert lines[-2].startswith("mission  keep out  ◇ rally  ⌂ home  ◎ setpoint")
        check_picture(f"map-{size[0]}x{size[1]}", lines[2:-1])

    drive(story, size)


def test_pan_zoom_fit_and_follow():
    async def story(pilot, _app, screen):
        whole = screen.map.view
        assert screen.map.cursor is None
        await pilot.press("right", "k", "k")
        moved = screen.map.view
        assert moved.east_m > whole.east_m
        assert moved.north_m > whole.north_m
        assert screen.map.cursor == (40, 10)
        await pilot.press("+", "+")
        assert screen.map.view.m_per_dot == pytest.approx(moved.m_per_dot / 2)
        await pilot.press("f")
        assert (screen.map.view.north_m, screen.map.view.east_m) == (0.0, 0.0)
        await pilot.press("-", "-", "a")
        assert screen.map.view == whole

    drive(story)


def test_followed_vehicle_stays_in_the_middle_part():
    async def story(pilot, _app, screen):
        await pilot.press("f")
        near, far = screen.map.scene.vehicle.place, Place(500.0, 0.0)
        screen.map.show_scene(screen.map.scene._replace(vehicle=screen.map.scene.vehicle._replace(place=far)))
        assert screen.map.view.shows(far, 0.4)
        assert not screen.map.view.shows(near)

    drive(story)


def test_wheel_zooms_around_the_mouse_and_drag_moves_the_map():
    async def story(pilot, _app, screen):
        before = screen.map.view
        place = before.cell_place(10, 5)
        await pilot._post_mouse_events([MouseScrollUp], screen.map, (10, 5))
        assert screen.map.view.m_per_dot < before.m_per_dot
        assert screen.map.view.cell_place(10, 5) == pytest.approx(place)
        await pilot.mouse_down(screen.map, (10, 5))
        await pilot.hover(screen.map, (20, 8))
        await pilot.mouse_up(screen.map, (20, 8))
        assert screen.map.view.cell_place(20, 8) == pytest.approx(place)
        assert not isinstance(pilot.app.screen, Confirm)

    drive(story)


@pytest.mark.parametrize("answer", ["y", "enter", "escape"])
def test_click_asks_before_the_vehicle_is_sent(answer):
    async def story(pilot, app, screen):
        await pilot.click(screen.map, (10, 5))
        await pilot.pause()
        assert isinstance(app.screen, Confirm)
        assert not app.feed.actions
        await pilot.press(answer)
        await pilot.pause()
        assert [action.name for action in app.feed.actions] == ["goto"] * (answer == "y")

    drive(story)


def test_disarmed_vehicle_is_not_sent_and_the_footer_has_no_key_for_it():
    async def story(pilot, app, screen):
        app.feed.shown = VIEW
        app.redraw()
        await pilot.pause()
        assert "Go here" not in shown(app)[-1]
        await pilot.click(screen.map, (10, 5))
        await pilot.press("h", "g", "G", "Y")
        await pilot.pause()
        assert app.screen is screen
        said = [notice.message for notice in app._notifications]
        assert said == ["the vehicle is disarmed: take off first"]

    drive(story)


def test_vehicle_is_sent_to_the_place_under_the_cursor():
    async def story(pilot, app, screen):
        await pilot.press("h", "g", "y")
        await pilot.pause()
        (action,) = app.feed.actions
        place = place_of(FRAME, action.facts["latitude_deg"], action.facts["longitude_deg"])
        assert place == pytest.approx(screen.map.cursor_place, abs=1e-6)
        assert action.facts["altitude_m"] is None

    drive(story)


def test_go_there_needs_a_place():
    async def story(pilot, app, _screen):
        await pilot.press("g")
        await pilot.pause()
        assert [note.message for note in app._notifications] == ["move the map or the mouse to a place"]
        assert not isinstance(app.screen, Confirm)

    drive(story)


def test_failed_download_is_shown_below_the_map():
    async def story(pilot, app, screen):
        await pilot.press("u")
        app.redraws = 0
        screen.show(VIEW, 10.0)
        app.feed.jobs[-1][1].set_exception(CliError("download of the mission: no answer", FAILED))
        for _ in range(3):
            app.redraws = 0
            screen.show(VIEW, 10.0)
            if not app.feed.jobs[-1][1].done():
                app.feed.jobs[-1][1].set_result(())
        app.redraws = 0
        screen.show(VIEW, 10.0)
        await pilot.pause()
        assert shown(app)[-2].startswith("download of the mission: no answer")

    drive(story)
