"""Signing against pymavlink's own in both directions, replays, timestamps, and links that must be signed."""

from __future__ import annotations

import struct
import time
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink import mavutil
from pymavlink.dialects.v20 import common

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link
from flightstack.mavlink.signing import (
    KEEP_TICKS,
    LARGEST_TIMESTAMP,
    MAX_STREAMS,
    NEW_STREAM_TICKS,
    NO_KEY,
    TICKS_PER_S,
    Counts,
    LinkSigning,
    Signing,
    timestamp_of,
    without_signature,
)

KEY, OTHER_KEY = bytes(range(32)), bytes(range(1, 33))
NOW_S = 1.75e9
NOW = timestamp_of(NOW_S)


class Clock:
    def __init__(self, now_s: float = NOW_S) -> None:
        self.now_s = now_s

    def __call__(self) -> float:
        return self.now_s


def signing(key: bytes = KEY, **more: Any) -> Signing:
    return Signing(key, Clock(), **more)


def peer(key: bytes = KEY, timestamp: int = NOW, link_id: int = 3, system: int = 255) -> common.MAVLink:
    """The other end, as raw pymavlink has it."""
    codec = common.MAVLink(None, system, 190)
    codec.robust_parsing = True
    codec.signing.secret_key = key
    codec.signing.sign_outgoing = True
    codec.signing.timestamp = timestamp
    codec.signing.link_id = link_id
    return codec


def heartbeat() -> Any:
    return mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)


def text(words: str) -> Any:
    return mavlink.MAVLink_statustext_message(6, words.encode())


def packed(codec: common.MAVLink, message: Any = None) -> bytes:
    frame = bytes((heartbeat() if message is None else message).pack(codec))
    codec.seq = (codec.seq + 1) % 256
    return frame


def link(own: Signing, **more: Any) -> Link:
    return Link(1, 1, signing=LinkSigning(own, 7, **more))


def taken(receiver: Link, *frames: bytes) -> int:
    return sum(len(list(receiver.decode(frame))) for frame in frames)


# ---------------------------------------------------------------------- with pymavlink


def test_pymavlink_accepts_signed_frames() -> None:
    own, receiver = signing(), peer()
    sender = link(own)
    for index in range(300):
        (message,) = receiver.parse_buffer(sender.encode(text(f"number {index}")))
        assert (message.text, message.get_signed(), message.get_link_id()) == (f"number {index}", True, 7)
    assert receiver.signing.goodsig_count == 300
    assert receiver.signing.timestamp == own.timestamp


def test_pymavlink_takes_one_message_signed_on_two_links() -> None:
    message, receiver = text("to all"), peer()
    first, second = link(signing()), link(signing())
    first.encode(message)
    (received,) = receiver.parse_buffer(second.encode(message))
    assert (received.text, received.get_signed()) == ("to all", True)


def test_accepts_frames_signed_by_pymavlink() -> None:
    own = signing()
    receiver, sender = link(own), peer()
    assert taken(receiver, *(packed(sender, text(f"number {index}")) for index in range(300))) == 300
    assert own.counts == Counts(good=300)
    assert own.timestamp == NOW + 299


def test_a_stream_of_signed_frames_is_taken_in_any_pieces() -> None:
    receiver, sender = link(signing()), peer()
    stream = b"".join(packed(sender, text("piece " * index)) for index in range(8))
    assert taken(receiver, *(stream[at : at + 5] for at in range(0, len(stream), 5))) == 8


def test_mavutils_setup_signing_talks_to_us() -> None:
    """Both directions at once, with the machine's clock, as a script with mavutil does it."""
    connection = mavutil.mavfile(None, "test")
    connection.mav = common.MAVLink(None, 255, 190)
    connection.setup_signing(KEY)
    own = Signing(KEY, time.time)
    us = link(own)
    for _ in range(20):
        assert taken(us, packed(connection.mav)) == 1
        (message,) = connection.mav.parse_buffer(us.encode(heartbeat()))
        assert message.get_signed()
    assert own.counts.refused == 0


@given(
    st.binary(min_size=32, max_size=32).filter(any),
    st.integers(0, 255),
    st.integers(1, LARGEST_TIMESTAMP - 1),
)
def test_a_signature_is_pymavlinks_octet_by_octet(key: bytes, link_id: int, timestamp: int) -> None:
    codec = peer(key, timestamp, link_id)
    expected = packed(codec, text("same"))
    codec.signing.sign_outgoing, codec.seq = False, 0
    unsigned = packed(codec, text("same"))
    ours = Signing(key, Clock(0.0), latest=timestamp - 1)
    assert ours.sign(unsigned, common.MAVLink_statustext_message.crc_extra, link_id) == expected


# ---------------------------------------------------------------------- what is refused


