"""A MAVLink link without I/O: encoder and decoder with its own sequence numbers, and addressing of messages."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from flightstack.mavlink.decoding import received
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.frames import (
    CHECKSUM_SIZE,
    HEADER_V2,
    MAGIC_V1,
    MAGIC_V2,
    Frame,
    FrameReader,
    has_checksum,
    pack_frame,
)
from flightstack.mavlink.packed import PackedMessage
from flightstack.mavlink.payloads import payload_of
from flightstack.mavlink.signing import LinkSigning

if TYPE_CHECKING:
    from flightstack.mavlink.frame_packer import FramePacker  # NumPy, which not every end of a link needs

Message: TypeAlias = Any
"""A pymavlink message object, or a ``PackedMessage`` to send."""

SILENT_AFTER_S = 5.0
"""Timeout of a peer without valid messages: five missed heartbeats."""


class Link:
    """Encoder and decoder of one link. Invalid bytes are counted and raise no error."""

    def __init__(
        self,
        system_id: int,
        component_id: int,
        keeps_unknown: bool = False,
        signing: LinkSigning | None = None,
    ) -> None:
        """With ``keeps_unknown``, ``decode`` also yields messages unknown to the dialect, for forwarding.

        With ``signing``, sent messages are signed, and received ones without a required signature count as bad.
        """
        self._signing = signing
        self._system_id, self._component_id = system_id, component_id
        self._sequence = 0
        self._reader = FrameReader()
        self._keeps_unknown = keeps_unknown
        self.received = 0
        self.sent = 0
        self.bad = 0
        self.unknown = 0
        """Messages unknown to the dialect that ``decode`` has yielded; they count as bad too."""

    def encode(self, message: Message) -> bytes:
        """Return the frame of ``message`` with this link's next sequence number.

        Out-of-range values are fitted in ``message`` (``fields.fit``).
        """
        if message.__class__ is PackedMessage:
            kind, payload = message.packing, message.payload
            message_id, crc_extra = kind.message_id, kind.crc_extra
        else:
            kind, payload = message.__class__, payload_of(message)
            message_id, crc_extra = kind.id, kind.crc_extra  # the message may have a field ``id``
        source = self._sequence, self._system_id, self._component_id
        frame = pack_frame(message_id, payload, crc_extra, *source)
        self._sequence = (self._sequence + 1) % 256
        self.sent += 1
        return frame if self._signing is None else self._signing.outgoing(frame, crc_extra)

    def encode_numbered(self, packer: FramePacker, numbers: Sequence[int]) -> list[bytes]:
        """Return the frames of messages of ``packer``, by their numbers, with this link's next sequence numbers."""
        frames = packer.frames(numbers, self._sequence, self._system_id, self._component_id)
        self._sequence = (self._sequence + len(frames)) % 256
        self.sent += len(frames)
        if self._signing is None:
            return frames
        return [
            self._signing.outgoing(frame, packer.crc_extra(number))
            for frame, number in zip(frames, numbers, strict=True)
        ]

    def is_authentic(self, message: Message) -> bool:
        """Return True if a decoded message carried the signature that this link requires, if any."""
        return self._signing is None or self._signing.is_authentic(bytes(message.get_msgbuf()))

    @property
    def has_partial(self) -> bool:
        """True if the decoder holds an incomplete frame."""
        return self._reader.has_partial

    def decode(self, data: bytes) -> Iterator[Message]:
        """Return the messages that ``data`` completes; count other bytes in ``bad``.

        ``get_msgbuf()`` returns the received frame. Fields are decoded when one of them is read. Text fields are safe
        to print.
        """
        kind = self._kind_of_one(data)
        if kind is None:
            return self._stream(data)
        message = self._message(data, kind, is_checked=False)  # typical datagram: no search for frames
        return iter(() if message is None else (message,))

    def _kind_of_one(self, data: bytes) -> Any:
        """Return the class of the message if ``data`` is exactly one known, unsigned frame and none is incomplete."""
        payload_size = len(data) - HEADER_V2 - CHECKSUM_SIZE
        if payload_size < 0 or data[0] != MAGIC_V2 or data[2] != 0:
            return None
        if data[1] != payload_size or self._reader.has_partial:
            return None
        return mavlink.mavlink_map.get(data[7] | data[8] << 8 | data[9] << 16)

    def _stream(self, data: bytes) -> Iterator[Message]:
        faults_before = self._reader.faults
        frames = self._reader.feed(data)
        self.bad += self._reader.faults - faults_before
        for frame in frames:
            if frame.known:
                message = self._message(frame.data, mavlink.mavlink_map[frame.message_id], is_checked=True)
                if message is not None:
                    yield message
            else:
                self.bad += 1
                if self._keeps_unknown and (self._signing is None or self._signing.accepts(frame.data)):
                    self.unknown += 1
                    yield _unknown(frame)

    def _message(self, frame: bytes, kind: Any, *, is_checked: bool) -> Message | None:
        """Return the message in a known frame; None for a wrong signature or, unless checked, a wrong checksum."""
        is_accepted = self._signing is None or self._signing.accepts(frame)
        if not (is_accepted and (is_checked or has_checksum(frame, HEADER_V2, kind.crc_extra))):
            self.bad += 1
            return None
        self.received += 1
        return received(frame, kind)


def is_unknown(message: Message) -> bool:
    """Return True for a message unknown to the dialect, with an unverified checksum."""
    return isinstance(message, mavlink.MAVLink_unknown)


def _unknown(frame: Frame) -> Message:
    """Return pymavlink's placeholder for an unknown message, with its sender."""
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
    """Return the sender of ``message``."""
    return Address(message.get_srcSystem(), message.get_srcComponent())


def is_for(message: Message, own: Address) -> bool:
    """Return True if a message is addressed to ``own`` or broadcast (0)."""
    return message.target_system in (0, own.system) and message.target_component in (0, own.component)


def is_from(message: Message, peer: Address) -> bool:
    """Return True if ``message`` comes from ``peer``; component 0 matches any."""
    return message.get_srcSystem() == peer.system and peer.component in (0, message.get_srcComponent())
