"""Run an action: send its commands, read the answers, wait for the effect. Sans-IO."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from typing import NamedTuple

from flightstack.core.enums import Severity
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address, Message
from gcs_cli.actions.action import Action, ActionError, NotReadyError, Step
from gcs_cli.actions.progress import EffectTimer
from gcs_cli.clients.command_client import CommandClient, CommandTiming, RepeatedMessage
from gcs_cli.vehicle.view_types import VehicleView

NEEDS_LIMIT_S = 3.0
"""Timeout of the telemetry that an action needs."""
TEXT_WAIT_S = 0.3
"""Timeout of the STATUSTEXT that explains a refusal; it follows the answer."""
LANDED_STATE_S = 2.0
"""Time that a disarmed vehicle may report to be in the air: PX4 sends its landed state once a second."""
LANDED_STATE_REPORTS = 2
"""Reports after the disarming that must say so: the last one before it is old, and later ones may be lost."""
_POLL_S = 0.25
_MOST_REASONS = 3


class Outcome(Enum):
    """Result of an action."""

    DONE = "done"
    """The vehicle reports the effect."""
    ACKNOWLEDGED = "acknowledged"
    """The vehicle accepted the command and does not report its effect, or the caller did not want to wait."""
    REFUSED = "refused"
    """The vehicle refused, or its state does not permit the action."""
    IMPOSSIBLE = "impossible"
    """The request does not fit this vehicle: it has no such mode, or needs an altitude."""
    SILENT = "silent"
    """The vehicle did not answer."""
    NOT_SEEN = "not_seen"
    """Accepted, but the effect was not reached in time."""
    ENDED = "ended"
    """The vehicle left the action for another mode, disarmed, or was lost."""


class Result(NamedTuple):
    """End of an action."""

    outcome: Outcome
    sentence: str
    elapsed_s: float
    """Time from the first command to the effect, of the vehicle's clock if it sends one."""

    @property
    def ok(self) -> bool:
        """True if the vehicle did what was asked, as far as it reports."""
        return self.outcome in (Outcome.DONE, Outcome.ACKNOWLEDGED)


