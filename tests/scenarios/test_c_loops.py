"""Missions on the loops in C: software in the loop."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from pyulog import ULog

from flightstack.core.contract import LoopFlags, LoopRow, LoopStatus
from flightstack.core.errors import ConfigError, TargetError
from flightstack.firmware.c_loops import CLoops, HostLoops
from flightstack.firmware.toolchain import build as building
from flightstack.firmware.toolchain.build import host_library
from flightstack.mavlink.dialect import mavlink
from flightstack.params.config import StackConfig
from flightstack.process.assembly import build
from gcs_cli.report.analysis import read_flight
from tests.firmware.app_support import Target
from tests.parity.recorded_loops import record
from tests.support.lossy_line import LineFaults, LossyLine
from tests.support.plan_items import item
from tests.support.plugin_site import example_module
from tests.support.truth import World

SPEEDS = np.zeros(8, np.float32)


def flown(**config: object) -> World:
    world = World(**config)
    world.upload("square.plan")
    world.arm()
    world.start_mission()
    world.run_until("not armed")
    return world


@pytest.mark.parametrize("controller", ["pid", "backstepping"])
def test_a_mission_in_c_is_the_mission_in_python(controller: str) -> None:
    in_c, in_python = (flown(loops=loops, controller=controller) for loops in ("c", "python"))
    assert in_c.reached == in_python.reached == [0, 1, 2, 3, 4, 5]
    assert in_c.time_s == pytest.approx(in_python.time_s, abs=0.1)
    assert in_c.state.position_ned_m == pytest.approx(in_python.state.position_ned_m, abs=1e-4)
    assert in_c.engine.stack.loops.get_parameter("POS_XY_P") == pytest.approx(
        in_python.engine.stack.loops.get_parameter("POS_XY_P"), rel=1e-7
    )


def test_two_flights_in_c_leave_the_same_log(tmp_path) -> None:
    one, other = flown(loops="c"), flown(loops="c")
    assert one.flight().log.content == other.flight().log.content
    log = tmp_path / "flight.ulg"
    log.write_bytes(one.flight().log.content)
    info = read_flight(log).info
    assert info["loops"] == "c"
    assert str(info["ver_loops"]).startswith("C, float, sources ")


def test_the_log_tells_when_the_loops_begin_and_when_guidance_gives_the_target(tmp_path) -> None:
    world = World(loops="c")
    world.gcs.streams["offboard"] = lambda: mavlink.MAVLink_set_attitude_target_message(
        0, 1, 1, 0b00000111, [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0, 0.75
    )
    world.takeoff(3.0)
    world.arm()
    world.takeoff(3.0)
    world.run_until("altitude_m > 2.9")
    world.set_mode("OFFBOARD")
    world.run_for(0.5)
    world.set_mode("HOLD")
    world.run_for(0.5)
    world.land()
    world.run_until("not armed")
    log = tmp_path / "flight.ulg"
    log.write_bytes(world.flight().log.content)
    (data,) = (d for d in ULog(str(log)).data_list if d.name == "vehicle_attitude_setpoint")
    flags = data.data["loop_flags"]
    assert set(flags) >= {0, LoopFlags.OUTER_DUE, LoopFlags.SET_TARGET}
    takeoff, touchdown = np.flatnonzero(flags & LoopFlags.RESET)
    assert flags[:takeoff].tolist() == [0] * takeoff
    assert flags[touchdown] == LoopFlags.RESET | LoopFlags.SET_TARGET
    given = np.flatnonzero(flags == LoopFlags.SET_TARGET)
    assert np.count_nonzero(np.diff(given) == 1) + 1 >= 40


def test_parameters_reach_c_in_flight() -> None:
    world = World(loops="c", params={"POS_XY_P": 2.5})
    assert world.engine.stack.loops.get_parameter("POS_XY_P") == 2.5
    assert world.engine.stack.params.set("POS_XY_P", 3.25) is None
    assert world.engine.stack.loops.get_parameter("POS_XY_P") == 3.25
    with pytest.raises(KeyError):
        world.engine.stack.loops.get_parameter("FS_MASS")
    with pytest.raises(KeyError):
        world.engine.stack.loops.set_parameter("NO_SUCH", 1.0)


def test_c_with_double_computes_what_python_does_over_a_whole_mission() -> None:
    """The backend's own code is in between: inputs, flags, rows."""
    flight = record("square.plan")
    executor = HostLoops(host_library("double"), flight.numbers)
    largest = 0.0
    for row in range(len(flight.flags)):
        executor.input[:13], executor.input[13:24] = flight.states[row], flight.setpoints[row]
        executor.input[24:] = flight.targets[row]
        executor.step(int(flight.flags[row]))
        assert executor.output[31] == flight.status[row]
        largest = max(largest, float(np.abs(executor.output[:31] - flight.outputs[row]).max()))
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
        setup_of.loops.executor.set("FS_MASS", -1.0)
    with pytest.raises(KeyError):
        setup_of.loops.executor.set("NOT_THERE", 1.0)


