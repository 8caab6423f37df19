"""Missions on the loops in C: software in the loop."""

from __future__ import annotations

import numpy as np
import pytest

from flightstack.assembly import build
from flightstack.config import StackConfig
from flightstack.contract import LoopFlags, LoopRow, LoopStatus
from flightstack.firmware.build import host_library
from flightstack.firmware.c_loops import CLoops
from flightstack.firmware.host_library import HostLoops
from flightstack.mavlink.dialect import mavlink
from flightstack.params.errors import ConfigError
from gcs_cli.analysis import read_flight
from tests.parity.recorded_loops import record
from tests.support.world import World, item

SPEEDS = np.zeros(8, np.float32)


def flown(**config: object) -> World:
    world = World(**config)
    world.upload("square.plan")
    world.start_mission()
    world.until_disarmed()
    return world


@pytest.mark.parametrize("controller", ["pid", "backstepping"])
def test_a_mission_in_c_is_the_mission_in_python(controller: str) -> None:
    in_c, in_python = (flown(loops=loops, controller=controller) for loops in ("c", "python"))
    assert in_c.reached == in_python.reached == [0, 1, 2, 3, 4, 5]
    assert in_c.time_s == pytest.approx(in_python.time_s, abs=0.1)
    assert in_c.position == pytest.approx(in_python.position, abs=1e-4)
    assert in_c.stack.loops.get_parameter("POS_XY_P") == pytest.approx(
        in_python.stack.loops.get_parameter("POS_XY_P"), rel=1e-7
    )


def test_two_flights_in_c_leave_the_same_log(tmp_path) -> None:
    one, other = flown(loops="c"), flown(loops="c")
    assert one.log == other.log
    log = tmp_path / "flight.ulg"
    log.write_bytes(one.log)
    info = read_flight(log).info
    assert info["loops"] == "c"
    assert str(info["ver_loops"]).startswith("C, float, sources ")


