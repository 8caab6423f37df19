"""The application of ``gcs watch``, driven by keys."""

from __future__ import annotations

import asyncio

import pytest

from gcs_cli.tui.app import WatchApp
from gcs_cli.tui.screens import SCREENS
from tests.support.screens import shown
from tests.support.still_feed import StillFeed
from tests.support.watch_states import FULL


@pytest.mark.parametrize("entry", SCREENS, ids=lambda entry: entry.mode)
def test_a_digit_opens_a_screen(entry: object) -> None:
    async def run() -> None:
        app = WatchApp(StillFeed(FULL))
        async with app.run_test() as pilot:
            await pilot.press(entry.key)
            await pilot.pause()
            assert app.current_mode == entry.mode
            assert f"{entry.key} {entry.title}" in shown(app)[1]
            assert shown(app)[-1].endswith("q Quit")

    asyncio.run(run())


@pytest.mark.parametrize("entry", SCREENS, ids=lambda entry: entry.mode)
@pytest.mark.parametrize("size", [(20, 5), (80, 24), (200, 50)], ids=str)
def test_every_screen_survives_any_size(entry: object, size: tuple[int, int]) -> None:
    async def run() -> None:
        app = WatchApp(StillFeed(FULL))
        async with app.run_test(size=size) as pilot:
            await pilot.press(entry.key)
            await pilot.resize_terminal(20, 5)
            await pilot.resize_terminal(*size)
            await pilot.pause()
            assert len(shown(app)) == size[1]

    asyncio.run(run())
