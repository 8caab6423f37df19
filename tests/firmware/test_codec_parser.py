"""The C parser against a search by the Python parser's own judgement, that parser, and pymavlink."""

from __future__ import annotations

import ctypes
import random
from types import SimpleNamespace
from typing import Any, NamedTuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flightstack.mavlink import frames as python_parser
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.frames import FrameReader
from tests.firmware.codec_support import (
    KINDS,
    Found,
    any_frame,
    damaged,
    load,
    parse,
    sealed,
    stream,
    trimmed,
)

STEP = 53_010
QUIET = bytes(600)
"""So much behind a stream, and every beginning in it is decided. No frame begins with zeros."""


@pytest.fixture(scope="module")
def codec(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    return load(tmp_path_factory.mktemp("codec"))


@pytest.fixture(scope="module", autouse=True)
def _python_parser_of_the_same_dialect() -> Any:
    """Let the Python parser know the codec's messages alone, and never give up on a piece of data."""
    patch = pytest.MonkeyPatch()
    patch.setattr(python_parser, "mavlink", SimpleNamespace(mavlink_map=KINDS, MAVLINK_IFLAG_SIGNED=1))
    patch.setattr(python_parser, "MAX_FAULTS", 10**9)
    yield
    patch.undo()


class Expected(NamedTuple):
    """What a search through all of a stream finds, when nothing comes behind it."""

    frames: list[tuple[int, int, int, int, bytes]]
    unknown: int
    skipped: int


def expected(data: bytes) -> Expected:
    """Search with the Python parser's own judgement. Of an unknown message a frame has to follow, or nothing."""
    out, unknown, skipped, at = [], 0, 0, 0
    while at < len(data):
        frame = whole_frame(data, at)
        if frame is None:
            skipped += 1
            at += 1
            continue
        at += len(frame.data)
        if frame.known:
            out.append(fields(frame))
        else:
            unknown += 1
    return Expected(out, unknown, skipped)


def whole_frame(data: bytes, at: int) -> python_parser.Frame | None:
    """Return the frame that begins at ``at``, if one does."""
    if data[at] != 0xFE and not (data[at] == 0xFD and data[at + 2 : at + 3] in {b"\0", b"\1"}):
        return None
    size = python_parser.frame_size(data, at)
    if size is None or at + size > len(data):
        return None
    frame = python_parser.checked(data[at : at + size])
    believed = frame is not None and (
        frame.known or data[at + size : at + size + 1] in {b"\xfd", b"\xfe", b""}
    )
    return frame if believed else None


def fields(frame: python_parser.Frame) -> tuple[int, int, int, int, bytes]:
    """Return what the C parser tells of a frame: id, sequence, system, component, payload."""
    ids, at = (4, 10) if frame.data[0] == 0xFD else (2, 6)
    sequence, system, component = frame.data[ids : ids + 3]
    return frame.message_id, sequence, system, component, frame.data[at : at + frame.data[1]]


def seen(found: list[Found]) -> list[tuple[int, int, int, int, bytes]]:
    return [(f.id, f.sequence, f.system, f.component, f.payload) for f in found]


def step_frame(number: int) -> bytes:
    """Return an FS_PIL_STEP of full length."""
    payload = random.Random(number).randbytes(KINDS[STEP].unpacker.size - 1) + b"\x01"
    return sealed(STEP, payload, sender=bytes([number % 256, 255, 190]))


@pytest.mark.parametrize("poisoned", [False, True])
@pytest.mark.parametrize("eager", [False, True])
def test_half_a_million_octets_give_the_frames_that_are_in_them(
    codec: ctypes.CDLL, eager: bool, poisoned: bool
) -> None:
    """Good, damaged, nested, truncated and unknown frames between noise; whatever the octets' high bits hold."""
    data = stream(seed=4, parts=12_000) + QUIET
    assert len(data) > 500_000
    found, summary = parse(codec, data, eager, poisoned)
    assert seen(found) == expected(data).frames
    assert summary.good == len(found) > 4_000
    assert summary.bad > 100
    assert summary.unknown > 100
    assert summary.good >= sum(frame.known for frame in FrameReader().feed(data))
    assert [f.recoded for f in found] == [trimmed(f.payload[: KINDS[f.id].unpacker.size]) for f in found]


SEGMENTS = st.one_of(
    st.binary(max_size=40),
    st.text("\xfd\xfe\x00\x01\x09", max_size=60).map(lambda text: text.encode("latin-1")),
    st.integers(0, 2**32).map(lambda seed: any_frame(random.Random(seed))),
    st.integers(0, 2**32).map(lambda seed: damaged(random.Random(seed), any_frame(random.Random(seed + 1)))),
)


@settings(max_examples=400)
@given(parts=st.lists(SEGMENTS, max_size=12), eager=st.booleans(), poisoned=st.booleans())
def test_any_mixture_gives_its_frames_and_every_octet_is_accounted_for(
    codec: ctypes.CDLL, parts: list[bytes], eager: bool, poisoned: bool
) -> None:
    """Octets are in frames, in frames passed over, or skipped; silence leaves none behind."""
    data = b"".join(parts)
    assert parse(codec, data, eager, poisoned)[1].held <= 280
    found, summary = parse(codec, data, eager, poisoned, flush=True)
    assert Expected(seen(found), summary.unknown, summary.skipped) == expected(data)
    assert (summary.held, summary.good) == (0, len(found))


def test_the_parser_of_the_ground_links_finds_the_same_in_whole_frames(codec: ctypes.CDLL) -> None:
    """The two differ only where a would-be frame of an unknown message has no other frame behind it."""
    rng = random.Random(5)
    data = b"".join(any_frame(rng) for _ in range(3_000)) + step_frame(1)
    found, summary = parse(codec, data)
    theirs = FrameReader().feed(data)
    assert seen(found) == [fields(frame) for frame in theirs if frame.known]
    assert summary.unknown == sum(not frame.known for frame in theirs) > 200
    assert (summary.skipped, summary.bad, summary.held) == (0, 0, 0)


def test_pymavlink_agrees_on_a_clean_line(codec: ctypes.CDLL) -> None:
    rng = random.Random(8)
    sent = [
        sealed(0, rng.randbytes(9), 1 + n % 2, signed=n % 4 == 3, sender=rng.randbytes(3)) for n in range(400)
    ]
    decoder = mavlink.MAVLink(None)
    decoder.robust_parsing = True
    theirs = [m for m in decoder.parse_buffer(b"".join(sent)) if m.get_type() == "HEARTBEAT"]
    ours, summary = parse(codec, b"".join(sent))
    assert [(f.sequence, f.system, f.component) for f in ours] == [
        (m.get_seq(), m.get_srcSystem(), m.get_srcComponent()) for m in theirs
    ]
    assert len(ours) == 400
    assert (summary.skipped, summary.bad, summary.held) == (0, 0, 0)


def test_a_lost_octet_costs_no_other_frame(codec: ctypes.CDLL) -> None:
    """Whichever it is: also in the header, where the rest reads as an unknown message that ends in the next frame."""
    first, second = step_frame(1), step_frame(2)
    assert len(first) == 116
    for lost in range(len(first)):
        found, summary = parse(codec, first[:lost] + first[lost + 1 :] + second, flush=True)
        assert [f.sequence for f in found] == [2], lost
        assert (summary.skipped, summary.unknown) == (115, 0), lost


def test_a_doubled_octet_costs_no_other_frame(codec: ctypes.CDLL) -> None:
    first, second = step_frame(1), step_frame(2)
    for doubled in range(len(first)):
        found, _ = parse(codec, first[: doubled + 1] + first[doubled:] + second, flush=True)
        assert [f.sequence for f in found][-1] == 2, doubled


def test_frames_inside_a_false_start_come_at_once_when_it_is_found_out(codec: ctypes.CDLL) -> None:
    """A wrong length that swallows two frames gives both back, with the octet that proves it wrong."""
    start = b"\xfd\xf0\x00\x00\x05\x01\x01\x00\x00\x00"  # a HEARTBEAT of 240 octets
    data = start + step_frame(1) + step_frame(2)
    rest = bytes(252 - len(data))
    assert parse(codec, data + rest[:-1])[0] == []
    found, summary = parse(codec, data + rest, eager=True)
    assert [f.sequence for f in found] == [1, 2]
    assert (summary.bad, summary.skipped, summary.held) == (1, 10 + len(rest), 0)
    # who takes one frame per octet gets the second with the next octet
    assert [f.sequence for f in parse(codec, data + rest, eager=False)[0]] == [1]
    assert [f.sequence for f in parse(codec, data + rest + b"\0", eager=False)[0]] == [1, 2]


def test_silence_brings_out_what_a_false_start_holds_back(codec: ctypes.CDLL) -> None:
    """In lockstep both sides would wait for ever: a flush gives the start up, and the frames come."""
    data = b"\xfd\xff\x01" + step_frame(7) + b"\xfd\x30\x00" + step_frame(8) + b"\xfe\x09"
    assert parse(codec, data)[0] == []
    found, summary = parse(codec, data, flush=True)
    assert [f.sequence for f in found] == [7, 8]
    assert (summary.flushed, summary.held, summary.skipped) == (2, 0, 8)


def test_a_version_1_beginning_of_noise_is_found_out_by_its_header(codec: ctypes.CDLL) -> None:
    """One octet of 256 begins one: it must not hold the line back when its message or length cannot be."""
    for header in (b"\xfe\xff\x01\x01\x01\x01", b"\xfe\x0a\x01\x01\x01\x00"):
        found, summary = parse(codec, header + step_frame(3))
        assert [f.sequence for f in found] == [3]
        assert (summary.bad, summary.skipped) == (0, 6)


def test_a_frame_that_demands_what_we_do_not_know_is_noise(codec: ctypes.CDLL) -> None:
    frame = bytearray(sealed(0, bytes(9)))
    frame[2] = 0x02
    found, summary = parse(codec, bytes(frame) + step_frame(3))
    assert [f.sequence for f in found] == [3]
    assert summary.unknown == 0


def test_a_frame_in_an_unknown_messages_payload_is_not_ours(codec: ctypes.CDLL) -> None:
    tunnel = sealed(385, bytes(5) + step_frame(1))
    found, summary = parse(codec, tunnel + step_frame(2))
    assert [f.sequence for f in found] == [2]
    assert (summary.unknown, summary.skipped) == (1, 0)


def test_a_longer_payload_than_ours_is_read_as_far_as_we_know_it(codec: ctypes.CDLL) -> None:
    """A sender with a newer definition appends fields: version 2 allows it, version 1 does not."""
    longer = bytes(range(1, 13))
    (found,), _ = parse(codec, sealed(0, longer, 2))
    assert (found.payload, found.recoded) == (longer, longer[:9])
    assert parse(codec, sealed(0, longer, 1))[0] == []


def test_the_worst_octets_are_bounded_work_and_no_frame(codec: ctypes.CDLL) -> None:
    """Beginnings as dense as they can be: every octet of what is held is judged, each by a long checksum."""
    data = (
        b"\xfe\x09\x00\x00\x00\x00" * 20_000 + b"\xfd\x00\x00" * 20_000 + b"\xfd" * 50_000 + b"\xfe" * 50_000
    )
    found, summary = parse(codec, data, flush=True)
    assert seen(found) == expected(data).frames
    assert summary.held == 0
