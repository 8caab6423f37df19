"""File services against whatever may arrive: nothing is raised, memory stays bounded, the service goes on."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.files import BytesFile, Entry, FileTree, PartialFile, fixed
from flightstack.mavlink.ftp_messages import Opcode, Packet, ftp_message, read_packet
from flightstack.mavlink.link import Address, Link, Message
from flightstack.services.files.ftp_server import MAX_CLIENTS, FtpServer
from flightstack.services.files.ftp_sessions import MAX_SESSIONS
from flightstack.services.logs.log_server import MAX_RANGES, LogServer
from flightstack.services.logs.log_store import DatedLogs, FlatLogs
from gcs_cli.clients.ftp_client import FtpClient, FtpDone
from gcs_cli.clients.log_client import LogClient, LogDone, LogEntry
from tests.protocol.file_harness import GCS, VEHICLE, Ether, MemoryLogs, Station, content

BYTES = st.binary(max_size=251)
SMALL, BIG = content(500), content(90_000)
LOGS = MemoryLogs({"one.ulg": SMALL, "two.ulg": BIG})
TREE = FileTree(
    {"small": fixed(SMALL), "big": fixed(BIG), "empty": fixed(b"")},
    {"@MAV_LOG": FlatLogs(LOGS), "fs/log": DatedLogs(LOGS)},
)
PATHS = [
    b"small",
    b"/big",
    b"empty",
    b"/",
    b"",
    b"@MAV_LOG",
    b"fs/log/../..",
    b"\xff\xfe",
    b"fs/log",
    b"small\0x",
]

packets = st.builds(
    Packet,
    sequence=st.integers(0, 0xFFFF),
    session=st.integers(0, 5) | st.integers(0, 255),
    opcode=st.sampled_from(list(Opcode)) | st.integers(0, 255),
    size=st.integers(0, 255),
    request=st.integers(0, 255),
    burst_complete=st.booleans(),
    offset=st.integers(0, 600) | st.integers(0, 0xFFFF_FFFF),
    data=st.sampled_from(PATHS) | st.binary(max_size=239),
)
steps = st.lists(st.tuples(packets, st.integers(1, 3), st.floats(0.0, 3.0)), max_size=40)


def from_(message: Message, source: Address) -> Message:
    """Return ``message`` as it arrives from ``source``."""
    (arrived,) = Link(250, 1).decode(Link(*source).encode(message))
    return arrived


class CountedFile(BytesFile):
    """A file that counts how often it is open."""

    open_now = 0

    def __init__(self, data: bytes) -> None:
        super().__init__(data)
        CountedFile.open_now += 1

    def close(self) -> None:
        CountedFile.open_now -= 1


class CountedTree:
    """The files of ``TREE``, each counted while it is open."""

    def list(self, path: str) -> list[Entry] | None:
        return TREE.list(path)

    def open(self, path: str) -> CountedFile | None:
        file = TREE.open(path)
        return None if file is None else CountedFile(file.read(0, file.size))


@settings(max_examples=80)
@given(steps)
def test_the_ftp_server_answers_every_request_and_closes_every_file(
    story: list[tuple[Packet, int, float]],
) -> None:
    CountedFile.open_now = 0
    server, now_s = FtpServer(VEHICLE, CountedTree()), 0.0
    for packet, client, pause_s in story:
        server.receive(from_(ftp_message(VEHICLE, packet), Address(client, 190)), client, now_s)
        is_request = packet.opcode not in (Opcode.ACK, Opcode.NAK)
        sent = server.poll(now_s)
        is_silent_at_first = packet.opcode == Opcode.CALC_FILE_CRC32
        assert not is_request or is_silent_at_first or any(peer == client for peer, _ in sent)
        for _, message in sent:
            answer = read_packet(message)
            assert answer.size == len(answer.data)
        now_s += pause_s
        assert CountedFile.open_now <= 3 * (MAX_SESSIONS + 1)
    server.poll(now_s)
    server.poll(now_s + 30.0)
    assert CountedFile.open_now == 0
    assert server.next_deadline() is None


@settings(max_examples=80)
@given(st.lists(st.tuples(BYTES, st.integers(1, 255)), max_size=60))
def test_random_payloads_harm_nobody(payloads: list[tuple[bytes, int]]) -> None:
    server, client = FtpServer(VEHICLE, TREE), FtpClient(VEHICLE, GCS)
    client.start_download("big")
    for payload, source in payloads:
        padded = list(payload.ljust(251, b"\0"))
        message = mavlink.MAVLink_file_transfer_protocol_message(0, 0, 0, padded)
        server.receive(from_(message, Address(source, 190)), source, 0.0)
        client.receive(from_(message, VEHICLE), 0.0)
        client.poll(0.0)
    assert server.client_count <= MAX_CLIENTS
    good = FtpClient(VEHICLE, GCS)
    good.start_download("big")
    server.poll(0.0)
    ether = Ether(server, Station(good))
    ether.run(lambda: good.result is not None)
    assert good.result == FtpDone(BIG)


@settings(max_examples=80)
@given(steps)
def test_the_ftp_client_takes_whatever_a_vehicle_answers(story: list[tuple[Packet, int, float]]) -> None:
    client, now_s = FtpClient(VEHICLE, GCS), 0.0
    client.start_list("/") if len(story) % 2 else client.start_download("big")
    for packet, _, pause_s in story:
        for message in client.poll(now_s):
            sent = read_packet(message)
            if packet.offset < 300:  # an answer that looks right; the others are noise
                packet = packet._replace(  # noqa: PLW2901
                    sequence=(sent.sequence + 1) & 0xFFFF, request=sent.opcode, session=0, opcode=Opcode.ACK
                )
        client.receive(from_(ftp_message(GCS, packet), VEHICLE), now_s)
        now_s += pause_s
    for _ in range(40):
        client.poll(now_s)
        now_s += 1.0
    assert client.result is not None  # it ends, whatever came


log_messages = st.one_of(
    st.builds(
        mavlink.MAVLink_log_request_list_message,
        st.integers(0, 2), st.integers(0, 2), st.integers(0, 0xFFFF), st.integers(0, 0xFFFF),
    ),
    st.builds(
        mavlink.MAVLink_log_request_data_message,
        st.integers(0, 2), st.integers(0, 2), st.integers(0, 3) | st.integers(0, 0xFFFF),
        st.integers(0, 600) | st.integers(0, 0xFFFF_FFFF), st.integers(0, 600) | st.integers(0, 0xFFFF_FFFF),
    ),
    st.builds(mavlink.MAVLink_log_request_end_message, st.integers(0, 2), st.integers(0, 2)),
    st.builds(mavlink.MAVLink_log_erase_message, st.integers(0, 2), st.integers(0, 2)),
)  # fmt: skip


@settings(max_examples=80)
@given(st.lists(st.tuples(log_messages, st.integers(1, 3), st.floats(0.0, 3.0)), max_size=60))
def test_the_log_server_takes_any_request(story: list[tuple[Message, int, float]]) -> None:
    store, now_s = MemoryLogs(LOGS.content), 0.0
    server = LogServer(VEHICLE, store, lambda: False, lambda level, text: None)
    for message, client, pause_s in story:
        server.receive(from_(message, Address(client, 190)), client, now_s)
        for _, answer in server.poll(now_s):
            if answer.get_type() == "LOG_DATA":
                assert answer.count <= 90
        assert max(server.backlog(), default=0) <= MAX_RANGES
        now_s += pause_s
    good = LogClient(VEHICLE)
    good.start_list()
    Ether(server, Station(good)).run(lambda: good.result is not None)
    assert isinstance(good.result, LogDone)
    assert [entry.size for entry in good.result.entries] == [len(data) for data in store.content.values()]


@settings(max_examples=80)
@given(
    st.integers(0, 400),
    st.lists(
        st.tuples(st.integers(0, 0xFFFF_FFFF) | st.integers(0, 400), st.integers(0, 255), BYTES), max_size=40
    ),
)
def test_the_log_client_takes_whatever_a_vehicle_sends(
    size: int, blocks: list[tuple[int, int, bytes]]
) -> None:
    client = LogClient(VEHICLE)
    client.start_download(LogEntry(1, size, 0))
    for offset, count, data in blocks:
        client.poll(0.0)
        message = mavlink.MAVLink_log_data_message(1, offset, count, list(data[:90].ljust(90, b"\0")))
        client.receive(from_(message, VEHICLE), 0.0)
    for second in range(40):
        client.poll(float(second))
    assert client.result is not None
    assert not isinstance(client.result, LogDone) or len(client.result.content) == size


@given(st.integers(0, 300), st.lists(st.tuples(st.integers(0, 400), st.binary(max_size=60)), max_size=30))
def test_gaps_are_counted_as_a_table_of_bytes_counts_them(size: int, pieces: list[tuple[int, bytes]]) -> None:
    missing, has = PartialFile(size), bytearray(size)
    for offset, data in pieces:
        came = [n for n in range(offset, min(offset + len(data), size)) if not has[n]]
        assert missing.fill(offset, data) == len(came)
        for n in range(offset, min(offset + len(data), size)):
            has[n] = 1
        assert missing.left == has.count(0)
        assert missing.first == (has.index(0) if 0 in has else size)
        assert missing.within(50, 120) == has[50:120].count(0)
        wanted = [n for begin, count in missing.pieces(7) for n in range(begin, begin + count)]
        assert wanted == [n for n in range(size) if not has[n]]
