"""Parsing of ULog files against pyulog alone."""

from __future__ import annotations

import random
import struct
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from pyulog import ULog

from flightstack.core.errors import ConfigError
from flightstack.flight_log import ulog_scan
from flightstack.flight_log.ulog import DATA_TYPE, HEADER_SIZE, MESSAGE_HEADER
from gcs_cli.logs.ulog_parser import LogBytes, parse_ulog
from tests.support.sample_logs import small_ulog
from tests.support.truth import World


@pytest.fixture(scope="module")
def log() -> bytes:
    """A flight with texts and changed parameters."""
    with World(vehicle="x_quad") as world:
        world.arm()
        world.takeoff(2.0)
        world.param_set("MPC_XY_CRUISE", 3.0)
        world.run_for(2.0)
        world.param_set("MPC_XY_CRUISE", 4.0)
        world.land()
        world.run_until("not armed")
        return world.flight().log.content


def assert_equal(content: bytes) -> None:
    """Compare everything that a reader uses with pyulog's own parser."""
    (ours, _), theirs = parse_ulog(content, "log"), ULog(LogBytes(content))
    assert ours.data_list == theirs.data_list
    assert (ours.start_timestamp, ours.last_timestamp) == (theirs.start_timestamp, theirs.last_timestamp)
    assert ours.changed_parameters == theirs.changed_parameters
    assert ours.initial_parameters == theirs.initial_parameters
    assert ours.msg_info_dict == theirs.msg_info_dict
    assert ours.file_corruption == theirs.file_corruption
    texts = [(text.timestamp, text.log_level, text.message) for text in theirs.logged_messages]
    assert [(text.timestamp, text.log_level, text.message) for text in ours.logged_messages] == texts
    drops = [(drop.timestamp, drop.duration) for drop in theirs.dropouts]
    assert [(drop.timestamp, drop.duration) for drop in ours.dropouts] == drops


def test_log_is_parsed_as_pyulog_does(log: bytes) -> None:
    assert not parse_ulog(log, "log").damaged
    assert len(parse_ulog(log, "log").log.changed_parameters) == 2
    assert_equal(log)


def test_only_wanted_topics_are_given(log: bytes) -> None:
    found = parse_ulog(log, "log", ["vehicle_attitude"]).log.data_list
    assert [item.name for item in found] == ["vehicle_attitude"]
    assert found == ULog(LogBytes(log), ["vehicle_attitude"]).data_list


@pytest.mark.parametrize("topic", ["loop_timing", "vehicle_attitude", "vehicle_status"])
def test_last_time_is_that_of_the_wanted_topics(log: bytes, topic: str) -> None:
    """The newest row of the log may be of another topic; it does not count."""
    ours, theirs = parse_ulog(log, "log", [topic]).log, ULog(LogBytes(log), [topic])
    assert ours.last_timestamp == theirs.last_timestamp
    assert ours.changed_parameters == theirs.changed_parameters


@pytest.mark.parametrize("size", [-1, -7, -100])
def test_cut_log_is_damaged_and_parsed_as_pyulog_does(log: bytes, size: int) -> None:
    assert parse_ulog(log[:size], "log").damaged
    assert_equal(log[:size])


def test_log_with_bytes_of_no_message_is_damaged_and_parsed_as_pyulog_does(log: bytes) -> None:
    middle = len(log) // 2
    broken = log[:middle] + b"\xff" * 40 + log[middle:]
    assert parse_ulog(broken, "log").damaged
    assert_equal(broken)


def test_row_of_another_size_is_damage(log: bytes) -> None:
    data = log + struct.pack("<HBH", 5, ord("D"), 0) + b"abc"
    assert parse_ulog(data, "log").damaged
    assert_equal(data)


def test_row_of_no_subscription_is_damage(log: bytes) -> None:
    data = log + struct.pack("<HBH", 5, ord("D"), 999) + b"abc"
    assert parse_ulog(data, "log").damaged
    assert_equal(data)


def test_dropout_has_the_latest_time_before_it(log: bytes) -> None:
    assert_equal(log + struct.pack("<HBH", 2, ord("O"), 17))


