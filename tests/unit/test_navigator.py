"""The modes besides the mission: takeoff, hold, land, return; and a state that is not finite."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flightstack.core.contract import Vector3
from flightstack.core.enums import Mode
from tests.support.perfect_vehicle import PerfectVehicle


def in_air(north=0.0, east=0.0, down=-5.0, **params: float) -> PerfectVehicle:
    vehicle = PerfectVehicle(**params)
    vehicle.airborne_at(north, east, down)
    return vehicle


def test_takeoff_rises_straight_to_its_altitude_at_its_speed() -> None:
    vehicle = PerfectVehicle(MPC_TKO_SPEED=1.2)
    vehicle.enter(Mode.TAKEOFF, 4.0)
    vehicle.run(15.0)
    path = np.array(vehicle.path)
    assert vehicle.position == pytest.approx([0.0, 0.0, -4.0], abs=1e-6)
    assert np.abs(path[:, :2]).max() == 0.0
    assert -np.diff(path[:, 2]).min() * 50.0 == pytest.approx(1.2, rel=0.004)
    assert not vehicle.navigator.landed


@settings(max_examples=40)
@given(st.floats(-8.0, 8.0), st.floats(-8.0, 8.0), st.floats(-2.0, 1.5))
def test_hold_stops_ahead_and_never_goes_back_far(north: float, east: float, sink: float) -> None:
    """The hold's point is where the reference comes to rest."""
    vehicle = in_air(down=-50.0)
    vehicle.state[3:6] = north, east, sink
    vehicle.navigator.goal.trajectory[3:6] = north, east, sink
    vehicle.enter(Mode.HOLD)
    vehicle.run(15.0)
    path = np.array(vehicle.path)
    end = vehicle.position
    assert np.abs(vehicle.state[3:6]).max() < 1e-4
    speed = math.hypot(north, east)
    if speed > 0.1:
        along = (path[:, :2] @ (north, east)) / speed
        assert along.max() <= math.hypot(*end[:2]) + 0.08  # 0.045 m seen, at 1 m/s


def test_hold_keeps_the_heading_and_a_turn_in_progress_stops() -> None:
    vehicle = in_air()
    vehicle.plan((115, 270.0, 0.0, 1.0, 1.0), (93, 10.0))
    vehicle.enter(Mode.MISSION)
    vehicle.run(2.0)
    turned = vehicle.turned
    vehicle.enter(Mode.HOLD)
    vehicle.run(5.0)
    assert math.degrees(vehicle.turned - turned) < 30.0  # braking from 60 deg/s
    settled = vehicle.turned
    vehicle.run(3.0)
    assert vehicle.turned == pytest.approx(settled, abs=1e-3)


def test_land_descends_where_it_is_and_detects_the_ground() -> None:
    vehicle = in_air(3.0, -2.0, -8.0)
    vehicle.enter(Mode.LAND)
    vehicle.until(lambda: vehicle.navigator.landed)
    path = np.array(vehicle.path)
    assert np.abs(path[:, :2] - (3.0, -2.0)).max() < 1e-9
    sink = np.diff(path[:, 2]) * 50.0
    assert sink.max() == pytest.approx(1.5, rel=0.004)
    assert sink[path[1:, 2] > -2.0].max() == pytest.approx(0.7, abs=0.01)


@pytest.mark.parametrize(
    ("start", "top"),
    [((30.0, 40.0, -5.0), 15.0), ((30.0, 40.0, -25.0), 25.0), ((3.0, 4.0, -5.0), 5.0)],
    ids=["climbs to the return altitude", "is higher already", "is near: does not climb"],
)
def test_return_climbs_goes_home_and_lands(start: tuple[float, float, float], top: float) -> None:
    vehicle = in_air(*start)
    vehicle.enter(Mode.RETURN)
    vehicle.until(lambda: vehicle.navigator.landed)
    path = np.array(vehicle.path)
    assert path[:, 2].min() == pytest.approx(-top, abs=0.02)
    assert vehicle.position[:2] == pytest.approx([0.0, 0.0], abs=1e-3)
    far = np.hypot(path[:, 0], path[:, 1]) > 1.0
    assert (
        path[far & (np.abs(path[:, 0] - start[0]) > 0.5)][:, 2].max() <= -top + 0.42
    )  # on the way at that height


def test_the_return_speed_and_altitude_are_parameters() -> None:
    vehicle = in_air(100.0, 0.0, -5.0, RTL_RETURN_ALT=30.0, MPC_XY_CRUISE=7.0, RTL_MIN_DIST=1.0)
    vehicle.enter(Mode.RETURN)
    vehicle.until(lambda: vehicle.position[0] < 2.0)
    assert vehicle.position[2] == pytest.approx(-30.0, abs=0.02)
    assert -np.diff(np.array(vehicle.path)[:, 0]).min() * 50.0 == pytest.approx(7.0, rel=0.004)


