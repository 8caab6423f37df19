"""The ground station's side of one flight, sans-IO: connect, upload, arm, start, fly, shut down.

Call ``step`` after each message and deadline. No step relies on a single message: at many times real time telemetry
is sparse, and any datagram may be lost.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from pathlib import Path
from typing import NamedTuple

from flightstack.plan import Plan
from gcs_cli.errors import FAILED, NO_ANSWER
from gcs_cli.fly.flight_watch import STALL_S, Watch, no_state, no_vehicle
from gcs_cli.link import calls
from gcs_cli.link.calls import Answer, Call
from gcs_cli.link.session import Session
from gcs_cli.link.subscription import LOOP_TIMING
from gcs_cli.report.flight_outcome import Code, Outcome, ends_in_air, outcome_of, too_late
from gcs_cli.transfers.plan_parts import Uploads
from gcs_cli.vehicle.view_types import VehicleView

READY_PAUSE_S = 0.02
"""Pause between two requests for the vehicle's state before arming."""
SHUT_DOWN_TIMEOUT_S = 3.0
_FACTOR_NEEDS_S = 0.05
_IN_AIR = 2  # MAV_LANDED_STATE


class Phase(Enum):
    """Phase of a flight; the value is its description."""

    CONNECT = "waiting for the vehicle"
    UPLOAD = "uploading the plan"
    READY = "waiting until the vehicle is ready"
    ARM = "arming"
    START = "starting the mission"
    FLY = "flying"
    CONFIRM = "requesting the result of the mission"
    SHUT_DOWN = "shutting the vehicle down"
    OVER = "flight completed"


class Flown(NamedTuple):
    """A completed or aborted flight."""

    folder: Path
    outcome: Outcome
    wall_time_s: float | None
    overruns: int | None
    returned_by_us: bool


