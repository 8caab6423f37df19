"""The vehicle's side of the mission protocol, without I/O.

A stored mission is replaced only by a whole one that passed the check. One upload at a time; downloads go to
any number of clients at once. Everything is answered to the peer it came from.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Hashable
from typing import NamedTuple, TypeAlias

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Message
from flightstack.mavlink.services.addressing import Address, is_for, sender
from flightstack.mavlink.services.mission_downloads import Downloads
from flightstack.mavlink.services.mission_messages import DEFAULT_TIMING, Timing, ack_message, mission_id
from flightstack.mavlink.services.mission_upload import Client, Upload
from flightstack.plan.rejection import Rejection
from flightstack.plan.item import MissionItem
from flightstack.plan.vocabulary import MAX_MISSION_ITEMS, MissionResult, MissionType

Items: TypeAlias = tuple[MissionItem, ...]


class MissionReplaced(NamedTuple):
    """A new mission is in force. A mission equal to the old one counts, with ``is_changed`` false."""

    mission_type: MissionType
    items: Items
    mission_id: int
    is_changed: bool


class MissionCleared(NamedTuple):
    """The mission was removed."""

    mission_type: MissionType


class CurrentRequested(NamedTuple):
    """A client asks to continue at this item, which exists."""

    seq: int


class MissionRefused(NamedTuple):
    """A client's wish was refused; the reason is for a STATUSTEXT, since MISSION_ACK has no room for it."""

    result: MissionResult
    seq: int | None
    reason: str


MissionEvent: TypeAlias = MissionReplaced | MissionCleared | CurrentRequested | MissionRefused
Check: TypeAlias = Callable[[Items], Rejection | None]

PROTOCOL = frozenset(
    {
        "MISSION_ACK",
        "MISSION_CLEAR_ALL",
        "MISSION_COUNT",
        "MISSION_ITEM",
        "MISSION_ITEM_INT",
        "MISSION_REQUEST",
        "MISSION_REQUEST_INT",
        "MISSION_REQUEST_LIST",
        "MISSION_SET_CURRENT",
    }
)