@pytest.mark.parametrize("mode", list(Mode))
@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_nothing_moves_while_the_state_is_not_finite(mode: Mode, bad: float) -> None:
    vehicle = in_air()
    vehicle.plan((16, 0.0, 0.0, 0.0, math.nan, 5.0, 0.0, -5.0))
    vehicle.enter(mode, 8.0)
    vehicle.run(1.0)
    n = vehicle.navigator
    memories = (n.setpoint, *n.goal[:7])
    before = [memory.copy() for memory in memories]
    state = vehicle.state.copy()
    state[7] = bad
    for _ in range(10):
        n.step(mode, state, np.array([1.0, 0.0, 0.0, 0.0, 10.0]), 10.0)
    for memory, kept in zip(memories, before, strict=True):
        for field in memory.dtype.names or (...,):  # not the bytes between the fields of a record
            np.testing.assert_array_equal(memory[field], kept[field])


def test_only_items_that_need_the_air_fly() -> None:
    """A mission on the ground starts its rotors for a takeoff, not for a wait, a heading or a landing."""
    vehicle = PerfectVehicle()
    for command, flies in ((22, True), (16, True), (19, True), (93, False), (115, False), (21, False)):
        vehicle.plan((command, 5.0, 0.0, 0.0, 0.0, 0.0, 0.0, -2.0))
        vehicle.enter(Mode.MISSION)
        assert vehicle.navigator.mission_flies == flies, command
    vehicle.plan()
    assert not vehicle.navigator.mission_flies


def test_a_finished_mission_holds_at_its_last_place() -> None:
    vehicle = in_air()
    vehicle.plan((16, 0.0, 0.0, 0.0, math.nan, 8.0, 0.0, -5.0))
    vehicle.enter(Mode.MISSION)
    vehicle.until_finished()  # half a metre before it
    vehicle.navigator.hold_at_last_item()
    vehicle.mode = Mode.HOLD
    vehicle.run(8.0)
    assert vehicle.position == pytest.approx([8.0, 0.0, -5.0], abs=1e-4)


# ---------------------------------------------------------------------- resets of the estimate, and lost positions


def test_reset_of_the_estimate_shifts_the_reference_and_not_the_goal() -> None:
    vehicle = in_air()
    vehicle.enter(Mode.HOLD)
    vehicle.navigator.reposition(20.0, 0.0, -5.0, math.nan)
    vehicle.run(2.0)
    error = vehicle.navigator.setpoint[:6] - vehicle.state[:6]
    step, speed = Vector3(3.0, -4.0, 1.0), Vector3(0.5, 0.25, -0.125)
    vehicle.state[:3] += step
    vehicle.state[3:6] += speed
    vehicle.navigator.shift(Mode.HOLD, step, speed, 0.25)
    assert vehicle.navigator.setpoint[:6] - vehicle.state[:6] == pytest.approx(error)
    vehicle.run(0.01)
    assert vehicle.navigator.setpoint[:6] - vehicle.state[:6] == pytest.approx(error, abs=0.05)
    vehicle.run(20.0)
    assert vehicle.position == pytest.approx([20.0, 0.0, -5.0], abs=0.05)


def test_landing_goes_on_above_the_same_ground_after_a_reset_of_the_estimate() -> None:
    vehicle = in_air(down=-10.0)
    vehicle.enter(Mode.LAND)
    vehicle.run(2.0)
    step = Vector3(30.0, -20.0, 0.0)
    vehicle.state[:3] += step
    vehicle.navigator.shift(Mode.LAND, step, Vector3(0.0, 0.0, 0.0), 0.0)
    vehicle.run(3.0)
    assert vehicle.position[:2] == pytest.approx(step[:2], abs=1e-6)


def test_landing_without_a_position_brakes_and_goes_down_where_it_is() -> None:
    vehicle = in_air(down=-10.0)
    vehicle.state[3:6] = 3.0, 0.0, 0.0
    vehicle.navigator.reset_reference(vehicle.state)
    assert vehicle.navigator.set_known(position=False, velocity=True)
    assert not vehicle.navigator.set_known(position=False, velocity=True)
    vehicle.enter(Mode.LAND)
    vehicle.run(0.5)
    assert 1.0 < vehicle.state[3] < 3.0
    vehicle.run(3.0)
    assert abs(vehicle.state[3]) < 0.05
    assert vehicle.position[:2] == pytest.approx([0.0, 0.0])  # the setpoint is where the vehicle is
    assert vehicle.position[2] > -8.0


def test_landing_without_a_velocity_demands_no_tilt() -> None:
    vehicle = in_air(down=-10.0)
    vehicle.state[3:6] = 3.0, -1.0, 0.0
    vehicle.navigator.set_known(position=False, velocity=False)
    vehicle.enter(Mode.LAND)
    vehicle.run(1.0)
    setpoint = vehicle.navigator.setpoint
    assert (setpoint[6:8] == 0.0).all()
    assert setpoint[3:5] == pytest.approx(vehicle.state[3:5])
