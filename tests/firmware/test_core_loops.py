"""The loops in C behave as ``PythonLoops``: resets, given targets, unsound inputs, changed gains, any rotor set."""

from __future__ import annotations

import functools
import math
import re
from pathlib import Path

import numpy as np
import pytest

from flightstack.control.controller_loading import load_controller
from flightstack.core.contract import LoopStatus
from flightstack.firmware.numbers import target_numbers
from flightstack.params.gains_file import open_gains
from flightstack.params.vehicle import load_vehicle
from tests.firmware.both_loops import DIVISOR, FLOWN, INNER_HZ, TILT_RAD, both, run_python
from tests.firmware.core_samples import Sequence, sequence
from tests.firmware.core_support import (
    CORE,
    DRIVER,
    EXACT,
    OUTER_DUE,
    PARTS,
    RESET,
    Core,
    Loops,
    compiler,
    run_tool,
    same_bits,
    sources,
)


def assert_same(made: np.ndarray, expected: np.ndarray) -> None:
    """Compare outputs of double to the last bit."""
    for name, part in PARTS.items():
        assert same_bits(made[:, part], expected[:, part]), name


@functools.cache
def shaken_in_python(name: str) -> tuple[Sequence, np.ndarray, np.ndarray]:
    """Return inputs, outputs and status of a shaken vehicle."""
    controller, vehicle = FLOWN[name]
    inputs = sequence(5000, 41, vehicle().weight_n)
    return inputs, *run_python(both(controller, vehicle())[0], inputs)


@pytest.mark.parametrize("name", FLOWN)
def test_a_shaken_vehicle_is_answered_as_by_python(name: str) -> None:
    controller, vehicle = FLOWN[name]
    inputs, expected, expected_status = shaken_in_python(name)
    made, status = both(controller, vehicle())[1].run(*inputs)
    assert np.array_equal(status, expected_status)
    assert_same(made, expected)
    assert {0, LoopStatus.INPUT_NOT_FINITE} <= set(status.tolist())


def level(count: int, flags: int) -> Sequence:
    """Return ticks at rest, one metre below the setpoint and a little beside it."""
    states, setpoints, targets = np.zeros((count, 13)), np.zeros((count, 11)), np.zeros((count, 5))
    states[:, 6] = targets[:, 0] = 1.0
    states[:, 0:2] = 0.1  # so that the target leans and integrals grow
    setpoints[:, 2] = -1.0
    return Sequence(states, setpoints, targets, np.full(count, flags, np.uint16))


def test_a_changed_gain_keeps_what_its_integral_gives() -> None:
    python, c = both("pid", load_vehicle("paper_quad"))
    ticks = level(200, OUTER_DUE)
    for name, value, factors in (
        ("PID_ROLL_I", 50.0, [4.0, 1.0, 1.0]),
        ("PID_ROLL_I", 1.0, [50.0, 1.0, 1.0]),
        ("PID_ROLL_I", 2.0, [0.5, 1.0, 1.0]),
        ("PID_PITCH_I", 0.0, [1.0, 0.0, 1.0]),
        ("PID_YAW_P", 12.5, [1.0, 1.0, 1.0]),
        ("MPC_TILTMAX_AIR", 20.0, [1.0, 1.0, 1.0]),
    ):
        assert_same(c.run(*ticks)[0], run_python(python, ticks)[0])
        python.set_parameter(name, value)
        before = c.integrals
        assert c.set(name, value) == 0
        assert c.get(name) == value
        assert c.integrals == pytest.approx([i * factor for i, factor in zip(before, factors, strict=True)])
        assert before[0] != 0.0
        assert before[1] != 0.0
    assert_same(c.run(*ticks)[0], run_python(python, ticks)[0])


@pytest.mark.parametrize("real", ["float", "double"])
def test_a_gain_that_is_set_again_changes_no_bit(real: str) -> None:
    """A host that hears no answer sets again; integral * gain / gain is often another integral."""
    python, c = both("pid", load_vehicle("paper_quad"), real)
    gains = [f"PID_{axis}_I" for axis in ("ROLL", "PITCH", "YAW")]
    memory = python.memories["attitude"]
    for value in np.random.default_rng(2).uniform(1.0, 100.0, 50).tolist():
        for name in gains:
            python.set_parameter(name, value)
            assert c.set(name, value) == 0
        run_python(python, level(3, OUTER_DUE))
        c.run(*level(3, OUTER_DUE))
        before = [*c.integrals[:2], *memory.tolist()]
        for name in gains:
            python.set_parameter(name, value)
            assert c.set(name, value) == 0
        assert [*c.integrals[:2], *memory.tolist()] == before
    assert all(before[:2])  # the integrals of roll and pitch have grown


