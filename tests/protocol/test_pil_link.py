"""The link to a target, on a line that loses and changes octets, against the firmware's own application."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from flightstack.control.attitude_backstepping import CONTROLLER as BACKSTEPPING
from flightstack.control.attitude_pid import CONTROLLER as PID
from flightstack.core.contract import LoopFlags, LoopRow, LoopStatus
from flightstack.core.errors import TargetError, WrongFirmwareError
from flightstack.firmware.c_loops import CLoops
from flightstack.firmware.pil.client import DEFAULT_TIMING, PilTiming
from flightstack.firmware.pil.target_loops import FINAL_ATTEMPTS, TargetLoops
from flightstack.firmware.targets import finish_loops
from flightstack.params.vehicle import load_vehicle
from gcs_cli.pil.result import target_checks
from gcs_cli.pil.target_record import STATES, read_record
from tests.firmware.app_support import SAFE, Target, mavlink
from tests.support.lossy_line import NO_FAULTS, LineFaults, LossyLine
from tests.support.pil_setups import HASH, SPEEDS, setup, sil

WEATHERS = {
    "fair": NO_FAULTS,
    "loses octets": LineFaults(loss=5e-4),
    "changes octets": LineFaults(change=5e-4),
    "doubles pieces": LineFaults(doubling=0.2),
    "delays beyond the time-out": LineFaults(delay=0.02),
    "is noisy": LineFaults(noise=0.2),
    "does everything": LineFaults(2e-4, 2e-4, 0.1, 0.01, 0.3, 0.1),
}


@pytest.fixture
def device() -> Iterator[Target]:
    target = Target()
    yield target
    target.close()


def connected(line: LossyLine, controller=PID, **options: object) -> CLoops:
    of = setup(controller)
    executor = TargetLoops(line, of.numbers(), clock_s=line.clock, expected_hash=HASH, **options)  # type: ignore[arg-type]
    return CLoops("serial:test", executor, of)


def drive(
    loops: CLoops, ticks: int, seed: int = 3, each_tick: Callable[[], object] = lambda: None
) -> np.ndarray:
    """Step with random inputs, resets, given targets and changes of gains; return the rows with the target."""
    rng = np.random.default_rng(seed)
    rows = []
    names = [spec.name for spec in loops.parameter_specs]
    integral_gains = [name for name in names if name.startswith("PID_") and name.endswith("_I")]
    assert len(integral_gains) in (0, 3)
    for tick in range(ticks):
        state = np.concatenate([rng.normal(size=6), [1.0, 0.0, 0.0, 0.0], rng.normal(size=3) * 0.3])
        state[6:10] += rng.normal(size=4) * 0.1
        state[6:10] /= np.linalg.norm(state[6:10])
        wish = rng.normal(size=11)
        if rng.random() < 0.01:
            loops.reset(state)
        gain = rng.uniform(1.0, 4.0)
        if rng.random() < 0.02:
            loops.set_parameter("POS_XY_P", gain)
            assert loops.get_parameter("POS_XY_P") == np.float32(gain)
        if rng.random() < 0.05:  # one after another, as a slider does: each scales what is summed
            for name in integral_gains:
                for number in rng.uniform(1.0, 50.0, 3):
                    loops.set_parameter(name, number)
        outer = tick % 5 == 0
        target = np.array([*state[6:10], 9.0])
        if outer and rng.random() < 0.2:
            loops.set_attitude_target(target)
            outer = False
        each_tick()
        row = np.zeros(LoopRow.SIZE)
        loops.step(state, wish, SPEEDS, outer, row)
        rows.append(np.concatenate([row, loops.attitude_target]))
    return np.array(rows)


@pytest.mark.parametrize("name", WEATHERS)
@pytest.mark.parametrize("controller", [PID, BACKSTEPPING], ids=["pid", "backstepping"])
def test_whatever_the_line_does_the_target_computes_what_c_does_here(device, name, controller) -> None:
    line = LossyLine(device, WEATHERS[name], seed=7)
    loops = connected(line, controller)
    assert np.array_equal(drive(loops, 1000), drive(sil(controller), 1000))
    loops.close()
    assert line.is_closed
    executor = loops.executor
    assert isinstance(executor, TargetLoops)
    counters, steps = executor.counters, executor.record.steps
    assert steps["step"].tolist() == list(range(1000))  # none skipped, none twice
    status = executor.record.status
    assert status is not None
    assert status["steps"] == 1000
    assert (counters.resent > 0) == (name not in ("fair", "doubles pieces"))
    assert (status["repeats"] + status["out_of_order"] > 0) == (name != "fair")


@pytest.mark.parametrize("name", WEATHERS)
def test_short_steps_fly_the_rotor_commands_of_c(device, name) -> None:
    """The attitude target and status too, and the attitude reference before each outer tick."""
    line = LossyLine(device, WEATHERS[name], seed=7)
    loops = connected(line, short=True)
    short, full = drive(loops, 1000), drive(sil(), 1000)
    loops.close()
    same = [*range(13), *range(31, short.shape[1])]
    assert np.array_equal(short[:, same], full[:, same])
    reference = LoopRow.REFERENCE_ATTITUDE
    assert np.array_equal(short[4::5, reference], full[4::5, reference])
    assert np.isnan(short[:4, reference]).all()
    assert np.isnan(short[:, LoopRow.WRENCH]).all()


@pytest.mark.parametrize("name", WEATHERS)
def test_windows_of_steps_make_the_outputs_of_single_ones(device, name) -> None:
    """And of C here, with a change of a gain in between; the latency of the line is paid once per window."""
    rng = np.random.default_rng(2)
    inputs = rng.normal(size=(400, 29)) * 0.3
    inputs[:, 6] += 1.0
    flags = [LoopFlags.RESET if at == 0 else LoopFlags.OUTER_DUE if at % 5 == 0 else 0 for at in range(400)]
    line = LossyLine(device, WEATHERS[name], seed=7)
    executors = [connected(line).executor, sil().executor]
    began_s, made = line.now_s, []
    for executor in executors:
        first = executor.run(flags[:123], inputs[:123])
        executor.set("POS_XY_P", 2.5)
        made.append(np.concatenate([first, executor.run(flags[123:], inputs[123:])]))
    assert np.array_equal(*made)
    if name == "fair":  # 1 ms in each direction, 8 steps in a window
        assert line.now_s - began_s == pytest.approx(0.002 * (math.ceil(123 / 8) + 1 + math.ceil(277 / 8)))


def test_firmware_of_another_protocol_is_refused_in_one_sentence(device) -> None:
    class Older:
        """Firmware from before there were versions: the extension fields of its identity are missing."""

        def __getattr__(self, name: str) -> object:
            return getattr(device, name)

        def take(self) -> bytes:
            answers = b""
            for message in device.heard():
                if message.get_type() == "FS_PIL_IDENTITY":
                    message.protocol = message.window = 0
                answers += bytes(message.pack(mavlink.MAVLink(None, 1, 1)))
            return answers

    line = LossyLine(Older())
    with pytest.raises(
        WrongFirmwareError,
        match=r"line: its firmware speaks version 0 of the target protocol, not 4: flash it",
    ):
        TargetLoops(line, setup().numbers(), clock_s=line.clock, expected_hash=HASH)


def test_a_gain_that_is_set_again_in_flight_changes_no_bit(device) -> None:
    """A late copy of the host's own, or a ground station that writes all parameters back."""
    flown = connected(LossyLine(device))

    def again() -> None:
        for name in ("PID_ROLL_I", "PID_PITCH_I", "PID_YAW_I"):
            value = flown.get_parameter(name)
            device.ask(mavlink.MAVLink_param_set_message(1, 1, name.encode(), value, 9))

    assert np.array_equal(drive(flown, 200, each_tick=again), drive(sil(), 200))