class Flight:
    """Flies ``plan`` on the vehicle of ``session``."""

    def __init__(
        self,
        session: Session,
        plan: Plan,
        now_s: float,
        connect_s: float,
        limit_s: float,
        stall_s: float = STALL_S,
    ) -> None:
        self.phase = Phase.CONNECT
        self.outcome: Outcome | None = None
        self.began_s: float | None = None
        self.ended_s: float | None = None
        self.returned_by_us = False
        self.shut_down_accepted = False
        self._session = session
        self._items = plan.items
        self._uploads = Uploads(session, plan, restores=False)  # the vehicle starts without plans
        self._ends_in_air = ends_in_air(plan.items)
        self._connect_s = connect_s
        self._connect_due_s = now_s + connect_s
        self._limit_s = limit_s
        self._call: Call | None = None
        self._next_request_s: float | None = None
        self._requests: list[calls.Command] = []
        self._start_time_s: float | None = None
        self._watch = Watch(stall_s, connect_s)
        self._phase_due_s = 0.0

    @property
    def view(self) -> VehicleView:
        """State of the vehicle."""
        return self._session.view

    @property
    def is_over(self) -> bool:
        """True after the end of the flight."""
        return self.phase is Phase.OVER

    @property
    def flown_s(self) -> float | None:
        """Simulated time since the start of the mission."""
        if self._start_time_s is None or self.view.time_s is None:
            return None
        return self.view.time_s - self._start_time_s

    @property
    def real_time_factor(self) -> float | None:
        """Ratio of simulated to wall time since the start of the mission; None if unknown."""
        if self.began_s is None or self.flown_s is None or self.view.link.last_received_s is None:
            return None
        wall_s = self.view.link.last_received_s - self.began_s
        return self.flown_s / wall_s if wall_s > _FACTOR_NEEDS_S else None

    @property
    def upload_progress(self) -> tuple[int, int]:
        """Uploaded items and their total."""
        return self._uploads.progress

    def abort(self, outcome: Outcome, now_s: float, vehicle_is_gone: bool = False) -> None:
        """End the flight with ``outcome``; shut the vehicle down unless it is gone."""
        if self.outcome is None:
            self._end(outcome, now_s, vehicle_is_gone)

    def step(self, now_s: float) -> None:
        """Advance the flight as far as possible."""
        before = None
        while before is not self.phase and not self.is_over:
            before = self.phase
            if self.outcome is None and self.phase is not Phase.CONNECT:
                self._watch_vehicle(now_s)
            _STEPS[self.phase](self, now_s)

    def _watch_vehicle(self, now_s: float) -> None:
        at = "" if self.view.time_s is None else f" at t = {self.view.time_s:.1f} s"
        if self.view.powered_off:
            reason = f"the flight stack shut down{at} while {self.phase.value}"
            self._end(Outcome(Code.PROCESS_ENDED, reason), now_s)
            return
        lost = self._watch.loss(self.view.silent_s(now_s), self.view.time_s, self.phase.value)
        if lost is not None:
            self._end(Outcome(Code.VEHICLE_LOST, lost), now_s)

    # -- phases

    def _connect(self, now_s: float) -> None:
        if self.view.identity is not None:
            self.phase = Phase.UPLOAD
        elif now_s >= self._connect_due_s:
            self._end(Outcome(Code.NO_VEHICLE, no_vehicle(self._connect_s), NO_ANSWER), now_s)

    def _upload(self, now_s: float) -> None:
        if self._accepted(
            self._uploads.answer(now_s), f"the vehicle refused the {self._uploads.name}: ", now_s
        ):
            self._command(calls.REQUEST_SYS_STATUS, now_s)
            self.phase = Phase.READY

    def _ready(self, now_s: float) -> None:
        """Wait for the simulator's first state; request it, because telemetry may start with simulated time."""
        if self.view.healthy:
            self._command(calls.ARM, now_s)
            self.phase = Phase.ARM
        elif now_s >= self._connect_due_s:
            self._end(Outcome(Code.NO_VEHICLE, no_state(self._connect_s), NO_ANSWER), now_s)
        elif self._next_request_s is not None:
            if now_s >= self._next_request_s:
                self._next_request_s = None
                self._command(calls.REQUEST_SYS_STATUS, now_s)
        elif self._call is None or self._call.answer(now_s) is not None:
            self._next_request_s = now_s + READY_PAUSE_S

    def _arm(self, now_s: float) -> None:
        if self._answered("the vehicle refused to arm: ", now_s):
            self._start_time_s = self.view.time_s or 0.0
            self._command(calls.START_MISSION, now_s)
            self.phase = Phase.START

    def _start(self, now_s: float) -> None:
        if self._answered("the vehicle refused to start the mission: ", now_s):
            self.began_s = now_s
            self._session.subscribe(LOOP_TIMING)
            self._watch.begin(self._start_time_s, now_s)
            self.phase = Phase.FLY

    def _fly(self, now_s: float) -> None:
        view = self.view
        stall = self._watch.stall(view.time_s, now_s)
        heard_since_start = self.began_s is not None and (view.last_heartbeat_s or 0.0) > self.began_s
        if heard_since_start and not view.armed:
            self.ended_s = now_s
            self._requests = [calls.REQUEST_LOOP_TIMING, calls.REQUEST_MISSION_CURRENT]
            self._call = None
            self.phase = Phase.CONFIRM
        elif (self.flown_s or 0.0) > self._limit_s:
            self._end(too_late(view, self._items, self._limit_s), now_s)
        elif stall is not None:
            self._end(Outcome(Code.STALLED, stall), now_s)
        elif self._ends_in_air and view.mission.complete and view.mode == "HOLD" and not self.returned_by_us:
            self.returned_by_us = True
            self._command(calls.RETURN, now_s)
        elif self.returned_by_us and view.landed_state == _IN_AIR:
            self._answered("the mission is complete, but the vehicle refused to return: ", now_s)

    def _confirm(self, now_s: float) -> None:
        """Request values that the last telemetry may lack; the answers are in the view."""
        if self._call is not None and self._call.answer(now_s) is None:
            return
        if self._requests:
            self._command(self._requests.pop(), now_s)
        else:
            self._end(outcome_of(self.view, self._items), now_s)

    def _shut_down(self, now_s: float) -> None:
        answer = self._call.answer(now_s) if self._call else None
        self.shut_down_accepted = self.view.powered_off or (answer is not None and answer.accepted)
        if self.shut_down_accepted or answer is not None or now_s >= self._phase_due_s:
            self._session.use(None)
            self.phase = Phase.OVER

    # -- helpers

    def _command(self, command: calls.Command, now_s: float) -> None:
        self._call = calls.command(self._session, *command, now_s)

    def _answered(self, refusal: str, now_s: float) -> bool:
        """Return True if the pending request was accepted; end the flight if it was refused."""
        return self._accepted(self._call.answer(now_s) if self._call else None, refusal, now_s)

    def _accepted(self, answer: Answer | None, refusal: str, now_s: float) -> bool:
        if answer is None:
            return False
        if answer.accepted:
            return True
        reason = answer.reason if answer.silent else refusal + answer.reason
        code, exit_code = (Code.VEHICLE_LOST, NO_ANSWER) if answer.silent else (Code.REFUSED, FAILED)
        self._end(Outcome(code, reason, exit_code), now_s)
        return False

    def _end(self, outcome: Outcome, now_s: float, vehicle_is_gone: bool = False) -> None:
        self.outcome = outcome
        if self.began_s is not None and self.ended_s is None:
            self.ended_s = now_s
        gone = vehicle_is_gone or self.view.powered_off or self.view.lost(now_s)
        reachable = self.view.identity is not None and not gone
        self.phase = Phase.SHUT_DOWN if reachable else Phase.OVER
        if reachable:
            self._phase_due_s = now_s + SHUT_DOWN_TIMEOUT_S
            self._command(calls.SHUT_DOWN, now_s)


_STEPS: dict[Phase, Callable[[Flight, float], None]] = {
    Phase.CONNECT: Flight._connect,
    Phase.UPLOAD: Flight._upload,
    Phase.READY: Flight._ready,
    Phase.ARM: Flight._arm,
    Phase.START: Flight._start,
    Phase.FLY: Flight._fly,
    Phase.CONFIRM: Flight._confirm,
    Phase.SHUT_DOWN: Flight._shut_down,
    Phase.OVER: lambda _flight, _now_s: None,
}
