"""The link's doctor on lines that lose, delay and stay silent: it finds what is wrong, and says what to change."""

from __future__ import annotations

import random
from collections.abc import Iterator
from typing import Any

import pytest
from rich.console import Console

from flightstack.firmware.choice import LoopsChoice
from flightstack.firmware.pil.client import PilCounters
from flightstack.firmware.sources import source_hash
from flightstack.firmware.targets import open_link, timing_of
from gcs_cli.errors import FAILED, NO_ANSWER, USAGE, CliError
from gcs_cli.pil import doctor
from gcs_cli.pil.advice import Port, advice
from gcs_cli.pil.doctor import check_findings, examine, findings, print_findings
from gcs_cli.pil.probe import Measurement, measured
from tests.firmware.app_support import RESTARTED, STEPPING, Target

HERE = source_hash().hex()
IDENTITY = {
    "board": "b",
    "compiler": "c",
    "source_hash": HERE,
    "cost_unit": "cycles",
    "clock_hz": 200_000_000,
    "real_octets": 4,
    "char_bits": 16,
}
FTDI = Port("/dev/ttyUSB1", 16.0, "/sys/x/latency_timer")


def quiet(_done: int, _total: int) -> None:
    """Show no progress."""


class LossyLine:
    """A line to the host program that loses whole writes and reads, by a seed."""

    def __init__(self, loss: float, seed: int = 1) -> None:
        self._link = open_link(LoopsChoice("host"))
        self._loss, self._random = loss, random.Random(seed)
        self.name = "a lossy line"

    def write(self, data: bytes) -> None:
        if self._random.random() >= self._loss:
            self._link.write(data)

    def read(self, timeout_s: float) -> bytes:
        return self._link.read(timeout_s)

    def close(self) -> None:
        self._link.close()


class SilentLine:
    """Nobody is at the other end; time passes at once."""

    name = "a silent line"

    def write(self, data: bytes) -> None:
        """Lose it."""

    def read(self, timeout_s: float) -> bytes:
        return b""

    def close(self) -> None:
        """Nothing is held open."""


class SlowLine:
    """A line to the firmware's application that takes the octets' time, on a clock of its own."""

    name = "a slow line"

    def __init__(self, device: Target, baud: int) -> None:
        self._device, self._octet_s = device, 10.0 / baud
        self._coming: list[tuple[float, bytes]] = []
        self.now_s = 0.0

    def clock(self) -> float:
        return self.now_s

    def write(self, data: bytes) -> None:
        self._device.give(data)
        answer = self._device.take()
        from_s = self._coming[-1][0] if self._coming else self.now_s
        self._coming.append((from_s + (len(data) + len(answer)) * self._octet_s, answer))

    def read(self, timeout_s: float) -> bytes:
        if not self._coming or self._coming[0][0] > self.now_s + timeout_s:
            self.now_s += timeout_s
            return b""
        at_s, data = self._coming.pop(0)
        self.now_s = max(self.now_s, at_s)
        return data

    def close(self) -> None:
        """Nothing is held open."""


@pytest.fixture
def device() -> Iterator[Target]:
    target = Target(was_watchdog=True)
    yield target
    target.close()


def of_counters(baud: int | None, trip_s: float, resent: int = 0, **more: Any) -> Measurement:
    counters = PilCounters(resent=resent, octets_sent=11_600, octets_received=14_400)
    return Measurement(baud, IDENTITY, None, (trip_s,) * 100, counters, **more)


def test_a_good_line_needs_no_change() -> None:
    (found,) = examine(LoopsChoice("host"), [115_200], 50, quiet)
    result = findings(LoopsChoice("host"), [found])
    assert len(found.round_trips_s) == 50
    assert result["lines"][0]["lost"] == 0
    assert result["lines"][0]["identity"]["source_hash"] == HERE
    assert result["advice"] == []
    check_findings(result)


def test_lost_exchanges_are_repeated_counted_and_reported() -> None:
    line = LossyLine(0.2)
    try:
        found = measured(line, 115_200, 40, quiet)
    finally:
        line.close()
    assert found.problem is None
    assert len(found.round_trips_s) == 40
    assert found.lost > 0
    assert any(
        "lost" in sentence and "lower baud rate" in sentence for sentence in advice(FTDI, [found], HERE)
    )


def test_a_silent_line_ends_and_names_what_to_look_at() -> None:
    found = measured(SilentLine(), 115_200, 40, quiet)
    assert found.identity is None
    (sentence,) = advice(FTDI, [found], HERE)
    for words in ("flashed", "baud", "two ports", "another program"):
        assert words in sentence
    with pytest.raises(CliError) as error:
        check_findings({**findings(LoopsChoice("serial", "/dev/x"), [found]), "target": "/dev/x"})
    assert error.value.exit_code == NO_ANSWER


