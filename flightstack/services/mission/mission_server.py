"""Vehicle side of the mission protocol for missions, geofences and rally points. No I/O.

``MissionServer`` speaks the protocol, ``MissionService`` applies the uploaded plans to the vehicle. An upload replaces
the stored plan only when it is complete and passes its check. There is one upload at a time per plan type, so that the
items of different clients do not mix. Several clients may download at once.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterable, Mapping

from flightstack.core.enums import Severity
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address, Message, is_for, sender
from flightstack.mavlink.mission_messages import DEFAULT_TIMING, GOES_THERE, PROTOCOL, Timing, ack_message
from flightstack.plan.commands import PLAN_NAMES, MissionResult, MissionType
from flightstack.plan.kept_plans import KeptPlans
from flightstack.plan.rejection import Rejection
from flightstack.services.mission.mission_downloads import Downloads
from flightstack.services.mission.mission_store import (
    Check,
    CurrentRequested,
    Items,
    MissionCleared,
    MissionEvent,
    MissionRefused,
    MissionReplaced,
    PlanStore,
)
from flightstack.services.mission.mission_upload import Client, Upload
from flightstack.vehicle.assembly import VehicleParts

_MAX_ENDED = 32  # uploads whose acknowledgement can be repeated; bounds memory


class MissionServer:
    """Serves upload, download and clearing of one plan of each type in ``checks``."""

    def __init__(
        self, own: Address, checks: Mapping[MissionType, Check], timing: Timing = DEFAULT_TIMING
    ) -> None:
        self.own = own
        self.current_seq = 0
        """Current mission item, for the ``current`` flag of a download; set by the owner."""
        self._timing = timing
        self._store = PlanStore(checks)
        self._uploads: dict[int, Upload] = {}
        self._ended: dict[tuple[int, Client], tuple[int, Message]] = {}
        self._downloads = Downloads()
        self._outbox: list[tuple[Hashable, Message]] = []
        self._events: list[MissionEvent] = []

    def items(self, mission_type: MissionType = MissionType.MISSION) -> Items:
        """Return the plan in force."""
        return self._store.items(mission_type)

    def plan_id(self, mission_type: MissionType = MissionType.MISSION) -> int:
        """Return MAVLink's opaque id of the plan in force, for MISSION_CURRENT; 0 for none."""
        return self._store.plan_id(mission_type)

    def restore(self, mission_type: MissionType, items: Items) -> Rejection | None:
        """Restore a plan that was accepted before; return its rejection, or None."""
        outcome = self._store.replace(mission_type, items)
        if isinstance(outcome, Rejection):
            self._refused(outcome.result, outcome.seq, outcome.reason, mission_type)
            return outcome
        self._events.append(outcome)
        return None

    def receive(self, message: Message, peer: Hashable, now_s: float) -> None:
        """Take a message from ``peer``. Ignore other protocols and other targets."""
        kind = message.get_type()
        if kind not in PROTOCOL or not is_for(message, self.own):
            return
        client = Client(peer, sender(message))
        if kind == "MISSION_SET_CURRENT":
            self._on_set_current(message.seq)
        elif kind == "MISSION_ACK":
            self._on_ack(message, client, now_s)
        elif kind == "MISSION_CLEAR_ALL":
            self._on_clear(message.mission_type, client)
        elif not self._store.has(message.mission_type):
            self._ack(client, MissionResult.UNSUPPORTED, message.mission_type)
        elif kind == "MISSION_COUNT":
            self._on_count(message, client, now_s)
        elif kind == "MISSION_REQUEST_LIST":
            self._on_list(message, client, now_s)
        elif kind in ("MISSION_REQUEST", "MISSION_REQUEST_INT"):
            self._on_request(message, client, now_s)
        elif message.current < GOES_THERE:
            self._on_item(message, client, now_s)

    def poll(self, now_s: float) -> list[tuple[Hashable, Message]]:
        """Return the messages to send now, each with its peer."""
        for upload in list(self._uploads.values()):
            if now_s < upload.deadline_s:
                continue
            if upload.is_silent(now_s):
                reason = (
                    f"the upload stopped at item {len(upload.items)} (last {upload.count - 1}): no answer"
                )
                self._refuse_upload(upload, Rejection(MissionResult.OPERATION_CANCELLED, None, reason))
            else:
                self._send(upload.client, upload.request(now_s))
        outbox, self._outbox = self._outbox, []
        return outbox

    def next_deadline(self) -> float | None:
        """Return the time of the next poll if no message arrives before; −inf for at once, None for never."""
        if self._outbox:
            return -math.inf
        return min((upload.deadline_s for upload in self._uploads.values()), default=None)

    def events(self) -> list[MissionEvent]:
        """Return the events since the last call."""
        events, self._events = self._events, []
        return events

    # -- upload

    def _on_count(self, message: Message, client: Client, now_s: float) -> None:
        kind, count = message.mission_type, message.count
        if self._is_busy_for(client, [kind], kind):
            return
        # a restart by the same client: discard the items of its first attempt
        self._uploads.pop(kind, None)
        self._ended.pop((kind, client), None)
        reason = self._store.too_long(kind, count)
        if reason is not None:
            self._ack(client, MissionResult.NO_SPACE, kind)
            self._refused(MissionResult.NO_SPACE, None, reason, kind)
        elif count == 0:
            self._clear([kind])
            self._ack(client, MissionResult.ACCEPTED, kind)
        else:
            self._uploads[kind] = Upload(client, kind, count, self._timing, now_s)

    def _on_item(self, message: Message, client: Client, now_s: float) -> None:
        kind = message.mission_type
        upload = self._uploads.get(kind)
        if upload is None or upload.client != client:
            # a repeated last item: the MISSION_ACK was lost
            last_seq, ack = self._ended.get((kind, client), (None, None))
            if ack is not None and last_seq == message.seq:
                self._send(client, ack)
        elif upload.accept(message, now_s) and upload.is_complete:
            self._complete(upload)

    def _complete(self, upload: Upload) -> None:
        outcome = self._store.replace(upload.mission_type, tuple(upload.items))
        if isinstance(outcome, Rejection):
            self._refuse_upload(upload, outcome)
        else:
            self._events.append(outcome)
            self._end(upload, MissionResult.ACCEPTED)

    def _refuse_upload(self, upload: Upload, rejection: Rejection) -> None:
        self._refused(*rejection, upload.mission_type)
        self._end(upload, rejection.result)

    def _end(self, upload: Upload, result: MissionResult) -> None:
        kind = upload.mission_type
        del self._uploads[kind]
        ack = self._ack(upload.client, result, kind)
        # keep the acknowledgement itself: the plan in force, and its id, may be another client's when it is repeated
        self._ended.pop((kind, upload.client), None)  # sorted by the end of the upload
        self._ended[kind, upload.client] = (upload.count - 1, ack)
        if len(self._ended) > _MAX_ENDED:
            del self._ended[next(iter(self._ended))]

    def _is_busy_for(self, client: Client, kinds: Iterable[int], asked: int) -> bool:
        """Deny ``client`` and return True while another client uploads one of ``kinds``."""
        for kind in kinds:
            upload = self._uploads.get(kind)
            if upload is not None and upload.client != client:
                self._ack(client, MissionResult.DENIED, asked)
                name = PLAN_NAMES[MissionType(kind)]
                reason = f"another ground station is uploading a {name}; try again when it is done"
                self._refused(MissionResult.DENIED, None, reason, kind)
                return True
        return False

    def _on_ack(self, message: Message, client: Client, now_s: float) -> None:
        """End the client's download; any error cancels its upload."""
        kind, result = message.mission_type, message.type
        self._downloads.end(client, kind)
        upload = self._uploads.get(kind)
        if upload is None or upload.client != client:
            return
        if result == MissionResult.UNSUPPORTED and upload.change_kind(now_s):
            return  # it may support the other request message; PX4 does the same
        if result != MissionResult.ACCEPTED:
            del self._uploads[kind]

    # -- download, clearing and the current item

    def _on_list(self, message: Message, client: Client, now_s: float) -> None:
        kind = message.mission_type
        count, plan_id = self._downloads.begin(
            client, kind, self._store.items(kind), self._store.plan_id(kind), now_s
        )
        self._send(client, mavlink.MAVLink_mission_count_message(*client.address, count, kind, plan_id))

    def _on_request(self, message: Message, client: Client, now_s: float) -> None:
        kind = message.mission_type
        answer = self._downloads.answer(message, client, self._store.items(kind), self.current_seq, now_s)
        if answer is None:
            self._ack(client, MissionResult.INVALID_SEQUENCE, kind)
        else:
            self._send(client, answer)

    def _on_clear(self, kind: int, client: Client) -> None:
        kinds = list(self._store.kinds) if kind == MissionType.ALL else [kind]
        if not all(self._store.has(each) for each in kinds):
            self._ack(client, MissionResult.UNSUPPORTED, kind)
        elif not self._is_busy_for(client, kinds, kind):
            self._clear(kinds)
            self._ack(client, MissionResult.ACCEPTED, kind)

    def _clear(self, kinds: Iterable[int]) -> None:
        for kind in kinds:
            self._uploads.pop(kind, None)
            self._events.append(self._store.clear(kind))

    def _on_set_current(self, seq: int) -> None:
        count = len(self.items())
        if seq < count:
            self._events.append(CurrentRequested(seq))
        else:
            reason = f"item {seq} cannot be made current: the mission has {count} items"
            self._refused(MissionResult.INVALID_SEQUENCE, seq, reason, MissionType.MISSION)

    def _refused(self, result: MissionResult, seq: int | None, reason: str, kind: int) -> None:
        self._events.append(MissionRefused(result, seq, reason, MissionType(kind)))

    def _ack(self, client: Client, result: MissionResult, kind: int) -> Message:
        plan_id = self._store.plan_id(kind) if result == MissionResult.ACCEPTED else 0
        ack = ack_message(client.address, result, kind, plan_id)
        self._send(client, ack)
        return ack

    def _send(self, client: Client, message: Message) -> None:
        self._outbox.append((client.peer, message))


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
        self._server.current_seq = self._vehicle.now.progress.current
        self._server.receive(message, peer, now_s)
        self._take_events()

    def poll(self, now_s: float) -> list[tuple[Hashable | None, Message]]:
        """Return requests, items and acknowledgements."""
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
