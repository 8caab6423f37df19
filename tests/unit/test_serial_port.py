"""A serial port as a line of octets, on a pseudo-terminal."""

from __future__ import annotations

import contextlib
import errno
import os
import pty
import tty
from collections.abc import Iterator

import pytest
import serial

from flightstack.transports.byte_link import LineError
from flightstack.transports.serial_port import SerialPort


@pytest.fixture
def line() -> Iterator[tuple[int, SerialPort]]:
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    port = SerialPort(os.ttyname(theirs), 921_600)
    os.close(theirs)
    yield ours, port
    port.close()
    with contextlib.suppress(OSError):  # a test may have closed it
        os.close(ours)


def test_any_octets_pass_both_ways(line: tuple[int, SerialPort]) -> None:
    ours, port = line
    octets = bytes(range(256))
    port.write(octets)
    assert os.read(ours, 1000) == octets
    os.write(ours, octets)
    assert port.read(1.0) == octets


def test_nothing_within_the_time_is_nothing(line: tuple[int, SerialPort]) -> None:
    assert line[1].read(0.0) == b""
    assert line[1].read(0.01) == b""


def test_data_before_opening_is_dropped() -> None:
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    os.write(ours, b"old")
    port = SerialPort(os.ttyname(theirs), 9600)
    assert port.read(0.0) == b""
    port.close()
    os.close(ours)
    os.close(theirs)


@pytest.mark.parametrize("path", ["/dev/null", "/dev/zero", __file__])
def test_non_serial_device_raises_line_error(path: str) -> None:
    with pytest.raises(LineError, match=f"^{path}: is not a serial port$"):
        SerialPort(path, 115_200)


def test_lost_connection_raises_line_error(line: tuple[int, SerialPort]) -> None:
    ours, port = line
    os.close(ours)
    with pytest.raises(LineError, match="at 921600 baud: connection lost"):
        port.read(1.0)
    with pytest.raises(LineError, match="at 921600 baud: connection lost"):
        port.write(b"x")


@pytest.mark.parametrize(
    ("error", "sentence"),
    [
        (
            serial.SerialException(errno.EACCES, "could not open"),
            "permission denied: add your user to its group",
        ),
        (serial.SerialException(errno.EBUSY, "could not open"), "in use by another program"),
        (serial.SerialException("Could not configure port: (5, 'Input/output error')"), "Input/output error"),
        (ValueError("Not a valid baudrate: 7"), "Not a valid baudrate: 7"),
        (serial.SerialException(), "SerialException"),
    ],
)
def test_why_a_port_cannot_be_opened(monkeypatch, error: Exception, sentence: str) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(serial, "Serial", refuse)
    with pytest.raises(LineError, match=f"^/dev/ttyX: .*{sentence}"):
        SerialPort("/dev/ttyX", 9600)