def test_the_same_seed_gives_the_same_link(device) -> None:
    counted = []
    for _ in range(2):
        target = Target()
        loops = connected(LossyLine(target, WEATHERS["does everything"], seed=5))
        drive(loops, 300)
        executor = loops.executor
        assert isinstance(executor, TargetLoops)
        counted.append(executor.counters)
        target.close()
    assert counted[0] == counted[1]
    assert counted[0].resent > 0


def test_all_numbers_are_on_the_target_before_the_first_step(device) -> None:
    numbers = setup(BACKSTEPPING).numbers()
    connected(LossyLine(device, WEATHERS["loses octets"], seed=1), BACKSTEPPING)
    told = {}
    for message in device.ask(mavlink.MAVLink_param_request_list_message(1, 1)):
        if message.get_type() == "PARAM_VALUE":
            told[message.param_id] = message.param_value
    assert len(told) > len(numbers)
    assert {name: told[name] for name in numbers} == {n: np.float32(v) for n, v in numbers.items()}


@pytest.mark.parametrize("name", ["paper_quad", "x_quad"])
def test_any_vehicle_takes_the_place_of_the_one_built_in(device, name) -> None:
    """Of whose numbers some are -0: they are 0 afterwards."""
    numbers = setup()._replace(vehicle=load_vehicle(name)).numbers()
    line = LossyLine(device)
    executor = TargetLoops(line, numbers, clock_s=line.clock, expected_hash=HASH)
    assert executor.get("FS_MASS") == np.float32(numbers["FS_MASS"])


