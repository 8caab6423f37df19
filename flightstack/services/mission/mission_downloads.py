"""Downloads in progress. Each serves the plan that was in force when the client requested its count.

If a plan is replaced during a download, the client must not receive a mix of both.
"""

from __future__ import annotations

from typing import NamedTuple

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Message
from flightstack.mavlink.mission_messages import message_from_item
from flightstack.plan.commands import MissionType
from flightstack.plan.item import MissionItem
from flightstack.services.mission.mission_upload import Client

_FORGET_AFTER_S = 30.0
_MAX_DOWNLOADS = 64  # bounds memory if clients do not finish their downloads


class _Download(NamedTuple):
    items: tuple[MissionItem, ...]
    plan_id: int
    served: int
    """Number of items requested so far."""
    heard_s: float
    is_switched: bool = False
    """True if it replaced an incomplete download of another plan."""

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
        """Start a download of ``items``, and return their count and id.

        During a download, the request is a new one or a late copy, which cannot be distinguished. If the plan has
        changed, ``answer`` withholds further items until the client requests the first one again.
        """
        last = self._by_client.get((client, kind))
        is_half_done = last is not None and last.is_half_done and now_s - last.heard_s < _FORGET_AFTER_S
        if last is not None and is_half_done and last.plan_id == plan_id:
            self._keep(client, kind, last._replace(heard_s=now_s))
        else:
            self._keep(client, kind, _Download(items, plan_id, 0, now_s, is_half_done))
        return len(items), plan_id

    def end(self, client: Client, kind: int) -> None:
        """Remove a download."""
        self._by_client.pop((client, kind), None)

    def answer(
        self,
        request: Message,
        client: Client,
        stored: tuple[MissionItem, ...],
        current_seq: int,
        now_s: float,
    ) -> Message | None:
        """Return the requested item, or None if its number does not exist.

        A client that continues in a plan that was replaced gets MISSION_COUNT again, with another id.

        Without a download in progress the item is that of the stored plan. As in PX4, the deprecated MISSION_REQUEST
        is answered with MISSION_ITEM: clients that send it may not support MISSION_ITEM_INT.
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
        self._by_client.pop((client, kind), None)  # sorted by the time of the last request
        self._by_client[client, kind] = download
        if len(self._by_client) > _MAX_DOWNLOADS:
            del self._by_client[next(iter(self._by_client))]
