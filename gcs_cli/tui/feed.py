"""The link beside the screens: a thread runs the connection, screens read immutable states and send jobs."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from typing import Any, NamedTuple, TypeVar

from flightstack.core.enums import Severity
from flightstack.mavlink.link import Message
from gcs_cli.actions.action import Action
from gcs_cli.actions.run import ActionRun, Outcome, Result
from gcs_cli.errors import CliError
from gcs_cli.link.connection import Connection
from gcs_cli.link.session import Session
from gcs_cli.link.subscription import ROTORS_AND_TIMING
from gcs_cli.tui.fly.history import History
from gcs_cli.tui.map.traffic import MESSAGES as TRAFFIC_MESSAGES
from gcs_cli.tui.map.traffic import Traffic
from gcs_cli.tui.messages.message_log import MessageLog
from gcs_cli.vehicle.view_types import VehicleView

Value = TypeVar("Value")

GATHER_S = 0.1
"""Messages are received in batches of this time: a wake-up costs several messages. A job or an action of the
user ends the wait; no batches while the answer that measures the round trip is awaited, or others use the link."""
_STEP_S = 0.05


class Notice(NamedTuple):
    """A line to show for a moment: the progress or the end of an action."""

    text: str
    severity: int


class _Running(NamedTuple):
    session: Session
    run: ActionRun
    is_announced: bool = False


class _Job(NamedTuple):
    run: Callable[[Connection], Any]
    future: Future[Any]
    ends_in_order: bool


class Feed:
    """Runs ``connection`` in a thread between ``start`` and ``stop``.

    Only this thread uses the connection: a screen that exchanges messages gives a job to ``submit``, and an action to
    ``act``.
    """

    def __init__(self, connection: Connection) -> None:
        self.connection = connection
        self.history = History()
        self.traffic = Traffic()
        self.messages = MessageLog()
        self.notices: deque[Notice] = deque(maxlen=20)
        """Lines for the user, which the application takes."""
        self.commands_all = False
        """True if actions go to all vehicles."""
        self.error: Exception | None = None
        """Error that ended the thread."""
        self._jobs: deque[_Job] = deque()
        self._job: _Job | None = None
        self._calls: deque[Callable[[], None]] = deque()
        """Short calls that run between two steps of the link, during a job too."""
        self._running: dict[int, _Running] = {}
        self.rates_hz: dict[int, float] = dict(ROTORS_AND_TIMING)
        self._is_stopping = False
        self._shown: tuple[VehicleView, tuple[VehicleView, ...]] = (VehicleView(), ())
        """State of the selected vehicle, and of all, after the last step of the link."""
        self._wake = threading.Event()
        """Ends the wait for a batch."""
        self._thread: threading.Thread | None = None

    @property
    def view(self) -> VehicleView:
        """State of the selected vehicle after the last step of the link."""
        return self._shown[0]

    @property
    def views(self) -> tuple[VehicleView, ...]:
        """States of all vehicles on the link after its last step, by system id."""
        return self._shown[1]

    @property
    def targets(self) -> tuple[VehicleView, ...]:
        """States of the vehicles that actions go to: the selected one, or all."""
        view = self.view
        return self.views if self.commands_all else () if view.identity is None else (view,)

    @property
    def now_s(self) -> float:
        """Clock of the connection [s]."""
        return self.connection.now_s

    @property
    def link_name(self) -> str:
        """Address of the link."""
        return str(self.connection.endpoint)

    def start(self) -> None:
        """Start to receive."""
        self.connection.fleet.observe = self._observe
        self.connection.on_step = self._serve
        self.connection.fleet.subscribe(self.rates_hz)
        self.connection.fleet.keep()
        self._show()
        self._thread = threading.Thread(target=self._run, name="link", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the thread: the current job fails at its next step, unless it ends in order; others are cancelled."""
        self._is_stopping = True
        self._wake.set()
        if self._thread is not None:
            self._thread.join()

    @property
    def is_stopping(self) -> bool:
        """True if the current job has to end."""
        return self._is_stopping

    def submit(
        self, job: Callable[[Connection], Value], system_id: int | None = None, *, ends_in_order: bool = False
    ) -> Future[Value]:
        """Run ``job`` in the thread of the link; messages are received while it waits on the connection.

        With ``system_id`` it fails with CliError if another vehicle is selected when it begins. The selection changes
        only between jobs. With ``ends_in_order`` it continues after ``stop``, for example until an interrupted upload
        has restored the former plans.
        """
        future: Future[Value] = Future()
        self._jobs.append(_Job(partial(_run_on, system_id, job), future, ends_in_order))
        self._wake.set()
        return future

    def select(self, system_id: int | None) -> None:
        """Show and command the vehicle with this system id; None: command all."""
        self.commands_all = system_id is None
        if system_id is not None:
            self.submit(lambda connection: connection.fleet.select(system_id))

    def act(self, action: Action, system_id: int) -> None:
        """Perform ``action`` on a vehicle, selected or not.

        It does not wait for jobs. The answer and the effect become notices and messages. A new action ends the wait
        for the effect of the former one.
        """
        self._calls.append(partial(self._begin, action, system_id))
        self._wake.set()

    def tell(self, text: str, severity: Severity = Severity.NOTICE) -> None:
        """Show a line for a moment, and keep it among the messages."""
        self.notices.append(Notice(text, severity))
        self._calls.append(lambda: self.messages.say(self.view, text, severity))

    def keep_rate(self, message_id: int, rate_hz: float | None) -> None:
        """Request a stream of the screens at this rate from now on; not at all if it is 0, or None for the default."""
        if message_id not in self.rates_hz:
            return
        rates = {number: rate for number, rate in self.rates_hz.items() if number != message_id}
        self.rates_hz = {**rates, message_id: rate_hz} if rate_hz else rates
        self.submit(lambda connection: connection.fleet.subscribe(self.rates_hz))

    def _observe(self, message: Message, now_s: float) -> None:
        self.history.record(message, now_s)
        if message.get_msgId() in TRAFFIC_MESSAGES:
            self._observe_traffic(message, now_s)

    def _observe_traffic(self, message: Message, now_s: float) -> None:
        view = self.connection.session.view
        self.traffic.record(message, now_s, casts_parameters=view.autopilot.casts_parameters)
        if view.identity is not None and view.identity.system_id == message.get_srcSystem():
            request = self.traffic.own_address_request(message, now_s)
            if request is not None and not self.connection.is_recording:
                self.connection.send(request)

    def _run(self) -> None:
        try:
            while not self.is_stopping:
                self._wake.wait(self._pause_s())
                self._wake.clear()
                while self._jobs and not self.is_stopping:
                    self._execute(self._jobs.popleft())
                self.connection.step(self.now_s + _STEP_S)
        except Exception as error:
            self.error = error
        finally:
            while self._jobs:
                self._jobs.popleft().future.cancel()

    def _pause_s(self) -> float:
        connection = self.connection
        is_urgent = connection.serves_others or connection.session.awaits_round_trip(self.now_s)
        return 0.0 if is_urgent else GATHER_S

    def _serve(self) -> None:
        """Begin the actions, and follow the messages and the effects; after every step of the link, in jobs too.

        Raise CliError in a job that has to end.
        """
        self._show()
        while self._calls:
            self._calls.popleft()()
        for view in self.views:
            self.messages.follow(view)
        for system_id in list(self._running):
            self._follow(system_id)
        if self.is_stopping and self._job is not None and not self._job.ends_in_order:
            raise CliError("interrupted")

    def _show(self) -> None:
        """Build the views that the screens read."""
        sessions = self.connection.fleet.sessions.values()
        views = sorted((session.view for session in sessions), key=lambda view: view.identity or ())
        self._shown = self.connection.session.view, tuple(views)

    def _execute(self, job: _Job) -> None:
        if not job.future.set_running_or_notify_cancel():
            return
        self._job = job
        try:
            job.future.set_result(job.run(self.connection))
        except Exception as error:
            job.future.set_exception(error)
        finally:
            self._job = None

    def _begin(self, action: Action, system_id: int) -> None:
        session = self.connection.fleet.sessions[system_id]
        if self.connection.is_recording:
            self._say(session, f"{action.name}: a recording takes no commands", Severity.WARNING)
            return
        former = self._running.pop(system_id, None)
        if former is not None:
            session.detach(former.run)
            self._say(session, f"{former.run.action.name}: no longer followed", Severity.NOTICE)
        run = ActionRun(action, lambda: session.view, self.now_s, session.own)
        session.attach(run)
        self._running[system_id] = _Running(session, run)

    def _follow(self, system_id: int) -> None:
        """Report the answer of the vehicle, then the effect."""
        session, run, is_announced = self._running[system_id]
        if run.result is not None:
            del self._running[system_id]
            session.detach(run)
            self._say(session, result_text(run.action, run.result), severity_of(run.result))
        elif run.acknowledged and not is_announced:
            self._running[system_id] = _Running(session, run, is_announced=True)
            self._say(session, f"accepted: {run.action.doing}", Severity.NOTICE)

    def _say(self, session: Session, text: str, severity: Severity) -> None:
        self.messages.say(session.view, text, severity)
        several = len(self.views) > 1
        self.notices.append(Notice(f"{session.target[0]}: {text}" if several else text, severity))


def _run_on(system_id: int | None, job: Callable[[Connection], Value], connection: Connection) -> Value:
    if system_id not in (None, connection.session.target[0]):
        raise CliError(f"vehicle {system_id} is no longer selected: select it with v")
    return job(connection)


def result_text(action: Action, result: Result) -> str:
    """Return how an action ended, and when its effect was seen."""
    if result.outcome is Outcome.DONE:
        return f"{result.sentence} after {result.elapsed_s:.1f} s"
    return result.sentence


def severity_of(result: Result) -> Severity:
    """Return the severity of the end of an action."""
    if result.ok:
        return Severity.NOTICE
    return Severity.WARNING if result.outcome is Outcome.ENDED else Severity.ERROR
