"""A flight's log streamed while it is written: what a reader puts together from the pieces is the log."""

from __future__ import annotations

import random
from io import BytesIO

import pytest
from pyulog import ULog

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address, Link
from flightstack.process.log_files import FileTail
from flightstack.services.logs.log_stream import CHUNK, GIVE_UP_S, NO_MESSAGE_BEGINS, LogStream
from tests.support.truth import World

VEHICLE, CLIENT = Address(1, 1), Address(255, 190)
PEER, OTHER = "peer", "other"


class Growing:
    """A log that grows by ``step`` octets whenever it is asked."""

    def __init__(self, content: bytes, step: int = 1 << 30) -> None:
        self.content, self.step, self.offset, self.visible, self.closed = content, step, 0, 0, False

    def read(self, count: int) -> bytes:
        self.visible = min(len(self.content), self.visible + self.step)
        data = self.content[self.offset : min(self.visible, self.offset + count)]
        self.offset += len(data)
        return data

    @property
    def ended(self) -> bool:
        return self.visible == len(self.content)

    def close(self) -> None:
        self.closed = True


class Reader:
    """The client's end, as PX4's mavlink_ulog_streaming.py has it: acknowledge, and put pieces in order."""

    def __init__(self, loss: float = 0.0, seed: int = 1) -> None:
        self.random, self.loss = random.Random(seed), loss
        self.pieces: dict[int, bytes] = {}
        self.first: dict[int, int] = {}
        self.acked = 0
        self.link = Link(*CLIENT)
        self.from_vehicle = Link(*VEHICLE)

    def run(self, stream: LogStream, seconds: float = 60.0) -> None:
        now_s = 0.0
        while now_s < seconds and stream.next_deadline() is not None:
            for peer, message in stream.poll(now_s):
                assert peer == PEER
                if self.random.random() >= self.loss:
                    self.take(stream, message, now_s)
            now_s += 0.005

    def take(self, stream: LogStream, message: object, now_s: float) -> None:
        (m,) = self.link.decode(self.from_vehicle.encode(message))
        self.pieces[m.sequence] = bytes(m.data[: m.length])
        self.first[m.sequence] = m.first_message_offset
        if m.get_type() == "LOGGING_DATA_ACKED":
            self.acked += 1
            (ack,) = Link(*VEHICLE).decode(
                self.link.encode(mavlink.MAVLink_logging_ack_message(1, 1, m.sequence))
            )
            if self.random.random() >= self.loss:
                stream.receive(ack, PEER, now_s)

    @property
    def content(self) -> bytes:
        return b"".join(self.pieces[number] for number in sorted(self.pieces))


@pytest.fixture(scope="module")
def log() -> bytes:
    world = World()
    world.takeoff(2.0)
    world.arm()
    world.run_for(3.0)
    world.disarm(force=True)
    return world.flight().log.content


def streamed(content: bytes, reader: Reader, step: int = 1 << 30) -> Growing:
    tail = Growing(content, step)
    stream = LogStream(VEHICLE, lambda: tail)
    assert stream.start(PEER, CLIENT) is None
    reader.run(stream)
    return tail


@pytest.mark.parametrize("step", [1 << 30, 1000, 7])
def test_what_arrives_is_the_log(log: bytes, step: int) -> None:
    content = log[: 60_000 if step > 7 else 15_000]
    reader = Reader()
    tail = streamed(content, reader, step)
    assert reader.content == content
    assert tail.closed


def test_a_whole_flight_is_readable(log: bytes) -> None:
    reader = Reader()
    streamed(log, reader)
    assert reader.content == log
    assert {"vehicle_status"} <= {data.name for data in ULog(BytesIO(reader.content)).data_list}


def test_definitions_survive_a_lossy_link(log: bytes) -> None:
    """Nothing acknowledged is missing, at 30 % loss each way; of the data about 30 % is."""
    reader = Reader(loss=0.3)
    streamed(log[:60_000], reader)
    definitions = sorted(reader.pieces)[: reader.acked]
    assert definitions[0] == 0
    assert reader.acked > 10
    begun = b"".join(reader.pieces[n] for n in range(min(set(range(10_000)) - set(reader.pieces))))
    assert log.startswith(begun)
    assert b"mission_result" in begun  # the last formats came through


def test_offsets_point_at_messages(log: bytes) -> None:
    """From a piece with an offset on, the log can be read without what came before."""
    reader = Reader()
    streamed(log[:40_000], reader)
    at, starts = 16, set()
    while at < 40_000:
        starts.add(at)
        at += 3 + int.from_bytes(log[at : at + 2], "little")
    for number, piece in reader.pieces.items():
        begin = number * CHUNK
        inside = sorted(start - begin for start in starts if begin <= start < begin + len(piece))
        assert reader.first[number] == (inside[0] if inside else NO_MESSAGE_BEGINS)


def test_one_client_at_a_time(log: bytes) -> None:
    stream = LogStream(VEHICLE, lambda: Growing(log))
    assert stream.start(PEER, CLIENT) is None
    assert "another client" in str(stream.start(OTHER, CLIENT))
    stream.stop()
    assert stream.start(OTHER, CLIENT) is None


def test_a_client_that_never_acknowledges_is_given_up(log: bytes) -> None:
    tail = Growing(log)
    stream = LogStream(VEHICLE, lambda: tail)
    stream.start(PEER, CLIENT)
    sent = sum(len(stream.poll(0.1 * n)) for n in range(round(10 * GIVE_UP_S) + 5))
    assert 15 <= sent <= 21  # every quarter of a second for five seconds
    assert tail.closed
    assert stream.next_deadline() is None


def test_a_stream_waits_for_the_log_to_begin(log: bytes) -> None:
    tails: list[Growing] = []
    stream = LogStream(VEHICLE, lambda: tails[0] if tails else None)
    stream.start(PEER, CLIENT)
    assert stream.poll(0.0) == []
    tails.append(Growing(log))
    assert len(stream.poll(0.1)) == 1


def test_a_stream_waits_for_a_congested_peer(log: bytes) -> None:
    congested = {PEER}
    stream = LogStream(VEHICLE, lambda: Growing(log), lambda peer: peer not in congested)
    assert stream.start(PEER, CLIENT) is None
    assert stream.poll(0.0) == []
    congested.clear()
    assert [peer for peer, _ in stream.poll(0.1)] == [PEER]


def test_a_tail_reads_a_file_as_it_grows(tmp_path) -> None:
    path, is_open = tmp_path / "flight.ulg", [True]
    with open(path, "wb", buffering=0) as file:
        file.write(b"abc")
        tail = FileTail(path, lambda: is_open[0])
        assert tail.read(2) == b"ab"
        assert tail.read(9) == b"c"
        assert tail.read(9) == b""
        file.write(b"de")
        assert not tail.ended
        assert tail.read(9) == b"de"
    is_open[0] = False
    assert tail.ended
    tail.close()
    tail.close()
    assert tail.read(1) == b""
