"""Input of the user: the driver of the terminal, and the queue that handles one event after the other."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Awaitable, Callable
from io import TextIOWrapper
from typing import IO, Any, TypeAlias, cast

from textual.app import App, ScreenStackError
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
        """Handle events until cancelled, or until the application has ended and its screens are gone."""
        while True:
            event, seen = await self._events.get()
            try:
                await self._take(event, seen)
            except ScreenStackError:
                if self._app.screen_stack:
                    raise
                self._drop_rest()
                return
            finally:
                self._events.task_done()

    def _drop_rest(self) -> None:
        while not self._events.empty():
            self._events.get_nowait()
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
        node: DOMNode | None = self._app.focused or self._app.screen
        while node is not None:
            handled = asyncio.Event()
            if node.call_later(handled.set):
                while not handled.is_set() and node.is_running:
                    with contextlib.suppress(TimeoutError):
                        await asyncio.wait_for(handled.wait(), _CHECK_S)
            node = node.parent if isinstance(node.parent, DOMNode) else None
        await asyncio.sleep(0)  # an action that asks begins as a task


class LastingFile:
    """A file whose writing has no effect once it fails: a terminal that was closed, or whose connection ended.

    The thread that writes for Textual ends at an error, and the program then waits forever for room in its queue.
    ``on_lost`` is called at each failure.
    """

    def __init__(self, file: IO[str], on_lost: Callable[[], object]) -> None:
        self._file, self._on_lost = file, on_lost

    def write(self, text: str) -> int:
        """Write ``text`` as far as that is possible."""
        self._try(lambda: self._file.write(text))
        return len(text)

    def flush(self) -> None:
        """Flush as far as that is possible."""
        self._try(self._file.flush)

    def fileno(self) -> int:
        """Return the descriptor."""
        return self._file.fileno()

    def _try(self, call: Callable[[], object]) -> None:
        try:
            call()
        except BlockingIOError:  # a terminal that another program made non-blocking, and is slow
            pass
        except OSError:
            self._on_lost()


class TerminalDriver(LinuxDriver):
    """Ends also without its terminal, and leaves the application mode before it enters it again.

    SIGSTOP and a stop by the shell call no handler. Textual starts a second thread that reads the keys when the process
    continues, and the end of the program waits for the first one until another key is pressed.
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._file = cast(TextIOWrapper, LastingFile(cast(IO[str], self._file), self._end))

    def _end(self) -> None:
        self._app.call_later(self._app.exit)

    def _sigcont_application(self, *arguments: object) -> None:
        if self._auto_restart and not self._must_signal_resume:
            self.suspend_application_mode()
            self._must_signal_resume = True
        super()._sigcont_application(*arguments)
