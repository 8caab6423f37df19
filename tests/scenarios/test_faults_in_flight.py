"""Faults and disturbances of the simulator in a hover of the whole stack."""

from __future__ import annotations

import numpy as np
import pytest

from sim_bridge.plant.dimensions import propeller_radius_m
from tests.support.truth import World

BOTH_PLANTS = pytest.mark.parametrize("plant", ["rigid", "multibody"])


def hovering(**options: object) -> World:
    world = World(**options)  # type: ignore[arg-type]
    world.arm()
    world.takeoff(5.0)
    world.run_until("mode == 'HOLD'")
    world.run_for(3.0)
    return world


def land(world: World) -> None:
    world.land()
    world.run_until("not armed", 60.0)


def told(world: World, words: str) -> bool:
    return any(words in text for text in world.texts)


def squares(world: World) -> np.ndarray:
    return world.engine.simulator.frame.rotor_speed_rad_s[:4].astype(float) ** 2


@BOTH_PLANTS
def test_hover_carries_a_payload_beside_its_centre_and_drops_it(plant: str) -> None:
    """Thrust and torques are those of the weight at its place; the plus frame has its arms on the axes."""
    world = hovering(plant=plant)
    vehicle, before = world.engine.stack.vehicle, squares(world)
    payload_kg, x = 0.1, 0.04
    world.fault(f"payload {payload_kg} at {x},0,0.05")
    world.run_for(10.0)
    share = payload_kg / vehicle.mass_kg
    after, arm = squares(world), vehicle.rotors[0].position_frd_m[0]
    thrust = vehicle.rotors[0].thrust_coefficient_n_s2
    assert after.sum() / before.sum() == pytest.approx(1.0 + share, rel=1e-3)  # measured: 2.4e-4
    torque = (after[0] - after[2]) * thrust * arm
    assert torque == pytest.approx(payload_kg * 9.81 * x, rel=1e-3)  # measured: 5e-5
    assert after[1] - after[3] == pytest.approx(0.0, abs=1e-6 * after.sum())  # measured: 0
    world.fault("payload cut")
    world.run_for(10.0)
    assert squares(world) == pytest.approx(before, rel=1e-3)  # measured: 3.4e-4
    assert world.state.altitude_m == pytest.approx(5.0, abs=0.01)  # measured: 0.002
    land(world)


def test_hover_leans_against_a_wind_that_begins() -> None:
    world = hovering(vehicle="x_quad")
    place = world.state.position_ned_m
    world.fault("wind step 5,0,0")
    world.run_for(15.0)
    pitch_rad = 2.0 * np.arcsin(world.engine.simulator.frame.state[8])
    lean = 0.30 * 5.0 / world.engine.stack.vehicle.weight_n
    assert np.tan(pitch_rad) == pytest.approx(lean, rel=1e-3)  # measured: 2e-5
    assert np.abs(np.subtract(world.state.position_ned_m, place)).max() < 0.05  # measured: 0.007
    world.engine.simulator.clear_faults()
    world.run_for(10.0)
    assert abs(world.engine.simulator.frame.state[8]) < 1e-3


def test_jump_of_the_clock_is_reported_and_flown_on() -> None:
    world = hovering()
    world.fault("clock jump 0.4")
    world.run_for(2.0)
    assert told(world, "Simulator time jumped ahead by 0.40")
    world.run_for(10.0)  # the pause between two texts
    world.fault("clock jump -3")
    world.run_for(2.0)
    assert told(world, "Simulator time went back by")
    land(world)


def test_short_stall_of_the_clock_holds_the_commands() -> None:
    world = hovering()
    begin_s, simulated_us = world.time_s, world.engine.simulator.time_us
    world.fault("clock stalled")
    for _ in range(25):
        world.tick()
    assert world.time_s == pytest.approx(begin_s, abs=0.003)
    world.engine.simulator.clear_faults()
    world.run_for(1.0)
    assert world.engine.simulator.time_us - simulated_us == pytest.approx(1_050_000, abs=4000)
    assert not told(world, "Simulator")
    land(world)


def test_long_stall_of_the_clock_leads_to_the_failsafe() -> None:
    world = hovering()
    world.fault("clock stalled")
    for _ in range(1000):  # two seconds of the machine's clock
        world.tick()
    assert told(world, "Simulator clock stands still")
    assert told(world, "State is frozen or missing: rotors hold their speeds")


def test_slightly_late_state_is_flown() -> None:
    world = hovering()
    world.fault("state late 0.01")
    world.run_for(5.0)
    assert world.state.altitude_m == pytest.approx(5.0, abs=0.1)
    land(world)


def test_hover_in_ground_effect_needs_less_thrust() -> None:
    """By Cheeseman and Bennett, with the rotors 1.23 m above the ground: 0.1 % less."""
    found, radius = [], 0.0
    for faults in ((), ("ground effect on",)):
        world = World(vehicle="x_quad")
        for fault in faults:
            world.fault(fault)
        world.arm()
        world.takeoff(1.0)
        world.run_for(20.0)
        found.append(squares(world).sum())
        radius = propeller_radius_m(world.engine.stack.vehicle)
    height = 0.2 + world.state.altitude_m + 0.03
    assert 1.0 - found[1] / found[0] == pytest.approx((radius / (4.0 * height)) ** 2, rel=0.02)


def test_faults_repeat_bit_for_bit() -> None:
    logs = []
    for _ in range(2):
        world = hovering(vehicle="x_quad", wind=(3.0, 0.0, 0.0), seed=5)
        world.fault("gust 1.5")
        world.fault("wind shear 0.2")
        world.fault("payload 0.2 at 0.02,0,0.1")
        world.fault("rotor 2 delayed 0.004")
        world.run_for(5.0)
        land(world)
        logs.append(world.flight().log.content)
    assert logs[0] == logs[1]
