"""Faults and disturbances of the simulator in a hover of the whole stack."""

from __future__ import annotations

import numpy as np
import pytest

from flightstack.core.enums import Mode
from sim_bridge.multibody.default_parts import propeller_radius_m
from tests.support.world import World

BOTH_PLANTS = pytest.mark.parametrize("plant", ["rigid", "multibody"])


def hovering(**options: object) -> World:
    world = World(**options)  # type: ignore[arg-type]
    assert world.arm() == 0
    assert world.takeoff(5.0) == 0
    world.until(lambda: world.mode is Mode.HOLD)
    world.run(3.0)
    return world


def land(world: World) -> None:
    assert world.land() == 0
    world.until_disarmed(60.0)


def told(world: World, words: str) -> bool:
    return any(words in text for text in world.texts)


def squares(world: World) -> np.ndarray:
    return world.simulator.frame.rotor_speed_rad_s[:4].astype(float) ** 2


@BOTH_PLANTS
def test_hover_carries_a_payload_beside_its_centre_and_drops_it(plant: str) -> None:
    """Thrust and torques are those of the weight at its place; the plus frame has its arms on the axes."""
    world = hovering(plant=plant)
    vehicle, before = world.stack.vehicle, squares(world)
    payload_kg, x = 0.1, 0.04
    world.inject(f"payload {payload_kg} at {x},0,0.05")
    world.run(10.0)
    share = payload_kg / vehicle.mass_kg
    after, arm = squares(world), vehicle.rotors[0].position_frd_m[0]
    thrust = vehicle.rotors[0].thrust_coefficient_n_s2
    assert after.sum() / before.sum() == pytest.approx(1.0 + share, rel=1e-3)  # measured: 2.4e-4
    torque = (after[0] - after[2]) * thrust * arm
    assert torque == pytest.approx(payload_kg * 9.81 * x, rel=1e-3)  # measured: 5e-5
    assert after[1] - after[3] == pytest.approx(0.0, abs=1e-6 * after.sum())  # measured: 0
    world.inject("payload cut")
    world.run(10.0)
    assert squares(world) == pytest.approx(before, rel=1e-3)  # measured: 3.4e-4
    assert world.altitude == pytest.approx(5.0, abs=0.01)  # measured: 0.002
    land(world)


def test_hover_leans_against_a_wind_that_begins() -> None:
    world = hovering(vehicle="x_quad")
    place = world.position
    world.inject("wind step 5,0,0")
    world.run(15.0)
    pitch_rad = 2.0 * np.arcsin(world.simulator.frame.state[8])
    lean = 0.30 * 5.0 / world.stack.vehicle.weight_n
    assert np.tan(pitch_rad) == pytest.approx(lean, rel=1e-3)  # measured: 2e-5
    assert np.abs(world.position - place).max() < 0.05  # measured: 0.007
    world.simulator.clear_faults()
    world.run(10.0)
    assert abs(world.simulator.frame.state[8]) < 1e-3


def test_jump_of_the_clock_is_reported_and_flown_on() -> None:
    world = hovering()
    world.inject("clock jump 0.4")
    world.run(2.0)
    assert told(world, "Simulator time jumped ahead by 0.40")
    world.run(10.0)  # the pause between two texts
    world.inject("clock jump -3")
    world.run(2.0)
    assert told(world, "Simulator time went back by")
    land(world)


def test_short_stall_of_the_clock_holds_the_commands() -> None:
    world = hovering()
    begin_s, simulated_us = world.time_s, world.simulator.time_us
    world.inject("clock stalled")
    for _ in range(25):
        world.tick()
    assert world.time_s == pytest.approx(begin_s, abs=0.003)
    world.simulator.clear_faults()
    world.run(1.0)
    assert world.simulator.time_us - simulated_us == pytest.approx(1_050_000, abs=4000)
    assert not told(world, "Simulator")
    land(world)


def test_long_stall_of_the_clock_leads_to_the_failsafe() -> None:
    world = hovering()
    world.inject("clock stalled")
    for _ in range(1000):  # two seconds of the machine's clock
        world.machine_ns += 2_000_000
        world.tick()
    assert told(world, "Simulator clock stands still")
    assert told(world, "State is frozen or missing: rotors hold their speeds")


def test_slightly_late_state_is_flown() -> None:
    world = hovering()
    world.inject("state late 0.01")
    world.run(5.0)
    assert world.altitude == pytest.approx(5.0, abs=0.1)
    land(world)


def test_hover_in_ground_effect_needs_less_thrust() -> None:
    """By Cheeseman and Bennett, with the rotors 1.23 m above the ground: 0.1 % less."""
    found, radius = [], 0.0
    for faults in ((), ("ground effect on",)):
        world = World(vehicle="x_quad")
        for fault in faults:
            world.inject(fault)
        assert world.arm() == 0
        assert world.takeoff(1.0) == 0
        world.run(20.0)
        found.append(squares(world).sum())
        radius = propeller_radius_m(world.stack.vehicle)
    height = 0.2 + world.altitude + 0.03
    assert 1.0 - found[1] / found[0] == pytest.approx((radius / (4.0 * height)) ** 2, rel=0.02)


def test_faults_repeat_bit_for_bit() -> None:
    logs = []
    for _ in range(2):
        world = hovering(vehicle="x_quad", wind=(3.0, 0.0, 0.0), seed=5)
        world.inject("gust 1.5")
        world.inject("wind shear 0.2")
        world.inject("payload 0.2 at 0.02,0,0.1")
        world.inject("rotor 2 delayed 0.004")
        world.run(5.0)
        land(world)
        logs.append(world.log)
    assert logs[0] == logs[1]
