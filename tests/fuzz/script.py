"""What arrives on a link, written as bytes that a fuzzer can change and a person can replay. Pure.

A script is a row of records: style and peer, number of the message or a pause, size, and so many octets. Whatever the
bytes are, they are a script; what is cut off is missing. So a fuzzer need not find checksums by chance.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from enum import IntEnum
from typing import NamedTuple, TypeAlias

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Message
from flightstack.mavlink.signing import Signing
from tests.fuzz.inputs import KINDS, sealed, sealed_v1

MOST_STEPS = 64
KEY = bytes(range(1, 33))
"""The key of scripts that sign."""
Sources: TypeAlias = tuple[tuple[int, int], ...]
SOURCES: Sources = ((255, 190), (254, 190), (1, 191), (1, 1))
"""Who the four peers say they are."""
_INDEX = {kind.number: index for index, kind in enumerate(KINDS)}
_PAUSE_S = 0.02


class Style(IntEnum):
    """How a record's octets arrive."""

    FRAME = 0  # of MAVLink 2
    FRAME_V1 = 1
    SIGNED = 2
    FORGED = 3
    CUT = 4  # a frame in two pieces, the second field says where
    RAW = 5
    PAUSE = 6
    UNKNOWN = 7  # a message that the dialect lacks


class Step(NamedTuple):
    """One arrival: pieces of data from one of four peers, after a pause."""

    peer: int
    pieces: tuple[bytes, ...]
    pause_s: float


def steps(script: bytes, sources: Sources = SOURCES) -> Iterator[Step]:
    """Yield what the script says, at most ``MOST_STEPS`` steps, from four peers that call themselves ``sources``."""
    signing = Signing(KEY, lambda: 1.75e9)
    at = 0
    for number in range(MOST_STEPS):
        if at + 3 > len(script):
            return
        first, choice, size = script[at : at + 3]
        payload = script[at + 3 : at + 3 + size]
        at += 3 + size
        peer = first >> 3 & 3
        yield _step(Style(first & 7), peer, choice, payload, (number, *sources[peer]), signing)


def _step(
    style: Style, peer: int, choice: int, payload: bytes, source: tuple[int, int, int], signing: Signing
) -> Step:
    kind = KINDS[choice % len(KINDS)]
    if style is Style.PAUSE:
        return Step(peer, (), choice * _PAUSE_S)
    if style is Style.RAW:
        return Step(peer, (payload,), 0.0)
    if style is Style.UNKNOWN:
        head = bytes((len(payload), 0, 0, *source)) + (54_000 + choice).to_bytes(3, "little")
        return Step(peer, (b"\xfd" + head + payload + b"\0\0",), 0.0)
    payload = payload[: kind.size] or b"\0"
    if style is Style.FRAME_V1 and kind.number < 256:
        return Step(peer, (sealed_v1(kind, payload, source),), 0.0)
    frame = sealed(kind, payload, source)
    if style is Style.SIGNED:
        frame = signing.sign(frame, kind.crc_extra, peer)
    elif style is Style.FORGED:
        frame = signing.sign(frame, kind.crc_extra, peer)[:-1] + b"\0"
    elif style is Style.CUT:
        cut = choice % len(frame)
        return Step(peer, (frame[:cut], frame[cut:]), 0.0)
    return Step(peer, (frame,), 0.0)


# ---------------------------------------------------------------------- writing scripts


def record(message: Message, codec: mavlink.MAVLink, style: Style = Style.FRAME, peer: int = 0) -> bytes:
    """Return the record of one message."""
    frame = message.pack(codec)
    payload = bytes(frame[10 : 10 + frame[1]])
    return bytes((style | peer << 3, _INDEX[message.get_msgId()], len(payload))) + payload


def pause(seconds: float) -> bytes:
    """Return a record that lets time pass."""
    return bytes((Style.PAUSE, min(255, round(seconds / _PAUSE_S)), 0))


def written(messages: Iterable[Message], style: Style = Style.FRAME) -> bytes:
    """Return the script in which these arrive one after the other, a moment between them."""
    codec = mavlink.MAVLink(None)
    return b"".join(record(message, codec, style) + pause(0.02) for message in messages)


def of_frames(frames: Iterable[bytes]) -> bytes:
    """Return the script in which these frames of MAVLink 2 arrive."""
    script = b""
    for frame in frames:
        payload = frame[10 : 10 + frame[1]]
        number = int.from_bytes(frame[7:10], "little")
        script += bytes((Style.FRAME, _INDEX[number], len(payload))) + payload
    return script


def restyled(script: bytes, style: Style) -> bytes:
    """Return the script with its frames in another style."""
    out = bytearray(script)
    at = 0
    while at + 3 <= len(out):
        if out[at] & 7 == Style.FRAME:
            out[at] |= style
        at += 3 + out[at + 2]
    return bytes(out)
