"""The firmware as a process: on a pseudo-terminal, on its standard streams, and how it ends."""

from __future__ import annotations

import os
import select
import subprocess
import time
from collections.abc import Iterator
from typing import Any

import pytest
from pymavlink import mavparm, mavutil

from flightstack.firmware.numbers import TARGET_NUMBERS, default_numbers
from flightstack.mavlink.dialect import mavlink
from tests.firmware.app_support import RESET, cached, command, kinds, step

HANG_S = 60.0
"""A guard against a hang, far beyond what anything here takes."""


def start(*arguments: str) -> subprocess.Popen[bytes]:
    program = cached("fs_host", "-O2", program=True)
    return subprocess.Popen([program, *arguments], stdin=subprocess.PIPE, stdout=subprocess.PIPE)


@pytest.fixture
def process() -> Iterator[subprocess.Popen[bytes]]:
    with start() as started:
        yield started
        started.kill()


def terminal(process: subprocess.Popen[bytes]) -> str:
    """Return the name of the terminal that a process offers."""
    assert process.stdout is not None
    return process.stdout.readline().decode().strip()


def until(device: int, codec: Any, wanted: str) -> Any:
    """Read the terminal until a message of this kind comes."""
    while select.select([device], [], [], HANG_S)[0]:
        for message in codec.parse_buffer(os.read(device, 4096)) or []:
            if message.get_type() == wanted:
                return message
    raise AssertionError(f"no {wanted} came")


@pytest.fixture
def codec() -> Any:
    made = mavlink.MAVLink(None, 255, 190)
    made.robust_parsing = True
    return made


def test_it_answers_on_a_terminal_and_ends_when_that_is_closed(
    process: subprocess.Popen[bytes], codec: Any
) -> None:
    device = os.open(terminal(process), os.O_RDWR | os.O_NOCTTY)
    for number in range(50):  # a report has every octet, line ends and control characters among them
        os.write(device, step(number, RESET if number == 0 else 0).pack(codec))
        assert until(device, codec, "FS_PIL_REPORT").step == number
    os.write(device, command(512, mavlink.MAVLINK_MSG_ID_FS_PIL_IDENTITY).pack(codec))
    assert until(device, codec, "FS_PIL_IDENTITY").board == "host"
    os.close(device)
    assert process.wait(HANG_S) == 0


def test_it_waits_for_its_client_and_ends_with_who_started_it(process: subprocess.Popen[bytes]) -> None:
    """Nobody opens the terminal; the pipe to its standard input is closed."""
    assert terminal(process).startswith("/dev/")
    assert process.poll() is None
    assert process.stdin is not None
    process.stdin.close()
    assert process.wait(HANG_S) == 0


def test_it_does_not_compute_while_it_waits(process: subprocess.Popen[bytes], codec: Any) -> None:
    """Two seconds from heartbeat to heartbeat cost it a few milliseconds (measured: 3); a busy loop, 2000."""
    device = os.open(terminal(process), os.O_RDWR | os.O_NOCTTY)
    os.write(device, command(512, mavlink.MAVLINK_MSG_ID_FS_PIL_STATUS).pack(codec))
    until(device, codec, "FS_PIL_STATUS")
    for _ in range(3):
        until(device, codec, "HEARTBEAT")
    os.close(device)
    _, status, used = os.wait4(process.pid, 0)
    assert os.waitstatus_to_exitcode(status) == 0
    process.returncode = 0
    assert used.ru_utime + used.ru_stime < 0.2


def test_its_status_has_the_time_of_the_request(process: subprocess.Popen[bytes], codec: Any) -> None:
    """Between two requests the process waits without a byte; its clock is the machine's."""
    device = os.open(terminal(process), os.O_RDWR | os.O_NOCTTY)
    request = command(512, mavlink.MAVLINK_MSG_ID_FS_PIL_STATUS)
    until(device, codec, "HEARTBEAT")
    os.write(device, request.pack(codec))
    first, answered_s = until(device, codec, "FS_PIL_STATUS"), time.monotonic()
    while select.select([device], [], [], 0.3)[0]:
        os.read(device, 4096)
    asked_s = time.monotonic()
    os.write(device, request.pack(codec))
    second = until(device, codec, "FS_PIL_STATUS")
    os.close(device)
    assert second.time_boot_ms - first.time_boot_ms >= (asked_s - answered_s) * 1e3 - 1.0


def test_on_standard_streams_it_answers_all_that_came_before_the_end(codec: Any) -> None:
    sent = b"".join(
        bytes(message.pack(codec))
        for message in (step(0, RESET), step(1), command(512, mavlink.MAVLINK_MSG_ID_FS_PIL_IDENTITY))
    )
    process = start("--stdio")
    answered, _ = process.communicate(sent, HANG_S)
    assert process.returncode == 0
    heard = [m for m in kinds(codec.parse_buffer(answered)) if m not in ("HEARTBEAT", "FS_PIL_STATUS")]
    assert heard == ["FS_PIL_REPORT", "FS_PIL_REPORT", "FS_PIL_IDENTITY", "COMMAND_ACK"]


def test_a_wrong_argument_is_answered_with_the_usage() -> None:
    program = cached("fs_host", "-O2", program=True)
    done = subprocess.run([program, "--help-me"], check=False, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (2, "usage: fs_host [--stdio]\n")


def test_pymavlink_reads_and_sets_parameters(process: subprocess.Popen[bytes]) -> None:
    """Its own connection, list and MAVParmDict.mavset, as MAVProxy uses them, on the terminal as a serial port."""
    connection = mavutil.mavlink_connection(terminal(process), baud=115200)
    connection.param_fetch_all()
    told: dict[str, float] = {}
    while len(told) < len(TARGET_NUMBERS):
        message = connection.recv_match(type="PARAM_VALUE", blocking=True, timeout=HANG_S)
        assert message is not None, sorted(told)
        told[message.param_id] = message.param_value
    assert told == pytest.approx(default_numbers(), rel=1e-6, abs=1e-9)
    connection.target_system, connection.target_component = 1, 1
    assert mavparm.MAVParmDict().mavset(connection, "POS_XY_P", 2.5, retries=3)
    connection.mav.param_request_read_send(1, 1, b"POS_XY_P", -1)
    assert connection.recv_match(type="PARAM_VALUE", blocking=True, timeout=HANG_S).param_value == 2.5
    connection.close()
    assert process.wait(HANG_S) == 0
