"""Stories on the screen Mission of ``gcs watch``, with the mission of a vehicle that stands still in flight."""

from __future__ import annotations

from collections.abc import Awaitable, Callable

from textual.pilot import Pilot

from flightstack.plan import Command, Plan
from gcs_cli.tui.app import WatchApp
from gcs_cli.tui.map.scene import Place
from gcs_cli.tui.mission.rows import mission_table
from gcs_cli.tui.mission.screen import MissionScreen
from gcs_cli.vehicle.view_types import GeoPosition, Mission
from tests.support.map_views import HOME, VIEW, item
from tests.support.pilots import run_story
from tests.support.still_feed import StillFeed

ITEMS = (
    item(Command.NAV_TAKEOFF),
    item(Command.NAV_WAYPOINT, Place(20.0, 0.0), param1=2.0),
    item(Command.DO_CHANGE_SPEED, param1=1.0, param2=2.0),
    item(Command.NAV_WAYPOINT, Place(20.0, 30.0)),
    item(Command.NAV_RETURN_TO_LAUNCH),
)
TABLE = mission_table(Plan(ITEMS), HOME)
FLYING = VIEW._replace(
    armed=True,
    home=GeoPosition(*HOME[:3], 0.0),
    geo=GeoPosition(*HOME[:2], HOME.altitude_m + 10.0, 10.0),
    mission=Mission(current=1, total=5, reached=0),
)


def answer(app: WatchApp, value: object) -> None:
    """Set the result of the newest job, or its error."""
    future = app.feed.jobs[-1][1]
    if isinstance(value, Exception):
        future.set_exception(value)
    else:
        future.set_result(value)


def said(app: WatchApp) -> list[str]:
    """Return the messages."""
    return [entry.text for entry in app.feed.messages.since(0)]


def drive(
    story: Callable[[Pilot[None], WatchApp, MissionScreen], Awaitable[None]], size=(80, 24), view=FLYING
) -> None:
    app = WatchApp(StillFeed(view))

    async def begin(pilot: Pilot[None]) -> None:
        await pilot.press("3")
        await pilot.pause()
        screen = app.screen
        assert isinstance(screen, MissionScreen)
        for items in (ITEMS, (), ()):
            screen.show(view, 10.0)
            answer(app, items)
        screen.show(view, 10.0)
        await pilot.pause()
        await story(pilot, app, screen)

    run_story(app, begin, size=size)
