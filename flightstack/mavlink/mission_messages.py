"""What both sides of the mission protocol share: timing, and items to and from messages.

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
from flightstack.plan.vocabulary import GLOBAL_FRAMES

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
"""Messages of the protocol that go to a vehicle."""

GOES_THERE, CHANGES_ALTITUDE = 2, 3
"""Values of an item's ``current`` that make it no part of a plan: fly there now (``ground.guided_items``)."""

_ITEM = struct.Struct("<ffffiifHB?")


class Timing(NamedTuple):
    """Waits of the protocol [s of whatever clock drives it]; the recommended values of the specification."""

    timeout_s: float = 1.5
    """Before any message but a request for an item is sent again."""
    item_timeout_s: float = 0.25
    """Before a request for an item is sent again."""
    retries: int = 5
    """How often a message but a request for an item is sent again."""
    silence_s: float = 5.0
    """How long items are asked for without any answer.

    PX4's value. The five retries that the specification recommends would last 1.5 s: with 20 % loss each way,
    one item in 460 would be lost by all six attempts, so that half of all missions of 320 items would fail.
    """

    settle_s: float = 0.5
    """Quiet time between two operations of one client that late messages could mix.

    No message says which transfer it belongs to.
    """


DEFAULT_TIMING = Timing()


def item_from_message(message: Message) -> MissionItem:
    """Return the item of a MISSION_ITEM_INT or a (deprecated, float) MISSION_ITEM."""
    x, y = message.x, message.y
    if message.get_type() == "MISSION_ITEM":
        is_global = message.frame in GLOBAL_FRAMES
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
    """Return the MISSION_ITEM_INT of an item, or the MISSION_ITEM, good to about a metre only."""
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
    """Return a MISSION_ACK; the id is that of the plan that a vehicle has accepted."""
    return mavlink.MAVLink_mission_ack_message(to.system, to.component, result, mission_type, opaque_id)


def mission_id(items: Sequence[MissionItem]) -> int:
    """Return a number that stands for the contents of a plan; 0 for an empty one.

    It is MAVLink's opaque id: the same plan has it whenever and by whomever it was uploaded.
    """
    checksum = 0
    for item in items:
        # one NaN for all: senders have many, which mean the same
        floats = [math.nan if math.isnan(v) else as_float32(v) for v in (*item.params, item.z)]
        checksum = zlib.crc32(
            _ITEM.pack(*floats[:4], item.x, item.y, floats[4], item.command, item.frame, item.autocontinue),
            checksum,
        )
    return checksum or 1 if items else 0
