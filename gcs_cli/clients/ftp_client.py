"""Client of MAVLink FTP, sans-IO: downloads files and lists directories.

``start_…`` begins an operation, ``poll`` returns the messages to send, ``receive`` processes received ones, and
``result`` is the result at the end. Files are read in bursts; single requests read lost parts.
"""

from __future__ import annotations

import math
import random
from collections.abc import Iterator
from typing import NamedTuple

from flightstack.mavlink.fields import clean
from flightstack.mavlink.files import MAX_SIZE, Entry, PartialFile
from flightstack.mavlink.ftp_messages import (
    ERROR_TEXTS,
    MAX_DATA,
    UINT32,
    FtpError,
    Opcode,
    Packet,
    ftp_message,
    next_sequence,
    read_packet,
)
from flightstack.mavlink.link import Address, Message, is_for, is_from

RETRY_S = 0.3
"""Time after which a request is sent again, before a round trip was measured."""
SOONEST_RETRY_S, LATEST_RETRY_S = 0.1, 4.0
SILENCE_S = 6.0
"""Longest time without progress before an operation fails; at least ``SILENT_ROUND_TRIPS``."""
SILENT_ROUND_TRIPS = 10
BURST_BYTES = 500 * MAX_DATA
"""Largest burst. If more than a tenth of it is missing, another burst is requested."""
BURST_NUMBERS = 1000
"""Sequence numbers between two bursts: a late answer shows which burst it belongs to."""
FEW = 50
MAX_READS = 16
"""Largest number of pending single requests."""
MAX_ENTRIES = 100_000
_HALF = 0x8000
_GAIN, _VARIATION_GAIN, _VARIATIONS = 1 / 8, 1 / 4, 4.0
_SMALLEST_MARGIN_S = 0.05


class FtpDone(NamedTuple):
    """The operation succeeded."""

    content: bytes = b""
    """Content of the file, of a download."""
    entries: tuple[Entry, ...] = ()
    """Content of the directory, of a list."""


class FtpFailed(NamedTuple):
    """The operation failed."""

    reason: str
    """One sentence for the user."""
    error: int | None = None
    """The vehicle's FtpError; None if it did not answer."""


class _AnswerTimeout:
    """Timeout of requests: mean round trip and four times its variation, as TCP computes it (RFC 6298).

    It lies between ``least_s`` and ``most_s``.
    """

    def __init__(self, first_s: float, least_s: float, most_s: float) -> None:
        self.value_s = first_s
        """The timeout [s]; ``first_s`` before a measurement."""
        self._least_s, self._most_s = least_s, most_s
        self.round_trip_s = 0.0
        """Mean round trip; 0 before a measurement."""
        self._variation_s = 0.0

    def measure(self, answer_s: float) -> None:
        """Take the time from a request to its own answer: one of several equal requests measures nothing."""
        if not self.round_trip_s:
            self.round_trip_s, self._variation_s = answer_s, answer_s / 2.0
        else:
            self._variation_s += _VARIATION_GAIN * (abs(answer_s - self.round_trip_s) - self._variation_s)
            self.round_trip_s += _GAIN * (answer_s - self.round_trip_s)
        margin_s = max(_SMALLEST_MARGIN_S, _VARIATIONS * self._variation_s)
        self.value_s = min(self._most_s, max(self._least_s, self.round_trip_s + margin_s))


