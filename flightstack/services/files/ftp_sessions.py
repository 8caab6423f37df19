"""Sessions, bursts and checksums of one MAVLink FTP client. No messages, no clock."""

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
"""Silence after which a new session of the same client may replace a session."""
BURST_PACKETS = 500
"""Packets in one burst, as in ArduPilot. The client requests the next burst, which shows that it is connected."""
CRC_CHUNK = 256 * 1024
"""Bytes per checksum step, about 0.2 ms."""


class FtpRefusal(Exception):  # noqa: N818  # an answer of the protocol, not an error of the program
    """A request is answered with a NAK."""

    def __init__(self, error: FtpError, errno: int | None = None) -> None:
        super().__init__(error.name)
        self.error = error
        self.errno = errno


@dataclass
class Burst:
    """A burst in progress."""

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
    """True if the end of the file was sent."""

    def read(self, offset: int, size: int) -> bytes:
        """Return up to ``size`` bytes (0: as many as fit). Raise FtpRefusal at the end of the file, or OSError."""
        if offset >= self.file.size:
            self.is_done = True
            raise FtpRefusal(FtpError.END_OF_FILE)
        data = self.file.read(offset, min(size or MAX_DATA, MAX_DATA, self.file.size - offset))
        if not data:  # the file was truncated since it was opened
            self.is_done = True
            raise FtpRefusal(FtpError.END_OF_FILE)
        self.is_done = self.is_done or offset + len(data) >= self.file.size
        return data


@dataclass
class Checksum:
    """A checksum in progress, and its request."""

    request: Packet
    file: VirtualFile
    offset: int = 0
    crc: int = 0

    def step(self) -> bool:
        """Add the next bytes; return True at the end of the file. Raise OSError."""
        data = self.file.read(self.offset, min(CRC_CHUNK, self.file.size - self.offset))
        self.crc = mavlink_crc32(data, self.crc)
        self.offset += len(data)
        return not data or self.offset >= self.file.size


@dataclass
class FtpSessions:
    """Sessions of one client. Numbers are per client, so that several clients can use session 0 at once."""

    address: Address
    heard_s: float
    sessions: dict[int, Session] = field(default_factory=dict)
    checksum: Checksum | None = None
    last: tuple[Packet, Packet] | None = None
    """The last request that changed state, and its answer, which is repeated if the client repeats the request."""

    @property
    def is_streaming(self) -> bool:
        """True while a burst is in progress."""
        return any(session.burst is not None for session in self.sessions.values())

    def open(self, file: VirtualFile, wanted: int, now_s: float) -> int:
        """Open a session for ``file`` and return its number; raise FtpRefusal if too many are open.

        The number is that of the request if it is free, as in ArduPilot: MAVProxy drops answers with another number.

        Finished and silent sessions are closed first: TERMINATE_SESSION may be lost, and clients that ignore the
        number in the answer (MAVSDK) would continue to read the old file.
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
        """Return an open session and restart its silence; raise FtpRefusal."""
        session = self.sessions.get(number)
        if session is None:
            raise FtpRefusal(FtpError.INVALID_SESSION)
        session.heard_s = now_s
        return session

    def close(self, number: int) -> None:
        """Close a session if it is open."""
        session = self.sessions.pop(number, None)
        if session is not None:
            session.file.close()

    def close_all(self) -> None:
        """Close all sessions, and cancel the checksum in progress."""
        for number in list(self.sessions):
            self.close(number)
        self.end_checksum()

    def end_checksum(self) -> None:
        """Close the file of the checksum in progress."""
        if self.checksum is not None:
            self.checksum.file.close()
            self.checksum = None

    def begin_burst(self, request: Packet, now_s: float) -> None:
        """Start or restart a burst at the offset of ``request``; raise FtpRefusal."""
        session = self.session(request.session, now_s)
        if request.offset >= session.file.size:
            session.is_done, session.burst = True, None
            raise FtpRefusal(FtpError.END_OF_FILE)
        size = min(request.size or MAX_DATA, MAX_DATA)
        session.burst = Burst(next_sequence(request.sequence), request.offset, size, BURST_PACKETS)

    def next_burst_packet(self) -> Packet | None:
        """Return the next packet of a burst, or None."""
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
    # The last packet of the file has the burst_complete flag. A NAK after it, as PX4 sends, would make MAVSDK drop
    # the whole file if this packet is lost; clients that need the NAK get it for their next burst request.
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
    """Return the ACK of a completed checksum."""
    request = checksum.request
    data = UINT32.pack(checksum.crc)
    return Packet(next_sequence(request.sequence), request.session, Opcode.ACK, 4, request.opcode, data=data)
