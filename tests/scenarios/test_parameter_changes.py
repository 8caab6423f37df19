"""Parameters that change while the vehicle flies, and what the log tells of them."""

from __future__ import annotations

import io
import math
from dataclasses import replace

import numpy as np
import pytest
from pyulog import ULog

from flightstack.core.contract import LoopRow
from flightstack.mavlink.dialect import mavlink
from tests.support.plan_items import item
from tests.support.truth import World

LONG_WAY = [item(22, z=3.0), item(16, north=200.0, z=3.0), item(16, north=400.0, z=3.0), item(20)]


def cruising(**config) -> World:
    world = World(**config)
    world.upload(LONG_WAY)
    world.arm()
    world.start_mission()
    world.run_until(lambda s: s.velocity_ned_m_s.x > 3.9)
    return world


def test_a_new_cruise_speed_is_flown_at_once() -> None:
    world = cruising()
    assert world.engine.stack.params.set("MPC_XY_CRUISE", 7.0) is None
    before = world.engine.stack.now.setpoint[3]
    world.run_for(0.02)
    assert world.engine.stack.now.setpoint[3] > before, "the reference speeds up with the next outer tick"
    world.run_for(5.0)
    assert world.state.velocity_ned_m_s.x == pytest.approx(7.0, abs=0.02)
    world.engine.stack.params.set("MPC_XY_CRUISE", 2.0)
    world.run_for(6.0)
    assert world.state.velocity_ned_m_s.x == pytest.approx(2.0, abs=0.02)


def test_a_speed_that_the_mission_has_set_stays() -> None:
    world = World()
    world.upload([item(22, z=3.0), replace(item(178), param2=3.0), item(16, north=200.0, z=3.0)])
    world.arm()
    world.start_mission()
    world.run_until(lambda s: s.velocity_ned_m_s.x > 2.95)
    world.engine.stack.params.set("MPC_XY_CRUISE", 8.0)
    world.run_for(4.0)
    assert world.state.velocity_ned_m_s.x == pytest.approx(3.0, abs=0.02)


@pytest.mark.parametrize(("controller", "gain"), [("pid", "PID_ROLL_P"), ("backstepping", "BS_ROLL_C1")])
def test_a_gain_acts_on_the_next_tick(controller: str, gain: str) -> None:
    """Two flights that are equal up to the change: the next row's torque is the new gain's."""
    changed, same = (
        cruising(controller=controller, wind=(0.0, 3.0, 0.0), gust=1.0, drag=True) for _ in range(2)
    )
    assert changed.engine.stack.now.row.tolist() == same.engine.stack.now.row.tolist()
    params = changed.engine.stack.params
    params.set(gain, 2.0 * params.value(gain))
    for world in (changed, same):
        world.tick()
    row, reference = changed.engine.stack.now.row, same.engine.stack.now.row
    roll = LoopRow.WRENCH.start + 1
    assert row[roll] != reference[roll]
    assert row[LoopRow.STATE].tolist() == reference[LoopRow.STATE].tolist(), "what is seen is still the same"
    assert row[roll + 1 : roll + 3].tolist() == reference[roll + 1 : roll + 3].tolist(), (
        "other axes are not touched"
    )
    changed.run_for(3.0)
    assert changed.state.velocity_ned_m_s.x == pytest.approx(4.0, abs=0.3)


def test_a_ground_station_changes_a_gain_in_flight_and_is_told() -> None:
    world = cruising()
    world.gcs.send(mavlink.MAVLink_param_set_message(1, 1, b"POS_XY_P", 6.1, mavlink.MAV_PARAM_TYPE_REAL32))
    world.run_for(0.1)
    assert world.engine.stack.loops.get_parameter("POS_XY_P") == 6.1
    assert world.gcs.received["PARAM_VALUE"].param_id == "POS_XY_P"
    assert world.gcs.received["PARAM_VALUE"].param_value == pytest.approx(6.1)
    world.gcs.send(
        mavlink.MAVLink_param_set_message(1, 1, b"POS_XY_P", math.nan, mavlink.MAV_PARAM_TYPE_REAL32)
    )
    world.run_for(0.1)
    assert world.engine.stack.params.value("POS_XY_P") == 6.1
    assert any("POS_XY_P" in text for text in world.texts)