def test_unsigned_frames_are_refused_but_for_those_of_radios() -> None:
    own = signing()
    receiver, sender = link(own), common.MAVLink(None, 255, 190)
    radio = mavlink.MAVLink_radio_status_message(1, 2, 3, 4, 5, 6, 7)
    assert taken(receiver, packed(sender), bytes(heartbeat().pack(sender, force_mavlink1=True))) == 0
    assert taken(receiver, packed(sender, radio), bytes(radio.pack(sender, force_mavlink1=True))) == 2
    assert own.counts == Counts(unsigned_taken=2, unsigned_refused=2)
    assert receiver.bad == 2
    assert own.counts.refused == 2


@pytest.mark.parametrize("where", ["everywhere", "on this link"])
def test_unsigned_frames_are_taken_where_they_are_allowed_but_never_wrong_ones(where: str) -> None:
    own = signing(allow_unsigned=where == "everywhere")
    receiver = link(own, trusted=where == "on this link")
    assert (
        taken(receiver, packed(common.MAVLink(None, 255, 190)), packed(peer()), packed(peer(OTHER_KEY))) == 2
    )
    assert own.counts == Counts(good=1, unsigned_taken=1, bad_signature=1)


def test_a_frame_of_another_key_is_refused_and_changes_nothing() -> None:
    own = signing()
    receiver, sender = link(own), peer()
    before = own.timestamp
    forged = packed(peer(OTHER_KEY, timestamp=LARGEST_TIMESTAMP - 5))
    assert taken(receiver, forged) == 0
    assert own.timestamp == before
    assert taken(receiver, packed(sender)) == 1  # pymavlink's own check would refuse this stream for ever
    assert own.counts == Counts(good=1, bad_signature=1)


@given(st.integers(0, 10_000), st.integers(1, 255))
def test_a_changed_octet_is_refused(place: int, change: int) -> None:
    own = signing()
    frame = bytearray(packed(peer(), text("hold")))
    frame[place % len(frame)] ^= change
    assert taken(link(own), bytes(frame)) == 0


def test_a_replay_is_refused_on_every_link() -> None:
    own = signing()
    first, second, sender = link(own), link(own), peer()
    frames = [packed(sender) for _ in range(5)]
    assert taken(first, *frames) == 5
    assert taken(first, *frames) == taken(second, *frames) == 0
    assert own.counts == Counts(good=5, replayed=10)


def test_an_overtaken_frame_is_refused() -> None:
    own, sender = signing(), peer()
    early, late = packed(sender), packed(sender)
    assert taken(link(own), late, early) == 1
    assert own.counts == Counts(good=1, replayed=1)


def test_each_stream_has_timestamps_of_its_own() -> None:
    own = signing()
    receiver = link(own)
    for system, link_id in ((255, 3), (255, 4), (254, 3)):
        assert taken(receiver, packed(peer(system=system, link_id=link_id))) == 1
    assert own.counts.good == 3


def test_a_new_stream_may_be_a_minute_behind_and_no_more() -> None:
    for behind, expected in ((NEW_STREAM_TICKS, 1), (NEW_STREAM_TICKS + 1, 0)):
        own = signing()
        assert taken(link(own), packed(peer(timestamp=NOW - behind))) == expected
        assert own.counts == Counts(good=expected, too_old=1 - expected)


def test_a_known_stream_goes_on_however_late_it_is() -> None:
    clock = Clock()
    own = Signing(KEY, clock)
    receiver, sender = link(own), peer()
    assert taken(receiver, packed(sender)) == 1
    clock.now_s += 3600.0
    assert taken(receiver, packed(sender)) == 1


