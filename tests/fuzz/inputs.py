"""What may arrive on a link, from noise to valid frames of every message. Seeded: a run can be repeated."""

from __future__ import annotations

import random
import struct
from typing import NamedTuple

from fastcrc import crc16

from flightstack.mavlink.dialect import mavlink
from flightstack.services.commands.command_server import HANDLERS
from flightstack.services.commands.link_commands import LINK_COMMANDS

_VALUES = (
    float("nan"), float("inf"), -float("inf"), 0.0, -0.0, 1.0, -1.0, 2.0, 3.4028234e38, -3.4028234e38,
    1e-45, 65535.0, 65536.0, 16777216.0, 2147483648.0, 4294967296.0, 1e19, 0.5,
)  # fmt: skip
_ODD = {
    "f": tuple(struct.pack("<f", value) for value in _VALUES),
    "d": tuple(struct.pack("<d", value) for value in (*_VALUES, 1.7e308, 5e-324)),
}
_SIZES = {code: struct.calcsize(f"<{code}") for code in "fdIiQqHhBbcs"}
_COMMANDS = tuple(sorted({*HANDLERS, *LINK_COMMANDS, 0, 1, 65535}))
_SERVED = ("MISSION_", "PARAM_", "LOG", "FILE_", "COMMAND_", "SET_", "MANUAL_", "TIMESYNC")
"""Beginnings of names of messages that services take: chosen more often than the others."""
NAMES = (
    b"MPC_XY_CRUISE",
    b"COM_RC_IN_MODE",
    b"SYSID_THISMAV",
    b"_HASH_CHECK",
    b"MAV_SYS_ID",
    b"",
    b"\xff" * 16,
)
PATHS = (
    b"/",
    b"@PARAM/param.pck",
    b"@MAV_LOG",
    b"fs/log",
    b"../../x",
    b"general.json.xz",
    b"\xff\x00/",
    b"@MAV_LOG/02.ulg",
)


class Field(NamedTuple):
    """Where a field lies in its payload."""

    name: str
    code: str  # as in ``struct``
    at: int
    count: int


class Kind(NamedTuple):
    """One message of the dialect."""

    number: int
    size: int
    crc_extra: int
    fields: tuple[Field, ...]


def _kind(number: int) -> Kind:
    message = mavlink.mavlink_map[number]
    codes = bytes(message.native_format).decode().lstrip("<")
    counts = [max(pair) for pair in zip(message.lengths, message.array_lengths, strict=True)]
    fields, at = [], 0
    for name, code, count in zip(message.ordered_fieldnames, codes, counts, strict=True):
        fields.append(Field(name, code, at, count))
        at += _SIZES[code] * count
    assert at == message.unpacker.size, message.msgname
    return Kind(number, at, message.crc_extra, tuple(fields))


KINDS = tuple(
    _kind(number)
    for number, kind in sorted(mavlink.mavlink_map.items())
    if not kind.__module__.endswith(".ardupilotmega")
)
"""Without messages that only ArduPilot has: another test may have registered them."""
_SERVED_KINDS = tuple(kind for kind in KINDS if mavlink.mavlink_map[kind.number].msgname.startswith(_SERVED))


