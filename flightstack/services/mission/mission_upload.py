"""State of one upload: the received items, and the requests for the next one."""

from __future__ import annotations

from collections.abc import Hashable
from typing import NamedTuple

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address, Message
from flightstack.mavlink.mission_messages import ItemTimeout, Timing, item_from_message
from flightstack.plan.item import MissionItem

_ATTEMPTS_PER_KIND = 4  # three requests of the preferred type, then one of the other


class Client(NamedTuple):
    """A client: its peer and its MAVLink address."""

    peer: Hashable
    address: Address


class Upload:
    """Collects the items of one upload in order, and repeats requests after a timeout."""

    def __init__(self, client: Client, mission_type: int, count: int, timing: Timing, now_s: float) -> None:
        self.client = client
        self.mission_type = mission_type
        self.count = count
        self.items: list[MissionItem] = []
        self._timing = timing
        self._item_timeout = ItemTimeout(timing.item_timeout_s)
        self._prefers_int = True
        self._attempts = 0
        self._may_request_early = True
        self._may_change_kind = True
        self.deadline_s = now_s
        self._give_up_s = now_s + timing.silence_s

    @property
    def is_complete(self) -> bool:
        """True if all items were received."""
        return len(self.items) == self.count

    def is_silent(self, now_s: float) -> bool:
        """Return True if the client has not answered within the timeout of the upload."""
        return now_s >= self._give_up_s

    def accept(self, message: Message, now_s: float) -> bool:
        """Take an item; return True if it was the requested one.

        A copy of an earlier item is dropped. A later item shows that one was lost: repeat the request at once, but
        only once, since each further request would duplicate items.
        """
        if message.seq != len(self.items):
            if message.seq > len(self.items) and self._may_request_early:
                self._may_request_early = False
                self.deadline_s = now_s
            return False
        self.items.append(item_from_message(message))
        self._item_timeout.answered(now_s)
        self._prefers_int = message.get_type() == "MISSION_ITEM_INT"
        self._attempts = 0
        self._may_request_early = True
        self.deadline_s = now_s
        self._give_up_s = now_s + self._timing.silence_s
        return True

    def change_kind(self, now_s: float) -> bool:
        """Use the other request message from now on; return False if that was tried before."""
        if not self._may_change_kind:
            return False
        self._may_change_kind = False
        self._prefers_int = not self._prefers_int
        self._attempts = 0
        self.deadline_s = now_s
        return True

    def request(self, now_s: float) -> Message:
        """Return the request for the next item, and restart its timeout.

        Older clients answer only the deprecated MISSION_REQUEST, so every fourth request is of the other type.
        """
        self._attempts += 1
        is_int = self._prefers_int != (self._attempts % _ATTEMPTS_PER_KIND == 0)
        kind = mavlink.MAVLink_mission_request_int_message
        if not is_int:
            kind = mavlink.MAVLink_mission_request_message
        self._item_timeout.asked(now_s, again=self._attempts > 1)
        self.deadline_s = now_s + self._item_timeout.timeout_s
        return kind(*self.client.address, len(self.items), self.mission_type)