def test_a_line_that_is_cut_ends_the_flight_with_a_sentence(device) -> None:
    line = LossyLine(device)
    loops = connected(line)
    drive(loops, 10)
    line.is_cut = True
    with pytest.raises(TargetError, match=r"on the lossy line did not answer step 10, sent 20 times"):
        drive(loops, 1)
    assert line.now_s < 10.0
    loops.close()
    assert line.is_closed


def test_a_target_that_restarts_in_flight_ends_it_with_a_sentence(device) -> None:
    class Restarted:
        def __init__(self) -> None:
            self.now = device

        def __getattr__(self, name: str) -> object:
            return getattr(self.now, name)

    changing = Restarted()
    loops = connected(LossyLine(changing))
    drive(loops, 10)
    other = Target()
    changing.now = other
    with pytest.raises(TargetError, match=r"expects step 0, not 10: it may have been restarted"):
        drive(loops, 1)
    other.close()


def test_bad_input_ends_the_flight_and_the_target_has_stopped_its_rotors(device) -> None:
    loops = connected(LossyLine(device))
    drive(loops, 10)
    state = np.array([math.nan] + [0.0] * 5 + [1.0] + [0.0] * 6)
    with pytest.raises(TargetError, match=r"stopped its rotors at step 10 because of invalid input"):
        loops.step(state, np.zeros(11), SPEEDS, True, np.zeros(LoopRow.SIZE))
    assert device.state == SAFE


def checks_of(loops: CLoops, folder: Path, ticks: int) -> list[str]:
    """End a flight; return what its verdict holds against the target."""
    finish_loops(loops, folder / "flight.ulg")
    return [check.name for check in target_checks(read_record(folder), ticks) if not check.passed]


def test_each_flight_is_judged_by_what_happened_in_it(device, tmp_path) -> None:
    loops = connected(LossyLine(device))
    drive(loops, 10)
    bad = np.array([math.nan] + [0.0] * 5 + [1.0] + [0.0] * 6)
    with pytest.raises(TargetError, match="invalid input"):
        loops.step(bad, np.zeros(11), SPEEDS, True, np.zeros(LoopRow.SIZE))
    assert checks_of(loops, tmp_path / "first", 10) == ["safe states of the target"]
    first = read_record(tmp_path / "first")
    assert (first.steps, first.bad_inputs, first.counted["safe_states"]) == (11, 1, 1)
    assert first.ending is not None
    assert "invalid input" in first.ending
    loops = connected(LossyLine(device))
    drive(loops, 20)
    assert checks_of(loops, tmp_path / "second", 20) == []
    second = read_record(tmp_path / "second")
    assert (second.counted["safe_states"], second.counted["steps"]) == (0, 20)
    assert (second.at_start["safe_states"], second.at_start["steps"]) == (1, first.status["steps"])
    assert STATES[second.at_start["state"]] == "safe state"


def test_a_target_that_is_lost_after_the_last_step_is_not_trusted(tmp_path) -> None:
    late = Target(
        ticks=(index * 3_000_000 for index in range(10_000))
    )  # of 200 MHz: a step takes longer than 2 ms
    line = LossyLine(late)
    loops = connected(line)
    drive(loops, 10)
    line.is_cut = True
    began_s = line.now_s
    failed = checks_of(loops, tmp_path, 10)
    assert failed == ["counters that the target did not tell", "steps that overran their period"]
    assert read_record(tmp_path).ending is None
    assert line.now_s - began_s == pytest.approx(FINAL_ATTEMPTS * DEFAULT_TIMING.timeout_s)
    late.close()


def test_the_farewell_outlasts_a_line_that_loses_much(device, tmp_path) -> None:
    for seed in range(20):
        line = LossyLine(device, seed=seed)
        loops = connected(line)
        drive(loops, 3)
        line.faults = LineFaults(loss=0.005)  # a third of all exchanges
        assert checks_of(loops, tmp_path / str(seed), 3) == []


