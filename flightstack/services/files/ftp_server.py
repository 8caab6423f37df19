"""Vehicle side of MAVLink FTP, read-only, for several clients at once. No I/O.

https://mavlink.io/en/services/ftp.html; where it is silent, the server does as PX4 and ArduPilot do. Every request is
answered, a write with FILE_PROTECTED. Each ``poll`` sends a part of a burst.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable
from typing import NamedTuple

from flightstack.mavlink.files import Entry, VirtualFile, VirtualFiles
from flightstack.mavlink.ftp_messages import (
    MAX_DATA,
    MAX_OFFSET,
    UINT32,
    FtpError,
    Opcode,
    Packet,
    ftp_message,
    next_sequence,
    read_packet,
)
from flightstack.mavlink.link import Address, Message, is_for, sender
from flightstack.services.files.ftp_sessions import (
    Checksum,
    FtpRefusal,
    FtpSessions,
    checksum_answer,
    refused,
)
from flightstack.services.rate_limit import RateLimit, always_has_room, rotated

SESSION_TIMEOUT_S = 10.0
"""Timeout after which the files of a silent client are closed, as in PX4."""
MAX_CLIENTS = 64
MAX_ANSWERS = 256
"""Answers that may be queued for the next poll; further requests are dropped."""

_REMEMBERED = (Opcode.OPEN_FILE_RO, Opcode.TERMINATE_SESSION, Opcode.RESET_SESSIONS, Opcode.CALC_FILE_CRC32)
_WRITING = (
    Opcode.CREATE_FILE,
    Opcode.WRITE_FILE,
    Opcode.REMOVE_FILE,
    Opcode.CREATE_DIRECTORY,
    Opcode.REMOVE_DIRECTORY,
    Opcode.OPEN_FILE_WO,
    Opcode.TRUNCATE_FILE,
    Opcode.RENAME,
)


class _Result(NamedTuple):
    """Data of an ACK."""

    data: bytes = b""
    session: int | None = None
    """Session, if it differs from that of the request."""


_Work = Callable[[FtpSessions, Packet, float], _Result | None]


class FtpServer:
    """Serves ``files``. Each client has its own sessions, which close when it is silent."""

    handles = frozenset({"FILE_TRANSFER_PROTOCOL"})

    def __init__(
        self,
        own: Address,
        files: VirtualFiles,
        has_room: Callable[[Hashable], bool] = always_has_room,
        pace: RateLimit | None = None,
    ) -> None:
        """A burst waits while ``has_room`` is False for its peer. Answers are always sent."""
        self.own = own
        self._files = files
        self._has_room = has_room
        self._pace = pace or RateLimit()
        self._clients: dict[tuple[Hashable, Address], FtpSessions] = {}
        self._outbox: list[tuple[Hashable, Message]] = []
        self._turn = 0
        self._work: dict[int, _Work] = {
            Opcode.NONE: lambda client, request, now_s: _Result(),
            Opcode.TERMINATE_SESSION: self._terminate,
            Opcode.RESET_SESSIONS: self._reset,
            Opcode.LIST_DIRECTORY: self._list,
            Opcode.OPEN_FILE_RO: self._open,
            Opcode.READ_FILE: self._read,
            Opcode.BURST_READ_FILE: self._burst,
            Opcode.CALC_FILE_CRC32: self._begin_checksum,
        }

    @property
    def client_count(self) -> int:
        """Number of known clients, at most MAX_CLIENTS."""
        return len(self._clients)

    @property
    def is_busy(self) -> bool:
        """True while a burst is in progress to a peer with room."""
        clients = self._clients.items()
        return any(client.is_streaming and self._has_room(peer) for (peer, _), client in clients)

    def receive(self, message: Message, peer: Hashable, now_s: float) -> None:
        """Take a message from ``peer``. Ignore all but requests to this vehicle."""
        if message.get_type() not in self.handles or not is_for(message, self.own):
            return
        request = read_packet(message)
        if request.opcode in (Opcode.ACK, Opcode.NAK) or len(self._outbox) >= MAX_ANSWERS:
            return  # two servers must never answer each other
        client = self._client(peer, sender(message), now_s)
        if client.last is not None and client.last[0] == request:
            self._send(peer, client, client.last[1])
        elif client.checksum is None or client.checksum.request != request:
            answer = self._answer(client, request, now_s)
            if answer is not None:
                self._reply(peer, client, request, answer)

    def poll(self, now_s: float) -> list[tuple[Hashable | None, Message]]:
        """Return the messages to send now, each with its peer."""
        if not (self._clients or self._outbox):  # the usual case
            return []
        for (peer, _), client in self._clients.items():
            if client.is_streaming and not self._has_room(peer):
                client.heard_s = now_s  # it waits for data
            if client.checksum is not None:
                self._step_checksum(peer, client, client.checksum)
        self._close_silent(now_s)
        outbox, self._outbox = self._outbox, []
        return [*outbox, *self._bursts(now_s)]

    def next_deadline(self) -> float | None:
        """Return the time of the next poll if no message arrives before; −inf for at once, None for never."""
        clients = self._clients.values()
        if self._outbox or any(client.checksum is not None for client in clients):
            return -math.inf
        if any(client.is_streaming for client in clients):
            return self._pace.ready_s()
        return min((client.heard_s + SESSION_TIMEOUT_S for client in clients), default=None)

    # -- clients

    def _client(self, peer: Hashable, address: Address, now_s: float) -> FtpSessions:
        client = self._clients.pop((peer, address), None) or FtpSessions(address, now_s)
        client.heard_s = now_s
        self._clients[peer, address] = client  # sorted by the time of the last request
        if len(self._clients) > MAX_CLIENTS:
            self._clients.pop(next(iter(self._clients))).close_all()
        return client

    def _close_silent(self, now_s: float) -> None:
        for key, client in list(self._clients.items()):
            if now_s - client.heard_s >= SESSION_TIMEOUT_S:
                client.close_all()
                del self._clients[key]

    # -- answers

    def _answer(self, client: FtpSessions, request: Packet, now_s: float) -> Packet | None:
        """Execute ``request`` and return the answer; None if it follows later."""
        sequence = next_sequence(request.sequence)
        try:
            if request.size > MAX_DATA:
                raise FtpRefusal(FtpError.INVALID_DATA_SIZE)
            work = self._work.get(request.opcode)
            if work is None:
                is_known = request.opcode in _WRITING
                raise FtpRefusal(FtpError.FILE_PROTECTED if is_known else FtpError.UNKNOWN_COMMAND)
            result = work(client, request, now_s)
        except FtpRefusal as refusal:
            return refused(sequence, request.session, request.opcode, request.offset, refusal)
        except OSError as error:
            failure = FtpRefusal(FtpError.FAIL_ERRNO, error.errno)
            return refused(sequence, request.session, request.opcode, request.offset, failure)
        if result is None:
            return None
        session = request.session if result.session is None else result.session
        data = result.data
        return Packet(sequence, session, Opcode.ACK, len(data), request.opcode, False, request.offset, data)

    def _reply(self, peer: Hashable, client: FtpSessions, request: Packet, answer: Packet) -> None:
        if request.opcode in _REMEMBERED:
            client.last = (request, answer)
        self._send(peer, client, answer)

    def _send(self, peer: Hashable, client: FtpSessions, answer: Packet) -> None:
        self._outbox.append((peer, ftp_message(client.address, answer)))

    def _terminate(self, client: FtpSessions, request: Packet, now_s: float) -> _Result:
        client.session(request.session, now_s)
        client.close(request.session)
        return _Result()

    def _reset(self, client: FtpSessions, request: Packet, now_s: float) -> _Result:
        client.close_all()
        return _Result()

    def _list(self, client: FtpSessions, request: Packet, now_s: float) -> _Result:
        path = request.path
        entries = None if path is None else self._files.list(path)
        if entries is None:
            raise FtpRefusal(FtpError.FILE_NOT_FOUND)
        data = b""
        for entry in entries[request.offset :]:
            line = _line(entry)
            if len(data) + len(line) > MAX_DATA:
                break
            data += line
        if not data:  # for an empty directory too: on an empty ACK clients repeat the request without end
            raise FtpRefusal(FtpError.END_OF_FILE)
        return _Result(data)

    def _opened(self, request: Packet) -> VirtualFile:
        path = request.path
        file = self._files.open(path) if path else None
        if file is None:
            raise FtpRefusal(FtpError.FILE_NOT_FOUND)
        if file.size > MAX_OFFSET:
            file.close()
            raise FtpRefusal(FtpError.FAIL)
        return file

    def _open(self, client: FtpSessions, request: Packet, now_s: float) -> _Result:
        file = self._opened(request)
        try:
            number = client.open(file, request.session, now_s)
        except FtpRefusal:
            file.close()
            raise
        return _Result(UINT32.pack(file.size), number)

    def _read(self, client: FtpSessions, request: Packet, now_s: float) -> _Result:
        return _Result(client.session(request.session, now_s).read(request.offset, request.size))

    # -- bursts and checksums

    def _burst(self, client: FtpSessions, request: Packet, now_s: float) -> None:
        client.begin_burst(request, now_s)

    def _bursts(self, now_s: float) -> list[tuple[Hashable | None, Message]]:
        """Return the next packets of all bursts, in turn."""
        sent: list[tuple[Hashable | None, Message]] = []
        allowance = self._pace.allowance(now_s)
        ready = [(key, client) for key, client in self._clients.items() if self._has_room(key[0])]
        streaming = rotated(ready, self._turn)
        while streaming and len(sent) < allowance:
            for key, client in list(streaming):
                packet = client.next_burst_packet() if len(sent) < allowance else None
                if packet is None:
                    streaming.remove((key, client))
                else:
                    client.heard_s = now_s  # the client is not silent: a burst needs no requests
                    sent.append((key[0], ftp_message(client.address, packet)))
        self._pace.take(len(sent))
        self._turn += len(sent)
        return sent

    def _begin_checksum(self, client: FtpSessions, request: Packet, now_s: float) -> None:
        file = self._opened(request)
        client.end_checksum()
        client.checksum = Checksum(request, file)

    def _step_checksum(self, peer: Hashable, client: FtpSessions, checksum: Checksum) -> None:
        request = checksum.request
        try:
            if not checksum.step():
                return
            answer = checksum_answer(checksum)
        except OSError as error:
            refusal = FtpRefusal(FtpError.FAIL_ERRNO, error.errno)
            sequence = next_sequence(request.sequence)
            answer = refused(sequence, request.session, request.opcode, 0, refusal)
        client.end_checksum()
        self._reply(peer, client, request, answer)


def _line(entry: Entry) -> bytes:
    """Return an entry of a listing as bytes; "S" (skipped) for one that does not fit, since offsets count it."""
    text = f"D{entry.name}" if entry.size is None else f"F{entry.name}\t{entry.size}"
    line = text.encode(errors="replace") + b"\x00"
    return line if len(line) <= MAX_DATA else b"S\x00"
