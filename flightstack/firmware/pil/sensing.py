"""Operations on the estimator of a target: events, and reading its memory. Pure."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flightstack.core.float32 import as_float32
from flightstack.firmware.pil.steps import BAD_INPUT, OUT_OF_ORDER, OWN_COMPONENT, OWN_SYSTEM
from flightstack.mavlink.dialect import LAYOUT_BY_NAME
from flightstack.mavlink.frames import pack_frame
from flightstack.mavlink.link import Link, Message

IMU, EARTH, LANDED, PARAMS, CLEAR, START, READ, ORIGIN = 10, 11, 12, 13, 14, 15, 16, 17
"""Kinds of FS_PIL_SENSE beside the estimator's rings."""
VALUES = 10
MOST_PARAMS = VALUES - 2
"""Parameters in an event, behind the first index and their number."""
WORDS = 60
"""Words of an FS_PIL_MEMORY."""
PAGES = 6
"""Requests in one exchange: their answers fit into the target's outbox."""

_SENSE = LAYOUT_BY_NAME["FS_PIL_SENSE"]
_pack = struct.Struct(_SENSE.format).pack


def _frame(event: int, kind: int, values: Sequence[float], sequence: int) -> bytes:
    padded = (*values, *(0.0,) * (VALUES - len(values)))
    try:
        payload = _pack(event, kind, *padded)
    except OverflowError:  # beyond float32
        payload = _pack(event, kind, *map(as_float32, padded))
    payload = payload.rstrip(b"\0") or b"\0"
    return pack_frame(_SENSE.message_id, payload, _SENSE.crc_extra, sequence & 255, OWN_SYSTEM, OWN_COMPONENT)


class Event(NamedTuple):
    """One FS_PIL_SENSE without its number."""

    kind: int
    values: Sequence[float] = ()


class SenseEvents:
    """Events sent together, resent until the target answers the last one; the target takes each once, in order."""

    def __init__(self, first: int, events: Sequence[Event]) -> None:
        """``first`` is the number of the first event."""
        self.result: Message | None = None
        self.failure: str | None = None
        self._first, self._events = first, events
        self._last = (first + len(events) - 1) & 0xFFFF_FFFF

    def frames(self, codec: Link, sequence: int) -> list[bytes]:
        """Return the frames of all events: the target refuses those that it has taken."""
        return [
            _frame((self._first + at) & 0xFFFF_FFFF, *event, sequence + at)
            for at, event in enumerate(self._events)
        ]

    def take_message(self, message: Message) -> None:
        """Process an FS_PIL_ESTIMATE; answers before the last event are not used."""
        if message.get_type() != "FS_PIL_ESTIMATE":
            return
        place = (message.event - self._first) & 0xFFFF_FFFF
        if message.status & OUT_OF_ORDER:
            if place > len(self._events):
                what = f"expects event {message.event} of the sensors, not {self._first}"
                self.failure = f"{what}: it may have been restarted"
        elif place < len(self._events) and message.status & BAD_INPUT:
            self.failure = "has no estimator: fly with --state truth, or use a target with more memory"
        elif message.event == self._last:
            self.result = message

    def silence(self, attempts: int) -> str:
        """Return why the events fail."""
        return f"did not answer event {self._last} of the sensors, sent {attempts} times"


class ReadWords:
    """Reads words of the estimator's memory in pages of 60."""

    def __init__(
        self, number: int, firsts: Sequence[int], words: np.ndarray[tuple[int], np.dtype[np.uint32]]
    ) -> None:
        """``number`` tells this reading from earlier ones. ``firsts`` are the first words of at most ``PAGES`` pages.

        ``words``, the whole memory, is written.
        """
        self.result: Message | None = None
        self.failure: str | None = None
        self._number, self._waiting, self._words = number, set(firsts), words

    def frames(self, codec: Link, sequence: int) -> list[bytes]:
        """Return the requests of the pages that are missing."""
        return [
            _frame(self._number, READ, (first,), sequence + at)
            for at, first in enumerate(sorted(self._waiting))
        ]

    def take_message(self, message: Message) -> None:
        """Store the words of an FS_PIL_MEMORY."""
        if (
            message.get_type() == "FS_PIL_MEMORY"
            and message.event == self._number
            and message.first in self._waiting
        ):
            place = self._words[message.first : message.first + WORDS]
            place[:] = message.words[: len(place)]
            self._waiting.discard(message.first)
            if not self._waiting:
                self.result = message

    def silence(self, attempts: int) -> str:
        """Return why reading fails."""
        return f"did not tell the memory of its estimator, asked {attempts} times"
