"""Mission protocol elements shared by vehicle and ground station: timing, and items to and from messages.

The protocol: https://mavlink.io/en/services/mission.html
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Sequence
from typing import NamedTuple

from flightstack.core.float32 import as_float32
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address, Message
from flightstack.plan.commands import SCALED_FRAMES
from flightstack.plan.item import MissionItem, float_coordinate, integer_coordinate

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
"""Messages of the protocol sent to a vehicle."""

GOES_THERE, CHANGES_ALTITUDE = 2, 3
"""Values of ``current`` for guided items, which are no part of a plan (``services.commands.guided``)."""

_ITEM = struct.Struct("<ffffiifHB?")


class Timing(NamedTuple):
    """Timeouts of the protocol [s of the driving clock], with the specification's recommended values."""

    timeout_s: float = 1.5
    """Timeout before a message other than an item request is resent."""
    item_timeout_s: float = 0.25
    """Longest timeout before an item request is resent; see ``ItemTimeout``."""
    retries: int = 5
    """Number of retries of a message other than an item request."""
    silence_s: float = 5.0
    """Timeout of item requests without any answer, as in PX4.

    The five retries recommended by the specification last 1.5 s: at 20 % loss each way, one item in 460 fails all six
    attempts, and with it half of all missions of 320 items.
    """

    settle_s: float = 0.5
    """Quiet time between two operations of one client, because messages do not identify their transfer.
    """


DEFAULT_TIMING = Timing()


class ItemTimeout:
    """Timeout of item requests, from the measured round trips (RFC 6298), doubled after each loss.

    With a fixed timeout of 0.25 s, 1000 items at 20 % loss in each direction take 150 s on any link. Round trips of
    repeated requests are not measured, since it is not known which request was answered.
    """

    LEAST_S = 0.03
    """A busy vehicle or ground station is late by this much; shorter timeouts only repeat messages."""

    def __init__(self, longest_s: float) -> None:
        self.timeout_s = longest_s
        self._longest_s = longest_s
        self._mean_s: float | None = None
        self._deviation_s = 0.0
        self._asked_s: float | None = None

    def asked(self, now_s: float, *, again: bool) -> None:
        """Note a request, or a repeated one."""
        self._asked_s = None if again else now_s
        if again:
            self.timeout_s = min(self._longest_s, 2.0 * self.timeout_s)

    def answered(self, now_s: float) -> None:
        """Note the answer to the last request."""
        if self._asked_s is not None:
            took_s = now_s - self._asked_s
            if self._mean_s is None:
                self._mean_s, self._deviation_s = took_s, 0.5 * took_s
            else:
                self._deviation_s += 0.25 * (abs(took_s - self._mean_s) - self._deviation_s)
                self._mean_s += 0.125 * (took_s - self._mean_s)
        if self._mean_s is not None:
            wanted_s = self._mean_s + 4.0 * self._deviation_s
            self.timeout_s = min(self._longest_s, max(self.LEAST_S, wanted_s))


def item_from_message(message: Message) -> MissionItem:
    """Return the item of a MISSION_ITEM_INT or of the deprecated MISSION_ITEM."""
    x, y = message.x, message.y
    if message.get_type() == "MISSION_ITEM":
        is_global = message.frame in SCALED_FRAMES
        x, y = integer_coordinate(x, is_global), integer_coordinate(y, is_global)
    return MissionItem(
        message.command, message.frame,
        message.param1, message.param2, message.param3, message.param4,
        x, y, message.z, bool(message.autocontinue),
    )  # fmt: skip


def message_from_item(
    item: MissionItem,
    seq: int,
    to: Address,
    mission_type: int,
    *,
    is_current: bool = False,
    is_int: bool = True,
) -> Message:
    """Return the MISSION_ITEM_INT of an item, or the MISSION_ITEM, with a resolution of about a metre."""
    floats = [as_float32(value) for value in (*item.params, item.z)]
    x: float = item.x
    y: float = item.y
    kind = mavlink.MAVLink_mission_item_int_message
    if not is_int:
        kind = mavlink.MAVLink_mission_item_message
        x, y = float_coordinate(item.x, item.is_global), float_coordinate(item.y, item.is_global)
    return kind(
        to.system, to.component, seq, item.frame, item.command, int(is_current), int(item.autocontinue),
        *floats[:4], x, y, floats[4], mission_type,
    )  # fmt: skip


def ack_message(to: Address, result: int, mission_type: int, opaque_id: int = 0) -> Message:
    """Return a MISSION_ACK with the id of the accepted plan."""
    return mavlink.MAVLink_mission_ack_message(to.system, to.component, result, mission_type, opaque_id)


def mission_id(items: Sequence[MissionItem]) -> int:
    """Return MAVLink's opaque id of a plan, a checksum of its contents; 0 for an empty plan."""
    checksum = 0
    for item in items:
        # one NaN for all bit patterns of NaN
        floats = [math.nan if math.isnan(v) else as_float32(v) for v in (*item.params, item.z)]
        checksum = zlib.crc32(
            _ITEM.pack(*floats[:4], item.x, item.y, floats[4], item.command, item.frame, item.autocontinue),
            checksum,
        )
    return checksum or 1 if items else 0
