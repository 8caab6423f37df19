"""One MAVLink link without I/O: bytes in, messages out, and back, with sequence numbers of its own."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, TypeAlias

from flightstack.mavlink.dialect import mavlink

Message: TypeAlias = Any
"""A pymavlink message object."""


class Link:
    """Encodes and decodes one link. Bytes that make no message are counted, never raised."""

    def __init__(self, system_id: int, component_id: int) -> None:
        self._codec = mavlink.MAVLink(None, system_id, component_id)
        self._codec.robust_parsing = True
        self.received = 0
        self.sent = 0
        self.bad = 0

    def encode(self, message: Message) -> bytes:
        """Return the frame of ``message`` with this link's next sequence number."""
        frame: bytes = message.pack(self._codec)
        self._codec.seq = (self._codec.seq + 1) % 256
        self.sent += 1
        return bytes(frame)

    @property
    def has_partial(self) -> bool:
        """Tell whether the decoder holds the beginning of a frame."""
        return int(self._codec.buf_len()) > 0

    def decode(self, data: bytes) -> Iterator[Message]:
        """Yield the messages that ``data`` completes; what is not a message is counted in ``bad``."""
        try:
            if self._is_one_frame(data):  # the usual datagram: no need to look for frames
                messages = [self._codec.decode(bytearray(data))]
            else:
                messages = self._codec.parse_buffer(data) or []
        except mavlink.MAVError:  # robust parsing reports most faults as BAD_DATA; a signature fault raises
            self.bad += 1
            return
        for message in messages:
            if message.get_msgId() < 0:  # BAD_DATA and unknown messages
                self.bad += 1
            else:
                self.received += 1
                yield message

    def _is_one_frame(self, data: bytes) -> bool:
        """Tell whether ``data`` is one whole unsigned frame and the decoder holds no beginning of another."""
        if len(data) < 12 or data[0] != 0xFD or data[2] != 0:
            return False
        return data[1] == len(data) - 12 and not self.has_partial
