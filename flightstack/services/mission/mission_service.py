"""Connects the mission protocol to the autopilot."""

from __future__ import annotations

from collections.abc import Hashable

from flightstack.core.enums import Severity
from flightstack.mavlink.link import Address, Message
from flightstack.mavlink.mission_messages import PROTOCOL
from flightstack.plan import PLAN_NAMES, MissionType
from flightstack.plan.kept_plans import KeptPlans
from flightstack.services.mission.mission_server import MissionServer
from flightstack.services.mission.mission_store import (
    CurrentRequested,
    MissionCleared,
    MissionRefused,
    MissionReplaced,
)
from flightstack.vehicle.assembly import VehicleParts


class MissionService:
    """Applies uploaded plans to the vehicle."""

    handles = PROTOCOL

    def __init__(self, own: Address, vehicle: VehicleParts) -> None:
        self._vehicle = vehicle
        self._server = MissionServer(
            own,
            {
                MissionType.MISSION: vehicle.mission.check,
                MissionType.FENCE: vehicle.area.check_fence,
                MissionType.RALLY: vehicle.area.check_rally,
            },
        )
        self._setters = {
            MissionType.MISSION: vehicle.requests.set_mission,
            MissionType.FENCE: vehicle.area.set_fence,
            MissionType.RALLY: vehicle.area.set_rally,
        }

    def plans(self) -> KeptPlans:
        """Return the plans in force. A finished mission restarts at its first item."""
        mission, fence, rally = (self._server.items(kind) for kind in self._setters)
        places, progress = self._vehicle.places, self._vehicle.now.progress
        continues = not progress.finished and progress.current < len(mission)
        home = places.home_point if places.home_is_chosen else None
        return KeptPlans(mission, fence, rally, progress.current if continues else 0, home)

    def restore(self, plans: KeptPlans) -> str | None:
        """Restore plans that were in force before; return the first refusal, or None.

        Home and the geofence come first, since the other plans were checked against them. If one of them is refused,
        the rest is not restored.
        """
        refusal = None if plans.home is None else self._vehicle.area.set_home(plans.home)
        if refusal is not None:
            return f"home: {refusal}"
        reasons: list[str] = []
        for kind in (MissionType.FENCE, MissionType.MISSION, MissionType.RALLY):
            items = plans.items(kind)
            rejection = self._server.restore(kind, items) if items else None
            self._take_events()
            if rejection is not None:
                reasons.append(f"{PLAN_NAMES[kind]}: {rejection.reason}")
                if kind is MissionType.FENCE:
                    break
            elif kind is MissionType.MISSION and plans.current:
                self._vehicle.mission.set_current(plans.current)
        return reasons[0] if reasons else None

    def receive(self, message: Message, peer: Hashable, now_s: float) -> None:
        """Take a message of the mission protocol."""
        self._server.receive(message, peer, now_s)
        self._take_events()

    def poll(self, now_s: float) -> list[tuple[Hashable | None, Message]]:
        """Return requests, items and acknowledgements."""
        self._server.current_seq = self._vehicle.now.progress.current
        outbox = list(self._server.poll(now_s))
        self._take_events()
        return outbox

    def next_deadline(self) -> float | None:
        """Return the time of the next poll."""
        return self._server.next_deadline()

    def _take_events(self) -> None:
        journal = self._vehicle.journal
        events = self._server.events()
        if not events:  # the usual case: the plan ids have not changed
            return
        for event in events:
            if isinstance(event, MissionReplaced):
                self._setters[event.mission_type](event.items)
                journal.say(Severity.NOTICE, f"{_name(event.mission_type)} loaded, items: {len(event.items)}")
            elif isinstance(event, MissionCleared):
                self._setters[event.mission_type](())
            elif isinstance(event, CurrentRequested):
                refusal = self._vehicle.mission.set_current(event.seq)
                if refusal is not None:
                    journal.say(Severity.WARNING, f"Mission item: {refusal}")
            elif isinstance(event, MissionRefused):
                journal.say(Severity.WARNING, f"{_name(event.mission_type)} refused: {event.reason}")
        mission, fence, rally = (self._server.plan_id(kind) for kind in self._setters)
        self._vehicle.places.ids = (mission, fence, rally)


def _name(kind: MissionType) -> str:
    """Return "Mission", "Geofence" or "List of rally points"."""
    name = PLAN_NAMES[kind]
    return name[0].upper() + name[1:]
