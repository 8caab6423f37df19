"""The MAVLink FTP server, packet by packet."""

from __future__ import annotations

import zlib

import pytest
from pymavlink.mavftp_op import FTP_OP

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.files import BytesFile, Entry, FileTree, fixed
from flightstack.mavlink.ftp_messages import FtpError, Opcode, Packet, ftp_message, mavlink_crc32, read_packet
from flightstack.mavlink.link import Address, Link
from flightstack.services.files.ftp_server import MAX_CLIENTS, FtpServer
from tests.protocol.file_harness import GCS, VEHICLE, content

BIG = content(200_000)


class Dialogue:
    """Packets to a server, and its answers."""

    def __init__(self) -> None:
        self.tree = FileTree({"big": fixed(BIG), "small": fixed(b"hello")}, {})
        self.congested: set[Address] = set()
        self.server = FtpServer(VEHICLE, self.tree, lambda peer: peer not in self.congested)
        self.now_s = 0.0

    def tell(self, packet: Packet, source: Address = GCS, target: Address = VEHICLE) -> None:
        message = ftp_message(target, packet)
        message.get_header().srcSystem, message.get_header().srcComponent = source
        self.server.receive(message, source, self.now_s)

    def answers(self, polls: int = 1) -> list[Packet]:
        packets = []
        for _ in range(polls):
            packets += [read_packet(message) for _, message in self.server.poll(self.now_s)]
            self.now_s += 0.01
        return packets

    def ask(self, opcode: int, data: bytes = b"", source: Address = GCS, **fields: int) -> Packet:
        values = {"sequence": 10, "session": 0, "size": len(data), **fields}
        self.tell(Packet(opcode=opcode, data=data, **values), source)  # type: ignore[arg-type]
        (answer,) = self.answers()
        assert answer.sequence == (values["sequence"] + 1) & 0xFFFF
        assert answer.request == opcode
        return answer


def error_of(answer: Packet) -> int:
    assert answer.opcode == Opcode.NAK
    assert answer.size == (2 if answer.data[0] == FtpError.FAIL_ERRNO else 1)
    return answer.data[0]


def test_packets_are_those_of_pymavlink() -> None:
    packet = Packet(65535, 7, Opcode.ACK, 5, Opcode.READ_FILE, True, 4_000_000_000, b"hello")
    theirs = FTP_OP(65535, 7, 128, 5, 5, 1, 4_000_000_000, bytearray(b"hello")).pack()
    assert packet.pack() == bytes(theirs)
    frame = Link(1, 1).encode(ftp_message(GCS, packet))
    plain = mavlink.MAVLink_file_transfer_protocol_message(0, 255, 190, list(theirs.ljust(251, b"\0")))
    assert frame == Link(1, 1).encode(plain)
    (message,) = Link(255, 190).decode(frame)
    assert read_packet(message) == packet


def test_the_checksum_is_mavlinks() -> None:
    def one_bit_at_a_time(data: bytes) -> int:  # the specification's: polynomial 0xEDB88320, start 0, end 0
        crc = 0
        for byte in data:
            crc ^= byte
            for _ in range(8):
                crc = crc >> 1 ^ (0xEDB88320 if crc & 1 else 0)
        return crc

    assert mavlink_crc32(BIG[:999]) == one_bit_at_a_time(BIG[:999]) != zlib.crc32(BIG[:999])
    assert mavlink_crc32(BIG[500:999], mavlink_crc32(BIG[:500])) == mavlink_crc32(BIG[:999])


def test_open_read_and_terminate() -> None:
    dialogue = Dialogue()
    opened = dialogue.ask(Opcode.OPEN_FILE_RO, b"/small")
    assert (opened.opcode, opened.session, opened.size) == (Opcode.ACK, 0, 4)
    assert int.from_bytes(opened.data, "little") == 5
    assert dialogue.ask(Opcode.READ_FILE, sequence=11, size=3, offset=1).data == b"ell"
    assert dialogue.ask(Opcode.READ_FILE, sequence=12, size=239, offset=3).data == b"lo"
    assert error_of(dialogue.ask(Opcode.READ_FILE, sequence=13, size=239, offset=5)) == FtpError.END_OF_FILE
    assert dialogue.ask(Opcode.TERMINATE_SESSION, sequence=14).opcode == Opcode.ACK
    assert error_of(dialogue.ask(Opcode.READ_FILE, sequence=15, size=9)) == FtpError.INVALID_SESSION
    assert error_of(dialogue.ask(Opcode.TERMINATE_SESSION, sequence=16)) == FtpError.INVALID_SESSION


