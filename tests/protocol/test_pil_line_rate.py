"""The baud rate of a line to a target, negotiated between host and firmware on a simulated line."""

from __future__ import annotations

import json
import os
import pty
import random
import termios
from collections.abc import Iterator
from pathlib import Path

import pytest

from flightstack.core.errors import ConfigError, TargetError
from flightstack.firmware import targets
from flightstack.firmware.choice import LoopsChoice
from flightstack.firmware.pil.client import DEFAULT_TIMING
from flightstack.firmware.pil.session import negotiate_baud
from flightstack.firmware.pil.target_loops import TargetLoops
from flightstack.firmware.targets import make_loops
from flightstack.transports.byte_link import LineError
from flightstack.transports.serial_port import SerialPort
from gcs_cli.errors import CliError
from gcs_cli.pil import doctor
from gcs_cli.pil.conformance import command
from gcs_cli.pil.conformance.check import PASSED, Check
from gcs_cli.pil.conformance.command import run_conformance
from tests.firmware.app_support import START_BAUD, Target
from tests.support.lossy_line import LossyLine
from tests.support.pil_setups import HASH, setup

FAST, OTHER = 921_600, 460_800


class RatedLine(LossyLine):
    """A line that turns every octet into noise while both ends have different rates, or at a rate that it damages."""

    def __init__(self, device: Target, baud: int, damaged: tuple[int, ...] = ()) -> None:
        self.baud, self.damaged, self.target = baud, damaged, device
        self._noise = random.Random(3)
        super().__init__(device)

    def set_baud(self, baud: int) -> None:
        self.baud = baud
        self._events.clear()

    def _send(self, data: bytes, to_device: bool) -> None:
        if self.baud != self.target.baud or self.baud in self.damaged:
            data = bytes(self._noise.choice((0x00, 0x80, 0xF0, 0xFF)) for _ in range(len(data) // 4 + 1))
        super()._send(data, to_device)


@pytest.fixture
def device() -> Iterator[Target]:
    target = Target(bauds=(START_BAUD, FAST, OTHER))
    yield target
    target.close()


def negotiated(line: RatedLine, wanted: int) -> str | None:
    return negotiate_baud(line, wanted, DEFAULT_TIMING, clock_s=line.clock)


def test_a_target_at_its_first_rate_comes_to_the_wanted_one(device: Target, tmp_path: Path) -> None:
    line = RatedLine(device, FAST)
    assert negotiated(line, FAST) is None
    assert (line.baud, device.baud) == (FAST, FAST)
    assert line.now_s < 1.0
    loops = TargetLoops(line, setup().numbers(), clock_s=line.clock, expected_hash=HASH)
    assert loops.identity["baud"] == FAST


def test_a_target_at_the_wanted_rate_is_asked_once(device: Target) -> None:
    line = RatedLine(device, FAST)
    negotiated(line, FAST)
    began_s = line.now_s
    assert negotiated(line, FAST) is None
    assert line.now_s - began_s < 0.01


def test_a_target_at_another_rate_is_brought_back_first(device: Target) -> None:
    """The host before this one left it there."""
    line = RatedLine(device, OTHER)
    assert negotiated(line, OTHER) is None
    line.set_baud(FAST)
    assert negotiated(line, FAST) is None
    assert (line.baud, device.baud) == (FAST, FAST)


def test_the_first_rate_finds_a_target_at_another_one(device: Target) -> None:
    line = RatedLine(device, FAST)
    negotiated(line, FAST)
    line.set_baud(START_BAUD)
    assert negotiated(line, START_BAUD) is None
    assert device.baud == START_BAUD


def test_a_free_running_target_needs_a_fast_line(device: Target, monkeypatch: pytest.MonkeyPatch) -> None:
    line = RatedLine(device, START_BAUD)
    monkeypatch.setattr(targets, "open_link", lambda _: line)
    monkeypatch.setattr(targets, "negotiate_baud", lambda link, wanted, _: negotiated(link, wanted))
    with pytest.raises(ConfigError, match="at 500 Hz requires at least 580000 baud"):
        make_loops("serial:/dev/x,free", setup(), lockstep=False)
    assert line.is_closed


def test_doctor_measures_every_rate_a_second_time(device: Target, monkeypatch: pytest.MonkeyPatch) -> None:
    line = RatedLine(device, START_BAUD)

    def opened(choice: LoopsChoice) -> RatedLine:
        line.is_closed = False
        line.set_baud(choice.baud)
        return line

    monkeypatch.setattr(doctor, "open_link", opened)
    serial = LoopsChoice("serial", "/dev/x")
    for _ in range(2):
        found = doctor.examine(serial, [START_BAUD, OTHER, FAST], 5, lambda _done, _total: None, line.clock)
        assert [len(each.round_trips_s) for each in found] == [5, 5, 5]
        assert device.baud == START_BAUD


def test_conformance_negotiates_its_rate(
    device: Target, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    line, rates = RatedLine(device, OTHER), list[tuple[int, int]]()

    def checks(*_: object) -> Iterator[Check]:
        rates.append((line.baud, device.baud))
        yield Check("hello", PASSED, "")
        yield Check("losses", PASSED, "")

    monkeypatch.setattr(command, "port_or_target", lambda *_: LoopsChoice("serial", "/dev/x"))
    monkeypatch.setattr(command, "open_link", lambda _: line)
    monkeypatch.setattr(command, "conformance", checks)
    monkeypatch.setattr(command.time, "monotonic", line.clock)
    run_conformance("/dev/x", None, [OTHER], as_json=True)
    assert rates == [(OTHER, OTHER)]
    assert device.baud == START_BAUD
    line.is_closed = False
    line.set_baud(2_000_000)
    with pytest.raises(CliError, match="/dev/x: the target cannot run at 2000000 baud"):
        run_conformance("/dev/x", None, [2_000_000], as_json=True)


def test_a_rate_that_the_line_damages_falls_back(device: Target, tmp_path: Path) -> None:
    line = RatedLine(device, FAST, damaged=(FAST,))
    note = negotiated(line, FAST)
    assert note == "the target did not answer at 921600 baud: the line stays at 115200 baud"
    assert (line.baud, device.baud) == (START_BAUD, START_BAUD)
    loops = TargetLoops(line, setup().numbers(), clock_s=line.clock, expected_hash=HASH, note=note)
    assert note in loops.version
    loops.write_record(tmp_path / "flight.ulg")
    assert json.loads((tmp_path / "pil-link.json").read_text())["note"] == note


def test_a_rate_that_the_target_cannot_have_falls_back(device: Target) -> None:
    line = RatedLine(device, 2_000_000)
    note = negotiated(line, 2_000_000)
    assert note == "the target cannot run at 2000000 baud: the line stays at 115200 baud"
    assert (line.baud, device.baud) == (START_BAUD, START_BAUD)


def test_a_silent_line_stays_at_the_rate_of_the_user(device: Target) -> None:
    line = RatedLine(device, FAST)
    line.is_cut = True
    assert negotiated(line, FAST) is None
    assert line.baud == FAST
    assert line.now_s == pytest.approx(2.5)
    line.set_baud(START_BAUD)
    assert negotiated(line, START_BAUD) is None
    assert line.now_s == pytest.approx(4.5)


def test_a_broken_line_is_one_sentence(device: Target) -> None:
    class Broken(RatedLine):
        def write(self, data: bytes) -> None:
            raise LineError("/dev/ttyUSB1: connection lost")

    with pytest.raises(TargetError, match=r"^/dev/ttyUSB1: connection lost$"):
        negotiated(Broken(device, FAST), FAST)


def test_serial_port_changes_its_rate() -> None:
    ours, theirs = pty.openpty()
    port = SerialPort(os.ttyname(theirs), START_BAUD)
    os.write(ours, b"left from before")
    port.set_baud(FAST)
    assert termios.tcgetattr(theirs)[4:6] == [termios.B921600, termios.B921600]
    assert port.name.endswith("at 921600 baud")
    assert port.read(0.0) == b""
    port.close()
    with pytest.raises(LineError, match="cannot run at 115200 baud"):
        port.set_baud(START_BAUD)
    os.close(ours)
    os.close(theirs)
