"""Stories with the application of ``gcs watch``, of a vehicle whose values stand still."""

from __future__ import annotations

from collections.abc import Awaitable, Callable

from textual.pilot import Pilot

from gcs_cli.tui.app import WatchApp
from gcs_cli.vehicle.view_types import VehicleView
from tests.support.pilots import run_story
from tests.support.still_feed import StillFeed
from tests.support.watch_states import FULL

GROUNDED = FULL._replace(armed=False, landed_state=1)
Story = Callable[[WatchApp, Pilot], Awaitable[None]]


def play(story: Story, view: VehicleView = FULL, size: tuple[int, int] = (80, 24)) -> StillFeed:
    """Run the application with ``story``; return its feed."""
    feed = StillFeed(view)

    app = WatchApp(feed)

    async def begin(pilot: Pilot[None]) -> None:
        await pilot.pause()
        await story(app, pilot)

    run_story(app, begin, size=size, notifications=True)
    return feed


def asked(feed: StillFeed) -> list[str]:
    """Return the names of the actions that were asked for."""
    return [action.name for action in feed.actions]
