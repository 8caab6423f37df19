"""Our decoder makes the messages that pymavlink's makes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from random import Random
from typing import Any

import pytest

from flightstack.mavlink.decoding import field_reader, received
from flightstack.mavlink.dialect import ardupilot_dialect, mavlink
from flightstack.mavlink.fields import TEXT_FIELDS, clean
from flightstack.mavlink.frames import MAGIC_V1, checksum, pack_frame
from flightstack.mavlink.link import Link
from flightstack.mavlink.signing import KEY_SIZE, Signing
from gcs_cli.tui.fly.history import History

ardupilot_dialect()
KINDS = list(mavlink.mavlink_map.values())
_ORACLE = mavlink.MAVLink(None, 255, 190)


def _version_2(kind: Any, payload: bytes) -> bytes:
    return pack_frame(kind.id, payload, kind.crc_extra, sequence=200, system_id=7, component_id=9)


def _version_1(kind: Any, payload: bytes) -> bytes:
    body = bytes((len(payload), 200, 7, 9, kind.id)) + payload
    return bytes((MAGIC_V1,)) + body + checksum(body, kind.crc_extra)


def _parts(message: Any, kind: Any) -> str:
    """Return all that users read of a message; as text, because NaN differs from itself."""
    values = {name: getattr(message, name) for name in kind.fieldnames}
    raw = {name: bytes(getattr(message, f"_{name}_raw")) for name in TEXT_FIELDS[kind]}
    for name in raw:
        values[name] = clean(values[name])
    sender = message.get_srcSystem(), message.get_srcComponent(), message.get_seq(), message.get_msgId()
    buffers = bytes(message.get_msgbuf()), bytes(message.get_payload()), message.get_crc()
    described = message.get_type(), message.get_fieldnames(), message.instance_field, message.id
    signed = message.get_signed(), message.get_link_id()
    return repr((values, raw, sender, buffers, described, signed, vars(message.get_header())))


def _payloads(kind: Any, random: Random) -> Iterator[bytes]:
    """Yield random payloads: whole, without zeros at the end, and one of a later dialect, which is longer."""
    size = kind.unpacker.size
    for length in (size, max(1, size - 1), max(1, size // 2), 1, min(255, size + 4)):
        yield random.randbytes(length - 1) + b"\x01"


def _signed(kind: Any, payload: bytes) -> bytes:
    return Signing(b"k" * KEY_SIZE, lambda: 2e9).sign(_version_2(kind, payload), kind.crc_extra, 3)


@pytest.mark.parametrize("frame_of", [_version_1, _version_2, _signed])
def test_messages_equal_those_of_pymavlink(frame_of: Callable[[Any, bytes], bytes]) -> None:
    random = Random(1)
    kinds = [kind for kind in KINDS if frame_of is not _version_1 or kind.id < 256]
    for kind in kinds:
        for payload in _payloads(kind, random):
            frame = frame_of(kind, payload)
            oracle = _ORACLE.decode(bytearray(frame))
            message = received(frame, kind)
            if not TEXT_FIELDS[kind]:
                assert str(message) == str(oracle)
                assert repr(message.to_dict()) == repr(oracle.to_dict())
            assert _parts(message, kind) == _parts(oracle, kind), kind.msgname
    assert len(kinds) > 100


def test_fields_are_read_in_any_order() -> None:
    random = Random(2)
    for kind in KINDS:
        frame = _version_2(kind, next(_payloads(kind, random)))
        oracle = _ORACLE.decode(bytearray(frame))
        for name in kind.fieldnames:
            value, expected = getattr(received(frame, kind), name), getattr(oracle, name)
            assert repr(value) == repr(clean(expected) if name in TEXT_FIELDS[kind] else expected)


def test_field_reader_reads_what_the_attributes_hold() -> None:
    random = Random(3)
    for kind in (mavlink.MAVLink_attitude_target_message, mavlink.MAVLink_global_position_int_message):
        read = field_reader(kind.msgname, *kind.fieldnames)
        for frame_of in (_version_1, _version_2):
            for payload in _payloads(kind, random):
                message = received(frame_of(kind, payload), kind)
                shown = [list(value) if isinstance(value, tuple) else value for value in read(message)]
                assert repr(shown) == repr([getattr(message, name) for name in kind.fieldnames])


@pytest.mark.parametrize("frame_of", [_version_1, _version_2])
def test_field_reader_reads_each_number_alone(frame_of: Callable[[Any, bytes], bytes]) -> None:
    random = Random(4)
    for kind in KINDS:
        if not hasattr(mavlink, kind.__name__) or (frame_of is _version_1 and kind.id > 255):
            continue
        lengths = dict(zip(kind.ordered_fieldnames, kind.array_lengths, strict=True))
        for name in (name for name in kind.fieldnames if not lengths[name]):
            read = field_reader(kind.msgname, name)
            for payload in _payloads(kind, random):
                message = received(frame_of(kind, payload), kind)
                assert repr(read(message)) == repr(getattr(message, name)), (kind.msgname, name)


def test_changed_field_keeps_its_value_when_others_are_decoded() -> None:
    message = received(
        _version_2(mavlink.MAVLink_attitude_message, b"\x01" * 28), mavlink.MAVLink_attitude_message
    )
    message.roll = 2.0
    assert message.pitch != 2.0
    assert message.roll == 2.0


def test_message_with_a_wrong_checksum_is_refused() -> None:
    link = Link(255, 190)
    frame = bytearray(Link(1, 1).encode(mavlink.MAVLink_attitude_message(1, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)))
    for place in (4, 12, len(frame) - 1):
        wrong = frame.copy()
        wrong[place] ^= 1
        assert not list(link.decode(bytes(wrong)))
    assert (link.received, link.bad) == (0, 3)


def test_received_message_can_be_changed_and_sent_again() -> None:
    """A router sends what it receives; other users change a copy of a message of theirs."""
    (first,) = Link(255, 190).decode(Link(1, 1).encode(mavlink.MAVLink_mission_current_message(3, 9)))
    first.seq = 4
    (again,) = Link(255, 190).decode(Link(1, 1).encode(first))
    assert (again.seq, again.total, again.get_type()) == (4, 9, "MISSION_CURRENT")


def test_history_of_decoded_messages_keeps_lists_and_numbers() -> None:
    sender, receiver, history = Link(1, 1), Link(255, 190), History()
    for step in range(3):
        target = mavlink.MAVLink_attitude_target_message(
            step, 0, [1.0, 0.0, step / 4, 0.0], 0.0, 0.0, 0.0, 0.5
        )
        (message,) = receiver.decode(sender.encode(target))
        history.record(message, 0.1 * step)
    assert history.series("ATTITUDE_TARGET.q[2]").values.tolist() == [0.0, 0.25, 0.5]
    assert history.series("ATTITUDE_TARGET.time_boot_ms").values.tolist() == [0.0, 1.0, 2.0]