def test_streams_do_not_fill_the_memory() -> None:
    own = signing()
    receiver = link(own)
    for index in range(MAX_STREAMS + 10):
        taken(receiver, packed(peer(system=1 + index % 250, link_id=index // 250)))
    assert own.counts == Counts(good=MAX_STREAMS, too_old=10)


def test_without_a_key_nothing_is_signed_and_all_is_taken() -> None:
    own = signing(NO_KEY)
    us = link(own)
    assert not own.is_on
    assert us.encode(heartbeat())[2] == 0
    assert taken(us, packed(peer()), packed(common.MAVLink(None, 255, 190))) == 2
    assert own.counts == Counts()


def test_unknown_messages_are_passed_on_only_when_they_are_signed() -> None:
    own = signing()
    receiver = Link(1, 1, keeps_unknown=True, signing=LinkSigning(own, 7))
    unsigned = b"\xfd\x01\x00\x00\x00\xff\xbe" + (54321).to_bytes(3, "little") + b"x" + b"\0\0"
    assert taken(receiver, unsigned) == 0
    signed = Signing(KEY, Clock()).sign(unsigned, 0, 3)
    assert taken(receiver, signed) == 1


# ---------------------------------------------------------------------- our timestamps


def test_timestamps_follow_the_clock_and_never_repeat() -> None:
    clock = Clock()
    own = Signing(KEY, clock)
    first = own.next_timestamp()
    assert first == NOW
    assert own.next_timestamp() == first + 1  # the clock stands still
    clock.now_s += 1.0
    assert own.next_timestamp() == first + TICKS_PER_S
    clock.now_s -= 100.0  # and is set back
    assert own.next_timestamp() == first + TICKS_PER_S + 1


def test_a_heard_timestamp_takes_ours_along() -> None:
    own = signing()
    assert taken(link(own), packed(peer(timestamp=NOW + 999))) == 1
    assert own.next_timestamp() == NOW + 1000


@given(st.lists(st.tuples(st.floats(0.0, 70.0), st.integers(0, 9_000_000), st.booleans()), max_size=30))
def test_timestamps_rise_over_orderly_ends(steps: list[tuple[float, int, bool]]) -> None:
    """Frames sent and heard, a clock that is set back now and then, and starts anew."""
    disk, used, clock = [0], [], Clock()

    def start() -> Signing:
        return Signing(KEY, clock, disk[0], lambda latest: disk.__setitem__(0, latest))

    own = start()
    for seconds, heard_ahead, ends in steps:
        clock.now_s += seconds - 20.0
        if heard_ahead % 2:
            ahead = max(own.timestamp, timestamp_of(clock.now_s)) + heard_ahead
            own.accepts(packed(peer(timestamp=ahead, link_id=len(used) % 256)))
        used.append(own.next_timestamp())
        if ends:
            own.close()
            own = start()
    assert used == sorted(set(used))


@given(st.lists(st.tuples(st.floats(1e-4, 70.0), st.booleans()), max_size=30))
def test_timestamps_follow_the_clock_over_crashes(steps: list[tuple[float, bool]]) -> None:
    disk, clock = [0], Clock()

    def start() -> Signing:
        return Signing(KEY, clock, disk[0], lambda latest: disk.__setitem__(0, latest))

    own = start()
    for seconds, crashes in steps:
        clock.now_s += seconds
        assert own.next_timestamp() == timestamp_of(clock.now_s)
        assert timestamp_of(clock.now_s) - disk[0] < KEEP_TICKS
        if crashes:
            own = start()


def test_an_orderly_end_keeps_the_latest_timestamp() -> None:
    kept: list[int] = []
    clock = Clock()
    own = Signing(KEY, clock, keep=kept.append)
    own.next_timestamp()
    clock.now_s += 1.0
    own.next_timestamp()
    own.close()
    own.close()
    assert kept == [NOW, NOW + TICKS_PER_S]


def test_the_last_timestamp_of_all_is_no_end() -> None:
    own = signing()
    us = link(own)
    assert taken(us, packed(peer(timestamp=LARGEST_TIMESTAMP - 1))) == 1
    assert [len(us.encode(heartbeat())) for _ in range(3)] == [34] * 3
    own.set_key(OTHER_KEY, 2**64 - 1)
    assert len(us.encode(heartbeat())) == 34


@pytest.mark.parametrize("unix_s", [-1e300, 0.0, 1.4e9, 1e300])
def test_any_clock_makes_a_timestamp(unix_s: float) -> None:
    assert 0 <= timestamp_of(unix_s) <= LARGEST_TIMESTAMP


def test_a_new_key_makes_old_frames_worthless() -> None:
    own = signing()
    us, sender = link(own), peer()
    frame = packed(sender)
    own.set_key(OTHER_KEY)
    assert taken(us, frame) == 0
    assert taken(us, packed(peer(OTHER_KEY))) == 1
    with pytest.raises(ValueError, match="32"):
        own.set_key(b"short")


# ---------------------------------------------------------------------- logs, and anything at all


def test_a_log_gets_the_frame_without_its_signature() -> None:
    codec = peer()
    signed = packed(codec, text("logged"))
    codec.signing.sign_outgoing, codec.seq = False, 0
    unsigned = packed(codec, text("logged"))
    extra = common.MAVLink_statustext_message.crc_extra
    assert without_signature(signed, extra) == without_signature(unsigned, extra) == unsigned


@settings(max_examples=300)
@given(st.binary(max_size=80), st.integers(0, 1), st.booleans())
def test_any_octets_are_taken_without_an_error(junk: bytes, flags: int, has_header: bool) -> None:
    receiver = link(signing())
    header = (
        struct.pack("<BBBBBBBHB", 0xFD, len(junk) % 256, flags, 0, 0, 255, 190, 0, 0) if has_header else b""
    )
    assert taken(receiver, header + junk) == 0
    receiver.decode(b"")
