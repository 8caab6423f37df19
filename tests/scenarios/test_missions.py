"""Whole missions in one process, in simulated time, on the bytes that go over the wire."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import numpy as np
import pytest

from flightstack.core.contract import Vector3
from gcs_cli.report.analysis import read_flight
from gcs_cli.report.summary import RunInfo, summarise
from tests.support.plan_items import item
from tests.support.truth import World

SQUARE = [(10.0, 0.0, -3.0), (10.0, 10.0, -5.0), (0.0, 10.0, -4.0), (0.0, 0.0, -3.0)]

# the fastest of the paper's loops needs 1 kHz (paper/errata: gain margin 3.8 dB at 500 Hz)
GAINS = [("tuned", 500.0, 100.0), ("paper", 1000.0, 250.0)]


def fly_square(**options: object) -> tuple[World, list[Vector3]]:
    world = World(**options)
    world.upload("square.plan")
    world.arm()
    world.start_mission()
    path = []
    while world.state.armed:
        world.run_for(0.02)
        path.append(world.state.position_ned_m)
        assert world.time_s < 60.0, world.texts
    return world, path


@pytest.mark.parametrize("controller", ["pid", "backstepping"])
@pytest.mark.parametrize("vehicle", ["paper_quad", "x_quad"])
def test_square_is_flown_through_every_corner_and_ends_disarmed_at_home(
    vehicle: str, controller: str
) -> None:
    world, path = fly_square(vehicle=vehicle, controller=controller)
    assert world.reached == [0, 1, 2, 3, 4, 5]
    assert "Mission finished" in world.texts
    for corner in SQUARE:
        miss = min(math.dist(position, corner) for position in path)
        assert miss < 0.6, corner  # acceptance radius 0.5 m; largest miss seen 0.51 m
    # lands on its spot: 9 mm off at most in the four flights
    assert np.linalg.norm(world.state.position_ned_m[:2]) < 0.05
    assert abs(world.state.altitude_m) < 0.01


@pytest.mark.parametrize("controller", ["pid", "backstepping"])
@pytest.mark.parametrize(("gains", "inner_hz", "outer_hz"), GAINS)
@pytest.mark.parametrize("plant", ["rigid", "paper"])
def test_both_controllers_fly_with_both_sets_of_gains_on_both_plants(
    controller: str, gains: str, inner_hz: float, outer_hz: float, plant: str
) -> None:
    world, _ = fly_square(
        controller=controller, gains=gains, inner_hz=inner_hz, outer_hz=outer_hz, plant=plant
    )
    assert world.reached == [0, 1, 2, 3, 4, 5]
    assert abs(world.state.altitude_m) < 0.01


def test_ideal_rotors_fly_the_papers_gains_without_limits() -> None:
    world, _ = fly_square(controller="backstepping", gains="paper", inner_hz=1000.0, ideal_rotors=True)
    assert world.reached == [0, 1, 2, 3, 4, 5]


def test_every_mission_item_is_flown() -> None:
    world = World()
    world.upload("every_item.plan")
    assert {item.command for item in world.plan.items} == {16, 19, 20, 21, 22, 93, 115, 177, 178}
    world.arm()
    world.start_mission()
    world.run_until("not armed", 120.0)
    # item 6 jumps back to 2 once; item 9 always jumps over the landing (10) to the return
    assert world.reached == [0, 1, 2, 3, 4, 5, 6, 2, 3, 4, 5, 6, 7, 8, 9, 11]
    assert np.linalg.norm(world.state.position_ned_m[:2]) < 0.05


def test_a_landing_in_the_middle_of_a_mission_is_followed_by_a_second_takeoff() -> None:
    world = World()
    hop = [item(22, z=2.0), item(21, north=3.0), item(93, p1=2.0), item(22, z=2.0), item(21)]
    world.upload(hop)
    world.arm()
    world.start_mission()
    world.run_until(lambda _: 1 in world.reached)
    world.run_for(1.0)
    assert world.state.landed
    assert world.state.armed
    world.run_until("not armed")
    assert world.reached == [0, 1, 2, 3, 4]
    assert world.texts.count("Takeoff detected") == 2


def test_wind_and_gusts_are_withstood() -> None:
    world, path = fly_square(vehicle="x_quad", wind=(5.0, -3.0, 0.0), gust=1.0, seed=3)
    assert world.reached == [0, 1, 2, 3, 4, 5]
    for corner in SQUARE:
        assert min(math.dist(position, corner) for position in path) < 0.7  # 0.55 m seen


def test_gusty_torque_is_withstood() -> None:
    """Its standard deviation about roll and pitch is 7 % of the torque that the rotors have there."""
    world, path = fly_square(vehicle="x_quad", torque_gust=0.2, seed=3)
    assert world.reached == [0, 1, 2, 3, 4, 5]
    for corner in SQUARE:
        assert min(math.dist(position, corner) for position in path) < 0.5  # 0.26 m seen
    assert np.linalg.norm(world.state.position_ned_m[:2]) < 0.1  # 0.044 m seen
    _, calm = fly_square(vehicle="x_quad", seed=3)
    assert max(math.dist(a, b) for a, b in zip(path, calm, strict=False)) > 0.02  # 0.06 m seen


def test_constant_torque_is_integrated_away() -> None:
    world = World(torque=(0.02, 0.0, 0.0))
    world.takeoff(3.0)
    world.arm()
    world.run_until("mode == 'HOLD'")
    world.run_for(15.0)
    assert math.dist(world.state.position_ned_m, (0.0, 0.0, -3.0)) < 0.02  # 3 mm seen


def test_same_seed_gives_the_same_log_byte_for_byte_and_another_seed_another() -> None:
    options = {"vehicle": "x_quad", "gust": 1.5}
    logs = [fly_square(seed=seed, **options)[0].flight().log.content for seed in (5, 5, 6)]
    assert len(logs[0]) > 1_000_000
    assert logs[0] == logs[1]
    assert logs[0] != logs[2]


@pytest.mark.parametrize(
    ("inner_hz", "outer_hz"), [(250.0, 50.0), (500.0, 100.0), (1000.0, 100.0), (400.0, 400.0)]
)
def test_the_rates_are_free(inner_hz: float, outer_hz: float) -> None:
    world = World(inner_hz=inner_hz, outer_hz=outer_hz)
    world.upload("hop.plan")
    world.arm()
    world.start_mission()
    world.run_until("not armed", 60.0)
    assert world.reached == [0, 1]


def test_the_reference_is_followed_closely() -> None:
    """The tracking error of a smooth leg in still air: reference model and feed-forward leave millimetres."""
    world = World()
    world.upload("square.plan")
    world.arm()
    world.start_mission()
    errors = []
    while world.state.armed:
        world.run_for(0.01)
        if not world.state.landed:
            errors.append(math.dist(world.state.position_ned_m, world.engine.stack.now.setpoint[:3]))
    assert max(errors[: -int(1.0 / 0.01)]) < 0.25
    assert float(np.sqrt(np.mean(np.square(errors)))) < 0.08


def test_an_upright_vehicle_keeps_its_integrators_quiet_on_the_ground() -> None:
    """Armed and waiting, nothing winds up: the takeoff after a long wait is the takeoff after a short one."""
    climbs = []
    for wait_s in (0.0, 20.0):
        world = World()
        world.arm()
        world.run_for(wait_s)
        world.takeoff(2.0)
        world.run_for(3.0)
        climbs.append(world.state.position_ned_m)
    for a, b in itertools.pairwise(climbs):
        assert np.allclose(a, b, atol=1e-3)  # 4e-6 seen


@pytest.mark.parametrize(
    ("height_m", "least_m"),
    [pytest.param(5.0, 5.0, id="high"), pytest.param(1.0, 2.5, id="lower than MIS_TAKEOFF_ALT")],
)
def test_a_mission_that_begins_with_a_waypoint_rises_before_it_sets_out(
    height_m: float, least_m: float
) -> None:
    world = World()
    world.upload([item(16, north=8.0, z=height_m), item(21, north=8.0, z=0.0)])
    world.arm()
    world.start_mission()
    aside_m, highest_m = 0.0, 0.0
    while world.state.armed:
        world.run_for(0.02)
        highest_m = max(highest_m, world.state.altitude_m)
        if highest_m < least_m - 0.5:
            aside_m = max(aside_m, abs(world.state.north_m))
        assert world.time_s < 60.0, world.texts
    assert world.reached == [0, 1]
    assert aside_m < 0.02  # 0.001 m seen: straight up to within NAV_MC_ALT_RAD
    assert highest_m > least_m - 0.45
    assert abs(world.state.north_m - 8.0) < 0.1


def test_a_mission_that_goes_on_after_a_landing_rises_from_there() -> None:
    world = World(params={"COM_DISARM_LAND": -1})
    world.upload([
        item(22, z=3.0), item(16, north=6.0, z=3.0), item(21, north=6.0, z=0.0), item(16, north=12.0, z=3.0),
        item(21, north=12.0, z=0.0),
    ])  # fmt: skip
    world.arm()
    world.start_mission()
    world.run_until(lambda _: 2 in world.reached, 60.0)
    farthest_m = world.state.north_m
    while world.state.altitude_m < 2.0:
        world.run_for(0.02)
        farthest_m = max(farthest_m, world.state.north_m)
        assert world.time_s < 60.0, world.texts
    assert farthest_m < 6.1
    world.run_until(lambda _: 4 in world.reached, 60.0)
    assert abs(world.state.north_m - 12.0) < 0.1


def test_the_figures_of_a_flight_in_wind_leave_out_the_ground(tmp_path: Path) -> None:
    """The vehicle skips over the ground for 1.5 s until it is found landed; the setpoint sinks by 1 m meanwhile."""
    world, _ = fly_square(vehicle="x_quad", wind=(5.0, -3.0, 0.0), gust=1.0, seed=7)
    log = tmp_path / "flight.ulg"
    log.write_bytes(world.flight().log.content)
    summary = summarise(read_flight(log), world.plan, RunInfo("completed", "square.plan"))
    assert summary["max_tracking_error_m"] < 0.15  # 0.105 m seen; 0.62 m with the ground
    assert summary["max_attitude_error_deg"] < 10.0  # 8.1° seen; 30° with the ground
    assert summary["sim_time_s"] - summary["flight_time_s"] > 2.0
    assert [row["overshoot_m"] for row in summary["waypoints"]] == [
        pytest.approx(overshoot_m, abs=0.02) if overshoot_m is not None else None
        for overshoot_m in (0.0, 0.20, 0.0, 0.27, 0.31, None)
    ]
