"""Texts for the operator."""

from __future__ import annotations

from collections.abc import Iterator

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Message

STATUSTEXT_SIZE = 50


def status_texts(severity: int, text: str) -> Iterator[Message]:
    """STATUSTEXT, in chunks of 50 octets when it is longer; the last chunk is the one that is not full."""
    octets = text.encode("utf-8")
    if len(octets) <= STATUSTEXT_SIZE:
        yield mavlink.MAVLink_statustext_message(severity, octets, 0, 0)
        return
    identity = 1 + sum(octets) % 0xFFFF
    for chunk, start in enumerate(range(0, len(octets) + 1, STATUSTEXT_SIZE)):
        part = octets[start : start + STATUSTEXT_SIZE]
        yield mavlink.MAVLink_statustext_message(severity, part, identity, chunk)
