"""A free-running target, host and firmware together, in simulated time."""

from __future__ import annotations

import json
import os
import pty
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from flightstack.core.contract import LoopRow
from flightstack.core.errors import ConfigError, TargetError
from flightstack.firmware.c_loops import CLoops
from flightstack.firmware.pil.free_running import STATE_TIMEOUT_MS, FreeLoops
from flightstack.firmware.pil.line_model import STATE_OCTETS
from flightstack.firmware.pil.target_loops import TargetLoops
from flightstack.firmware.targets import finish_loops, make_loops
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.frames import message_id_of
from flightstack.transports.byte_link import LineError
from tests.firmware.app_support import READY, SAFE, Target, read
from tests.support.pil_setups import HASH, SPEEDS, setup, sil

PERIOD_US = 2_000
FREE = 4


class FreeLine:
    """A line without delay to a target that has its own time, which ``pass_us`` advances."""

    name = "the free line"

    def __init__(self, device: Target) -> None:
        self._device, self._data = device, b""
        self.now_us = 0
        self.is_closed = self.is_cut = self.is_lost = False
        self.dropped: list[int] = []
        """Ids of messages of which the next frame is lost, in either direction."""

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
            self._data += self._answers()

    def _answers(self) -> bytes:
        frames = self._device.frames(65_536)
        return b"".join(frame for frame in frames if not self._drops(message_id_of(frame)))

    def _drops(self, message_id: int) -> bool:
        if message_id in self.dropped:
            self.dropped.remove(message_id)
            return True
        return False

    def write(self, data: bytes) -> None:
        if self.is_lost:
            raise LineError("the free line: connection lost")
        if not self.is_cut and not self._drops(message_id_of(data)):
            self._device.give(data)
            self._data += self._answers()

    def read(self, timeout_s: float) -> bytes:
        if self.is_lost:
            raise LineError("the free line: connection lost")
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


PARAM_IDS = (mavlink.MAVLINK_MSG_ID_PARAM_SET, mavlink.MAVLINK_MSG_ID_PARAM_VALUE)


@pytest.mark.parametrize("lost", [(), PARAM_IDS[:1], PARAM_IDS[1:], PARAM_IDS])
def test_parameters_change_in_flight(device: Target, lost: tuple[int, ...]) -> None:
    """States go on while a lost PARAM_SET or PARAM_VALUE is repeated."""
    loops, line = connected(device)
    level(loops)
    line.dropped += lost
    loops.set_parameter("POS_Z_P", 3.0)
    loops.set_parameter("POS_XY_P", 1.5)
    for _ in range(60):
        before_us = line.now_us
        level(loops)
        assert line.now_us == before_us  # a step does not wait
        line.pass_us(PERIOD_US)
    line.pass_us(10 * PERIOD_US)
    assert line.dropped == []
    line.read(0.0)
    values = {name: device.ask(read(name)) for name in ("POS_Z_P", "POS_XY_P")}
    for name, value in (("POS_Z_P", 3.0), ("POS_XY_P", 1.5)):
        (answer,) = [each for each in values[name] if each.get_type() == "PARAM_VALUE"]
        assert answer.param_value == value
        assert loops.get_parameter(name) == value
    assert device.state == FREE


def test_parameters_change_on_the_ground(device: Target) -> None:
    loops, line = connected(device)
    row, state = np.zeros(LoopRow.SIZE), np.array([0.0] * 6 + [1.0] + [0.0] * 6)
    loops.set_parameter("POS_Z_P", 3.0)
    for _ in range(5):
        loops.idle(state, SPEEDS, False, row)
        line.pass_us(PERIOD_US)
    line.read(0.0)
    (answer,) = [each for each in device.ask(read("POS_Z_P")) if each.get_type() == "PARAM_VALUE"]
    assert answer.param_value == 3.0


def test_a_lost_link_on_the_ground_is_one_sentence(device: Target, tmp_path: Path) -> None:
    loops, line = connected(device)
    row, state = np.zeros(LoopRow.SIZE), np.array([0.0] * 6 + [1.0] + [0.0] * 6)
    loops.idle(state, SPEEDS, False, row)
    line.is_lost = True
    with pytest.raises(TargetError, match=r"^the free line: connection lost$"):
        loops.idle(state, SPEEDS, False, row)  # in which no state is due
    finish_loops(loops, tmp_path / "flight.ulg")
    loops.close()
    assert line.is_closed
    assert json.loads((tmp_path / "pil-link.json").read_text())["ending"] == "the free line: connection lost"


def test_close_of_a_lost_link_closes_the_line(device: Target) -> None:
    loops, line = connected(device)
    line.is_cut = True
    loops.close()
    assert line.is_closed


def test_a_failed_flight_stops_the_target_and_has_a_record(device: Target, tmp_path: Path) -> None:
    loops, line = connected(device)
    level(loops)
    line.pass_us(400_000)
    with pytest.raises(TargetError, match="No state in time"):
        level(loops)
    finish_loops(loops, tmp_path / "flight.ulg")
    told = json.loads((tmp_path / "pil-link.json").read_text())
    assert told["status"]["safe_states"] == 1
    assert "No state in time: rotors stopped" in told["texts"]
    assert told["ending"].endswith("stopped its rotors: No state in time: rotors stopped")
    assert device.run_wait_us == 2**32 - 1  # it has stopped its ticks


def test_a_hold_keeps_the_target_flying(device: Target) -> None:
    """The flight stack holds its commands while its own state is stale."""
    loops, line = connected(device)
    for _ in range(10):
        level(loops)
        line.pass_us(PERIOD_US)
    for _ in range(500):
        loops.hold()
        line.pass_us(PERIOD_US)
    assert device.state == FREE
    assert level(loops)[LoopRow.ROTOR_COMMAND].max() > 0.0
    assert device.status().safe_states == 0


def test_a_hold_before_the_first_flight_sends_nothing(device: Target) -> None:
    loops, line = connected(device)
    line.is_lost = True
    loops.hold()


def test_a_pause_on_the_ground_lets_the_target_run_again(device: Target) -> None:
    """For example until the simulator connects."""
    loops, line = connected(device)
    line.pass_us(20_000_000)
    line.read(0.0)
    level(loops)
    line.pass_us(2 * PERIOD_US)
    assert level(loops)[LoopRow.ROTOR_COMMAND].max() > 0.0
    assert device.state == FREE


def test_states_at_rest_come_before_the_timeout_at_low_rates(device: Target) -> None:
    loops, line = connected(device)
    row, state = np.zeros(LoopRow.SIZE), np.array([0.0] * 6 + [1.0] + [0.0] * 6)
    level(loops)
    for _ in range(20):  # 20 Hz; the first REST is lost
        line.dropped += [mavlink.MAVLINK_MSG_ID_FS_PIL_STATE] * (line.now_us == 0)
        loops.idle(state, SPEEDS, False, row)
        line.pass_us(50_000)
    assert device.state == FREE


def test_free_running_refuses_a_line_too_slow_for_its_states() -> None:
    ours, theirs = pty.openpty()
    name = f"serial:{os.ttyname(theirs)}:115200,free"
    with pytest.raises(ConfigError, match=r"free-running at 500 Hz requires at least 580000 baud"):
        make_loops(name, setup(), lockstep=False)
    os.close(ours)
    os.close(theirs)


def test_octets_of_a_state_are_those_of_the_line_model(device: Target) -> None:
    state = mavlink.MAVLink_fs_pil_state_message(1, 1, [1.0] * 13, [1.0] * 11)
    assert len(state.pack(mavlink.MAVLink(None, 1, 1))) == STATE_OCTETS


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