class Inputs:
    """Draws inputs. ``targets`` are the systems that messages are for; ``sources`` who they say they are from."""

    def __init__(
        self, seed: int, targets: tuple[int, ...] = (0, 1, 1, 1, 7), sources: tuple[int, ...] = (0, 1, 7, 255)
    ) -> None:
        self.random = random.Random(seed)
        self._targets = targets
        self._sources = sources
        self.drawn: dict[int, int] = {}
        """How many frames of each message were drawn."""

    # ------------------------------------------------------------------ frames

    def payload(self, kind: Kind) -> bytearray:
        """Return a payload of random octets, odd numbers and things that a service looks for."""
        draw = self.random
        payload = bytearray(draw.randbytes(kind.size))
        if draw.random() < 0.3:
            payload = bytearray(kind.size)  # all that is not set below is zero
        for field in kind.fields:
            if field.name in ("target_system", "target") and field.code == "B":
                payload[field.at] = draw.choice(self._targets)
            elif field.name == "target_component":
                payload[field.at] = draw.choice((0, 1, 1, 1, 99))
            elif field.name == "command" and field.code == "H":
                payload[field.at : field.at + 2] = draw.choice(_COMMANDS).to_bytes(2, "little")
            elif field.name == "param_id":
                payload[field.at : field.at + 16] = draw.choice(NAMES).ljust(16, b"\0")
            elif field.code in _ODD and draw.random() < 0.5:
                size = _SIZES[field.code]
                for place in range(field.at, field.at + size * field.count, size):
                    payload[place : place + size] = draw.choice(_ODD[field.code])
            elif draw.random() < 0.5:
                self._small(payload, field)
        if kind.number == mavlink.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL:
            self._file_request(payload)
        return payload

    def _small(self, payload: bytearray, field: Field) -> None:
        """Make an integer field a small number: types, indices and counts mostly are."""
        if field.code in "IiQqHhBb" and field.count == 1:
            size = _SIZES[field.code]
            payload[field.at : field.at + size] = self.random.randrange(12).to_bytes(size, "little")

    def _file_request(self, payload: bytearray) -> None:
        path = self.random.choice(PATHS)
        payload[5:8] = bytes((self.random.randrange(4), self.random.randrange(17), len(path)))
        payload[11:15] = self.random.choice((0, 1, 239, 2**31, 2**32 - 1)).to_bytes(4, "little")
        payload[15 : 15 + len(path)] = path

    def frame(self, kind: Kind | None = None, cuts: bool = True) -> bytes:
        """Return a valid frame: of MAVLink 1 or 2, whole, cut where zeros end it or elsewhere, or with a signature.

        A field that is cut off is zero: a target then means everyone. ``cuts``: whether that may be.
        """
        draw = self.random
        if kind is None:
            kind = draw.choice(_SERVED_KINDS if draw.random() < 0.5 else KINDS)
        self.drawn[kind.number] = self.drawn.get(kind.number, 0) + 1
        payload = bytes(self.payload(kind))
        style = draw.random()
        if style < 0.1 and cuts:
            payload = payload[: draw.randrange(len(payload) + 1)]
        elif style < 0.6:
            payload = payload.rstrip(b"\0") or b"\0"
        source = (draw.randrange(256), draw.choice(self._sources), draw.choice((0, 1, 190)))
        if kind.number < 256 and style > 0.9:
            return sealed_v1(kind, payload, source)
        signed = 0.8 < style < 0.85
        return sealed(kind, payload, source, draw.randbytes(13) if signed else b"")

    # ------------------------------------------------------------------ what is no frame

    def noise(self) -> bytes:
        """Return random octets, beginnings of frames among them."""
        draw = self.random
        octets = bytearray(draw.randbytes(draw.choice((0, 1, 7, 60, 300))))
        for _ in range(len(octets) // 20):
            octets[draw.randrange(len(octets))] = draw.choice((0xFD, 0xFE))
        return bytes(octets)

    def spoiled(self) -> bytes:
        """Return a frame with one bit turned, which its checksum finds."""
        frame = bytearray(self.frame())
        signature = 13 if frame[0] == 0xFD and frame[2] & 1 else 0
        at = self.random.randrange(6 if frame[0] == 0xFE else 10, len(frame) - signature)
        frame[at] ^= 1 << self.random.randrange(8)
        return bytes(frame)

    def datagram(self) -> bytes:
        """Return any of it: mostly a frame; or noise, a spoiled or unknown one, several, or one with junk."""
        style = self.random.random()
        if style < 0.85:
            return self.frame()
        if style < 0.88:
            return self.noise()
        if style < 0.92:
            return self.spoiled()
        if style < 0.94:
            number = self.random.choice((54321, 60000, 2**24 - 1))
            size = self.random.randrange(256)
            head = bytes((size, 0, 0, 1, 7, 1)) + number.to_bytes(3, "little")
            return b"\xfd" + head + self.random.randbytes(size + 2)
        if style < 0.97:
            return self.noise() + self.frame() + self.noise()
        return self.frame() + self.frame()

    def pieces(self, data: bytes) -> list[bytes]:
        """Return ``data``, mostly whole, or cut anywhere."""
        if self.random.random() < 0.9:
            return [data]
        cut = self.random.randrange(len(data) + 1)
        return [data[:cut], data[cut:]]

    def mutated(self, frames: list[bytes]) -> list[bytes]:
        """Return a recorded session with frames lost, repeated, swapped, cut or with a bit turned."""
        draw = self.random
        out: list[bytes] = []
        for frame in frames:
            style = draw.random()
            if style < 0.03:
                continue
            if style < 0.06:
                out.append(frame)
            elif style < 0.09:
                at = draw.randrange(len(frame))
                frame = frame[:at] + bytes((frame[at] ^ 1 << draw.randrange(8),)) + frame[at + 1 :]  # noqa: PLW2901
            elif style < 0.11:
                frame = frame[: draw.randrange(len(frame))]  # noqa: PLW2901
            out.append(frame)
            if style > 0.96 and len(out) > 1:
                out[-1], out[-2] = out[-2], out[-1]
        return out


def sealed(kind: Kind, payload: bytes, source: tuple[int, int, int], signature: bytes = b"") -> bytes:
    """Return the MAVLink 2 frame with a right checksum; ``source``: sequence number, system and component."""
    head = bytes((len(payload), bool(signature), 0, *source)) + kind.number.to_bytes(3, "little")
    return b"\xfd" + head + payload + _checksum(head + payload, kind) + signature


def sealed_v1(kind: Kind, payload: bytes, source: tuple[int, int, int]) -> bytes:
    """Return the frame of MAVLink 1."""
    head = bytes((len(payload), *source, kind.number))
    return b"\xfe" + head + payload + _checksum(head + payload, kind)


def _checksum(body: bytes, kind: Kind) -> bytes:
    checksum: int = crc16.mcrf4xx(body + bytes((kind.crc_extra,)))
    return checksum.to_bytes(2, "little")
