"""The link beside the screens: a thread runs the connection, screens read immutable states and send jobs."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

from flightstack.mavlink.link import Message
from gcs_cli.link.connection import Connection
from gcs_cli.link.subscription import ROTORS_AND_TIMING
from gcs_cli.tui.history import History
from gcs_cli.tui.message_log import MessageLog
from gcs_cli.vehicle.view_types import VehicleView

Result = TypeVar("Result")

GATHER_S = 0.02
"""Messages are received in batches of this time, except during a job: one wake-up costs as much as one message."""
_STEP_S = 0.05


class Feed:
    """Runs ``connection`` in a thread between ``start`` and ``stop``.

    Only this thread uses the connection: a screen that exchanges messages gives a job to ``submit``.
    """

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self.history = History()
        self.messages = MessageLog()
        self.error: Exception | None = None
        """Error that ended the thread."""
        self._jobs: deque[tuple[Callable[[Connection], Any], Future[Any]]] = deque()
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None

    @property
    def view(self) -> VehicleView:
        """State of the selected vehicle."""
        return self._connection.session.view

    @property
    def views(self) -> tuple[VehicleView, ...]:
        """States of all vehicles on the link, by system id."""
        return (self.view,) if self.view.identity is not None else ()

    @property
    def now_s(self) -> float:
        """Clock of the connection [s]."""
        return self._connection.now_s

    @property
    def link_name(self) -> str:
        """Address of the link."""
        return str(self._connection.endpoint)

    def start(self) -> None:
        """Start to receive."""
        session = self._connection.session
        session.observe = self._observe
        session.subscribe(ROTORS_AND_TIMING)
        self._thread = threading.Thread(target=self._run, name="link", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the thread; pending jobs are cancelled."""
        self._stopping.set()
        if self._thread is not None:
            self._thread.join()

    def submit(self, job: Callable[[Connection], Result]) -> Future[Result]:
        """Run ``job`` in the thread of the link; messages are received while it waits on the connection."""
        future: Future[Result] = Future()
        self._jobs.append((job, future))
        return future

    def _observe(self, message: Message) -> None:
        self.history.record(message, self.now_s)

    def _run(self) -> None:
        try:
            while not self._stopping.wait(GATHER_S):
                while self._jobs:
                    self._execute(*self._jobs.popleft())
                self._connection.step(self.now_s + _STEP_S)
                for view in self.views:
                    self.messages.follow(view)
        except Exception as error:
            self.error = error
        finally:
            while self._jobs:
                self._jobs.popleft()[1].cancel()

    def _execute(self, job: Callable[[Connection], Any], future: Future[Any]) -> None:
        if not future.set_running_or_notify_cancel():
            return
        try:
            future.set_result(job(self._connection))
        except Exception as error:
            future.set_exception(error)
        finally:
            self._connection.session.subscribe(ROTORS_AND_TIMING)
