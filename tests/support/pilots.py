"""Stories with applications on Textual that wait for no clock."""

from __future__ import annotations

import asyncio
import selectors
from collections.abc import Awaitable, Callable, Mapping, Sequence
from typing import Any
from unittest import mock

import textual.css.stylesheet
from textual.app import App
from textual.css.model import RuleSet
from textual.css.parse import parse
from textual.css.tokenizer import Token
from textual.events import Key
from textual.pilot import Pilot

from gcs_cli.tui.app import WatchApp


class _SkippingSelector(selectors.DefaultSelector):
    """A selector that skips the time until the next timer instead of waiting for it."""

    def __init__(self) -> None:
        super().__init__()
        self.skipped_s = 0.0

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        if timeout is None:  # no timer runs: another thread is awaited
            return super().select(None)
        events = super().select(0)
        if not events:
            self.skipped_s += max(timeout, 0.0)
        return events


class _SkippingLoop(asyncio.SelectorEventLoop):
    def __init__(self) -> None:
        self._skipping = _SkippingSelector()
        super().__init__(self._skipping)

    def time(self) -> float:
        return super().time() + self._skipping.skipped_s


_rules: dict[tuple[Any, ...], list[RuleSet]] = {}
"""Rules of style sheets, by text and variables."""


def _parse_once(*given: Any, variable_tokens: Mapping[str, Sequence[Token]], **options: Any) -> list[RuleSet]:
    """Parse a style sheet, or return the rules that an application before had from the same text."""
    variables = tuple((name, *tokens) for name, tokens in variable_tokens.items())
    key = (*given, *options.items(), variables)
    if key not in _rules:
        _rules[key] = list(parse(*given, variable_tokens=variable_tokens, **options))  # type: ignore[arg-type]
    return _rules[key]


def run_story(
    app: App[Any],
    story: Callable[[Pilot[None]], Awaitable[None]],
    size: tuple[int, int] = (80, 24),
    **options: Any,
) -> None:
    """Run ``app`` on an event loop whose timers take no time, and drive it by ``story``.

    Textual's pilot waits at least 20 ms three times for each key; a story has twenty keys. Its style sheets are parsed
    three times at each start, a quarter of the CPU time of a story.
    """

    async def run() -> None:
        async with app.run_test(size=size, **options) as pilot:
            await story(pilot)

    with (
        mock.patch.object(textual.css.stylesheet, "parse", _parse_once),
        asyncio.Runner(loop_factory=_SkippingLoop) as runner,
    ):
        runner.run(run())


async def type_ahead(pilot: Pilot[None], *keys: str) -> None:
    """Press keys of ``gcs watch`` without waiting for their effects in between."""
    assert isinstance(pilot.app, WatchApp)
    for key in keys:
        pilot.app.post_message(Key(key, key if len(key) == 1 else None))
    await pilot.pause()
    await pilot.app.keys.handled()
    await pilot.pause()
