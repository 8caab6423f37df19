"""Open files of one MAVLink FTP client: sessions, bursts and running checksums. No messages, no clock."""

from __future__ import annotations

from dataclasses import dataclass, field

from flightstack.mavlink.files import VirtualFile
from flightstack.mavlink.ftp_messages import (
    MAX_DATA,
    UINT32,
    FtpError,
    Opcode,
    Packet,
    mavlink_crc32,
    next_sequence,
)
from flightstack.mavlink.link import Address

MAX_SESSIONS = 4
ABANDONED_S = 1.0
"""A session this silent gives way to a new one of the same client."""
BURST_PACKETS = 500
"""Packets in one burst, as ArduPilot sends: then the client must ask again, which shows that it is there."""
CRC_CHUNK = 256 * 1024
"""Bytes checked at once: about 0.2 ms."""


class FtpRefusal(Exception):  # noqa: N818  # an answer of the protocol, not an error of the program
    """A request that is answered by a NAK."""

    def __init__(self, error: FtpError, errno: int | None = None) -> None:
        super().__init__(error.name)
        self.error = error
        self.errno = errno


@dataclass
class Burst:
    """A burst under way."""

    sequence: int
    offset: int
    size: int
    packets_left: int


@dataclass
class Session:
    """An open file."""

    file: VirtualFile
    heard_s: float
    burst: Burst | None = None
    is_done: bool = False
    """Whether its end has been sent."""

    def read(self, offset: int, size: int) -> bytes:
        """Return up to ``size`` bytes (0: as many as fit); raise FtpRefusal at the end, and OSError."""
        if offset >= self.file.size:
            self.is_done = True
            raise FtpRefusal(FtpError.END_OF_FILE)
        data = self.file.read(offset, min(size or MAX_DATA, MAX_DATA, self.file.size - offset))
        if not data:  # it is shorter than it was when it was opened
            self.is_done = True
            raise FtpRefusal(FtpError.END_OF_FILE)
        self.is_done = self.is_done or offset + len(data) >= self.file.size
        return data


@dataclass
class Checksum:
    """A checksum under way, and the request that is answered by it."""

    request: Packet
    file: VirtualFile
    offset: int = 0
    crc: int = 0

    def step(self) -> bool:
        """Check the next bytes; return whether all are. Raise OSError."""
        data = self.file.read(self.offset, min(CRC_CHUNK, self.file.size - self.offset))
        self.crc = mavlink_crc32(data, self.crc)
        self.offset += len(data)
        return not data or self.offset >= self.file.size


@dataclass
class FtpSessions:
    """One client of the server. Session numbers are its own: clients that always use 0 are served at once."""

    address: Address
    heard_s: float
    sessions: dict[int, Session] = field(default_factory=dict)
    checksum: Checksum | None = None
    last: tuple[Packet, Packet] | None = None
    """The last request that changed something, and its answer, for when that gets lost."""

    @property
    def is_streaming(self) -> bool:
        """Whether a burst is under way."""
        return any(session.burst is not None for session in self.sessions.values())

    def open(self, file: VirtualFile, wanted: int, now_s: float) -> int:
        """Return the session number of ``file``; raise FtpRefusal when too many are open.

        It is the number of the request when that is free, as in ArduPilot: MAVProxy drops answers with another.

        A session whose end was sent, or which is silent, is closed: the message that ends it gets lost, and
        clients that ignore the number in the answer (MAVSDK) would go on to read the old file.
        """
        for number, session in list(self.sessions.items()):
            is_silent = session.burst is None and now_s - session.heard_s >= ABANDONED_S
            if session.is_done or is_silent:
                self.close(number)
        if len(self.sessions) >= MAX_SESSIONS:
            raise FtpRefusal(FtpError.NO_SESSIONS_AVAILABLE)
        taken = wanted in self.sessions
        number = next(n for n in range(MAX_SESSIONS) if n not in self.sessions) if taken else wanted
        self.sessions[number] = Session(file, now_s)
        return number

    def session(self, number: int, now_s: float) -> Session:
        """Return an open session, which counts as heard; raise FtpRefusal."""
        session = self.sessions.get(number)
        if session is None:
            raise FtpRefusal(FtpError.INVALID_SESSION)
        session.heard_s = now_s
        return session

    def close(self, number: int) -> None:
        """Close a session; one that is not open is ignored."""
        session = self.sessions.pop(number, None)
        if session is not None:
            session.file.close()

    def close_all(self) -> None:
        """Close all sessions, and end the checksum under way."""
        for number in list(self.sessions):
            self.close(number)
        self.end_checksum()

    def end_checksum(self) -> None:
        """Give up the checksum under way."""
        if self.checksum is not None:
            self.checksum.file.close()
            self.checksum = None

    def begin_burst(self, request: Packet, now_s: float) -> None:
        """Begin a burst, or begin it anew at another place; raise FtpRefusal."""
        session = self.session(request.session, now_s)
        if request.offset >= session.file.size:
            session.is_done, session.burst = True, None
            raise FtpRefusal(FtpError.END_OF_FILE)
        size = min(request.size or MAX_DATA, MAX_DATA)
        session.burst = Burst(next_sequence(request.sequence), request.offset, size, BURST_PACKETS)

    def next_burst_packet(self) -> Packet | None:
        """Return the next packet of a burst; None when none is under way."""
        for number, session in self.sessions.items():
            if session.burst is not None:
                return _burst_packet(number, session, session.burst)
        return None


def _burst_packet(number: int, session: Session, burst: Burst) -> Packet:
    sequence, offset = burst.sequence, burst.offset
    try:
        data = session.read(offset, burst.size)
    except FtpRefusal as refusal:
        session.burst = None
        return refused(sequence, number, Opcode.BURST_READ_FILE, offset, refusal)
    except OSError as error:
        session.burst = None
        failure = FtpRefusal(FtpError.FAIL_ERRNO, error.errno)
        return refused(sequence, number, Opcode.BURST_READ_FILE, offset, failure)
    burst.sequence, burst.offset = next_sequence(sequence), offset + len(data)
    burst.packets_left -= 1
    # The last packet of the file says so itself. A NAK after it, as PX4 sends, would make MAVSDK drop the
    # whole file when this packet gets lost; clients that want the NAK ask for the next burst and get it.
    is_last = burst.packets_left == 0 or burst.offset >= session.file.size
    if is_last:
        session.burst = None
    return Packet(sequence, number, Opcode.ACK, len(data), Opcode.BURST_READ_FILE, is_last, offset, data)


def refused(sequence: int, session: int, request: int, offset: int, refusal: FtpRefusal) -> Packet:
    """Return a NAK with ``sequence``."""
    data = bytes([refusal.error])
    if refusal.error == FtpError.FAIL_ERRNO:
        data += bytes([(refusal.errno or 0) & 0xFF])
    return Packet(sequence, session, Opcode.NAK, len(data), request, False, offset, data)


def checksum_answer(checksum: Checksum) -> Packet:
    """Return the answer of a checksum that is done."""
    request = checksum.request
    data = UINT32.pack(checksum.crc)
    return Packet(next_sequence(request.sequence), request.session, Opcode.ACK, 4, request.opcode, data=data)
