"""The three plans of a file or a vehicle - mission, geofence, rally points - and their upload."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Generator, Sequence
from typing import NamedTuple

from flightstack.core.geodesy import GeoPoint
from flightstack.plan import (
    PLAN_NAMES,
    MissionItem,
    MissionResult,
    MissionType,
    Plan,
)
from gcs_cli.clients.mission_client import MissionClient
from gcs_cli.link import calls
from gcs_cli.link.calls import Answer, Call
from gcs_cli.link.session import Session
from gcs_cli.plans.check import plan_problems

RESTORE_TIMEOUT_S = 30.0
"""Longest time to restore the former plans after an interrupt."""
_FORMER, _NEW, _UNKNOWN, _INCOMPLETE = "former", "new", "unknown", "perhaps incomplete"


class PlanPart(NamedTuple):
    """One of the three plans in a file or on a vehicle."""

    kind: MissionType
    name: str
    items: Sequence[MissionItem]


def plan_parts(plan: Plan) -> list[PlanPart]:
    """Return mission, geofence and rally points, in the order in which ground stations send them."""
    items = (plan.items, plan.fence, plan.rally)
    return [PlanPart(kind, name, part) for (kind, name), part in zip(PLAN_NAMES.items(), items, strict=True)]


def plan_problem(plan: Plan, home: GeoPoint) -> str | None:
    """Return the first reason that a vehicle refuses the plan, or None; the geofence is checked first."""
    problem = next(plan_problems(plan, home), None)
    return None if problem is None else f"{problem.part}: {problem.reason}"


def parts_to_send(plan: Plan, only: MissionType | None = None) -> list[PlanPart]:
    """Return the parts of a plan, or the one of type ``only``, in the order of their upload.

    The vehicle checks mission and rally points against its geofence, so that the new geofence goes first. The mission
    goes last, even without items; other parts without items are not sent.
    """
    mission, *others = plan_parts(plan)
    parts = [part for part in others if part.items] + [mission]
    return [part for part in parts if only in (None, part.kind)]


class Uploads:
    """Uploads the parts of a plan to a vehicle: all of them, or none.

    With ``restores``, the former parts are downloaded first, and restored if a new one is not accepted. Without, a
    vehicle keeps the parts that it has accepted. ``interrupted`` returns a reason to end early, or an empty text: then
    the former plans are restored too, for RESTORE_TIMEOUT_S at most. With ``only``, the other parts stay.
    ``on_restore`` is called before the first item of a former plan is sent.
    """

    def __init__(
        self,
        session: Session,
        plan: Plan,
        *,
        restores: bool,
        interrupted: Callable[[], str] = str,
        only: MissionType | None = None,
        on_restore: Callable[[], None] = lambda: None,
    ) -> None:
        self._session = session
        self._parts = parts_to_send(plan, only)
        self._others = [part for part in plan_parts(plan) if part not in self._parts]
        self._clients: dict[MissionType, MissionClient] = {}
        self._restores = restores
        self._interrupted = interrupted
        self._only = only
        self._on_restore = on_restore
        self._steps = self._run()
        self._call: Call | None = None
        self._answer: Answer | None = None
        self._sent = 0
        self._holds = {part.kind: _FORMER for part in self._parts}
        self._current: MissionType | None = None
        self._is_restoring = False
        self._restore_due_s: float | None = None
        self._is_gradual = not session.view.autopilot.replaces_plans_at_once
        """True if the vehicle overwrites a part item by item, as ArduPilot; others replace it after the last item."""
        self._now_s = 0.0
        self.name = self._parts[0].name
        """The current part, or the one that was not accepted."""
        self.kept: list[PlanPart] = []
        """Parts that are not in the plan and stay on the vehicle; known after an upload with ``restores``."""

    @property
    def progress(self) -> tuple[int, int]:
        """Sent items and their total."""
        is_sending = self._current is not None and not self._is_restoring
        current = self._call.progress[0] if self._call and is_sending else 0
        return self._sent + current, sum(len(part.items) for part in self._parts)

    @property
    def state(self) -> str:
        """Description of what the vehicle holds now."""
        holds = dict(self._holds)
        if self._current is not None:
            holds[self._current] = self._held_of_current
        if set(holds.values()) == {_FORMER}:
            return "the vehicle holds its former plans"
        return "the vehicle holds: " + ", ".join(f"{part.name} {holds[part.kind]}" for part in self._parts)

    @property
    def _held_of_current(self) -> str:
        """What the vehicle may hold of the current part, which it has not accepted."""
        assert self._current is not None
        sent, count = self._call.progress if self._call else (0, 0)
        if sent >= count:
            return _UNKNOWN
        return _INCOMPLETE if self._is_gradual else self._holds[self._current]

    def answer(self, now_s: float) -> Answer | None:
        """Continue; return the answer after the last part, or the first one that is not an acceptance."""
        self._now_s = now_s
        if self._call is None:
            self._call = next(self._steps)
        while self._answer is None:
            answer = self._call.answer(now_s) or self._interruption()
            if answer is None:
                break
            try:
                self._call = self._steps.send(answer)
            except StopIteration as end:
                self._answer = end.value
        return self._answer

    def _interruption(self) -> Answer | None:
        """Return the answer of a transfer that an interrupt ends: the current one, or a restore after its timeout."""
        reason = self._interrupted()
        if not reason:
            return None
        if self._restore_due_s is None:
            self._restore_due_s = self._now_s + RESTORE_TIMEOUT_S
            return None if self._is_restoring else Answer(False, reason, cancelled=True)
        if self._now_s >= self._restore_due_s:
            return Answer(False, f"not done within {RESTORE_TIMEOUT_S:g} s", cancelled=True)
        return None

    def _run(self) -> Generator[Call, Answer, Answer]:
        before: list[PlanPart] = []
        if self._restores and (len(self._parts) > 1 or self._is_gradual):
            for part in self._parts:
                self.name = part.name
                answer = yield self._transfer(part.kind)
                if answer.result == MissionResult.UNSUPPORTED:
                    continue
                if not answer.accepted:
                    return answer._replace(reason=f"{answer.reason}; nothing was changed")
                before.append(part._replace(items=answer.items))
            if self._session.view.mission.current is None:
                yield calls.command(self._session, *calls.REQUEST_MISSION_CURRENT, self._now_s)
        current = self._session.view.mission.current or 0
        for part in self._parts:
            self.name = part.name
            answer = yield from self._send(part, _NEW)
            if not answer.accepted:
                if self._restores:
                    answer = yield from self._undo(part, answer, before, current)
                return answer
            self._sent += len(part.items)
        if self._restores and self._only is None:
            yield from self._find_kept()
        return answer

    def _undo(
        self, part: PlanPart, answer: Answer, before: Sequence[PlanPart], current: int
    ) -> Generator[Call, Answer, Answer]:
        """Restore the parts ``before``; return the answer with a description of the vehicle's plans."""
        reasons = [answer.reason]
        is_refused = not (answer.silent or answer.cancelled)
        if is_refused and part.kind != MissionType.FENCE and "fence" in answer.reason.lower():
            yield from self._find_kept()
            reasons += [
                f"the vehicle keeps its geofence of {len(kept.items)} items, which is not in the file: "
                "remove it with `gcs mission clear --type fence`"
                for kept in self.kept
                if kept.kind == MissionType.FENCE
            ]
        if before:
            reasons.append((yield from self._restore(before, current)))
        elif not is_refused:
            self._clients[part.kind].cancel()
            reasons.append(self.state)
        return answer._replace(reason="; ".join(reasons))

    def _restore(self, before: Sequence[PlanPart], current: int) -> Generator[Call, Answer, str]:
        """Upload the former parts that were replaced; return a description of the vehicle's plans."""
        self._is_restoring = True
        replaced = [part for part in before if self._holds[part.kind] != _FORMER]
        if replaced:
            with contextlib.suppress(
                OSError
            ):  # a pipe without a reader; the plans count more than the notice
                self._on_restore()
        for part in replaced:
            answer = yield from self._send(part, _FORMER)
            if not answer.accepted:
                return f"the former {part.name} could not be restored: {answer.reason}; {self.state}"
            if part.kind == MissionType.MISSION and 0 < current < len(part.items):
                self._clients[part.kind].start_set_current(current)
                answer = yield Call(self._session, self._clients[part.kind])
                if not answer.accepted:
                    return f"{self.state}, but item {current} is no longer current: {answer.reason}"
        return self.state

    def _find_kept(self) -> Generator[Call, Answer, None]:
        """Download the parts that are not in the plan; without an answer they stay unknown."""
        for part in self._others:
            answer = yield self._transfer(part.kind)
            if answer.silent or answer.cancelled:
                return
            if answer.items:
                self.kept.append(part._replace(items=answer.items))

    def _send(self, part: PlanPart, which: str) -> Generator[Call, Answer, Answer]:
        """Upload a part, and record which version the vehicle holds."""
        self._current = part.kind
        answer = yield self._transfer(part.kind, part.items)
        if answer.accepted:
            self._holds[part.kind] = which
        elif answer.silent or answer.cancelled:
            self._holds[part.kind] = self._held_of_current
        elif self._is_gradual:  # refused, perhaps at one of its items
            self._holds[part.kind] = _INCOMPLETE
        self._current = None
        return answer

    def _transfer(self, kind: MissionType, items: Sequence[MissionItem] | None = None) -> Call:
        """Begin to upload ``items``, or to download; one client per type separates late messages."""
        if kind not in self._clients:
            self._clients[kind] = calls.mission_client(self._session, kind)
        client = self._clients[kind]
        if items is None:
            client.start_download()
        else:
            client.start_upload(items)
        return Call(self._session, client, items or ())