@pytest.mark.parametrize("opcode", [6, 7, 8, 9, 10, 11, 12, 13])
def test_whatever_writes_is_refused(opcode: int) -> None:
    assert error_of(Dialogue().ask(opcode, b"small")) == FtpError.FILE_PROTECTED


@pytest.mark.parametrize("opcode", [16, 77, 127, 130, 255])
def test_unknown_requests_are_answered(opcode: int) -> None:
    assert error_of(Dialogue().ask(opcode, b"small")) == FtpError.UNKNOWN_COMMAND


def test_nothing_is_acknowledged() -> None:
    assert Dialogue().ask(Opcode.NONE).opcode == Opcode.ACK


@pytest.mark.parametrize("opcode", [Opcode.ACK, Opcode.NAK])
def test_answers_are_not_answered(opcode: int) -> None:
    dialogue = Dialogue()
    dialogue.tell(Packet(1, 0, opcode, 0))
    assert not dialogue.answers()


def test_a_size_that_cannot_be_is_refused() -> None:
    assert error_of(Dialogue().ask(Opcode.OPEN_FILE_RO, size=240)) == FtpError.INVALID_DATA_SIZE


def test_a_repeated_request_gets_the_same_answer_and_opens_nothing_more() -> None:
    dialogue = Dialogue()
    answers = [dialogue.ask(Opcode.OPEN_FILE_RO, b"big") for _ in range(20)]
    assert set(answers) == {answers[0]}
    ends = [dialogue.ask(Opcode.TERMINATE_SESSION, sequence=11) for _ in range(3)]
    assert [end.opcode for end in ends] == [Opcode.ACK] * 3


def test_sequence_numbers_wrap() -> None:
    dialogue = Dialogue()
    assert dialogue.ask(Opcode.OPEN_FILE_RO, b"big", sequence=65535).sequence == 0
    dialogue.tell(Packet(65534, 0, Opcode.BURST_READ_FILE, 239))
    assert [packet.sequence for packet in dialogue.answers()][:3] == [65535, 0, 1]


def test_a_burst_ends_after_500_packets_and_says_so() -> None:
    dialogue = Dialogue()
    dialogue.ask(Opcode.OPEN_FILE_RO, b"big")
    dialogue.tell(Packet(20, 0, Opcode.BURST_READ_FILE, 100, offset=7))
    packets = dialogue.answers(60)
    assert b"".join(packet.data for packet in packets) == BIG[7 : 7 + 500 * 100]
    assert [packet.offset for packet in packets] == [7 + 100 * n for n in range(500)]
    assert [packet.sequence for packet in packets] == [21 + n for n in range(500)]
    assert [packet.burst_complete for packet in packets] == [False] * 499 + [True]


def test_the_last_packet_of_a_file_completes_its_burst_and_the_next_burst_says_end_of_file() -> None:
    dialogue = Dialogue()
    dialogue.ask(Opcode.OPEN_FILE_RO, b"big")
    dialogue.tell(Packet(20, 0, Opcode.BURST_READ_FILE, 239, offset=199_000))
    packets = dialogue.answers(3)
    assert [packet.burst_complete for packet in packets] == [False] * 4 + [True]
    nak = dialogue.ask(Opcode.BURST_READ_FILE, sequence=30, offset=200_000, size=239)
    assert error_of(nak) == FtpError.END_OF_FILE
    assert nak.offset == 200_000