class MissionServer:
    """Keeps one mission of each stored type, and lets clients upload, download and clear it."""

    def __init__(
        self,
        own: Address,
        check: Check,
        stored_types: Collection[MissionType] = (MissionType.MISSION,),
        max_items: int = MAX_MISSION_ITEMS,
        timing: Timing = DEFAULT_TIMING,
    ) -> None:
        self.own = own
        self.current_seq = 0
        """The item being flown, for the ``current`` flag of a download; the owner keeps it."""
        self._check = check
        self._max_items = max_items
        self._timing = timing
        self._stored: dict[int, Items] = dict.fromkeys(stored_types, ())
        self._upload: Upload | None = None
        self._ended: tuple[Client, int, int, MissionResult] | None = None
        self._downloads = Downloads()
        self._outbox: list[tuple[Hashable, Message]] = []
        self._events: list[MissionEvent] = []

    def items(self, mission_type: MissionType = MissionType.MISSION) -> Items:
        """Return the mission in force."""
        return self._stored.get(mission_type, ())

    def receive(self, message: Message, peer: Hashable, now_s: float) -> None:
        """Take any message from ``peer``; what is not of this protocol or not for us is ignored."""
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
        elif message.mission_type not in self._stored:
            self._ack(client, MissionResult.UNSUPPORTED, message.mission_type)
        elif kind == "MISSION_COUNT":
            self._on_count(message, client, now_s)
        elif kind == "MISSION_REQUEST_LIST":
            self._on_list(message, client, now_s)
        elif kind in ("MISSION_REQUEST", "MISSION_REQUEST_INT"):
            self._on_request(message, client, now_s)
        else:
            self._on_item(message, client, now_s)

    def poll(self, now_s: float) -> list[tuple[Hashable, Message]]:
        """Return the messages to send now, each with the peer it goes to."""
        upload = self._upload
        if upload is not None and now_s >= upload.deadline_s:
            if upload.is_silent(now_s):
                reason = f"the upload stopped at item {len(upload.items)} of {upload.count}: no answer"
                self._refuse_upload(upload, Rejection(MissionResult.OPERATION_CANCELLED, None, reason))
            else:
                self._send(upload.client, upload.request(now_s))
        outbox, self._outbox = self._outbox, []
        return outbox

    def next_deadline(self) -> float | None:
        """Return when to poll next if nothing arrives before; -inf for at once, None for never."""
        if self._outbox:
            return -math.inf
        return self._upload.deadline_s if self._upload else None

    def events(self) -> list[MissionEvent]:
        """Return what happened since the last call."""
        events, self._events = self._events, []
        return events

    # -- upload

    def _on_count(self, message: Message, client: Client, now_s: float) -> None:
        kind, count = message.mission_type, message.count
        if self._is_busy_for(client, kind):
            return
        self._upload = None  # the same client begins again: nothing of its first try may mix in
        self._ended = None
        if count > self._max_items:
            reason = f"the mission has {count} items, and at most {self._max_items} are allowed"
            self._ack(client, MissionResult.NO_SPACE, kind)
            self._events.append(MissionRefused(MissionResult.NO_SPACE, None, reason))
        elif count == 0:
            self._clear([kind])
            self._ack(client, MissionResult.ACCEPTED, kind)
        else:
            self._upload = Upload(client, kind, count, self._timing, now_s)

    def _on_item(self, message: Message, client: Client, now_s: float) -> None:
        upload = self._upload
        if upload is None or upload.client != client or upload.mission_type != message.mission_type:
            # The last item again: our MISSION_ACK got lost.
            if self._ended is not None and self._ended[:3] == (client, message.mission_type, message.seq):
                self._ack(client, self._ended[3], message.mission_type)
        elif upload.accept(message, now_s) and upload.is_complete:
            self._complete(upload)

    def _complete(self, upload: Upload) -> None:
        items = tuple(upload.items)
        kind = MissionType(upload.mission_type)
        rejection = self._check(items) if kind == MissionType.MISSION else None
        if rejection is not None:
            self._refuse_upload(upload, rejection)
            return
        is_changed = items != self._stored[kind]
        self._stored[kind] = items
        self._events.append(MissionReplaced(kind, items, mission_id(items), is_changed))
        self._end(upload, MissionResult.ACCEPTED)

    def _refuse_upload(self, upload: Upload, rejection: Rejection) -> None:
        self._events.append(MissionRefused(*rejection))
        self._end(upload, rejection.result)

    def _end(self, upload: Upload, result: MissionResult) -> None:
        self._upload = None
        self._ended = (upload.client, upload.mission_type, upload.count - 1, result)
        self._ack(upload.client, result, upload.mission_type)

    def _is_busy_for(self, client: Client, kind: int) -> bool:
        """Deny ``client`` while another one uploads; the upload goes on unharmed."""
        if self._upload is None or self._upload.client == client:
            return False
        self._ack(client, MissionResult.DENIED, kind)
        reason = "another ground station is uploading a mission; try again when it is done"
        self._events.append(MissionRefused(MissionResult.DENIED, None, reason))
        return True

    def _on_ack(self, message: Message, client: Client, now_s: float) -> None:
        """A client ends its download, or calls off its upload: any error does."""
        kind, result = message.mission_type, message.type
        self._downloads.end(client, kind)
        upload = self._upload
        if upload is None or upload.client != client or upload.mission_type != kind:
            return
        if result == MissionResult.UNSUPPORTED and upload.change_kind(now_s):
            return  # it may know the other kind of request: PX4 reads this answer the same way
        if result != MissionResult.ACCEPTED:
            self._upload = None

    # -- the rest

    def _on_list(self, message: Message, client: Client, now_s: float) -> None:
        kind = message.mission_type
        count = self._downloads.begin(client, kind, self._stored[kind], now_s)
        self._send(client, mavlink.MAVLink_mission_count_message(*client.address, count, kind))

    def _on_request(self, message: Message, client: Client, now_s: float) -> None:
        kind = message.mission_type
        answer = self._downloads.answer(message, client, self._stored[kind], self.current_seq, now_s)
        if answer is None:
            self._ack(client, MissionResult.INVALID_SEQUENCE, kind)
        else:
            self._send(client, answer)

    def _on_clear(self, kind: int, client: Client) -> None:
        if self._is_busy_for(client, kind):
            return
        if kind != MissionType.ALL and kind not in self._stored:
            self._ack(client, MissionResult.UNSUPPORTED, kind)
            return
        self._upload = None
        self._clear(list(self._stored) if kind == MissionType.ALL else [kind])
        self._ack(client, MissionResult.ACCEPTED, kind)

    def _clear(self, kinds: list[int]) -> None:
        for kind in kinds:
            self._stored[kind] = ()
            self._events.append(MissionCleared(MissionType(kind)))

    def _on_set_current(self, seq: int) -> None:
        count = len(self.items())
        if seq < count:
            self._events.append(CurrentRequested(seq))
        else:
            reason = f"item {seq} cannot be made current: the mission has {count} items"
            self._events.append(MissionRefused(MissionResult.INVALID_SEQUENCE, seq, reason))

    def _ack(self, client: Client, result: MissionResult, kind: int) -> None:
        self._send(client, ack_message(client.address, result, kind))

    def _send(self, client: Client, message: Message) -> None:
        self._outbox.append((client.peer, message))
