"""Keys of ``gcs watch``: those typed ahead, and the line that shows them."""

from __future__ import annotations

import asyncio
import errno
import io
import threading
from typing import IO, cast

import pytest
from textual.app import App
from textual.drivers._writer_thread import WriterThread
from textual.events import Key, Paste
from textual.pilot import Pilot
from textual.widgets import Input

from gcs_cli.tui.app import WatchApp
from gcs_cli.tui.input import KeyQueue, LastingFile
from gcs_cli.tui.orders.form import Confirm, OrderForm
from tests.support.pilots import type_ahead
from tests.support.screens import shown
from tests.support.watch_plays import GROUNDED, asked, play

LONG_S = 60
"""Hang guard [s]."""


def test_keys_typed_ahead_reach_the_form_that_opens() -> None:
    async def story(_app: WatchApp, pilot: Pilot) -> None:
        await type_ahead(pilot, "T", "backspace", "1", "2", "enter")

    assert [action.facts for action in play(story, GROUNDED).actions] == [{"altitude_m": 12.0}]


def test_value_typed_ahead_after_a_refused_one_is_sent() -> None:
    async def story(_app: WatchApp, pilot: Pilot) -> None:
        await type_ahead(pilot, "T", *"x", "enter", "backspace", *"7", "enter")

    assert [action.facts for action in play(story, GROUNDED).actions] == [{"altitude_m": 7.0}]


@pytest.mark.parametrize("screen", ["5", "6"])
def test_words_typed_ahead_are_searched_and_command_nothing(screen: str) -> None:
    async def story(app: WatchApp, pilot: Pilot) -> None:
        await type_ahead(pilot, screen, "slash", *"LAY")
        assert app.screen.query_one("#search", Input).value == "LAY"

    assert asked(play(story)) == []


@pytest.mark.parametrize("typed", [("X", "y"), ("X", "left", "enter")])
def test_keys_typed_before_a_question_do_not_answer_it(typed: tuple[str, ...]) -> None:
    async def story(app: WatchApp, pilot: Pilot) -> None:
        await type_ahead(pilot, *typed)
        assert isinstance(app.screen, Confirm)
        await pilot.press("y")
        await pilot.pause()

    async def ahead(app: WatchApp, pilot: Pilot) -> None:
        await type_ahead(pilot, *typed)
        assert app.feed.actions == []

    assert asked(play(ahead)) == []
    assert asked(play(story)) == ["terminate"]


def test_pasted_text_waits_for_the_keys_before_it() -> None:
    async def story(app: WatchApp, pilot: Pilot) -> None:
        for event in (Key("6", "6"), Key("slash", "/"), Paste("LAY")):
            app.post_message(event)
        await pilot.pause()
        await pilot.pause()
        assert app.screen.query_one("#search", Input).value == "LAY"

    assert asked(play(story)) == []


def test_key_waits_for_a_slow_screen() -> None:
    async def story(app: WatchApp, pilot: Pilot) -> None:
        await type_ahead(pilot, "T")
        app.screen.call_later(asyncio.sleep, 2.0)
        await type_ahead(pilot, "enter", "S")
        await pilot.pause(3.0)
        assert isinstance(app.screen, OrderForm)

    assert [action.facts for action in play(story, GROUNDED).actions] == [{"altitude_m": 5.0}]


@pytest.mark.parametrize("width", [60, 80])
def test_keys_of_all_screens_are_shown_at_any_width(width: int) -> None:
    async def story(app: WatchApp, pilot: Pilot) -> None:
        await pilot.press("3")
        await pilot.pause()
        assert shown(app)[-1].endswith("^p Commands  q Quit  ? Keys")
        assert " … " in shown(app)[-1]
        await pilot.click("KeyBar", offset=(shown(app)[-1].index("? Keys"), 0))
        await pilot.pause()
        assert app.screen.query("HelpPanel")

    play(story, size=(width, 24))


@pytest.mark.parametrize("screen", ["1", "5"])  # Messages has an escape of its own
def test_escape_closes_the_panel_of_keys_before_it_does_anything_else(screen: str) -> None:
    async def story(app: WatchApp, pilot: Pilot) -> None:
        await pilot.press(screen, "question_mark", "escape")
        await pilot.pause()
        assert not app.screen.query("HelpPanel")
        assert not isinstance(app.screen, Confirm)

    play(story)


def test_escape_still_answers_a_question() -> None:
    async def story(app: WatchApp, pilot: Pilot) -> None:
        await pilot.press("X")
        await pilot.pause()
        assert isinstance(app.screen, Confirm)
        await pilot.press("escape")
        await pilot.pause()
        assert not isinstance(app.screen, Confirm)

    assert asked(play(story)) == []


def test_click_on_the_end_of_a_key_presses_that_key(monkeypatch: pytest.MonkeyPatch) -> None:
    pressed: list[str] = []

    async def story(app: WatchApp, pilot: Pilot) -> None:
        await pilot.press("3")
        await pilot.pause()
        monkeypatch.setattr(app, "simulate_key", pressed.append)
        await pilot.click("KeyBar", offset=(shown(app)[-1].index("  q Quit") - 1, 0))

    play(story)
    assert pressed == ["ctrl+p"]


def test_output_without_a_terminal_does_not_hold_up_the_program() -> None:
    class Gone(io.StringIO):
        def write(self, _text: str) -> int:
            raise OSError(errno.EIO, "the terminal is gone")

        def flush(self) -> None:
            raise OSError(errno.EIO, "the terminal is gone")

    lost: list[int] = []
    writer = WriterThread(cast(IO[str], LastingFile(Gone(), lambda: lost.append(0))))
    writer.start()

    def write() -> None:
        for _ in range(100):
            writer.write("text")
        writer.stop()

    program = threading.Thread(target=write, daemon=True)
    program.start()
    program.join(LONG_S)
    assert not program.is_alive()
    assert lost


def test_keys_that_are_left_when_the_view_ends_are_dropped() -> None:
    async def ended() -> None:
        app: App[None] = App()
        async with app.run_test():
            keys = KeyQueue(app, app.on_event)
        assert not app.screen_stack
        for key in "12":
            keys.put(Key(key, key))
        await keys.run()
        await keys.handled()

    asyncio.run(ended())
