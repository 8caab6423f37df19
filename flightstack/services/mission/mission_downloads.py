"""The downloads under way. Each serves the mission as it was when the client asked for its count.

So a mission that is replaced meanwhile never reaches a client half old and half new.
"""

from __future__ import annotations

from typing import NamedTuple

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Message
from flightstack.mavlink.mission_messages import message_from_item
from flightstack.plan.item import MissionItem
from flightstack.plan.vocabulary import MissionType
from flightstack.services.mission.mission_upload import Client

_FORGET_AFTER_S = 30.0
_MAX_DOWNLOADS = 64  # a bound on memory, should clients never end theirs


class _Download(NamedTuple):
    items: tuple[MissionItem, ...]
    plan_id: int
    served: int
    """How many of the items were asked for, from the first on."""
    heard_s: float
    is_switched: bool = False
    """Whether it took the place of one of another plan that was half across."""

    @property
    def is_half_done(self) -> bool:
        return 0 < self.served < len(self.items)


class Downloads:
    """The downloads of all clients."""

    def __init__(self) -> None:
        self._by_client: dict[tuple[Client, int], _Download] = {}

    def begin(
        self, client: Client, kind: int, items: tuple[MissionItem, ...], plan_id: int, now_s: float
    ) -> tuple[int, int]:
        """Begin a download of ``items``, and return their count and id.

        In the middle of a download this is a new one, or a late copy of the request: nobody can tell. If the
        plan has changed meanwhile, ``answer`` holds back the rest of it until the client has begun anew.
        """
        before = self._by_client.get((client, kind))
        is_half_done = before is not None and before.is_half_done and now_s - before.heard_s < _FORGET_AFTER_S
        if before is not None and is_half_done and before.plan_id == plan_id:
            self._keep(client, kind, before._replace(heard_s=now_s))
        else:
            self._keep(client, kind, _Download(items, plan_id, 0, now_s, is_half_done))
        return len(items), plan_id

    def end(self, client: Client, kind: int) -> None:
        """Forget a download."""
        self._by_client.pop((client, kind), None)

    def answer(
        self,
        request: Message,
        client: Client,
        stored: tuple[MissionItem, ...],
        current_seq: int,
        now_s: float,
    ) -> Message | None:
        """Return the item asked for, or None if there is none of that number.

        A client that goes on where it was in a plan that has been replaced gets the count again, with another id.

        Without a download under way it is the stored mission's. A client that asks with the deprecated
        MISSION_REQUEST gets a MISSION_ITEM, as from PX4: those that still ask so know no other.
        """
        kind = request.mission_type
        items = stored
        download = self._by_client.get((client, kind))
        if download is not None and now_s - download.heard_s < _FORGET_AFTER_S:
            items = download.items
            if download.is_switched and request.seq > download.served:
                return mavlink.MAVLink_mission_count_message(
                    *client.address, len(items), kind, download.plan_id
                )
            served = max(download.served, min(request.seq + 1, len(items)))
            self._keep(client, kind, download._replace(served=served, heard_s=now_s))
        if request.seq >= len(items):
            return None
        return message_from_item(
            items[request.seq],
            request.seq,
            client.address,
            kind,
            is_current=kind == MissionType.MISSION and request.seq == current_seq,
            is_int=request.get_type() == "MISSION_REQUEST_INT",
        )

    def _keep(self, client: Client, kind: int, download: _Download) -> None:
        self._by_client.pop((client, kind), None)  # the order of the dictionary is that of the last request
        self._by_client[client, kind] = download
        if len(self._by_client) > _MAX_DOWNLOADS:
            del self._by_client[next(iter(self._by_client))]