class FtpClient:
    """One operation at a time with one vehicle; a new one replaces the current one.

    An operation fails after ``silence_s`` without progress, later on a link whose round trip takes seconds.
    """

    def __init__(self, vehicle: Address, own: Address, silence_s: float = SILENCE_S) -> None:
        self.vehicle = vehicle
        self.own = own
        self._silence_s = silence_s
        self.result: FtpDone | FtpFailed | None = None
        self._sequence = random.randrange(2 * _HALF)
        """Next sequence number. The first one is random: PX4 takes a request with the number of the last one, from
        any client, for a repetition, and repeats its answer."""
        self._outbox: list[Packet] = []
        self._request: Packet | None = None
        """The pending open or list request."""
        self._session: int | None = None
        self._file: PartialFile | None = None
        self._entries: list[Entry] = []
        self._offset = 0
        self._burst: Packet | None = None
        self._bursts: dict[int, float] = {}
        """Sequence number of the first answer → time of the request, of this burst and of late ones."""
        self._reads: dict[int, tuple[int, int, float]] = {}
        """Sequence number of the answer → offset, count and time of the request."""
        self._path = b""
        self._retry_s: float | None = None
        self._progress_s = math.inf
        self._sent_s = -math.inf
        """Time of the pending request."""
        self._is_repeated = False
        """True if that was sent again, so that its answer does not measure the round trip."""
        self._timeout = _AnswerTimeout(RETRY_S, SOONEST_RETRY_S, LATEST_RETRY_S)

    def start_download(self, path: str) -> None:
        """Download the file at ``path``."""
        self._start(path)
        self._ask(Opcode.OPEN_FILE_RO)

    def start_list(self, path: str) -> None:
        """List the directory ``path``."""
        self._start(path)
        self._ask(Opcode.LIST_DIRECTORY)

    @property
    def progress(self) -> tuple[int, int]:
        """Received bytes and their total (0 before the size is known)."""
        return (self._file.size - self._file.left, self._file.size) if self._file else (0, 0)

    # -- messages

    def receive(self, message: Message, now_s: float) -> None:
        """Process a message; messages that do not belong to this operation are ignored."""
        if (
            message.get_type() != "FILE_TRANSFER_PROTOCOL"
            or not is_from(message, self.vehicle)
            or not is_for(message, self.own)
            or self.result is not None
        ):
            return
        packet = read_packet(message)
        if packet.opcode not in (Opcode.ACK, Opcode.NAK) or packet.size > MAX_DATA:
            return
        if self._request is not None:
            self._on_answer(self._request, packet, now_s)
        elif self._file is not None and packet.session == self._session:
            self._on_data(self._file, packet, now_s)

    def poll(self, now_s: float) -> list[Message]:
        """Return the messages to send now."""
        if self.result is None and self._retry_s is not None and now_s >= self._retry_s:
            self._progress_s = min(self._progress_s, now_s)  # counted from the first poll
            silence_s = max(self._silence_s, SILENT_ROUND_TRIPS * self._timeout.round_trip_s)
            if now_s - self._progress_s >= silence_s:
                self._end(FtpFailed(f"the vehicle (system {self.vehicle.system}) does not answer"))
            elif self._request is not None:
                self._is_repeated = self._retry_s != -math.inf
                if not self._is_repeated:
                    self._sent_s = now_s
                self._outbox.append(self._request)
                self._retry_s = now_s + max(RETRY_S, self._timeout.round_trip_s)
            elif self._file is not None:
                self._burst = None
                self._fetch(self._file, now_s)
        outbox, self._outbox = self._outbox, []
        return [ftp_message(self.vehicle, packet) for packet in outbox]

    def next_deadline(self) -> float | None:
        """Return the time of the next ``poll`` without an earlier message; -inf: immediately, None: never."""
        if self._outbox:
            return -math.inf
        return None if self.result is not None else self._retry_s

    # -- open and list

    def _start(self, path: str) -> None:
        if self.result is None and self._session is not None:
            self._end(FtpFailed("the operation was cancelled"))
        self.result, self._file, self._session, self._burst = None, None, None, None
        self._entries, self._offset, self._reads, self._bursts = [], 0, {}, {}
        self._path = path.encode()[:MAX_DATA]
        self._progress_s = math.inf

    def _ask(self, opcode: Opcode) -> None:
        self._request = self._packet(opcode, size=len(self._path), offset=self._offset, data=self._path)
        self._retry_s = -math.inf

    def _on_answer(self, request: Packet, packet: Packet, now_s: float) -> None:
        if packet.sequence != next_sequence(request.sequence):
            return
        if packet.request != request.opcode:
            if packet.request != Opcode.BURST_READ_FILE:
                self._ask(Opcode(request.opcode))  # it answers an earlier client: use another number
            return
        self._progress_s = now_s
        if not self._is_repeated and self._sent_s > -math.inf:
            self._timeout.measure(now_s - self._sent_s)
        if packet.opcode == Opcode.NAK:
            self._on_refusal(request, packet)
        elif request.opcode == Opcode.LIST_DIRECTORY:
            self._on_entries(packet)
        else:
            self._on_opened(packet, now_s)

    def _on_opened(self, packet: Packet, now_s: float) -> None:
        self._request, self._session = None, packet.session
        size = UINT32.unpack_from(packet.data)[0] if packet.size >= UINT32.size else None
        if size is None:
            self._end(FtpFailed("the vehicle did not send the size of the file"))
        elif size > MAX_SIZE:
            self._end(FtpFailed(f"a file of {size} bytes is too large"))
        else:
            if self._file is None or self._file.size != size:
                self._file = PartialFile(size)
            self._fetch(self._file, now_s)

    def _on_refusal(self, request: Packet, packet: Packet) -> None:
        error = packet.data[0] if packet.data else FtpError.FAIL
        if error == FtpError.END_OF_FILE and request.opcode == Opcode.LIST_DIRECTORY:
            self._end(FtpDone(entries=tuple(self._entries)))
        elif error != FtpError.NO_SESSIONS_AVAILABLE:  # temporary: try again
            self._end(_refused(error))

    def _on_entries(self, packet: Packet) -> None:
        lines = (
            packet.data.split(b"\x00")[:-1] if packet.data.endswith(b"\x00") else packet.data.split(b"\x00")
        )
        lines = [line for line in lines if line]
        self._entries += _entries(lines)
        self._offset += len(lines)
        if not lines or self._offset > MAX_ENTRIES:
            self._end(FtpDone(entries=tuple(self._entries)))
        else:
            self._ask(Opcode.LIST_DIRECTORY)

    # -- data

    def _on_data(self, file: PartialFile, packet: Packet, now_s: float) -> None:
        if packet.request == Opcode.BURST_READ_FILE:
            is_over = self._on_burst(packet, now_s)
            if is_over is None:
                return
        elif packet.request == Opcode.READ_FILE and packet.sequence in self._reads:
            _, _, asked_s = self._reads.pop(packet.sequence)
            self._timeout.measure(now_s - asked_s)
            is_over = True
        else:
            return
        if packet.opcode == Opcode.NAK:
            self._on_nak(file, packet)
            if self.result is not None or self._request is not None:
                return
        elif file.fill(packet.offset, packet.data):
            self._progress_s = now_s
        if is_over or not file.left:
            self._fetch(file, now_s)
        else:
            self._retry_s = now_s + self._timeout.value_s

    def _on_burst(self, packet: Packet, now_s: float) -> bool | None:
        """Return True if the burst is complete, False if there is more; None if the packet is an older one's."""
        burst, sent_s = self._burst, self._bursts.get(packet.sequence)
        if sent_s is not None:
            self._timeout.measure(now_s - sent_s)
        if burst is None or (packet.sequence - next_sequence(burst.sequence)) % (2 * _HALF) >= _HALF:
            is_late = any((packet.sequence - first) % (2 * _HALF) < BURST_NUMBERS for first in self._bursts)
            return False if is_late and packet.opcode == Opcode.ACK else None
        if packet.offset < burst.offset:
            return None
        if (packet.sequence - self._sequence) % (2 * _HALF) < _HALF:
            self._sequence = next_sequence(packet.sequence)  # no later request shares numbers with this burst
        if packet.burst_complete or packet.opcode == Opcode.NAK:
            self._burst = None
            return True
        return False

    def _on_nak(self, file: PartialFile, packet: Packet) -> None:
        error = packet.data[0] if packet.data else FtpError.FAIL
        if error == FtpError.INVALID_SESSION:  # closed by the vehicle: open it again, keep the received data
            self._reads.clear()
            self._burst = None
            self._ask(Opcode.OPEN_FILE_RO)
        elif error != FtpError.END_OF_FILE:
            self._end(_refused(error))
        elif packet.offset < file.size:
            self._end(FtpFailed("the file became shorter while it was read", error))

    def _fetch(self, file: PartialFile, now_s: float) -> None:
        """Request missing data: many blocks in a burst, few one by one."""
        self._retry_s = now_s + self._timeout.value_s
        if not file.left:
            self._end(FtpDone(bytes(file.content)))
        elif self._burst is None:
            first = file.first
            if file.within(first, first + BURST_BYTES) > FEW * MAX_DATA:
                self._reads.clear()
                self._bursts = {key: s for key, s in self._bursts.items() if now_s < s + LATEST_RETRY_S}
                self._burst = self._packet(Opcode.BURST_READ_FILE, size=MAX_DATA, offset=first)
                self._outbox.append(self._burst)
                self._bursts[next_sequence(self._burst.sequence)] = now_s
                self._sequence = (self._burst.sequence + BURST_NUMBERS) % (2 * _HALF)
            else:
                self._read_pieces(file, now_s)

    def _read_pieces(self, file: PartialFile, now_s: float) -> None:
        self._reads = {key: read for key, read in self._reads.items() if now_s < read[2] + LATEST_RETRY_S}
        waiting = [read for read in self._reads.values() if now_s < read[2] + self._timeout.value_s]
        asked = {(offset, count) for offset, count, _ in waiting}
        for offset, count in self._wanted(file, asked):
            read = self._packet(Opcode.READ_FILE, size=count, offset=offset)
            waiting.append((offset, count, now_s))
            self._reads[next_sequence(read.sequence)] = waiting[-1]
            self._outbox.append(read)
        self._retry_s = min((asked_s for _, _, asked_s in waiting), default=now_s) + self._timeout.value_s

    def _wanted(self, file: PartialFile, asked: set[tuple[int, int]]) -> Iterator[tuple[int, int]]:
        room = MAX_READS - len(asked)
        for piece in file.pieces(MAX_DATA):
            if room <= 0:
                return
            if piece not in asked:
                room -= 1
                yield piece

    # -- helpers

    def _packet(self, opcode: Opcode, *, size: int = 0, offset: int = 0, data: bytes = b"") -> Packet:
        packet = Packet(self._sequence, self._session or 0, opcode, size, offset=offset, data=data)
        self._sequence = next_sequence(self._sequence)
        return packet

    def _end(self, result: FtpDone | FtpFailed) -> None:
        self._outbox.clear()
        if self._session is not None:
            self._outbox.append(self._packet(Opcode.TERMINATE_SESSION))
        self._session, self._request, self._retry_s, self.result = None, None, None, result


def _refused(error: int) -> FtpFailed:
    return FtpFailed(ERROR_TEXTS.get(error, f"it answered with error {error}"), error)


def _entries(lines: list[bytes]) -> Iterator[Entry]:
    """Yield the files and directories among the lines of a list; other lines are skipped."""
    for line in lines:
        kind, text = line[:1], line[1:].decode(errors="replace")
        if kind == b"D":
            yield Entry(clean(text), None)
        elif kind == b"F":
            fields = text.split("\t")
            size = fields[1] if len(fields) > 1 else ""
            yield Entry(clean(fields[0]), int(size) if size.isascii() and size.isdecimal() else 0)
