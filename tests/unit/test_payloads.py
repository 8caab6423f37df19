"""Frames of message objects equal pymavlink's, byte for byte, in all messages of the dialects."""

from __future__ import annotations

from random import Random
from typing import Any

import pytest

from flightstack.mavlink.dialect import ardupilot_dialect, mavlink
from flightstack.mavlink.fields import RANGES, STRUCT_CODES, fit
from flightstack.mavlink.link import Link
from flightstack.mavlink.payloads import payload_of

ardupilot_dialect()
KINDS = sorted(mavlink.mavlink_map.values(), key=lambda kind: kind.id)


def value_of(field_type: str, random: Random) -> float:
    """Return a value of a field; half of them are zero."""
    code = STRUCT_CODES[field_type]
    if random.random() < 0.5:
        return 0
    return random.uniform(-1e6, 1e6) if code in "fd" else random.randint(*RANGES[code])


def message_of(kind: Any, random: Random) -> Any:
    """Return a message of random values, whose arrays of bytes are ``bytes`` or lists."""
    lengths = dict(zip(kind.ordered_fieldnames, kind.array_lengths, strict=True))
    values: list[Any] = []
    for name, field_type in zip(kind.fieldnames, kind.fieldtypes, strict=True):
        length = lengths[name]
        if field_type == "char":
            values.append(random.randbytes(random.randint(0, length)))
        elif length:
            items = [value_of(field_type, random) for _ in range(length)]
            values.append(bytes(items) if field_type == "uint8_t" and random.random() < 0.5 else items)
        else:
            values.append(value_of(field_type, random))
    return kind(*values)


@pytest.mark.parametrize("seed", range(4))
def test_frame_of_each_message_has_pymavlinks_bytes(seed: int) -> None:
    random, link, codec = Random(seed), Link(7, 8), mavlink.MAVLink(None, 7, 8)
    for kind in KINDS:
        message = message_of(kind, random)
        codec.seq = link.sent % 256
        assert link.encode(message) == message.pack(codec), kind.msgname
    assert link.sent == len(KINDS) > 300


def test_received_message_is_sent_on_with_the_same_payload() -> None:
    random, link = Random(1), Link(7, 8)
    for kind in KINDS:
        message = message_of(kind, random)
        (received,) = Link(1, 1).decode(link.encode(message))
        assert payload_of(received) == payload_of(message), kind.msgname


def test_values_out_of_range_are_fitted_in_the_message() -> None:
    octets = [300, -1, 2.6, *[0] * 248]
    message = mavlink.MAVLink_file_transfer_protocol_message(-5, 1, 1, octets)
    assert payload_of(message) == b"\x00\x01\x01\xff\x00\x03"
    assert message.target_network == 0
    item = mavlink.MAVLink_mission_item_reached_message(70_000)
    assert payload_of(item) == b"\xff\xff"
    plain = mavlink.MAVLink_mission_item_reached_message(70_000)
    fit(plain)
    assert item.seq == plain.seq == 65_535


@pytest.mark.parametrize("octets", [[1] * 250, b"\1" * 250], ids=["list", "bytes"])
def test_array_that_is_too_short_is_refused(octets: Any) -> None:
    numbers = mavlink.MAVLink_battery_status_message(0, 0, 0, 0, [1] * 9, 0, 0, 0, 0)
    with pytest.raises(Exception, match="26 items"):
        payload_of(numbers)
    with pytest.raises(Exception, match="251 items"):
        payload_of(mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, octets))
