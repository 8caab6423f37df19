"""MAVLink 2 signing without I/O: who may speak, and proof that it is we who do.

The specification: https://mavlink.io/en/guide/message_signing.html. One ``Signing`` serves all links of a process: a
frame that was heard on one link is a replay on every other. pymavlink's own check notes the timestamp of a frame
before it knows that the signature is right, so that a forged one silences a stream; this one does not.
"""

from __future__ import annotations

import hashlib
import hmac
from collections.abc import Callable
from typing import NamedTuple

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.frames import (
    CHECKSUM_SIZE,
    HEADER_V2,
    MAGIC_V2,
    SIGNATURE_SIZE,
    checksum,
    message_id_of,
)

KEY_SIZE = 32
NO_KEY = bytes(KEY_SIZE)
"""The key that switches signing off."""
TICKS_PER_S = 100_000
EPOCH_UNIX_S = 1_420_070_400
"""Timestamps count 10 µs from here: 2015-01-01."""
LARGEST_TIMESTAMP = 2**48 - 1
NEW_STREAM_TICKS = 60 * TICKS_PER_S
"""A stream that was never heard may be so much behind our timestamp."""
KEEP_TICKS = 10 * TICKS_PER_S
"""The latest timestamp is kept for the next start this often."""
MAX_STREAMS = 1024
"""Only holders of the key open streams, but even they shall not fill the memory."""
_ALWAYS_TAKEN = frozenset({int(mavlink.MAVLINK_MSG_ID_RADIO_STATUS)})
"""Telemetry radios put them on the link, and have no key."""
_SIGNED = int(mavlink.MAVLINK_IFLAG_SIGNED)


class Counts(NamedTuple):
    """What happened to the frames that were received while there was a key."""

    good: int = 0
    unsigned_taken: int = 0
    unsigned_refused: int = 0
    bad_signature: int = 0
    replayed: int = 0
    too_old: int = 0

    @property
    def refused(self) -> int:
        """All frames that were not taken."""
        return self.unsigned_refused + self.bad_signature + self.replayed + self.too_old


def timestamp_of(unix_s: float) -> int:
    """Return the timestamp of a time since the Unix epoch; before 2015, 0."""
    return min(LARGEST_TIMESTAMP, max(0, int((unix_s - EPOCH_UNIX_S) * TICKS_PER_S)))