def test_a_new_burst_takes_the_place_of_the_one_under_way() -> None:
    """QGroundControl asks again with the same sequence number from another offset."""
    dialogue = Dialogue()
    dialogue.ask(Opcode.OPEN_FILE_RO, b"big")
    dialogue.tell(Packet(20, 0, Opcode.BURST_READ_FILE, 239))
    assert dialogue.answers()[0].offset == 0
    dialogue.tell(Packet(20, 0, Opcode.BURST_READ_FILE, 239, offset=190_000))
    packets = dialogue.answers(10)
    assert packets[0].offset == 190_000
    assert packets[0].sequence == 21
    assert packets[-1].burst_complete


def test_a_burst_waits_for_a_congested_peer_and_answers_do_not() -> None:
    dialogue = Dialogue()
    dialogue.ask(Opcode.OPEN_FILE_RO, b"big")
    dialogue.congested.add(GCS)
    dialogue.tell(Packet(20, 0, Opcode.BURST_READ_FILE, 239))
    assert not dialogue.answers(10)
    assert not dialogue.server.is_busy
    assert dialogue.ask(Opcode.NONE, sequence=30).opcode == Opcode.ACK
    dialogue.congested.clear()
    assert dialogue.server.is_busy
    assert dialogue.answers()[0].offset == 0


def test_a_burst_that_waits_for_a_congested_peer_keeps_its_session() -> None:
    dialogue = Dialogue()
    dialogue.ask(Opcode.OPEN_FILE_RO, b"big")
    dialogue.congested.add(GCS)
    dialogue.tell(Packet(20, 0, Opcode.BURST_READ_FILE, 239))
    assert not dialogue.answers(2000)  # 20 s
    dialogue.congested.clear()
    assert dialogue.answers()[0].opcode == Opcode.ACK


def test_terminate_and_reset_stop_a_burst() -> None:
    for opcode in (Opcode.TERMINATE_SESSION, Opcode.RESET_SESSIONS):
        dialogue = Dialogue()
        dialogue.ask(Opcode.OPEN_FILE_RO, b"big")
        dialogue.tell(Packet(20, 0, Opcode.BURST_READ_FILE, 239))
        assert dialogue.answers()
        assert dialogue.ask(opcode, sequence=30).opcode == Opcode.ACK
        assert not dialogue.answers(5)


def test_each_client_has_sessions_of_its_own() -> None:
    """So that clients which take the session for 0 whatever the answer says can download at once."""
    dialogue = Dialogue()
    other = Address(254, 190)
    assert dialogue.ask(Opcode.OPEN_FILE_RO, b"small").session == 0
    assert dialogue.ask(Opcode.OPEN_FILE_RO, b"big", other).session == 0
    assert dialogue.ask(Opcode.READ_FILE, sequence=11, size=5).data == b"hello"
    assert dialogue.ask(Opcode.READ_FILE, b"", other, sequence=11, size=5).data == BIG[:5]
    dialogue.ask(Opcode.RESET_SESSIONS, sequence=12)
    assert dialogue.ask(Opcode.READ_FILE, b"", other, sequence=12, size=5).data == BIG[:5]


def test_a_client_may_open_four_files_and_silent_ones_give_way() -> None:
    dialogue = Dialogue()
    sessions = [dialogue.ask(Opcode.OPEN_FILE_RO, b"big", sequence=n).session for n in range(4)]
    assert sessions == [0, 1, 2, 3]
    fifth = dialogue.ask(Opcode.OPEN_FILE_RO, b"big", sequence=4)
    assert error_of(fifth) == FtpError.NO_SESSIONS_AVAILABLE
    dialogue.now_s += 1.0
    assert dialogue.ask(Opcode.OPEN_FILE_RO, b"small", sequence=5).session == 0


def test_a_session_number_that_the_client_chose_is_kept() -> None:
    """MAVProxy counts its sessions itself, and takes no answer with another number for its own."""
    dialogue = Dialogue()
    sessions = [dialogue.ask(Opcode.OPEN_FILE_RO, b"big", session=240, sequence=n).session for n in range(2)]
    assert sessions == [240, 0]
    read = dialogue.ask(Opcode.READ_FILE, session=240, size=8)
    assert (read.opcode, read.session, read.size) == (Opcode.ACK, 240, 8)