def test_a_latency_timer_is_named_with_the_command_that_sets_it() -> None:
    slow = of_counters(921_600, 0.016)
    (timer, rate) = advice(FTDI, [slow], HERE)
    assert "echo 1 | sudo tee /sys/x/latency_timer" in timer
    assert "62 steps/s" in rate or "63 steps/s" in rate
    unknown, _ = advice(Port("/dev/ttyACM0"), [slow], HERE)
    assert "16 ms" in unknown
    fast = of_counters(921_600, 0.0010)
    assert advice(Port("/dev/ttyACM0", 1.0), [fast], HERE) == []


def test_the_time_on_the_wire_is_that_of_the_octets() -> None:
    assert of_counters(115_200, 0.03).wire_s == pytest.approx(260 * 10 / 115_200)
    assert of_counters(None, 0.03).wire_s is None


def test_wrong_firmware_is_measured_named_and_fails() -> None:
    other = of_counters(115_200, 0.03)._replace(identity={**IDENTITY, "source_hash": "ff" * 8})
    assert any("other sources" in sentence for sentence in advice(FTDI, [other], HERE))
    with pytest.raises(CliError) as error:
        check_findings(findings(LoopsChoice("serial", "/dev/x"), [other]))
    assert error.value.exit_code == FAILED
    double = of_counters(115_200, 0.03)._replace(identity={**IDENTITY, "real_octets": 8})
    assert any("64 bits" in sentence for sentence in advice(FTDI, [double], HERE))


def test_what_the_target_counted_is_told() -> None:
    found = of_counters(460_800, 0.001, resent=3, troubles={"uart_overruns": 3})
    assert any("uart overruns 3" in sentence for sentence in advice(None, [found], HERE))


def test_a_slow_line_is_waited_for_as_in_flight(device: Target) -> None:
    line = SlowLine(device, 2400)
    found = measured(line, 2400, 20, quiet, timing_of(LoopsChoice("serial", "/dev/x", 2400)), line.clock)
    assert (found.problem, found.lost, len(found.round_trips_s)) == (None, 0, 20)
    assert min(found.round_trips_s) > 0.3


def test_each_rate_is_given_the_time_that_flights_give_it(monkeypatch) -> None:
    given = []

    def noted(*arguments: Any) -> Measurement:
        given.append(arguments[4])
        return of_counters(115_200, 0.03)

    monkeypatch.setattr(doctor, "open_link", lambda _choice: SilentLine())
    monkeypatch.setattr(doctor, "measured", noted)
    choice = LoopsChoice("serial", "/dev/x")
    examine(choice, [9600, 115_200], 5, quiet)
    assert given == [timing_of(choice._replace(baud=baud)) for baud in (9600, 115_200)]


def test_one_rate_that_works_is_enough_and_the_others_are_told() -> None:
    good = of_counters(115_200, 0.03)
    bad = of_counters(921_600, 0.003)._replace(problem="did not answer step 3, sent 5 times")
    serial = LoopsChoice("serial", "/dev/x")
    for found in ([good, bad], [bad, good]):
        result = findings(serial, found)
        check_findings(result)
        assert (
            "At 921600 baud the target did not answer step 3, sent 5 times: the exchanges ended there."
            in (result["advice"])
        )
        assert any("33 steps/s" in sentence for sentence in result["advice"])  # of the rate that works
    with pytest.raises(CliError, match="did not answer step 3") as error:
        check_findings(findings(serial, [bad, of_counters(9600, 1.0)._replace(identity=None)]))
    assert error.value.exit_code == NO_ANSWER


def test_state_and_counters_before_the_first_step_are_told(device: Target) -> None:
    line = SlowLine(device, 115_200)
    timing = timing_of(LoopsChoice("serial", "/dev/x"))
    first, second = (measured(line, 115_200, 5, quiet, timing, line.clock) for _ in range(2))
    assert first.before is not None
    assert second.before is not None
    assert (first.before["state"], second.before["state"]) == (RESTARTED, STEPPING)
    assert second.before["steps"] == 5
    sentence = advice(None, [first, second], HERE)[0]
    assert "restarted by its watchdog" in sentence
    console = Console(record=True, width=200)
    print_findings(console, findings(LoopsChoice("host"), [first, second]))
    assert "before the first step: restarted by its watchdog, up for 0.0 s; frames 2" in console.export_text()


def test_a_target_in_its_safe_state_says_so() -> None:
    states = [advice(None, [of_counters(None, 0.03, before={"state": state})], HERE) for state in range(5)]
    assert [len(sentences) for sentences in states] == [0, 0, 1, 1, 0]
    assert "safe state" in states[2][0]


def test_a_port_that_is_not_there_is_a_mistake_of_the_user() -> None:
    with pytest.raises(CliError, match="no such device") as error:
        examine(LoopsChoice("serial", "/dev/ttyNONE"), [115_200], 5, quiet)
    assert error.value.exit_code == USAGE