def test_the_log_tells_when_the_loops_begin_and_when_guidance_gives_the_target(tmp_path) -> None:
    from pyulog import ULog  # noqa: PLC0415

    world = World(loops="c")
    world.streams["offboard"] = lambda: mavlink.MAVLink_set_attitude_target_message(
        0, 1, 1, 0b00000111, [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0, 0.75
    )
    world.takeoff(3.0)
    world.arm()
    world.takeoff(3.0)
    world.until(lambda: world.altitude > 2.9)
    world.command(mavlink.MAV_CMD_DO_SET_MODE, 1, 6)
    world.run(0.5)
    world.hold()
    world.run(0.5)
    world.land()
    world.until_disarmed()
    log = tmp_path / "flight.ulg"
    log.write_bytes(world.log)
    (data,) = (d for d in ULog(str(log)).data_list if d.name == "vehicle_attitude_setpoint")
    flags = data.data["loop_flags"]
    assert set(flags) >= {0, LoopFlags.OUTER_DUE, LoopFlags.SET_TARGET}
    begins = np.flatnonzero(flags & LoopFlags.RESET)
    assert len(begins) == 1
    assert flags[: begins[0]].tolist() == [0] * begins[0]
    given = np.flatnonzero(flags == LoopFlags.SET_TARGET)
    assert np.count_nonzero(np.diff(given) == 1) + 1 >= 40


def test_parameters_reach_c_in_flight() -> None:
    world = World(loops="c", params=("POS_XY_P=2.5",))
    assert world.stack.loops.get_parameter("POS_XY_P") == 2.5
    assert world.stack.params.set("POS_XY_P", 3.25) is None
    assert world.stack.loops.get_parameter("POS_XY_P") == 3.25
    with pytest.raises(KeyError):
        world.stack.loops.get_parameter("FS_MASS")
    with pytest.raises(KeyError):
        world.stack.loops.set_parameter("NO_SUCH", 1.0)


def test_c_with_double_computes_what_python_does_over_a_whole_mission() -> None:
    """The backend's own code is in between: inputs, flags, rows."""
    flight = record("square.plan")
    computer = HostLoops(host_library("double"), flight.numbers)
    largest = 0.0
    for row in range(len(flight.flags)):
        computer.input[:13], computer.input[13:24] = flight.states[row], flight.setpoints[row]
        computer.input[24:] = flight.targets[row]
        computer.step(int(flight.flags[row]))
        assert computer.output[31] == flight.status[row]
        largest = max(largest, float(np.abs(computer.output[:31] - flight.outputs[row]).max()))
    assert len(flight.flags) > 10_000
    assert largest < 1e-7  # rotor commands of some hundred rad/s


def test_a_state_that_is_not_finite_repeats_the_last_row() -> None:
    stack = build(StackConfig(loops="c"), lambda: None)
    loops, state = stack.loops, stack.simulator.state.copy()
    sound, row = np.zeros(LoopRow.SIZE), np.zeros(LoopRow.SIZE)
    loops.reset(state)
    loops.step(state, np.zeros(11), SPEEDS, True, sound)
    assert sound[LoopRow.STATUS] == 0
    for bad in (np.nan, np.inf, 1e300):
        state[0] = bad
        loops.step(state, np.zeros(11), SPEEDS, True, row)
        assert row[LoopRow.STATUS] == LoopStatus.INPUT_NOT_FINITE
        assert row[: LoopRow.STATUS].tolist() == sound[: LoopRow.STATUS].tolist()


def test_an_idle_vehicle_stands_as_with_python() -> None:
    rows = []
    for loops in ("c", "python"):
        stack = build(StackConfig(loops=loops), lambda: None)
        for armed in (False, True):
            row = np.full(LoopRow.SIZE, 7.0)
            stack.loops.idle(stack.simulator.state, SPEEDS, armed, row)
            rows.append(row.tolist())
    assert rows[:2] == rows[2:]
    assert rows[0] != rows[1]


def test_a_number_that_c_refuses_is_named() -> None:
    setup_of = build(StackConfig(loops="c"), lambda: None)
    assert isinstance(setup_of.loops, CLoops)
    with pytest.raises(ValueError, match="FS_MASS=-1 is out of range"):
        setup_of.loops.computer.set("FS_MASS", -1.0)
    with pytest.raises(KeyError):
        setup_of.loops.computer.set("NOT_THERE", 1.0)


@pytest.mark.parametrize(
    ("word", "sentence"),
    [
        ("fortran", "is none of python, c, host"),
        ("c:", "is none of"),
        ("serial", "names no device"),
        ("serial:", "names no device"),
        ("serial:/dev/ttyS9:5", "baud rate that no port has"),
    ],
)
def test_other_loops_are_refused_in_one_sentence(word: str, sentence: str) -> None:
    with pytest.raises(ConfigError, match=sentence):
        build(StackConfig(loops=word), lambda: None)


def test_a_controller_of_python_alone_cannot_fly_in_c(monkeypatch) -> None:
    from tests.support.failing_controller import CONTROLLER  # noqa: PLC0415

    monkeypatch.setattr("flightstack.assembly.load_controller", lambda _: CONTROLLER)
    with pytest.raises(ConfigError, match="exists in Python alone; in C there are pid, backstepping"):
        build(StackConfig(loops="c"), lambda: None)


def test_without_a_compiler_one_sentence_says_what_to_do(monkeypatch) -> None:
    from flightstack.firmware import build as building  # noqa: PLC0415

    building.host_compiler.cache_clear()
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr(building.shutil, "which", lambda _: None)
    monkeypatch.setattr(building, "_version", lambda _: "")
    with pytest.raises(ConfigError, match="there is no C compiler: tried cc, gcc, clang and zig"):
        build(StackConfig(loops="c"), lambda: None)
    building.host_compiler.cache_clear()


def test_loops_of_a_target_fly_in_lockstep_alone() -> None:
    with pytest.raises(ConfigError, match="fly in lockstep alone"):
        build(StackConfig(loops="host", lockstep=False), lambda: None)


def test_a_landing_and_a_second_flight_in_c() -> None:
    world = World(loops="c")
    world.upload([item(22, z=2.0), item(21)])
    for _ in range(2):
        world.start_mission()
        world.until_disarmed()
    assert len(world.logs) == 2