def test_a_file_read_to_its_end_gives_way_to_the_next() -> None:
    """The message that ends a session gets lost: MAVSDK would read the old file from session 0."""
    dialogue = Dialogue()
    dialogue.ask(Opcode.OPEN_FILE_RO, b"small", sequence=1)
    dialogue.ask(Opcode.READ_FILE, sequence=2, size=239)
    assert dialogue.ask(Opcode.OPEN_FILE_RO, b"big", sequence=3).session == 0
    assert dialogue.ask(Opcode.READ_FILE, sequence=4, size=5).data == BIG[:5]


def test_a_silent_client_loses_its_files() -> None:
    dialogue = Dialogue()
    dialogue.ask(Opcode.OPEN_FILE_RO, b"big")
    assert dialogue.server.next_deadline() == 10.0
    dialogue.now_s = 10.0
    dialogue.answers()
    assert dialogue.server.next_deadline() is None
    assert error_of(dialogue.ask(Opcode.READ_FILE, sequence=11, size=5)) == FtpError.INVALID_SESSION


def test_the_checksum_of_a_file() -> None:
    dialogue = Dialogue()
    dialogue.server = FtpServer(VEHICLE, FileTree({"large": fixed(bytes(1_000_000) + BIG)}, {}))
    dialogue.tell(Packet(3, 0, Opcode.CALC_FILE_CRC32, 5, data=b"large"))
    dialogue.tell(
        Packet(3, 0, Opcode.CALC_FILE_CRC32, 5, data=b"large")
    )  # it takes so long that it is repeated
    assert not dialogue.answers()
    (answer,) = dialogue.answers(10)
    assert answer.sequence == 4
    assert int.from_bytes(answer.data, "little") == mavlink_crc32(bytes(1_000_000) + BIG)
    assert error_of(dialogue.ask(Opcode.CALC_FILE_CRC32, b"none")) == FtpError.FILE_NOT_FOUND


class BrokenFile(BytesFile):
    def read(self, offset: int, count: int) -> bytes:
        raise OSError(5, "Input/output error")


class BrokenFiles:
    def list(self, path: str) -> list[Entry] | None:
        raise OSError(13, "Permission denied")

    def open(self, path: str) -> BytesFile | None:
        return BrokenFile(BIG)


def test_a_broken_disk_is_told_and_harms_nothing() -> None:
    dialogue = Dialogue()
    dialogue.server = FtpServer(VEHICLE, BrokenFiles())
    assert dialogue.ask(Opcode.LIST_DIRECTORY, b"/").data == bytes([FtpError.FAIL_ERRNO, 13])
    dialogue.ask(Opcode.OPEN_FILE_RO, b"big")
    assert dialogue.ask(Opcode.READ_FILE, sequence=11, size=5).data == bytes([FtpError.FAIL_ERRNO, 5])
    assert dialogue.ask(Opcode.BURST_READ_FILE, sequence=12).data == bytes([FtpError.FAIL_ERRNO, 5])
    assert dialogue.ask(Opcode.CALC_FILE_CRC32, b"big").data == bytes([FtpError.FAIL_ERRNO, 5])


def test_requests_for_others_are_ignored() -> None:
    dialogue = Dialogue()
    for target in (Address(2, 1), Address(1, 100)):
        dialogue.tell(Packet(1, 0, Opcode.NONE, 0), target=target)
    assert not dialogue.answers()
    dialogue.tell(Packet(1, 0, Opcode.NONE, 0), target=Address(0, 0))
    assert len(dialogue.answers()) == 1


def test_a_flood_of_requests_is_bounded() -> None:
    dialogue = Dialogue()
    for n in range(5000):
        dialogue.tell(Packet(n, 0, Opcode.LIST_DIRECTORY, 1, data=b"/"), Address(n % 250 + 1, 190))
    assert len(dialogue.answers()) == 256
    assert dialogue.server.client_count == MAX_CLIENTS
