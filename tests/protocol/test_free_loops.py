"""A free-running target, host and firmware together, in simulated time."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from flightstack.core.contract import LoopRow
from flightstack.core.errors import ConfigError, TargetError
from flightstack.firmware.c_loops import CLoops
from flightstack.firmware.free_loops import STATE_TIMEOUT_MS, FreeLoops
from flightstack.firmware.target_loops import TargetLoops
from flightstack.firmware.targets import finish_loops, make_loops
from tests.firmware.app_support import READY, SAFE, Target
from tests.support.pil_setups import HASH, SPEEDS, setup, sil

PERIOD_US = 2_000
FREE = 4


class FreeLine:
    """A line without delay to a target that has its own time, which ``pass_us`` advances."""

    name = "the free line"

    def __init__(self, device: Target) -> None:
        self._device, self._data = device, b""
        self.now_us = 0
        self.is_closed = self.is_cut = False

    def clock(self) -> float:
        return self.now_us * 1e-6

    def pass_us(self, passed_us: int) -> None:
        """Let time pass on both sides, with the ticks of the target."""
        end_us = self.now_us + passed_us
        while self.now_us < end_us:
            self.now_us = min(end_us, self.now_us + 250)
            self._device.run(self.now_us)
            if self.now_us % 1_000 == 0:
                self._device.poll(1)
            self._data += self._device.take()

    def write(self, data: bytes) -> None:
        if not self.is_cut:
            self._device.give(data)
            self._data += self._device.take()

    def read(self, timeout_s: float) -> bytes:
        if timeout_s > 0.0 and not self._data:
            self.pass_us(round(timeout_s * 1e6))
        data, self._data = self._data, b""
        return b"" if self.is_cut else data

    def close(self) -> None:
        self.is_closed = True


@pytest.fixture
def device() -> Iterator[Target]:
    target = Target()
    target.poll()
    target.run(-1)
    target.run(0)
    yield target
    target.close()


def connected(device: Target) -> tuple[CLoops, FreeLine]:
    line, of = FreeLine(device), setup()
    loops = FreeLoops(TargetLoops(line, of.numbers(), clock_s=line.clock, expected_hash=HASH))
    return CLoops("host,free", loops, of), line


def random_flight(loops: CLoops, line: FreeLine | None) -> np.ndarray:
    """Step with random inputs and, in some outer periods, given targets; return the rows."""
    rng, rows, targets = np.random.default_rng(5), np.zeros((200, LoopRow.SIZE)), np.zeros((200, 5))
    for tick, row in enumerate(rows):
        state = np.concatenate([rng.normal(size=6), [1.0, 0.0, 0.0, 0.0], rng.normal(size=3) * 0.3])
        is_given = (tick // 5) % 4 == 3
        if is_given and tick % 5 == 0:
            loops.set_attitude_target(np.array([1.0, 0.0, 0.0, 0.0, 5.0 + rng.random()]))
        loops.step(state, rng.normal(size=11), SPEEDS, tick % 5 == 0 and not is_given, row)
        targets[tick] = loops.attitude_target
        if line is not None:
            line.pass_us(PERIOD_US)
    return np.hstack([rows, targets])


def test_commands_are_those_of_c_one_tick_later(device: Target) -> None:
    """Each tick of the target flies the newest state; its command is there for the next tick of the host."""
    loops, line = connected(device)
    free, here = random_flight(loops, line), random_flight(sil(), None)
    assert np.array_equal(free[1:, LoopRow.ROTOR_COMMAND], here[:-1, LoopRow.ROTOR_COMMAND])
    reference = LoopRow.REFERENCE_ATTITUDE
    assert np.array_equal(free[1:, reference], here[:-1, reference])
    assert np.array_equal(
        free[1:, LoopRow.SIZE :], here[:-1, LoopRow.SIZE :]
    )  # the land detector reads its thrust
    assert np.isfinite(free[:, reference]).all()  # the commander checks it: NaN is a tilt error
    assert np.isnan(free[:, LoopRow.WRENCH]).all()


def level(loops: CLoops, outer: bool = True) -> np.ndarray:
    row = np.zeros(LoopRow.SIZE)
    state = np.array([0.0] * 6 + [1.0] + [0.0] * 6)
    loops.step(state, np.array([0.0, 0.0, -1.0] + [0.0] * 8), SPEEDS, outer, row)
    return row


def test_a_host_that_pauses_finds_the_rotors_stopped(device: Target) -> None:
    loops, line = connected(device)
    for _ in range(10):
        level(loops)
        line.pass_us(PERIOD_US)
    assert level(loops)[LoopRow.ROTOR_COMMAND].max() > 0.0
    line.pass_us(round(STATE_TIMEOUT_MS * 1e3) + 2 * PERIOD_US)
    assert device.state == SAFE
    with pytest.raises(
        TargetError, match=r"^the target on the free line stopped its rotors: No state in time"
    ):
        level(loops)


def test_a_vehicle_on_the_ground_sends_no_states(device: Target) -> None:
    loops, line = connected(device)
    row, state = np.zeros(LoopRow.SIZE), np.array([0.0] * 6 + [1.0] + [0.0] * 6)
    for _ in range(3):
        loops.reset(state)
        for _ in range(5):
            level(loops)
            line.pass_us(PERIOD_US)
        for _ in range(500):
            loops.idle(state, SPEEDS, False, row)
            line.pass_us(PERIOD_US)
        assert device.state == FREE
    assert device.status().safe_states == 0


def test_the_record_has_the_timing_of_the_target(device: Target, tmp_path: Path) -> None:
    loops, line = connected(device)
    for _ in range(1_200):
        level(loops)
        line.pass_us(PERIOD_US)
    finish_loops(loops, tmp_path / "flight.ulg")
    assert line.is_closed
    assert device.state == READY
    told = json.loads((tmp_path / "pil-link.json").read_text())["free_running"]
    assert told["period_us"] == PERIOD_US
    assert 900 <= told["ticks"] <= 1_200
    assert (told["missed"], told["overruns"], told["timeouts"]) == (0, 0, 0)
    assert told["late_max_us"] < 250
    assert told["end_to_end_max_us"] <= PERIOD_US


def test_a_line_that_is_cut_ends_the_flight_with_a_sentence(device: Target) -> None:
    loops, line = connected(device)
    for _ in range(10):
        level(loops)
        line.pass_us(PERIOD_US)
    line.is_cut = True
    for _ in range(240):
        level(loops)
        line.pass_us(PERIOD_US)
    line.pass_us(10 * PERIOD_US)
    with pytest.raises(TargetError, match=r"on the free line sent no rotor commands for 0.5 s"):
        level(loops)


def test_parameters_change_in_flight(device: Target) -> None:
    loops, line = connected(device)
    level(loops)
    loops.set_parameter("POS_Z_P", 3.0)
    line.pass_us(PERIOD_US)
    level(loops)
    assert loops.get_parameter("POS_Z_P") == 3.0
    assert math.isclose(loops.executor.get("POS_Z_P"), 3.0)


@pytest.mark.parametrize(
    ("loops", "lockstep", "words"),
    [
        ("host,free", True, "requires --clock realtime"),
        ("host", False, "require lockstep"),
        ("emulated,free", False, "cannot run by its own timer"),
    ],
)
def test_a_target_flies_on_its_own_clock_alone(loops: str, lockstep: bool, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        make_loops(loops, setup(), lockstep)
