"""MAVLink 2 message signing without I/O.

Specification: https://mavlink.io/en/guide/message_signing.html. One ``Signing`` serves all links of a process, so that
a frame received on one link is a replay on the others. pymavlink stores the timestamp of a frame before it verifies the
signature, so that a forged frame blocks a stream; this implementation verifies first.
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
"""Key that disables signing."""
TICKS_PER_S = 100_000
EPOCH_UNIX_S = 1_420_070_400
"""Epoch of timestamps, 2015-01-01; their unit is 10 µs."""
LARGEST_TIMESTAMP = 2**48 - 1
NEW_STREAM_TICKS = 60 * TICKS_PER_S
"""Maximum age of the first timestamp of a new stream."""
KEEP_TICKS = 10 * TICKS_PER_S
"""Interval at which the latest timestamp is saved for the next start."""
MAX_STREAMS = 1024
"""Bounds the memory that holders of the key can occupy."""
_ALWAYS_TAKEN = frozenset({int(mavlink.MAVLINK_MSG_ID_RADIO_STATUS)})
"""Sent by telemetry radios, which have no key."""
_SIGNED = int(mavlink.MAVLINK_IFLAG_SIGNED)


class Counts(NamedTuple):
    """Counts of received frames by outcome, while signing is on."""

    good: int = 0
    unsigned_taken: int = 0
    unsigned_refused: int = 0
    bad_signature: int = 0
    replayed: int = 0
    too_old: int = 0

    @property
    def refused(self) -> int:
        """Frames that were not accepted."""
        return self.unsigned_refused + self.bad_signature + self.replayed + self.too_old


def timestamp_of(unix_s: float) -> int:
    """Return the timestamp of a time since the Unix epoch; 0 before 2015."""
    return min(LARGEST_TIMESTAMP, max(0, int((unix_s - EPOCH_UNIX_S) * TICKS_PER_S)))


class Signing:
    """Key, own timestamp, and latest timestamps of all received streams.

    ``clock`` returns the time since the Unix epoch [s]. ``latest`` is the last argument of ``keep`` before this start;
    timestamps begin above both. After a crash with the clock set back, at most KEEP_TICKS of them repeat.
    ``allow_unsigned`` accepts unsigned frames, but not wrongly signed ones.
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
        """True if a key is set: frames are signed and checked."""
        return self._key != NO_KEY

    @property
    def stream_count(self) -> int:
        """Number of known streams, at most MAX_STREAMS."""
        return len(self._streams)

    @property
    def timestamp(self) -> int:
        """Latest timestamp sent or received."""
        return self._timestamp

    def set_key(self, key: bytes, initial_timestamp: int = 0) -> None:
        """Set the key (32 bytes; all zero for none); raise ValueError for another size."""
        if len(key) != KEY_SIZE:
            raise ValueError(f"a signing key has {KEY_SIZE} bytes, not {len(key)}")
        if key != self._key:
            self._streams.clear()  # timestamps of the old key do not count
        self._key = key
        self._timestamp = max(self._timestamp, min(initial_timestamp, LARGEST_TIMESTAMP))

    def next_timestamp(self) -> int:
        """Return a new timestamp: the clock's, or one more than the last.

        At the largest timestamp, which only a holder of the key can cause, it stops increasing.
        """
        timestamp = min(max(self._timestamp + 1, timestamp_of(self._clock())), LARGEST_TIMESTAMP)
        self._timestamp = timestamp
        if timestamp >= self._kept + KEEP_TICKS:
            self.close()
        return timestamp

    def close(self) -> None:
        """Save the latest timestamp."""
        if self._timestamp > self._kept:
            self._kept = self._timestamp
            self._keep(self._kept)

    def sign(self, frame: bytes, crc_extra: int, link_id: int) -> bytes:
        """Return the signed frame of an unsigned MAVLink 2 frame."""
        body = bytes((*frame[:2], frame[2] | _SIGNED)) + frame[3:-CHECKSUM_SIZE]
        tail = bytes((link_id,)) + self.next_timestamp().to_bytes(6, "little")
        signed = body + checksum(body[1:], crc_extra) + tail
        return signed + self._signature(signed)

    def accepts(self, frame: bytes, trusted: bool = False) -> bool:
        """Return True if a complete frame of either version is accepted, and count it.

        ``trusted``: the link requires no signature.
        """
        if not self.is_on:
            return True
        if is_signed(frame):
            outcome = self._classify(frame)
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
        """Return True if ``frame`` authenticates its sender; nothing is counted or stored.

        An unsigned RADIO_STATUS is accepted, but does not authenticate.
        """
        if self.is_on and is_signed(frame):
            return self._classify(frame) == "good"
        return trusted or self.allow_unsigned or not self.is_on

    def _classify(self, frame: bytes) -> str:
        """Return the counter of a signed frame."""
        if not hmac.compare_digest(self._signature(frame[:-6]), frame[-6:]):
            return "bad_signature"
        timestamp, last = _timestamp_in(frame), self._streams.get(_stream_of(frame))
        if last is not None and timestamp <= last:
            return "replayed"
        now = max(self._timestamp, timestamp_of(self._clock()))
        if last is None and (timestamp + NEW_STREAM_TICKS < now or len(self._streams) >= MAX_STREAMS):
            return "too_old"
        return "good"

    def _signature(self, signed: bytes) -> bytes:
        return hashlib.sha256(self._key + signed).digest()[:6]


class LinkSigning(NamedTuple):
    """Signing on one link; ``link_id`` (0 to 255) is unique among the links of the sender."""

    signing: Signing
    link_id: int
    trusted: bool = False
    """True if this link accepts unsigned frames."""

    def outgoing(self, frame: bytes, crc_extra: int) -> bytes:
        """Return the frame to send, signed if signing is on."""
        return self.signing.sign(frame, crc_extra, self.link_id) if self.signing.is_on else frame

    def accepts(self, frame: bytes) -> bool:
        """Return True if a received frame is accepted, and count it."""
        return self.signing.accepts(frame, self.trusted)

    def authenticates(self, frame: bytes) -> bool:
        """Return True if a received frame authenticates its sender; call before ``accepts``."""
        return self.signing.authenticates(frame, self.trusted)

    @property
    def requires_signature(self) -> bool:
        """True if only signed frames are accepted."""
        return not (self.trusted or self.signing.allow_unsigned) and self.signing.is_on

    def is_authentic(self, frame: bytes) -> bool:
        """Return True if an accepted frame carries the signature that this link requires, if any."""
        return is_signed(frame) or not self.requires_signature


def without_signature(frame: bytes, crc_extra: int) -> bytes:
    """Return a frame without its signature, for logging."""
    if not is_signed(frame):
        return frame
    body = bytes((*frame[:2], frame[2] & ~_SIGNED)) + frame[3 : HEADER_V2 + frame[1]]
    return body + checksum(body[1:], crc_extra)


def is_signed(frame: bytes) -> bool:
    """Return True if ``frame`` has a signature, valid or not."""
    return frame[0] == MAGIC_V2 and bool(frame[2] & _SIGNED)


def _timestamp_in(frame: bytes) -> int:
    return int.from_bytes(frame[-12:-6], "little")


def _stream_of(frame: bytes) -> bytes:
    """Return system, component and link id of a signed frame."""
    return frame[5:7] + frame[-SIGNATURE_SIZE : -SIGNATURE_SIZE + 1]
