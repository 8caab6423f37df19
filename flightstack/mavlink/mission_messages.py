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
from flightstack.plan.item import MissionItem, float_coordinate, integer_coordinate
from flightstack.plan.vocabulary import SCALED_FRAMES

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
    """Timeout before an item request is resent."""
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