class Signing:
    """The key, our timestamp, and the timestamps of all streams that were heard.

    ``clock`` returns the time since the Unix epoch [s]. ``latest`` is what ``keep`` was last called with, before
    this start: timestamps begin above both. A crash followed by a clock that was set back makes at most
    KEEP_TICKS of them repeat. ``allow_unsigned``: take unsigned frames, but never wrongly signed ones.
    """

    def __init__(
        self,
        key: bytes,
        clock: Callable[[], float],
        latest: int = 0,
        keep: Callable[[int], None] = lambda _latest: None,
        allow_unsigned: bool = False,
    ) -> None:
        self.allow_unsigned = allow_unsigned
        self.counts = Counts()
        self._clock = clock
        self._keep = keep
        self._key = NO_KEY
        self._timestamp = latest
        self._kept = latest
        self._streams: dict[bytes, int] = {}
        self.set_key(key)

    @property
    def is_on(self) -> bool:
        """Whether there is a key: frames are signed and checked."""
        return self._key != NO_KEY

    @property
    def stream_count(self) -> int:
        """Streams whose timestamps are remembered, at most MAX_STREAMS."""
        return len(self._streams)

    @property
    def timestamp(self) -> int:
        """The latest timestamp that was used or heard."""
        return self._timestamp

    def set_key(self, key: bytes, initial_timestamp: int = 0) -> None:
        """Use another key (32 octets; all zero: none) from now on; raise ValueError for another size."""
        if len(key) != KEY_SIZE:
            raise ValueError(f"a signing key has {KEY_SIZE} octets, not {len(key)}")
        if key != self._key:
            self._streams.clear()  # frames of the old key are worth nothing now
        self._key = key
        self._timestamp = max(self._timestamp, min(initial_timestamp, LARGEST_TIMESTAMP))

    def next_timestamp(self) -> int:
        """Return a timestamp that was never used before: the clock's, or one more than the last.

        At the end of all timestamps, to which only a holder of the key can take us, the last one stays.
        """
        timestamp = min(max(self._timestamp + 1, timestamp_of(self._clock())), LARGEST_TIMESTAMP)
        self._timestamp = timestamp
        if timestamp >= self._kept + KEEP_TICKS:
            self.close()
        return timestamp

    def close(self) -> None:
        """Keep the latest timestamp, at an orderly end."""
        if self._timestamp > self._kept:
            self._kept = self._timestamp
            self._keep(self._kept)

    def sign(self, frame: bytes, crc_extra: int, link_id: int) -> bytes:
        """Return an unsigned MAVLink 2 frame as a signed one."""
        body = bytes((*frame[:2], frame[2] | _SIGNED)) + frame[3:-CHECKSUM_SIZE]
        tail = bytes((link_id,)) + self.next_timestamp().to_bytes(6, "little")
        signed = body + checksum(body[1:], crc_extra) + tail
        return signed + self._signature(signed)

    def accepts(self, frame: bytes, trusted: bool = False) -> bool:
        """Tell whether a frame (whole, of either version) may be used, and count it.

        ``trusted``: it came on a link that needs no signature.
        """
        if not self.is_on:
            return True
        if is_signed(frame):
            outcome = self._judge(frame)
            if outcome == "good":
                timestamp = _timestamp_in(frame)
                self._streams[_stream_of(frame)] = timestamp
                self._timestamp = max(self._timestamp, timestamp)
        else:
            taken = trusted or self.allow_unsigned or message_id_of(frame) in _ALWAYS_TAKEN
            outcome = "unsigned_taken" if taken else "unsigned_refused"
        self.counts = self.counts._replace(**{outcome: getattr(self.counts, outcome) + 1})
        return outcome in ("good", "unsigned_taken")

    def authenticates(self, frame: bytes, trusted: bool = False) -> bool:
        """Return True if ``frame`` proves that its sender may use the link; nothing is counted or remembered.

        An unsigned RADIO_STATUS is accepted, but proves nothing.
        """
        if self.is_on and is_signed(frame):
            return self._judge(frame) == "good"
        return trusted or self.allow_unsigned or not self.is_on

    def _judge(self, frame: bytes) -> str:
        """Return what to count a signed frame as."""
        if not hmac.compare_digest(self._signature(frame[:-6]), frame[-6:]):
            return "bad_signature"
        timestamp, last = _timestamp_in(frame), self._streams.get(_stream_of(frame))
        if last is not None and timestamp <= last:
            return "replayed"
        now = max(self._timestamp, timestamp_of(self._clock()))
        if last is None and (timestamp + NEW_STREAM_TICKS < now or len(self._streams) >= MAX_STREAMS):
            return "too_old"
        return "good"

    def _signature(self, octets: bytes) -> bytes:
        return hashlib.sha256(self._key + octets).digest()[:6]


class LinkSigning(NamedTuple):
    """Signing on one link; ``link_id`` (0 to 255) tells it from our others."""

    signing: Signing
    link_id: int
    trusted: bool = False
    """Whether unsigned frames are taken on this link though they are not elsewhere."""

    def outgoing(self, frame: bytes, crc_extra: int) -> bytes:
        """Return what to send for an unsigned frame."""
        return self.signing.sign(frame, crc_extra, self.link_id) if self.signing.is_on else frame

    def accepts(self, frame: bytes) -> bool:
        """Tell whether a received frame may be used, and count it."""
        return self.signing.accepts(frame, self.trusted)

    def authenticates(self, frame: bytes) -> bool:
        """Return True if a received frame, not accepted yet, proves that its sender may use the link."""
        return self.signing.authenticates(frame, self.trusted)

    @property
    def requires_signature(self) -> bool:
        """Whether only signed frames are taken."""
        return not (self.trusted or self.signing.allow_unsigned) and self.signing.is_on

    def is_authentic(self, frame: bytes) -> bool:
        """Return True if a frame that was accepted had the signature that this link requires, if any."""
        return is_signed(frame) or not self.requires_signature


def without_signature(frame: bytes, crc_extra: int) -> bytes:
    """Return a frame without its signature, as it belongs into a log; an unsigned one stays as it is."""
    if not is_signed(frame):
        return frame
    body = bytes((*frame[:2], frame[2] & ~_SIGNED)) + frame[3 : HEADER_V2 + frame[1]]
    return body + checksum(body[1:], crc_extra)


def is_signed(frame: bytes) -> bool:
    """Return True if ``frame`` has a signature, right or wrong."""
    return frame[0] == MAGIC_V2 and bool(frame[2] & _SIGNED)


def _timestamp_in(frame: bytes) -> int:
    return int.from_bytes(frame[-12:-6], "little")


def _stream_of(frame: bytes) -> bytes:
    """Return system, component and link id of a signed frame."""
    return frame[5:7] + frame[-SIGNATURE_SIZE : -SIGNATURE_SIZE + 1]
