"""The three plans of a file or a vehicle - mission, geofence, rally points - and their upload one by one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from flightstack.geodesy import GeoPoint
from flightstack.plan import (
    PLAN_NAMES,
    MissionItem,
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


class Uploads:
    """Sends a whole plan to a vehicle that holds none: geofence and rally points, then the mission.

    In this order the vehicle checks the mission against its geofence.
    """

    def __init__(self, session: Session, plan: Plan) -> None:
        self._session = session
        mission, *others = plan_parts(plan)
        self._parts = [part for part in others if part.items] + [mission]
        self._sent = 0
        self._at = 0
        self._call: Call | None = None

    @property
    def name(self) -> str:
        """What is being sent."""
        return self._parts[self._at].name

    @property
    def progress(self) -> tuple[int, int]:
        """Items sent and in all."""
        sent = self._sent + (0 if self._call is None else self._call.progress[0])
        return sent, sum(len(part.items) for part in self._parts)

    def answer(self, now_s: float) -> Answer | None:
        """Go on as far as possible; return the answer once all is sent, or the first that is not an acceptance."""
        if self._call is None:
            self._call = self._begin()
        answer = self._call.answer(now_s)
        if answer is None or not answer.accepted or self._at == len(self._parts) - 1:
            return answer
        self._sent += len(self._parts[self._at].items)
        self._at += 1
        self._call = self._begin()
        return None

    def _begin(self) -> Call:
        part = self._parts[self._at]
        return calls.upload(self._session, part.items, part.kind)
