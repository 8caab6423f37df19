"""Input of the user: the driver of the terminal, and the queue that handles one event after the other."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Awaitable, Callable
from typing import Any, TypeAlias

from textual.app import App
from textual.dom import DOMNode
from textual.drivers.linux_driver import LinuxDriver
from textual.events import InputEvent, Key, MouseUp, Paste

from gcs_cli.tui.orders.form import Confirm

_ROUNDS = 2
"""A key is handled in the first round; a message of the widget, such as the end of an input, in the second."""
_CHECK_S = 0.5
"""Interval of the check for a widget that was removed meanwhile: it never answers."""

UserEvent: TypeAlias = InputEvent | Paste


class KeyQueue:
    """Keeps each event until the effect of the one before; a question takes no event from before it was there.

    Textual gives a key to the widget that has the focus when the key arrives, and calls the bindings later. So keys
    that follow ``/`` closely would not reach the search field that it opens: they would command the vehicle.
    """

    def __init__(self, app: App[Any], handle: Callable[[UserEvent], Awaitable[None]]) -> None:
        self._app = app
        self._handle = handle
        self._events: asyncio.Queue[tuple[UserEvent, DOMNode | None]] = asyncio.Queue()

    def put(self, event: UserEvent) -> None:
        """Handle ``event`` after the former ones."""
        self._events.put_nowait((event, self._screen))

    @property
    def _screen(self) -> DOMNode | None:
        """The screen in front, once it is mounted."""
        screen = self._app.screen if self._app.screen_stack else None
        return screen if screen is not None and screen.is_mounted else None

    async def run(self) -> None:
        """Handle events until cancelled."""
        while True:
            await self._take(*await self._events.get())
            self._events.task_done()

    async def handled(self) -> None:
        """Wait until each event so far has had its effect."""
        await self._events.join()

    async def _take(self, event: UserEvent, seen: DOMNode | None) -> None:
        screen = self._app.screen if self._app.screen_stack else None
        if isinstance(screen, Confirm) and screen is not seen:
            return
        await self._handle(event)
        if isinstance(event, Key | Paste | MouseUp):
            for _ in range(_ROUNDS):
                await self._settle()

    async def _settle(self) -> None:
        """Wait until the focused widget, those around it and the application have handled their messages."""
        node: DOMNode | None = self._app.focused or (self._app.screen if self._app.screen_stack else None)
        while node is not None:
            handled = asyncio.Event()
            if node.call_later(handled.set):
                while not handled.is_set() and node.is_running:
                    with contextlib.suppress(TimeoutError):
                        await asyncio.wait_for(handled.wait(), _CHECK_S)
            node = node.parent if isinstance(node.parent, DOMNode) else None
        await asyncio.sleep(0)  # an action that asks begins as a task


class TerminalDriver(LinuxDriver):
    """Leaves the application mode before it enters it again.

    SIGSTOP and a stop by the shell call no handler. Textual starts a second thread that reads the keys when the process
    continues, and the end of the program waits for the first one until another key is pressed.
    """

    def _sigcont_application(self, *arguments: object) -> None:
        if self._auto_restart and not self._must_signal_resume:
            self.suspend_application_mode()
            self._must_signal_resume = True
        super()._sigcont_application(*arguments)