def test_subscription_id_that_is_used_again_is_parsed_as_pyulog_does(log: bytes) -> None:
    name = b"vehicle_attitude"
    assert_equal(log + struct.pack("<HBBH", 3 + len(name), ord("A"), 0, 0) + name)


@pytest.mark.parametrize("content", [b"", b"ULog", bytes(HEADER_SIZE)])
def test_what_is_no_log_is_refused(content: bytes) -> None:
    with pytest.raises(ConfigError, match="is not a readable flight log"):
        parse_ulog(content, "log")


def test_file_on_disk_equals_its_bytes(log: bytes, tmp_path: Path) -> None:
    path = tmp_path / "flight.ulg"
    path.write_bytes(log)
    assert parse_ulog(log, "log").log.data_list == ULog(str(path)).data_list


def test_short_rows_of_other_topics_are_parsed_as_pyulog_does(log: bytes) -> None:
    data = log + struct.pack("<HBH", 5, ord("D"), 0) + b"abc"
    for topic in ("vehicle_attitude", "vehicle_status"):
        ours, theirs = parse_ulog(data, "log", [topic]).log, ULog(LogBytes(data), [topic])
        assert ours.data_list == theirs.data_list
        assert ours.last_timestamp == theirs.last_timestamp


def damaged(log: bytes, seed: int) -> bytes:
    """Return a log that is cut off, lacks bytes, or has others."""
    source = random.Random(seed)
    at, count = source.randrange(len(log)), source.randrange(1, 60)
    return (log[:at], log[:at] + log[at + count :], log[:at] + source.randbytes(count) + log[at:])[seed % 3]


@pytest.mark.parametrize("seed", range(30))
def test_messages_are_found_with_numba_as_without(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    content = damaged(small_ulog(), seed)
    compiled = ulog_scan.scan_messages(content)
    with monkeypatch.context() as patch:  # NUMBA_DISABLE_JIT=1
        patch.setattr(ulog_scan, "IS_DISABLED", True)
        patch.setattr(ulog_scan, "scan_kernel", ulog_scan.scan_kernel.py_func)
        debugged = ulog_scan.scan_messages(content)
    monkeypatch.setattr(ulog_scan, "sys", SimpleNamespace(modules={}))
    plain = ulog_scan.scan_messages(content)
    for one, another, third in zip(plain, compiled, debugged, strict=True):
        assert np.array_equal(one, another)
        assert np.array_equal(one, third)
    assert_finds_messages(plain, content)


def assert_finds_messages(found: ulog_scan.Messages, content: bytes) -> None:
    """Compare the messages with those that are found one by one."""
    at, rows, others = HEADER_SIZE, [], []
    while at < found.end:
        size, kind = MESSAGE_HEADER.unpack_from(content, at)
        if kind == DATA_TYPE:
            rows.append((at, size, int.from_bytes(content[at + 3 : at + 5], "little")))
        else:
            others.append(at)
        at += MESSAGE_HEADER.size + size
    assert at == found.end
    assert list(zip(*(array.tolist() for array in found[:3]), strict=True)) == rows
    assert found.others.tolist() == others


@pytest.mark.parametrize("kind", ["D", "O"])
def test_log_of_the_smallest_messages_is_scanned_to_its_end(kind: str) -> None:
    """They are more than a log of this size has as a rule."""
    content = bytes(HEADER_SIZE) + struct.pack("<HBH", 2, ord(kind), 7) * 5000
    found = ulog_scan.scan_messages(content)
    assert found.end == len(content)
    assert_finds_messages(found, content)


def test_latest_row_before_a_change_may_be_older_than_others(log: bytes) -> None:
    """Times need not increase: the largest one before a message counts, not that of the row before it."""
    row = bytes([*struct.pack("<HBHQ", 26, ord("D"), 0, 5), *bytes(16)])
    changed = struct.pack("<HBB", 1 + 7 + 4, ord("P"), 7) + b"float x" + bytes(4)
    assert_equal(log + row + changed + row + changed)
