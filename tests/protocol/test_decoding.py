"""Our decoder makes the messages that pymavlink's makes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from random import Random
from typing import Any

import pytest

from flightstack.mavlink.decoding import decoded
from flightstack.mavlink.dialect import ardupilot_dialect, mavlink
from flightstack.mavlink.fields import TEXT_FIELDS
from flightstack.mavlink.frames import MAGIC_V1, checksum, pack_frame
from flightstack.mavlink.link import Link
from gcs_cli.tui.fly.history import History

ardupilot_dialect()
KINDS = [kind for kind in mavlink.mavlink_map.values() if not TEXT_FIELDS[kind]]
_ORACLE = mavlink.MAVLink(None, 255, 190)


def _version_2(kind: Any, payload: bytes) -> bytes:
    return pack_frame(kind.id, payload, kind.crc_extra, sequence=200, system_id=7, component_id=9)


def _version_1(kind: Any, payload: bytes) -> bytes:
    body = bytes((len(payload), 200, 7, 9, kind.id)) + payload
    return bytes((MAGIC_V1,)) + body + checksum(body, kind.crc_extra)


def _parts(message: Any) -> str:
    """Return all that a message holds; as text, because NaN differs from itself."""
    attributes = {**vars(message), "_header": vars(message.get_header())}
    buffers = {name: bytes(attributes[name]) for name in ("_msgbuf", "_payload")}
    return repr(sorted({**attributes, **buffers}.items()))


def _payloads(kind: Any, random: Random) -> Iterator[bytes]:
    """Yield random payloads: whole, without zeros at the end, and one of a later dialect, which is longer."""
    size = kind.unpacker.size
    for length in (size, max(1, size - 1), max(1, size // 2), 1, min(255, size + 4)):
        yield random.randbytes(length - 1) + b"\x01"


@pytest.mark.parametrize("frame_of", [_version_1, _version_2])
def test_messages_equal_those_of_pymavlink(frame_of: Callable[[Any, bytes], bytes]) -> None:
    random = Random(1)
    kinds = [kind for kind in KINDS if frame_of is _version_2 or kind.id < 256]
    for kind in kinds:
        for payload in _payloads(kind, random):
            frame = frame_of(kind, payload)
            assert _parts(decoded(frame, kind)) == _parts(_ORACLE.decode(bytearray(frame))), kind.msgname
    assert len(kinds) > 100


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