def test_an_integral_too_large_to_be_carried_over_is_dropped() -> None:
    _, c = both("pid", load_vehicle("paper_quad"))
    c.core.call("drive_set_integral", c.memory, c.core.c_real(1e308))
    assert c.set("PID_ROLL_I", 1e-3) == 0
    assert c.integrals == [0.0, 1e308, 1e308]


@pytest.mark.parametrize("axis", range(3))
def test_each_gain_carries_its_own_integral_over(axis: int) -> None:
    _, c = both("pid", load_vehicle("paper_quad"))
    name = ("PID_ROLL_I", "PID_PITCH_I", "PID_YAW_I")[axis]
    assert c.set(name, 2.0) == 0
    c.core.call("drive_set_integral", c.memory, c.core.c_real(1.0))
    assert c.set(name, 4.0) == 0
    assert c.integrals == [0.5 if each == axis else 1.0 for each in range(3)]


def test_another_law_starts_without_memory() -> None:
    _, c = both("pid", load_vehicle("paper_quad"))
    c.run(*level(100, OUTER_DUE))
    assert any(c.integrals)
    assert c.set("FS_CTRL", 0.0) == 0
    assert any(c.integrals)
    assert c.set("FS_CTRL", 1.0) == 0
    assert not any(c.integrals)


@pytest.mark.parametrize("real", ["float", "double"])
def test_an_unsound_tick_repeats_the_last_sound_one(real: str) -> None:
    _, c = both("pid", load_vehicle("x_quad"), real)
    ticks = level(3, OUTER_DUE)
    ticks.states[1, 4] = np.nan
    made, status = c.run(*ticks)
    assert status.tolist()[1] == LoopStatus.INPUT_NOT_FINITE
    assert np.array_equal(made[1, 5:], made[0, 5:])
    assert not np.array_equal(made[2, 5:], made[0, 5:])
    ticks = level(2, 0)
    ticks.states[1, 10:] = 1e38 if real == "float" else 1e308
    made, status = c.run(*ticks)
    assert status.tolist()[1] == LoopStatus.OUTPUT_NOT_FINITE
    assert np.array_equal(made[1], made[0])


def test_a_reset_at_an_unsound_state_repeats_nothing() -> None:
    _, c = both("pid", load_vehicle("x_quad"))
    state, setpoint, target, flags = sequence(40, 3, 10.0)
    flags[:] = OUTER_DUE
    flags[0] = flags[-1] = RESET | OUTER_DUE
    state[-1, 0] = math.nan
    rows, status = c.run(state, setpoint, target, flags)
    assert np.count_nonzero(rows[-2]) > 20
    assert status[-1] == LoopStatus.INPUT_NOT_FINITE
    assert np.array_equal(rows[-1, :4], state[-1, 6:10])
    assert not rows[-1, 4:].any()


def test_a_reset_at_an_attitude_that_is_no_number_leaves_no_target() -> None:
    python, c = both("pid", load_vehicle("x_quad"))
    ticks = level(4, OUTER_DUE)
    ticks.states[1, 6] = math.nan
    ticks.flags[1:] = RESET, 0, OUTER_DUE
    (_, made), (_, expected) = c.run(*ticks), run_python(python, ticks)
    assert made.tolist() == expected.tolist()
    assert made[1:3].tolist() == [LoopStatus.INPUT_NOT_FINITE] * 2


def test_a_setpoint_that_is_no_number_keeps_the_target() -> None:
    _, c = both("pid", load_vehicle("x_quad"))
    ticks = level(6, OUTER_DUE)
    ticks.setpoints[3, 9] = np.nan
    ticks.setpoints[4, 0] = np.inf
    made, status = c.run(*ticks)
    assert not (status & LoopStatus.INPUT_NOT_FINITE).any()
    assert np.array_equal(made[3, :5], made[2, :5])
    assert np.array_equal(made[4, :5], made[2, :5])


def with_own(file: str, instead_of: str, real: str, folder: Path) -> Core:
    """Compile the core with a file of the tests instead of one of its own."""
    define = ["-DFS_DOUBLE"] if real == "double" else []
    files = [path for path in sources() if path.name != instead_of]
    flags = ["-O1", f"-I{files[0].parent}", "-shared", "-fPIC", "-fno-math-errno"]
    library = folder / "core.so"
    own = DRIVER.with_name(file)
    run_tool([compiler(), *EXACT, *define, *flags, *files, own, DRIVER, "-lm", "-o", library])
    return Core(real, library)


@pytest.fixture
def without_nan(tmp_path: Path, request: pytest.FixtureRequest) -> Core:
    """Return the core for a processor on which sine and cosine are numbers for any angle."""
    return with_own("math_without_nan.c", "fs_math.c", request.param, tmp_path)