def test_a_slow_line_has_its_own_time_for_the_farewell(device, tmp_path) -> None:
    line = LossyLine(device)
    loops = connected(line, timing=PilTiming(2.0, 20))
    drive(loops, 3)
    line.faults = LineFaults(delay=1.0, delay_s=0.9)
    assert checks_of(loops, tmp_path, 3) == []


def test_other_firmware_is_refused_with_both_hashes(device) -> None:
    of = setup()
    line = LossyLine(device)
    with pytest.raises(
        WrongFirmwareError, match=r"0102030405060708, on test board .*\(ff{15}\): flash it again"
    ):
        TargetLoops(line, of.numbers(), clock_s=line.clock, expected_hash=b"\xff" * 8)


def test_loops_of_double_are_refused() -> None:
    target = Target(real="double")
    line = LossyLine(target)
    with pytest.raises(WrongFirmwareError, match="compute with 64 bits, not with 32"):
        TargetLoops(line, setup().numbers(), clock_s=line.clock, expected_hash=HASH)
    target.close()


def test_a_silent_line_is_no_target() -> None:
    class Nobody:
        def give(self, data: bytes) -> None: ...

        def take(self) -> bytes:
            return b""

        def poll(self, passed_ms: int) -> None: ...

    line = LossyLine(Nobody())
    with pytest.raises(TargetError, match="did not answer 20 requests for FS_PIL_IDENTITY"):
        TargetLoops(line, setup().numbers(), clock_s=line.clock, expected_hash=HASH)
    assert line.now_s == pytest.approx(5.0)


def test_a_line_full_of_noise_is_no_target() -> None:
    class Noise:
        def __init__(self) -> None:
            self._random = np.random.default_rng(2)

        def give(self, data: bytes) -> None: ...

        def take(self) -> bytes:
            return self._random.bytes(50)

        def poll(self, passed_ms: int) -> None: ...

    line = LossyLine(Noise())
    with pytest.raises(TargetError, match="did not answer 20 requests for FS_PIL_IDENTITY"):
        TargetLoops(line, setup().numbers(), clock_s=line.clock, expected_hash=HASH)
    assert line.now_s < 6.0


def test_what_is_left_of_a_flight_beside_its_log(device, tmp_path) -> None:
    loops = connected(LossyLine(device, WEATHERS["does everything"], seed=11))
    drive(loops, 1)  # the trial at the start
    loops.reset(np.array([0.0] * 6 + [1.0] + [0.0] * 6))
    drive(loops, 200)
    finish_loops(loops, tmp_path / "flight.ulg")
    told = json.loads((tmp_path / "pil-link.json").read_text())
    assert told["identity"] == {
        "board": "test board with a name o",
        "compiler": ("compiler of " + "many words " * 5)[:47].strip(),
        "source_hash": HASH.hex(),
        "cost_unit": "cycles",
        "clock_hz": 200_000_000,
        "real_octets": 4,
        "char_bits": 8,
        "protocol": 4,
        "window": 8,
        "baud": 115_200,
        "clock_overhead": 0,
    }
    assert told["steps"] == 200
    assert told["ending"] is None
    assert told["status"]["stack_size"] == 4096
    assert told["status"]["stack_high_water"] == 321
    assert told["link"]["resent"] > 0
    assert told["round_trip_s"]["min"] == pytest.approx(0.002)
    steps = np.load(tmp_path / "pil-steps.npz")["steps"]
    assert steps["step"].tolist() == list(range(1, 201))
    assert steps["flags"][0] & LoopFlags.RESET
    assert steps["attempts"].max() > 1


def test_a_result_that_is_not_finite_repeats_the_last_row_as_in_c(device) -> None:
    """Finite inputs whose squares are not: the target keeps its place and says so."""
    both = connected(LossyLine(device)), sil()
    huge = np.array([0.0] * 6 + [1.0, 0.0, 0.0, 0.0] + [3e38] * 3)
    for loops in both:
        drive(loops, 6)
    rows = [np.zeros(LoopRow.SIZE), np.zeros(LoopRow.SIZE)]
    for loops, row in zip(both, rows, strict=True):
        loops.step(huge, np.zeros(11), SPEEDS, False, row)
    assert int(rows[0][LoopRow.STATUS]) & (LoopStatus.OUTPUT_NOT_FINITE | LoopStatus.INPUT_NOT_FINITE)
    assert np.array_equal(rows[0], rows[1])
