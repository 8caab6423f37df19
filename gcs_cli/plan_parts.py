"""The three plans of a file or a vehicle - mission, geofence, rally points - and their upload as one."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from typing import NamedTuple

from flightstack.geodesy import GeoPoint
from flightstack.mavlink.services.mission_client import MissionClient
from flightstack.plan import (
    PLAN_NAMES,
    MissionItem,
    MissionResult,
    MissionType,
    Plan,
    check_fence,
    check_mission,
    check_rally,
    fence_shape,
)
from gcs_cli import calls
from gcs_cli.calls import Answer, Call
from gcs_cli.session import Session


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
    """Return what the vehicle would say against the parts of a plan, the geofence first: the others obey it."""
    fence = fence_shape(plan.fence, home)
    checks = (
        ("geofence", check_fence(plan.fence, home)),
        ("mission", check_mission(plan.items, home, fence=fence) if plan.items else None),
        ("list of rally points", check_rally(plan.rally, home, fence=fence)),
    )
    return next((f"{name}: {rejection.reason}" for name, rejection in checks if rejection is not None), None)


def parts_to_send(plan: Plan) -> list[PlanPart]:
    """Return the parts of a plan in the order of their upload.

    The vehicle checks mission and rally points against the geofence that it holds, so that the new geofence goes
    first. The mission goes last, even without items; other parts without items stay as they are on the vehicle.
    """
    mission, *others = plan_parts(plan)
    return [part for part in others if part.items] + [mission]


class Uploads:
    """Sends the parts of a plan to a vehicle: all of them, or none.

    With ``restores``, the parts that the vehicle holds are downloaded first, and uploaded again if one is not
    accepted. Without, a vehicle that has accepted some of the parts keeps them.
    """

    def __init__(self, session: Session, plan: Plan, *, restores: bool) -> None:
        self._session = session
        self._parts = parts_to_send(plan)
        self._clients: dict[MissionType, MissionClient] = {}
        self._restores = (
            restores and len(self._parts) > 1
        )  # the vehicle replaces one part whole or not at all
        self._steps = self._run()
        self._call: Call | None = None
        self._answer: Answer | None = None
        self._sent = 0
        self._is_sending = False
        self.name = self._parts[0].name
        """The part that is being sent, or was not accepted."""

    @property
    def progress(self) -> tuple[int, int]:
        """Items sent and in all."""
        under_way = self._call.progress[0] if self._call and self._is_sending else 0
        return self._sent + under_way, sum(len(part.items) for part in self._parts)

    def answer(self, now_s: float) -> Answer | None:
        """Go on as far as possible; return the answer once all is sent, or the first that is not an acceptance."""
        if self._call is None:
            self._call = next(self._steps)
        while self._answer is None and (answer := self._call.answer(now_s)) is not None:
            try:
                self._call = self._steps.send(answer)
            except StopIteration as end:
                self._answer = end.value
        return self._answer

    def _run(self) -> Generator[Call, Answer, Answer]:
        before: list[PlanPart] = []
        for part in self._parts if self._restores else ():
            self.name = part.name
            answer = yield self._transfer(part.kind)
            if answer.result == MissionResult.UNSUPPORTED:
                continue
            if not answer.accepted:
                return answer._replace(reason=f"{answer.reason}; nothing was changed")
            before.append(part._replace(items=answer.items))
        for part in self._parts:
            self.name, self._is_sending = part.name, True
            answer = yield self._transfer(part.kind, part.items)
            self._is_sending = False
            if not answer.accepted:
                if self._restores:
                    changed = self._parts[: self._parts.index(part) + answer.silent]
                    kinds = {part.kind for part in changed}
                    end = yield from self._restore([old for old in before if old.kind in kinds])
                    answer = answer._replace(reason=f"{answer.reason}; {end}")
                return answer
            self._sent += len(part.items)
        return answer

    def _restore(self, parts: Sequence[PlanPart]) -> Generator[Call, Answer, str]:
        """Upload the former parts; return what the vehicle holds now, in words."""
        for part in parts:
            answer = yield self._transfer(part.kind, part.items)
            if not answer.accepted:
                return f"the former {part.name} could not be restored: {answer.reason}"
        return "the vehicle holds its former plans"

    def _transfer(self, kind: MissionType, items: Sequence[MissionItem] | None = None) -> Call:
        """Begin to upload ``items``, or to download; one client a kind, which keeps late messages apart."""
        if kind not in self._clients:
            self._clients[kind] = calls.mission_client(self._session, kind)
        client = self._clients[kind]
        if items is None:
            client.start_download()
        else:
            client.start_upload(items)
        return Call(self._session, client)
