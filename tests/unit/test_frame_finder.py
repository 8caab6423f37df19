"""The frame finder: byte streams split anywhere, with junk."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.frames import LARGEST_FRAME, FrameFinder
from flightstack.mavlink.link import Link
from flightstack.simulator_link.hot_frames import ActuatorsFrame

HEARTBEAT = Link(1, 1).encode(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3))
ACTUATORS = bytes(ActuatorsFrame().seal(4000, 6))
VERSION_1 = bytes(
    mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3).pack(mavlink.MAVLink(None), force_mavlink1=True)
)
FRAMES = [HEARTBEAT, ACTUATORS, VERSION_1]
STARTS = [b"\xfd\xff\x00", b"\xfe\xff", b"\xfd", b"\xfe", b"\xfd\x10\x01", HEARTBEAT[:9], ACTUATORS[:50]]
properties = settings(max_examples=200)


@properties
@given(st.lists(st.sampled_from(FRAMES), max_size=8), st.lists(st.integers(1, 60), max_size=30))
def test_a_clean_stream_cut_anywhere_gives_each_frame_once(frames: list[bytes], sizes: list[int]) -> None:
    stream, finder, found = b"".join(frames), FrameFinder(), []
    for size in [*sizes, len(stream)]:
        found += finder.find(stream[:size])
        stream = stream[size:]
    assert found == frames
    assert finder.junk == 0


@properties
@given(
    st.lists(st.tuples(st.one_of(st.sampled_from(STARTS), st.binary(max_size=20)), st.sampled_from(FRAMES)))
)
def test_a_frame_is_found_in_the_piece_that_completes_it(pairs: list[tuple[bytes, bytes]]) -> None:
    """Whatever precedes it. (No junk here is a frame by chance.)"""
    finder = FrameFinder()
    for junk, frame in pairs:
        assert finder.find(junk + frame)[-1] == frame


@properties
@given(st.lists(st.one_of(st.binary(max_size=600), st.sampled_from(STARTS * 3 + FRAMES)), max_size=20))
def test_less_than_a_frame_is_kept(pieces: list[bytes]) -> None:
    finder = FrameFinder()
    for piece in pieces:
        finder.find(piece)
        assert finder.partial_size < LARGEST_FRAME
