"""Frames of a link: a decoder and an encoder per peer, signing, and a tap for recordings. Sans-IO.

A module of its own: one wire serves the sessions of all vehicles.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from flightstack.mavlink.link import Address, Link, Message, is_unknown
from flightstack.mavlink.signing import LinkSigning, without_signature
from flightstack.transports.udp import Address as Peer

SYSTEM_ID = 255
COMPONENT_ID = 190  # MAV_COMP_ID_MISSIONPLANNER, as most ground stations use
_MOST_PEERS = 32


class Wire:
    """Decodes datagrams and encodes messages, with sequence numbers of each peer.

    ``record`` gets every frame, sent and received, without its signature.
    """

    def __init__(
        self,
        signing: LinkSigning | None = None,
        record: Callable[[bytes], None] | None = None,
        own_system: int = SYSTEM_ID,
    ) -> None:
        self.own = Address(own_system, COMPONENT_ID)
        """System and component of this side."""
        self.record = record
        self._signing = signing
        self._bad_before = 0
        """Those of decoders that were dropped."""
        self._decoders: dict[Peer, Link] = {}
        self._encoders: dict[Peer | None, Link] = {}

    @property
    def bad(self) -> int:
        """Bytes and frames that are no valid messages."""
        return self._bad_before + sum(link.bad - link.unknown for link in self._decoders.values())

    def decode(self, data: bytes, peer: Peer) -> Iterator[Message]:
        """Yield the authentic messages in a datagram, those unknown to the dialect too."""
        return self.decode_all((data,), peer)

    def decode_all(self, datagrams: Iterable[bytes], peer: Peer) -> Iterator[Message]:
        """Yield those in successive datagrams of one peer."""
        link = self._decoders.get(peer) or self._new_decoder(peer)
        for data in datagrams:
            messages = link.decode(data)
            if self._signing is None and self.record is None:
                yield from messages
            else:
                yield from self._recorded(messages, link)

    def _new_decoder(self, peer: Peer) -> Link:
        if len(self._decoders) > _MOST_PEERS:
            self._bad_before = self.bad
            self._decoders.clear()
        self._decoders[peer] = Link(*self.own, keeps_unknown=True, signing=self._signing)
        return self._decoders[peer]

    def _recorded(self, messages: Iterator[Message], link: Link) -> Iterator[Message]:
        """Yield and record the authentic messages."""
        for message in messages:
            if not link.is_authentic(message):
                continue
            if self.record is not None:
                self._record_received(message, self.record)
            yield message

    @staticmethod
    def _record_received(message: Message, record: Callable[[bytes], None]) -> None:
        frame = bytes(message.get_msgbuf())
        record(frame if is_unknown(message) else without_signature(frame, message.crc_extra))

    def encode(self, message: Message, peer: Peer | None) -> bytes:
        """Return the frame of a message from this ground station to ``peer``."""
        if len(self._encoders) > _MOST_PEERS:
            self._encoders.clear()
        link = self._encoders.get(peer)
        if link is None:
            link = self._encoders[peer] = Link(*self.own, signing=self._signing)
        frame = link.encode(message)
        if self.record is not None:
            self.record(without_signature(frame, message.crc_extra))
        return frame
