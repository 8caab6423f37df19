"""Log streaming over MAVLink while the log is written: LOGGING_START, LOGGING_DATA, LOGGING_STOP. No I/O.

As in PX4, the definitions (header, formats, subscriptions) go in LOGGING_DATA_ACKED, one message at a time, repeated
until it is acknowledged. Data follows in LOGGING_DATA without acknowledgement. Sequence numbers show lost messages;
``first_message_offset`` is where a parser may continue after a loss.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable

from flightstack.flight_log.ulog import DEFINITION_TYPES, HEADER_SIZE, MESSAGE_HEADER
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address, Message, is_for, sender
from flightstack.services.logs.log_store import LogTail
from flightstack.services.rate_limit import RateLimit, always_has_room

CHUNK = 249
NO_MESSAGE_BEGINS = 255
RESEND_S = 0.25
GIVE_UP_S = 5.0


class _Boundaries:
    """Finds the message boundaries of a ULog file in chunks of any size."""

    def __init__(self) -> None:
        self._to_next = HEADER_SIZE  # bytes to the next message
        self._header = b""
        self.in_data = False
        """True once the data section has started."""

    def scan(self, chunk: bytes) -> int:
        """Take the next chunk; return the offset of the first message that starts in it, or 255."""
        at, first = 0, NO_MESSAGE_BEGINS
        while at < len(chunk):
            if self._to_next:
                step = min(self._to_next, len(chunk) - at)
                self._to_next -= step
                at += step
                continue
            if not self._header and first == NO_MESSAGE_BEGINS:
                first = at
            missing = MESSAGE_HEADER.size - len(self._header)
            self._header += chunk[at : at + missing]
            at += missing
            if len(self._header) == MESSAGE_HEADER.size:
                self._to_next, kind = MESSAGE_HEADER.unpack(self._header)
                self.in_data = self.in_data or kind not in DEFINITION_TYPES
                self._header = b""
        return first


class _Stream:
    """One client's stream."""

    def __init__(self, peer: Hashable, client: Address) -> None:
        self.peer = peer
        self.client = client
        self.tail: LogTail | None = None
        self.boundaries = _Boundaries()
        self.sequence = 0
        self.waiting: Message | None = None
        self.since_s = self.sent_s = 0.0


class LogStream:
    """Streams the log of the current or next flight to one client at a time."""

    handles = frozenset({"LOGGING_ACK"})

    def __init__(
        self,
        own: Address,
        open_tail: Callable[[], LogTail | None],
        has_room: Callable[[Hashable], bool] = always_has_room,
    ) -> None:
        """``open_tail`` opens the log in progress, or returns None while there is none.

        The stream waits while ``has_room`` is False for its peer.
        """
        self._own = own
        self._open_tail = open_tail
        self._has_room = has_room
        self._stream: _Stream | None = None
        self._pace = RateLimit()

    def start(self, peer: Hashable, client: Address) -> str | None:
        """Start a stream to ``client``; return the refusal, or None. A repeated start restarts the stream."""
        stream = self._stream
        if stream is not None and (stream.peer, stream.client) != (peer, client):
            return "the log is being streamed to another client"
        self._end()
        self._stream = _Stream(peer, client)
        return None

    def stop(self) -> None:
        """End the stream, if any."""
        self._end()

    def _end(self) -> None:
        if self._stream is not None and self._stream.tail is not None:
            self._stream.tail.close()
        self._stream = None

    def receive(self, message: Message, peer: Hashable, now_s: float) -> None:
        """Take LOGGING_ACK."""
        stream = self._stream
        if stream is None or stream.waiting is None or not is_for(message, self._own):
            return
        same_client = (peer, sender(message)) == (stream.peer, stream.client)
        if same_client and message.sequence == stream.waiting.sequence:
            stream.waiting = None

    def poll(self, now_s: float) -> list[tuple[Hashable | None, Message]]:
        """Return the messages to send now, each with its peer."""
        stream = self._stream
        if stream is None:
            return []
        if stream.tail is None:
            stream.tail = self._open_tail()
            if stream.tail is None:
                return []
        if stream.waiting is not None:
            return self._resend(stream, now_s)
        pieces: list[tuple[Hashable | None, Message]] = []
        if not self._has_room(stream.peer):
            return pieces
        for _ in range(self._pace.allowance(now_s)):
            message = self._next(stream, now_s)
            if message is None:
                break
            self._pace.take(1)
            pieces.append((stream.peer, message))
            if stream.waiting is not None:
                break
        if not pieces and stream.tail.ended:
            self._end()
        return pieces

    def _resend(self, stream: _Stream, now_s: float) -> list[tuple[Hashable | None, Message]]:
        if now_s - stream.since_s > GIVE_UP_S:
            self._end()
        elif now_s - stream.sent_s >= RESEND_S:
            stream.sent_s = now_s
            return [(stream.peer, stream.waiting)]
        return []

    def _next(self, stream: _Stream, now_s: float) -> Message | None:
        assert stream.tail is not None
        chunk = stream.tail.read(CHUNK)
        if not chunk:
            return None
        needs_ack = not stream.boundaries.in_data
        first = stream.boundaries.scan(chunk)
        make = (
            mavlink.MAVLink_logging_data_acked_message if needs_ack else mavlink.MAVLink_logging_data_message
        )
        content = list(chunk) + [0] * (CHUNK - len(chunk))
        message = make(*stream.client, stream.sequence, len(chunk), first, content)
        stream.sequence = (stream.sequence + 1) % 0x10000
        if needs_ack:
            stream.waiting, stream.since_s, stream.sent_s = message, now_s, now_s
        return message

    def next_deadline(self) -> float | None:
        """Return the time of the next poll; with a stream open at the message rate, since its log may have grown."""
        stream = self._stream
        if stream is None:
            return None
        if stream.waiting is None:
            return self._pace.ready_s()
        return min(stream.sent_s + RESEND_S, stream.since_s + GIVE_UP_S)
