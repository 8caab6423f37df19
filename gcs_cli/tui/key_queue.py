"""Keys of the user, handled one after the other."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

from textual.app import App
from textual.dom import DOMNode
from textual.events import Key

_ROUNDS = 2
"""A key is handled in the first round; a message of the widget, such as the end of an input, in the second."""
_LOST_S = 0.5
"""A widget that is removed meanwhile never answers."""


class KeyQueue:
    """Keeps each key until the effect of the one before.

    Textual gives a key to the widget that has the focus when the key arrives, and calls the bindings later. So keys
    that follow ``/`` closely would not reach the search field that it opens: they would command the vehicle.
    """

    def __init__(self, app: App[Any], handle: Callable[[Key], Awaitable[None]]) -> None:
        self._app = app
        self._handle = handle
        self._keys: asyncio.Queue[Key] = asyncio.Queue()

    def put(self, key: Key) -> None:
        """Handle ``key`` after the former ones."""
        self._keys.put_nowait(key)

    async def run(self) -> None:
        """Handle keys until cancelled."""
        while True:
            await self._handle(await self._keys.get())
            for _ in range(_ROUNDS):
                await self._settle()

    async def _settle(self) -> None:
        """Wait until the focused widget, those around it and the application have handled their messages."""
        node: DOMNode | None = self._app.focused or (self._app.screen if self._app.screen_stack else None)
        while node is not None:
            handled = asyncio.Event()
            if node.call_later(handled.set):
                try:
                    await asyncio.wait_for(handled.wait(), _LOST_S)
                except TimeoutError:
                    return
            node = node.parent if isinstance(node.parent, DOMNode) else None
        await asyncio.sleep(0)  # an action that asks begins as a task
