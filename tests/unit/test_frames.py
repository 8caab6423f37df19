"""Frames in streams, datagrams and noise, against pymavlink, which makes them and judges them."""

from __future__ import annotations

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.frames import LARGEST_FRAME, FrameReader
from flightstack.mavlink.link import Link, is_unknown

HEARTBEAT = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
UNKNOWN_ID = 54321


def frames(count: int, signed: bool = False, version: int = 2) -> list[bytes]:
    codec = mavlink.MAVLink(None, 255, 190)
    codec.signing.secret_key, codec.signing.sign_outgoing = b"k" * 32, signed
    made = []
    for seq in range(count):
        codec.seq = seq
        message = mavlink.MAVLink_attitude_message(seq, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
        made.append(bytes(message.pack(codec, force_mavlink1=version == 1)))
    return made


def unknown_frame(payload: bytes = b"\x01\x02\x03") -> bytes:
    header = bytes([0xFD, len(payload), 0, 0, 9, 42, 17])
    return header + UNKNOWN_ID.to_bytes(3, "little") + payload + b"\xaa\xbb"


@pytest.mark.parametrize(("signed", "version"), [(False, 2), (True, 2), (False, 1)])
@pytest.mark.parametrize("step", [1, 7, 40, 1000])
def test_a_stream_may_be_cut_anywhere(signed: bool, version: int, step: int) -> None:
    sent = frames(20, signed, version)
    stream, reader = b"".join(sent), FrameReader()
    found = [f.data for at in range(0, len(stream), step) for f in reader.feed(stream[at : at + step])]
    assert found == sent
    assert reader.faults == 0
    assert not reader.has_partial


@settings(max_examples=200)
@given(st.lists(st.one_of(st.binary(max_size=60), st.integers(0, 4)), max_size=20), st.integers(1, 300))
def test_frames_are_found_between_noise(parts: list, step: int) -> None:
    """What is reported is always a frame that was sent: noise may hide a frame, but never makes a known one."""
    sent = frames(5)
    stream = b"".join(sent[part] if isinstance(part, int) else part for part in parts)
    reader = FrameReader()
    found = [f for at in range(0, len(stream), step) for f in reader.feed(stream[at : at + step])]
    assert all(f.data in sent for f in found if f.known)
    if not any(isinstance(part, bytes) for part in parts):
        assert [f.data for f in found] == [sent[part] for part in parts]


def test_a_frame_behind_a_false_start_is_not_lost() -> None:
    """A start whose length covers the next frames swallows none of them."""
    sent = frames(10)
    heart_id = mavlink.MAVLINK_MSG_ID_HEARTBEAT.to_bytes(3, "little")
    false_start = bytes([0xFD, 200, 0, 0, 0, 1, 1]) + heart_id
    found = FrameReader().feed(false_start + b"".join(sent))
    assert [f.data for f in found] == sent


def test_new_frame_discards_incomplete_one() -> None:
    (first, second) = frames(2)
    reader = FrameReader()
    assert reader.feed(first[:20]) == []
    assert [f.data for f in reader.feed(second)] == [second]
    assert reader.faults == 1


def test_long_noise_holds_less_than_a_frame() -> None:
    """pymavlink's own search keeps all of it as long as some frame is incomplete."""
    reader, chance = FrameReader(), random.Random(3)
    for _ in range(2000):
        reader.feed(chance.randbytes(500))
        assert reader.partial_size < LARGEST_FRAME
    assert reader.faults > 2000


def test_flags_that_we_do_not_understand_make_a_frame_unreadable() -> None:
    frame = bytearray(frames(1)[0])
    frame[2] = 0x02
    reader = FrameReader()
    assert [f for f in reader.feed(bytes(frame)) if f.known] == []
    assert reader.faults > 0


def test_noise_rarely_parses_as_frame() -> None:
    """One in a hundred pieces of noise holds what could be an unknown message; none a known one, with this seed."""
    chance, reader = random.Random(1), FrameReader()
    found = [frame for _ in range(5000) for frame in reader.feed(chance.randbytes(280))]
    assert not [frame for frame in found if frame.known]
    assert len(found) < 100


def test_unknown_messages_are_counted_and_kept_only_on_request() -> None:
    plain, keeping = Link(1, 1), Link(1, 1, keeps_unknown=True)
    assert list(plain.decode(unknown_frame())) == []
    (message,) = keeping.decode(unknown_frame())
    assert plain.bad == keeping.bad == 1
    assert is_unknown(message)
    assert (message.get_srcSystem(), message.get_srcComponent(), message.get_seq()) == (42, 17, 9)
    assert message.get_msgId() == UNKNOWN_ID
    assert bytes(message.get_msgbuf()) == unknown_frame()


def test_a_known_message_has_its_frame_as_received() -> None:
    (frame,) = frames(1)
    for data in (frame, b"noise" + frame):
        (message,) = Link(1, 1).decode(data)
        assert not is_unknown(message)
        assert bytes(message.get_msgbuf()) == frame