@pytest.mark.parametrize("without_nan", ["float", "double"], indirect=True)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_yaw_without_a_sine_keeps_the_target_also_without_nan(without_nan: Core, sign: float) -> None:
    """Beyond 10^4 rad, in Python as well; up to there it is flown."""
    vehicle, law = load_vehicle("x_quad"), load_controller("pid")
    numbers = target_numbers(vehicle, law, open_gains("tuned"), TILT_RAD, INNER_HZ, DIVISOR)
    python, _ = both("pid", vehicle)
    ticks = level(6, OUTER_DUE)
    largest = np.finfo(without_nan.dtype).max
    ticks.setpoints[:, 9] = sign * np.array([0.0, 1e4, 10_000.1, 2.1e4, 3e4, largest])
    made, status = Loops(without_nan, numbers).run(*ticks)
    assert not (status & (LoopStatus.INPUT_NOT_FINITE | LoopStatus.OUTPUT_NOT_FINITE)).any()
    assert not np.array_equal(made[1, :5], made[0, :5])
    assert all(np.array_equal(row, made[1, :5]) for row in made[2:, :5])
    flown, _ = run_python(python, ticks)
    assert not np.array_equal(flown[1, :5], flown[0, :5])
    assert all(np.array_equal(row, flown[1, :5]) for row in flown[2:, :5])


def test_each_law_is_given_its_period_its_memory_and_the_attitude(tmp_path: Path) -> None:
    core = with_own("laws_that_tell.c", "fs_controllers.c", "double", tmp_path)
    ticks = level(DIVISOR + 1, 0)
    ticks.flags[::DIVISOR] = OUTER_DUE
    ticks.states[-1, 6:10] = 0.5
    Loops(core, {"FS_INNER_HZ": 400.0}).run(*ticks)
    told = core.unwritten(10)
    core.call("laws_told", told)
    assert told[:4].tolist() == [DIVISOR / 400.0, DIVISOR / 400.0, 1.0 / 400.0, 1.0 / 400.0]
    assert told[4:6].tolist() == [2.0, DIVISOR + 1.0]  # steps of guidance and mixer
    assert told[6:].tolist() == [0.5] * 4


@pytest.mark.parametrize(("divisor", "period"), [(5, 5), (1, 1), (0, 1), (65_535, 65_535)])
def test_rate_groups_begin_with_the_outer_loop_and_come_back_to_it(divisor: int, period: int) -> None:
    due = np.zeros(140_000, np.uint16)
    Core("float").call("drive_rate_groups", divisor, due.size, due)
    assert np.array_equal(due, np.where(np.arange(due.size) % period == 0, OUTER_DUE, 0))


@pytest.mark.parametrize("real", ["float", "double"])
def test_infinities_of_both_signs_do_not_make_up_for_each_other(real: str) -> None:
    """In every pair of places: a processor without NaN may give a number for their sum."""
    numbers = target_numbers(
        load_vehicle("x_quad"), load_controller("pid"), open_gains("tuned"), 0.6, 500.0, 5
    )
    places = [(i, j) for i in range(13) for j in range(13) if i != j]
    ticks = level(len(places) + 1, OUTER_DUE)
    for tick, (i, j) in enumerate(places, start=1):
        ticks.states[tick, i], ticks.states[tick, j] = np.inf, -np.inf
    made, status = Loops(Core(real), numbers).run(*ticks)
    assert (status[1:] == LoopStatus.INPUT_NOT_FINITE).all()
    assert (made[1:] == made[0]).all()
    setpoints = level(12, OUTER_DUE)
    for place in range(11):
        setpoints.setpoints[place + 1, place], setpoints.setpoints[place + 1, (place + 1) % 11] = (
            np.inf,
            -np.inf,
        )
    made, status = Loops(Core(real), numbers).run(*setpoints)
    assert not (status & LoopStatus.INPUT_NOT_FINITE).any()
    assert (made[1:, :5] == made[0, :5]).all()  # the target stays


def test_no_test_for_finite_numbers_adds_them_up() -> None:
    """The core compares each number: the C28x does not promise a NaN for the difference of two infinities."""
    text = (CORE / "fs_loops.c").read_text()
    bodies = re.findall(r"static uint16_t \w+_is_(?:finite|sound)\(.*?\n}", text, re.DOTALL)
    assert len(bodies) == 7
    assert not any(re.search(r" [-+] ", body) for body in bodies)


@pytest.mark.parametrize("real", ["float", "double"])
def test_least_thrust_above_the_largest_is_refused_in_c(real: str) -> None:
    c = Loops(Core(real), {})
    assert c.set("POS_THR_MAX", 8.0) == 0
    assert c.set("POS_THR_MIN", 8.5) == 1
    assert c.set("POS_THR_MIN", 8.0) == 0
    assert c.set("POS_THR_MAX", 7.5) == 1
    assert (c.get("POS_THR_MIN"), c.get("POS_THR_MAX")) == (8.0, 8.0)