class ActionRun:
    """One run of an action. It is a service of a session: ``receive``, ``poll``, ``next_deadline``.

    ``view`` returns the present state of the vehicle. Without ``waits`` the run ends with the last acknowledgement.
    """

    def __init__(
        self,
        action: Action,
        view: Callable[[], VehicleView],
        now_s: float,
        own: Address,
        *,
        waits: bool = True,
    ) -> None:
        self.action = action
        self.result: Result | None = None
        """Set at the end."""
        self.step: Step | None = None
        """The step under way; None before the first."""
        self.acknowledged = False
        """True once the vehicle has accepted the command of the last step."""
        self._view = view
        self._own = own
        self._waits = waits
        self._begun_s = now_s
        self._steps: list[Step] | None = None
        self._client: CommandClient | RepeatedMessage | None = None
        self._timer: EffectTimer | None = None
        self._whole = EffectTimer(view(), now_s)
        self._texts_before = 0
        self._text_due_s: float | None = None

    # -- service of a session

    def receive(self, message: Message, now_s: float) -> None:
        """Process a message from the vehicle."""
        if self._client is not None:
            self._client.receive(message, now_s)
        if self._timer is not None and message.get_msgId() == mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE:
            self._timer.take_landed_state(self._view())

    def poll(self, now_s: float) -> list[Message]:
        """Advance the run, and return the messages to send now."""
        if self.result is None:
            self._advance(now_s)
        return [] if self._client is None else self._client.poll(now_s)

    def next_deadline(self) -> float | None:
        """Return the time at which to call ``poll`` at the latest."""
        if self.result is not None:
            return None
        due_s = None if self._client is None else self._client.next_deadline()
        wake_s = self._whole.now_s + _POLL_S
        return wake_s if due_s is None else min(due_s, wake_s)

    def cancel(self) -> None:
        """Stop: no further command is sent."""
        self._client = None
        self.result = Result(Outcome.ENDED, f"{self.action.name}: cancelled", self._whole.elapsed_s)

    # -- steps

    def _advance(self, now_s: float) -> None:
        view = self._view()
        self._whole.update(view, now_s)
        goes_on = self.action.goes_on_without_link or (self.step is not None and self.step.restarts)
        if not goes_on and (view.powered_off or view.lost(now_s)):
            how = "shut down" if view.powered_off else "was lost"
            self._end(Outcome.ENDED, f"{self.action.name}: the vehicle {how}")
        elif self._steps is None:
            self._begin(view, now_s)
        elif self._timer is not None:
            self._await_effect(view, now_s)
        else:
            self._await_answer(view, now_s)

    def _begin(self, view: VehicleView, now_s: float) -> None:
        action = self.action
        if action.needs is not None and not action.needs(view):
            if now_s - self._begun_s < NEEDS_LIMIT_S:
                return
            if not action.does_without(view):
                self._end(Outcome.REFUSED, f"{action.name}: {action.needs_text}")
                return
        try:
            self._steps = list(action.plan(view))
        except ActionError as error:
            outcome = Outcome.REFUSED if isinstance(error, NotReadyError) else Outcome.IMPOSSIBLE
            self._end(outcome, f"{action.name}: {error}")
            return
        self._next_step(view, now_s)

    def _next_step(self, view: VehicleView, now_s: float) -> None:
        assert self._steps is not None
        if not self._steps:
            self._end(Outcome.DONE, self.action.done)
            return
        self.step, self._timer, self._text_due_s = self._steps.pop(0), None, None
        vehicle = self._vehicle(view)
        if self.step.restarts:  # a repeated command would act on the restarted vehicle
            self._client = CommandClient(vehicle, self._own, CommandTiming(self.step.limit_s, retries=0))
        else:
            self._client = CommandClient(vehicle, self._own)
        self._client.send_command(self.step.command, now_s)
        self._texts_before = view.text_count

    @staticmethod
    def _vehicle(view: VehicleView) -> Address:
        assert view.identity is not None
        return Address(*view.identity[:2])

    def _await_answer(self, view: VehicleView, now_s: float) -> None:
        assert self._client is not None
        assert self.step is not None
        assert self._steps is not None
        answer = self._client.result
        if answer is None:
            if self.step.restarts and self.step.effect is not None and self.step.effect(view):
                self._client = None  # the answer was lost
                self._next_step(view, now_s)
            return
        if answer.result is None:
            self._end(Outcome.SILENT, f"{self.step.name}: {answer.reason}")
        elif answer.result == mavlink.MAV_RESULT_UNSUPPORTED and self.step.instead is not None:
            self._send_instead(self.step.instead(*self._vehicle(view)), view, now_s)
        elif not answer.accepted and self.step.reached_before(view):
            self._next_step(view, now_s)
        elif not answer.accepted:
            self._refuse(view, answer.reason, now_s)
        elif self.step.effect is None or not (self._waits or self._steps):
            self.acknowledged = not self._steps
            if self._steps:
                self._next_step(view, now_s)
            else:
                self._end(Outcome.ACKNOWLEDGED, self._accepted_text())
        else:
            self.acknowledged = not self._steps
            self._timer = EffectTimer(view, now_s)
            self._await_effect(view, now_s)

    def _accepted_text(self) -> str:
        action = self.action
        if not self._waits:
            return action.doing
        return f"accepted: {action.doing}" + (f"; {action.unseen}" if action.unseen else "")

    def _send_instead(self, message: Message, view: VehicleView, now_s: float) -> None:
        """Send a message without an answer: a change of the current item shows that the vehicle received it."""
        before = view.mission.current
        self._client = RepeatedMessage(message, now_s, lambda: self._view().mission.current != before)
        self._timer = EffectTimer(view, now_s)

    def _refuse(self, view: VehicleView, answer: str, now_s: float) -> None:
        """End with the vehicle's texts; they follow the answer."""
        assert self.step is not None
        if self._text_due_s is None:
            self._text_due_s = now_s + TEXT_WAIT_S
        if now_s >= self._text_due_s:
            reason = refusal_reason(view, self._texts_before)
            said = [reason or self.step.refusal or answer, self.step.advice]
            self._end(Outcome.REFUSED, f"{self.step.name} refused: {'; '.join(filter(None, said))}")

    def _await_effect(self, view: VehicleView, now_s: float) -> None:
        step, timer = self.step, self._timer
        assert step is not None
        assert timer is not None
        assert step.effect is not None
        timer.update(view, now_s)
        if step.effect(view):
            self._next_step(view, now_s)
            return
        if step.needs_armed and timer.was_armed and not view.armed:
            ended = _disarmed_where(view, timer)
            if ended is not None:
                self._end(Outcome.ENDED, f"{self.action.name}: the vehicle {ended}")
                return
        elif view.mode in step.modes:
            timer.was_in_mode = True
        elif timer.was_in_mode:
            self._end(Outcome.ENDED, f"{self.action.name}: the vehicle changed to mode {view.mode}")
            return
        if timer.is_over(step.limit_s, step.is_flight):
            self._miss(step, view)

    def _miss(self, step: Step, view: VehicleView) -> None:
        """End without the effect; a message without an answer is refused by a text."""
        waited = f"within {step.limit_s:g} s"
        if step.is_flight:
            waited = f"and has not moved for {step.limit_s:g} s"
        has_answered = not isinstance(self._client, RepeatedMessage)
        reason = "" if has_answered else refusal_reason(view, self._texts_before)
        if reason:
            self._end(Outcome.REFUSED, f"{step.name} refused: {reason}")
        else:
            acknowledged = "acknowledged, but " if has_answered else ""
            self._end(Outcome.NOT_SEEN, f"{step.name}: the vehicle {acknowledged}{step.missing} {waited}")

    def _end(self, outcome: Outcome, sentence: str) -> None:
        self._client = None
        self.result = Result(outcome, sentence, self._whole.elapsed_s)


def _disarmed_where(view: VehicleView, timer: EffectTimer) -> str | None:
    """Return the text for where it disarmed, or None while its landed state may be older than the disarming."""
    if view.on_ground is not False:
        return "disarmed"
    is_known = timer.disarmed_s >= LANDED_STATE_S and timer.reports_disarmed >= LANDED_STATE_REPORTS
    return "disarmed in the air" if is_known else None


def refusal_reason(view: VehicleView, texts_before: int) -> str:
    """Return the vehicle's warnings after the first ``texts_before`` texts; empty if there is none."""
    reasons: list[str] = []
    for entry in view.texts_since(texts_before):
        if entry.severity > Severity.WARNING:
            continue
        text = entry.text
        for prefix in view.autopilot.refusal_prefixes:
            text = text.removeprefix(prefix)
        if text and text not in reasons:
            reasons.append(text)
    return "; ".join(reasons[-_MOST_REASONS:])
