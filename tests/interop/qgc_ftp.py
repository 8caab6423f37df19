"""QGroundControl's download by MAVLink FTP: open, bursts, the holes, the end of the session."""

from __future__ import annotations

import re
import struct
from typing import NamedTuple

from flightstack.mavlink.dialect import mavlink
from tests.interop.qgc_link import AUTOPILOT, QGC, Station

TIMEOUT_S = 1.0
MOST_RETRIES = 3
SCHEME = "mftp://"
DATA = 239
OPEN_RO, READ, BURST, RESET_SESSIONS, ACK, NAK = 4, 5, 15, 2, 128, 129
END_OF_FILE = 6
_HEADER = struct.Struct("<HBBBBBxI")


class Answer(NamedTuple):
    """An answer that belongs to the request."""

    sequence: int
    session: int
    opcode: int
    size: int
    request: int
    burst_complete: int
    offset: int
    data: bytes


def path_of(uri: str) -> str:
    """FTPManager.cc, _parseURI: of ``mftp:///a`` it asks for ``//a``, since it keeps one slash too many."""
    path = uri[len(SCHEME) - 1 :] if uri.lower().startswith(SCHEME) else uri
    assert "://" not in path
    return re.sub(r"^(/??)\[;comp=\d+\]", r"\1", path)


class Files:
    """Vehicle/FTPManager.cc; sequence numbers go on from one download to the next."""

    def __init__(self, station: Station) -> None:
        self._station = station
        self._expected = 0
        self._session = 0

    def download(self, uri: str) -> bytes:
        """Return the file: download, _downloadComplete."""
        size = self._open(path_of(uri))
        content, holes = self._bursts()
        self._fill(content, holes)
        assert len(content) == size, "no missing blocks, but the file is still incomplete"
        answer = self._ask(RESET_SESSIONS)
        assert answer.opcode == ACK, answer
        return bytes(content)

    def _open(self, path: str) -> int:
        """_openFileROBegin, _openFileROAckOrNak: not repeated; the answer holds the size, in four bytes."""
        self._send(OPEN_RO, data=path.encode())
        answer = self._answer(OPEN_RO)
        assert answer is not None, f"{path}: no answer"
        assert answer.opcode == ACK, f"{path}: {answer}"
        assert answer.sequence == self._expected
        assert answer.size == 4
        self._session = answer.session
        return int(struct.unpack_from("<I", answer.data)[0])

    def _bursts(self) -> tuple[bytearray, list[tuple[int, int]]]:
        """_burstReadFileWorker, _burstReadFileAckOrNak, _burstReadFileTimeout: until NAK says end of file."""
        content, holes, retries = bytearray(), [], 0
        self._send(BURST, offset=0, size=DATA)
        while True:
            answer = self._answer(BURST)
            if answer is None:
                retries += 1
                assert retries <= MOST_RETRIES, "burst: retries exceeded"
                self._expected -= 2  # the same sequence number again
                self._send(BURST, offset=len(content), size=DATA)
            elif answer.opcode == NAK:
                if answer.sequence == self._expected:
                    assert answer.data[:1] == bytes([END_OF_FILE]), answer
                    return content, holes
            elif answer.sequence >= self._expected and answer.offset >= len(content):
                if answer.offset > len(content):
                    holes.append((len(content), answer.offset))
                    content.extend(bytes(answer.offset - len(content)))
                content.extend(answer.data[: answer.size])
                self._expected = answer.sequence
                if answer.burst_complete:
                    retries = 0
                    self._send(BURST, offset=len(content), size=DATA)
                else:
                    self._expected += 1

    def _fill(self, content: bytearray, holes: list[tuple[int, int]]) -> None:
        """_fillMissingBlocksWorker, _fillMissingBlocksAckOrNak."""
        for begin, end in holes:
            at = begin
            while at < end:
                answer = self._ask(READ, at, min(DATA, end - at))
                assert (answer.opcode, answer.offset) == (ACK, at), answer
                content[at : at + answer.size] = answer.data[: answer.size]
                at += answer.size

    def _ask(self, opcode: int, offset: int = 0, size: int = 0) -> Answer:
        self._send(opcode, offset=offset, size=size)
        for _ in range(MOST_RETRIES):
            answer = self._answer(opcode)
            if answer is not None and answer.sequence == self._expected:
                return answer
            self._expected -= 2
            self._send(opcode, offset=offset, size=size)
        raise AssertionError(f"request {opcode}: retries exceeded")

    def _send(self, opcode: int, offset: int = 0, size: int = 0, data: bytes = b"") -> None:
        """_sendRequestExpectAck: one past what came last; the answer is one past that."""
        session = 0 if opcode in (OPEN_RO, RESET_SESSIONS) else self._session
        header = _HEADER.pack((self._expected + 1) & 0xFFFF, session, opcode, len(data) or size, 0, 0, offset)
        self._expected = (self._expected + 2) & 0xFFFF
        payload = (header + data).ljust(251, b"\0")
        self._station.send(
            mavlink.MAVLink_file_transfer_protocol_message(0, self._station.system, AUTOPILOT, list(payload))
        )

    def _answer(self, request: int) -> Answer | None:
        """_mavlinkMessageReceived: for us, for this request, and not an old one (with wrap-around)."""
        while True:
            message = self._station.wait("FILE_TRANSFER_PROTOCOL", within_s=TIMEOUT_S)
            if message is None:
                return None
            payload = bytes(message.payload)
            answer = Answer(*_HEADER.unpack_from(payload), payload[_HEADER.size :])
            is_old = (self._expected - 1 - answer.sequence) & 0xFFFF < 0xFFFF // 2
            if message.target_system == QGC[0] and answer.request == request and not is_old:
                return answer