@pytest.mark.parametrize(
    ("word", "sentence"),
    [
        ("fortran", "is not one of python, c, host"),
        ("c:", "is not one of"),
        ("serial", "has no device"),
        ("serial:", "has no device"),
        ("serial:/dev/ttyS9:5", "baud rate below the minimum of 1200"),
        ("serial:/dev/ttyS9:20000001", "baud rate above the maximum"),
    ],
)
def test_other_loops_are_refused_in_one_sentence(word: str, sentence: str) -> None:
    with pytest.raises(ConfigError, match=sentence):
        build(StackConfig(loops=word), lambda: None)


def test_user_controller_flies_in_generated_c(monkeypatch) -> None:
    controller = example_module().CONTROLLER
    monkeypatch.setattr("flightstack.process.config_check.load_controller", lambda _: controller)
    in_c, in_python = (flown(loops=loops, controller="lqr") for loops in ("c", "python"))
    assert in_c.reached == in_python.reached == [0, 1, 2, 3, 4, 5]
    assert in_c.state.position_ned_m == pytest.approx(in_python.state.position_ned_m, abs=1e-4)  # 1e-6 seen
    loops = in_c.engine.stack.loops
    assert loops.get_parameter("LQR_ANGLE_ROLL") == pytest.approx(200.0)
    loops.set_parameter("LQR_ANGLE_ROLL", 150.0)
    assert loops.get_parameter("LQR_ANGLE_ROLL") == 150.0


def test_without_a_compiler_one_sentence_says_what_to_do(monkeypatch) -> None:
    building.host_compiler.cache_clear()
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr(building.shutil, "which", lambda _: None)
    monkeypatch.setattr(building, "compiler_version", lambda _: "")
    with pytest.raises(ConfigError, match="no C compiler found: tried cc, gcc, clang and zig"):
        build(StackConfig(loops="c"), lambda: None)
    building.host_compiler.cache_clear()


def test_loops_of_a_target_fly_in_lockstep_alone() -> None:
    with pytest.raises(ConfigError, match="require lockstep"):
        build(StackConfig(loops="host", lockstep=False), lambda: None)


def test_a_landing_and_a_second_flight_in_c() -> None:
    world = World(loops="c")
    world.upload([item(22, z=2.0), item(21)])
    for _ in range(2):
        world.arm()
        world.start_mission()
        world.run_until("not armed")
    assert len(world.engine.logs) == 2


# ------------------------------------------------------------------ on a target


@pytest.fixture
def on_a_bad_line(monkeypatch) -> Iterator[list[LossyLine]]:
    """Let ``--loops host`` mean the application at the end of a bad line; yield the lines that were opened."""
    device, lines = Target(), []

    def open_bad_line(_: object) -> LossyLine:
        lines.append(LossyLine(device, LineFaults(2e-4, 2e-4, 0.05, 0.002, 0.3, 0.02), seed=4))
        return lines[-1]

    monkeypatch.setattr("flightstack.firmware.targets.open_link", open_bad_line)
    monkeypatch.setattr("flightstack.firmware.pil.target_loops.source_hash", lambda: bytes(range(1, 9)))
    yield lines
    device.close()


def story(loops: str) -> World:
    """Take off, go somewhere with other gains, fly by a given attitude, and land."""
    world = World(loops=loops)
    world.gcs.streams["attitude"] = lambda: mavlink.MAVLink_set_attitude_target_message(
        0, 1, 1, 0b00000111, [0.9997, 0.0247, 0.0, 0.0], 0.0, 0.0, 0.0, 0.5
    )
    world.arm()
    world.takeoff(3.0)
    world.run_until("altitude_m > 2.9")
    for name, value in (("POS_XY_P", 2.2), ("PID_ROLL_I", 0.01), ("MPC_TILTMAX_AIR", 20.0)):
        assert world.engine.stack.params.set(name, value) is None
    world.run_for(1.0)
    world.set_mode("OFFBOARD")
    world.run_for(0.5)
    world.set_mode("HOLD")
    world.run_for(1.0)
    world.land()
    world.run_until("not armed")
    return world


def test_a_flight_on_a_target_behind_a_bad_line_is_the_flight_in_c(on_a_bad_line, tmp_path) -> None:
    logs = []
    for loops in ("host", "c"):
        world = story(loops)
        log = tmp_path / f"{loops}.ulg"
        log.write_bytes(world.flight().log.content)
        logs.append(ULog(str(log)))
        if loops == "host":
            (line,) = on_a_bad_line
            executor = world.engine.stack.loops.executor
            world.engine.stack.loops.close()
            assert line.is_closed
            assert executor.record.status["repeats"] > 10
    for there, here in zip(*(log.data_list for log in logs), strict=True):
        assert there.name == here.name
        for name in here.data:
            assert np.array_equal(there.data[name], here.data[name], equal_nan=True), f"{here.name}.{name}"
    flags = logs[0].get_dataset("vehicle_attitude_setpoint").data["loop_flags"]
    assert np.count_nonzero(flags == LoopFlags.SET_TARGET) > 40


def test_a_mission_ends_with_a_sentence_when_the_line_is_cut(on_a_bad_line) -> None:
    world = World(loops="host")
    world.upload("hop.plan")
    world.arm()
    world.start_mission()
    world.run_until("altitude_m > 0.3")
    on_a_bad_line[0].is_cut = True
    with pytest.raises(TargetError, match=r"did not answer step \d+, sent 20 times"):
        world.run_for(0.1)