def test_an_integral_gain_changes_without_a_bump() -> None:
    """A steady torque is held by the integral: halving or removing its gain leaves the torque where it is."""
    world = World(torque=(0.05, 0.0, 0.0))
    world.arm()
    world.takeoff(4.0)
    world.run_until("mode == 'HOLD'")
    world.run_for(4.0)
    held = float(world.engine.stack.now.row[LoopRow.WRENCH][1])
    assert held == pytest.approx(-0.05, abs=2e-3)
    world.engine.stack.params.set("PID_ROLL_I", world.engine.stack.params.value("PID_ROLL_I") / 2.0)
    highest = lowest = held
    for _ in range(250):
        world.tick()
        torque = float(world.engine.stack.now.row[LoopRow.WRENCH][1])
        highest, lowest = max(highest, torque), min(lowest, torque)
    assert highest - lowest < 1e-3  # a step would be 0.025 N m


def test_less_tilt_is_flown_with_less_tilt() -> None:
    world = cruising()
    world.engine.stack.params.set("MPC_TILTMAX_AIR", 5.0)
    world.engine.stack.params.set("MPC_XY_CRUISE", 12.0)
    tilts = []
    for _ in range(400):
        world.tick()
        x, y = world.engine.stack.now.attitude_target[1:3]
        tilts.append(math.degrees(math.acos(1.0 - 2.0 * (x * x + y * y))))
    assert max(tilts[5:]) <= 7.2  # 5° on each axis at most
    assert max(tilts) > 4.9


def test_gains_are_given_like_any_parameter_and_ask_for_the_same_flight() -> None:
    given = World(params={"PID_ROLL_P": 120, "pos_xy_p": 6})
    assert (given.engine.stack.params.value("PID_ROLL_P"), given.engine.stack.params.value("POS_XY_P")) == (
        120.0,
        6.0,
    )
    later = World()
    later.engine.stack.params.set("PID_ROLL_P", 120.0)
    later.engine.stack.params.set("POS_XY_P", 6.0)
    for world in (given, later):
        world.upload([item(22, z=2.0), item(16, north=5.0, z=2.0), item(21, north=5.0)])
        world.arm()
        world.start_mission()
        world.run_for(4.0)
    assert given.state.position_ned_m == later.state.position_ned_m
    assert given.state.position_ned_m != World().state.position_ned_m


def test_a_change_that_is_taken_back_leaves_no_trace() -> None:
    """Every parameter of the loops to an end of its range and back: the same numbers, bit for bit."""
    flights = [World(), World()]
    params = flights[1].engine.stack.params
    backend = flights[1].engine.stack.loops
    for spec in backend.parameter_specs:
        end = spec.low if spec.name == "POS_THR_MIN" else spec.high  # at most POS_THR_MAX
        assert params.set(spec.name, end) is None
        assert backend.get_parameter(spec.name) == pytest.approx(end, rel=1e-12)
        params.reset([spec.name])
    for world in flights:
        world.arm()
        world.takeoff(3.0)
        world.run_for(3.0)
    assert flights[0].state.position_ned_m == flights[1].state.position_ned_m


def test_the_log_holds_all_parameters_and_their_changes() -> None:
    world = World(params={"MPC_YAW_MODE": 5, "POS_XY_P": 8})
    world.arm()
    world.takeoff(2.0)
    world.run_for(2.0)
    changed_us = world.engine.stack.now.time_us
    world.engine.stack.params.set("MPC_XY_CRUISE", 6.5)
    world.engine.stack.params.set("MPC_YAW_MODE", 0)
    world.run_for(1.0)
    world.disarm(force=True)
    log = ULog(io.BytesIO(world.flight().log.content))
    begin = log.initial_parameters
    assert set(begin) == set(world.engine.stack.params.specs)
    assert (begin["MPC_YAW_MODE"], begin["POS_XY_P"]) == (5, 8.0)
    for name, spec in world.engine.stack.params.specs.items():
        assert isinstance(begin[name], int) == spec.is_integer
        assert begin[name] == pytest.approx(np.float32(begin[name]))
    assert [(name, value) for _, name, value in log.changed_parameters] == [
        ("MPC_XY_CRUISE", 6.5),
        ("MPC_YAW_MODE", 0),
    ]
    assert all(abs(time_us - changed_us) <= 10_000 for time_us, _, _ in log.changed_parameters)
