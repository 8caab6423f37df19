"""One MAVLink link without I/O: bytes in, messages out, and back, with sequence numbers of its own."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple, TypeAlias

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.fields import PACKING_ERRORS, TEXT_FIELDS, clean, fit
from flightstack.mavlink.frames import (
    CHECKSUM_SIZE,
    HEADER_V2,
    MAGIC_V1,
    MAGIC_V2,
    Frame,
    FrameReader,
    message_id_of,
    pack_frame,
)
from flightstack.mavlink.signing import LinkSigning

Message: TypeAlias = Any
"""A pymavlink message object."""

SILENT_AFTER_S = 5.0
"""A peer that sent nothing valid for so long counts as gone: five heartbeats are missing."""


class Link:
    """Encodes and decodes one link. Bytes that make no message are counted, never raised."""

    def __init__(
        self,
        system_id: int,
        component_id: int,
        keeps_unknown: bool = False,
        signing: LinkSigning | None = None,
    ) -> None:
        """``keeps_unknown``: let ``decode`` yield messages that the dialect lacks too, to be passed on.

        ``signing``: sign what is sent, and count as bad what is not signed as it should be.
        """
        self._signing = signing
        self._codec = mavlink.MAVLink(None, system_id, component_id)
        self._codec.robust_parsing = True
        self._reader = FrameReader()
        self._keeps_unknown = keeps_unknown
        self.received = 0
        self.sent = 0
        self.bad = 0

    def encode(self, message: Message) -> bytes:
        """Return the frame of ``message`` with this link's next sequence number.

        Values that their fields cannot hold are brought into range in ``message`` (``fields.fit``).
        """
        try:
            frame: bytes = message.pack(self._codec)
        except PACKING_ERRORS:
            fit(message)
            frame = message.pack(self._codec)
        self._codec.seq = (self._codec.seq + 1) % 256
        self.sent += 1
        return self._outgoing(bytes(frame), message)

    def _outgoing(self, frame: bytes, message: Message) -> bytes:
        return frame if self._signing is None else self._signing.outgoing(frame, message.crc_extra)

    def encode_shared(self, message: Message) -> bytes:
        """Do as ``encode``, for a message that goes to several links and does not change between.

        The payload is packed by the first of them. The others have to write header and checksum only.
        """
        codec = self._codec
        payload: bytes | None = message.get_payload()
        packed = (
            payload is not None and len(payload) == message.get_header().mlen
        )  # of a received one it is not
        if payload is None or not packed:
            return self.encode(message)
        number = message.get_msgId()  # ``id`` may be a field
        frame = pack_frame(number, payload, message.crc_extra, codec.seq, codec.srcSystem, codec.srcComponent)
        codec.seq = (codec.seq + 1) % 256
        self.sent += 1
        return self._outgoing(frame, message)

    def is_authentic(self, message: Message) -> bool:
        """Return True if a decoded message carried the signature that this link requires, if any."""
        return self._signing is None or self._signing.is_authentic(bytes(message.get_msgbuf()))

    @property
    def has_partial(self) -> bool:
        """Tell whether the decoder holds the beginning of a frame."""
        return self._reader.has_partial

    def decode(self, data: bytes) -> Iterator[Message]:
        """Yield the messages that ``data`` completes; what is not a message is counted in ``bad``.

        Each has its frame as it was received in ``get_msgbuf()``. Its texts are clean: they may be shown.
        """
        if self._is_one_frame(data):  # the usual datagram: no need to look for frames
            message = self._message(data)
            if message is not None:
                yield message
            return
        faults_before = self._reader.faults
        frames = self._reader.feed(data)
        self.bad += self._reader.faults - faults_before
        for frame in frames:
            if frame.known:
                message = self._message(frame.data)
                if message is not None:
                    yield message
            else:
                self.bad += 1
                if self._keeps_unknown and (self._signing is None or self._signing.accepts(frame.data)):
                    yield _unknown(frame)

    def _message(self, frame: bytes) -> Message | None:
        """Decode one known frame; None when its checksum or signature is wrong."""
        if self._signing is not None and not self._signing.accepts(frame):
            self.bad += 1
            return None
        try:
            message = self._codec.decode(bytearray(frame))
        except mavlink.MAVError:
            self.bad += 1
            return None
        for name in TEXT_FIELDS[type(message)]:  # the frame keeps the bytes as they came
            setattr(message, name, clean(getattr(message, name)))
        self.received += 1
        return message

    def _is_one_frame(self, data: bytes) -> bool:
        """Tell whether ``data`` is one whole unsigned frame that we know and no beginning of another is held."""
        payload_size = len(data) - HEADER_V2 - CHECKSUM_SIZE
        if payload_size < 0 or data[0] != MAGIC_V2 or data[2] != 0:
            return False
        if data[1] != payload_size or self.has_partial:
            return False
        return message_id_of(data) in mavlink.mavlink_map


def is_unknown(message: Message) -> bool:
    """Tell whether the dialect lacks ``message``: its checksum could not be verified."""
    return isinstance(message, mavlink.MAVLink_unknown)


def _unknown(frame: Frame) -> Message:
    """Return pymavlink's stand-in for a message that the dialect lacks, with its sender."""
    message = mavlink.MAVLink_unknown(frame.message_id, frame.data)
    sequence, system, component = frame.data[2:5] if frame.data[0] == MAGIC_V1 else frame.data[4:7]
    header = mavlink.MAVLink_header(frame.message_id, 0, 0, frame.data[1], sequence, system, component)
    message._header = header
    return message


class Address(NamedTuple):
    """A MAVLink system and component; 0 means all."""

    system: int
    component: int


def sender(message: Message) -> Address:
    """Return who sent ``message``."""
    return Address(message.get_srcSystem(), message.get_srcComponent())


def is_for(message: Message, own: Address) -> bool:
    """Tell whether a message with a target is for ``own``; 0 is for everyone."""
    return message.target_system in (0, own.system) and message.target_component in (0, own.component)


def is_from(message: Message, peer: Address) -> bool:
    """Tell whether ``message`` comes from ``peer``, whose component may be 0 for any."""
    return message.get_srcSystem() == peer.system and peer.component in (0, message.get_srcComponent())
