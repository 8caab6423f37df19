"""The telemetry log, with pymavlink's mavutil as the judge."""

from __future__ import annotations

import itertools
import resource
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink import mavutil

from flightstack.mavlink.dialect import FS_LOOP_TIMING_ID, FsLoopTiming, mavlink
from flightstack.mavlink.link import Link
from gcs_cli.link.tlog import TlogFile, decode_records, encode_record, read_messages

START_US = 1_760_000_000_000_000


def frames() -> list[bytes]:
    link = Link(1, 1)
    messages = [
        mavlink.MAVLink_heartbeat_message(2, 12, 81, 4 << 16, 4, 3),
        mavlink.MAVLink_attitude_message(1000, 0.1, -0.2, 0.3, 0.0, 0.0, 0.0),
        mavlink.MAVLink_statustext_message(6, b"Reached item 3"),
        mavlink.MAVLink_ping_message(1, 0, 0, 0),  # its zeros at the end are cut on the wire
    ]
    return [link.encode(message) for message in messages]


def loop_timing_frame() -> bytes:
    values = [1000, 500, 2, 0, 500.0, 100.0, 50.0, 12.0, 20.0, 90.0, 0.0, 0.0, 0.0, 0]
    return Link(1, 1).encode(FsLoopTiming(*values))


def write(path: Path, records: list[bytes]) -> None:
    with TlogFile(path) as log:
        for index, frame in enumerate(records):
            log.write(START_US + 10_000 * index, frame)
        assert log.error is None


def test_mavutil_reads_the_file(tmp_path: Path) -> None:
    path = tmp_path / "gcs.tlog"
    write(path, frames())
    reader = mavutil.mavlink_connection(str(path))
    got = list(iter(reader.recv_msg, None))
    reader.close()
    assert [message.get_type() for message in got] == ["HEARTBEAT", "ATTITUDE", "STATUSTEXT", "PING"]
    assert [message._timestamp for message in got] == pytest.approx(
        [START_US * 1e-6 + 0.01 * i for i in range(4)]
    )
    assert got[2].text == "Reached item 3"
    assert all(message._link == 0 for message in got)


def test_messages_of_our_dialect_are_found_among_others(tmp_path: Path) -> None:
    path = tmp_path / "gcs.tlog"
    write(path, [*frames(), loop_timing_frame(), *frames()])
    [(record, message)] = read_messages(path, frozenset({FS_LOOP_TIMING_ID}))
    assert record.time_us == START_US + 40_000
    assert (message.ticks, message.execution_max_us) == (500, 90.0)


def version_1_frame() -> bytes:
    codec = mavlink.MAVLink(None, 1, 1)
    return bytes(mavlink.MAVLink_heartbeat_message(2, 12, 81, 0, 4, 3).pack(codec, force_mavlink1=True))


def signed_frame() -> bytes:
    codec = mavlink.MAVLink(None, 1, 1)
    codec.signing.secret_key = bytes(32)
    codec.signing.sign_outgoing = True
    codec.signing.timestamp = 1
    return bytes(mavlink.MAVLink_heartbeat_message(2, 12, 81, 0, 4, 3).pack(codec))


KINDS = [*frames(), loop_timing_frame(), version_1_frame(), signed_frame()]


@settings(max_examples=100)
@given(st.lists(st.sampled_from(KINDS), max_size=8), st.integers(0, 400))
def test_every_prefix_gives_the_whole_records_in_it(chosen: list[bytes], cut: int) -> None:
    records = [encode_record(4 * index, frame) for index, frame in enumerate(chosen)]
    whole = b"".join(records)
    data = whole[:cut]
    complete = sum(end <= len(data) for end in itertools.accumulate(map(len, records)))
    got = list(decode_records(data))
    assert [record.frame for record in got] == chosen[:complete]
    assert [record.time_us for record in got] == [4 * index for index in range(complete)]


@settings(max_examples=100)
@given(st.binary(max_size=200))
def test_any_bytes_are_read_without_error(data: bytes) -> None:
    assert sum(len(record.frame) + 8 for record in decode_records(data)) <= len(data)


def test_the_version_1_identifier_is_found() -> None:
    [record] = decode_records(encode_record(0, version_1_frame()))
    assert record.message_id == 0


def test_a_full_disk_does_not_end_the_session() -> None:
    log = TlogFile(Path("/dev/full"))
    log.write(START_US, frames()[0])
    log.write(START_US, frames()[1])
    log.close()
    assert isinstance(log.error, OSError)


def test_a_tlog_that_ends_early_ends_with_a_whole_record(tmp_path: Path) -> None:
    path = tmp_path / "gcs.tlog"
    with TlogFile(path) as tlog:
        tlog.write(1, b"\xfd" + bytes(20))
        before, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (40, hard))  # the kernel refuses more, as a full disk does
        try:
            tlog.write(2, b"\xfd" + bytes(20))
            tlog.write(3, b"\xfd" + bytes(20))
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (before, hard))
        assert tlog.error is not None
    assert path.stat().st_size == 29
