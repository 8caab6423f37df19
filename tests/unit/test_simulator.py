"""The simulator without I/O: time, frames, limits, bad commands, determinism."""

from __future__ import annotations

import hashlib
import math
import os
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest

from flightstack.core.contract import Vector3
from flightstack.mavlink.dialect import mavlink
from flightstack.params.vehicle import load_vehicle
from flightstack.simulator_link.hot_frames import (
    ARMED_FLAG,
    GROUND_CONTACT_FLAG,
    LOCKSTEP_FLAG,
    ActuatorsFrame,
    PlantStateFrame,
)
from sim_bridge.errors import PlantDivergedError, UsageProblemError
from sim_bridge.plant.compiled_plant import CompiledPlant
from sim_bridge.plant.disturbance import Disturbance
from sim_bridge.plant.plant import InitialState, PlantOptions
from sim_bridge.simulator import Simulator

PAPER, X_QUAD = load_vehicle("paper_quad"), load_vehicle("x_quad")
GUSTY = PlantOptions(Disturbance(Vector3(2.0, -1.0, 0.0), 1.5), seed=7)
TWISTED = PlantOptions(Disturbance(torque_gust_n_m=0.02), seed=7)
BOTH_GUSTS = GUSTY._replace(disturbance=GUSTY.disturbance._replace(torque_gust_n_m=0.02))


def command(*speeds: float, armed: bool = True) -> ActuatorsFrame:
    frame = ActuatorsFrame()
    frame.rotor_speed_rad_s[: len(speeds)] = speeds
    frame.set_rotor_count(4)
    frame.seal(0, LOCKSTEP_FLAG | (ARMED_FLAG if armed else 0))
    return frame


def rotor_speeds(simulator: Simulator) -> list[float]:
    return simulator.frame.rotor_speed_rad_s[:4].tolist()


def flight_digest(options: PlantOptions) -> str:
    """Digest of all frames of 3 s, long enough to refill the noise twice."""
    simulator = Simulator(X_QUAD, "rigid", options)
    digest = hashlib.sha256()
    actuators = command(0.0, 0.0, 0.0, 0.0)
    for step in range(1500):
        digest.update(simulator.state_frame())
        actuators.rotor_speed_rad_s[:4] = 680.0 + 10.0 * math.sin(0.01 * step)
        simulator.apply(actuators)
    return digest.hexdigest()


def test_first_frame_is_a_valid_message_at_rest() -> None:
    frame = bytes(Simulator(PAPER).state_frame())
    (message,) = mavlink.MAVLink(None).parse_buffer(bytearray(frame))
    assert message.get_type() == "FS_PLANT_STATE"
    assert (message.time_us, message.rotor_count, message.flags) == (0, 4, 1 | GROUND_CONTACT_FLAG)
    assert list(message.q) == [1.0, 0.0, 0.0, 0.0]
    assert PlantStateFrame().open(frame)


@pytest.mark.parametrize("plant", ["rigid", "paper"])
def test_thrust_above_weight_takes_off_and_the_flag_follows(plant: str) -> None:
    simulator = Simulator(PAPER, plant)
    simulator.state_frame()
    assert simulator.frame.flags & GROUND_CONTACT_FLAG
    for _ in range(500):
        simulator.apply(command(*[250.0] * 4))
    assert simulator.time_us == 1_000_000
    assert not simulator.on_ground
    assert simulator.frame.state[2] < -0.5
    simulator.state_frame()
    assert not simulator.frame.flags & GROUND_CONTACT_FLAG


def test_limits_clip_the_command_and_disarmed_rotors_stop() -> None:
    simulator = Simulator(PAPER)
    rotor = PAPER.rotors[0]
    for _ in range(200):
        simulator.apply(command(0.0, 1e5, -5.0, 100.0))
    low, high = rotor.min_speed_rad_s, rotor.max_speed_rad_s
    assert rotor_speeds(simulator) == pytest.approx([low, high, low, 100.0], rel=1e-6)
    for _ in range(200):
        simulator.apply(command(200.0, 200.0, 200.0, 200.0, armed=False))
    assert max(rotor_speeds(simulator)) < 1e-6


def test_ideal_rotors_have_neither_lag_nor_limits() -> None:
    simulator = Simulator(PAPER.with_ideal_rotors())
    simulator.apply(command(-50.0, 900.0, -50.0, 900.0))
    assert rotor_speeds(simulator) == [-50.0, 900.0, -50.0, 900.0]


@pytest.mark.parametrize("plant", ["rigid", "paper"])
@pytest.mark.parametrize("ideal", [True, False])
def test_bad_commands_are_counted_and_the_last_good_one_holds(plant: str, ideal: bool) -> None:
    vehicle = PAPER.with_ideal_rotors() if ideal else PAPER
    simulator, twin = Simulator(vehicle, plant), Simulator(vehicle, plant)
    for one in (simulator, twin):
        one.apply(command(220.0, 230.0, 220.0, 230.0))
    for _ in range(10):
        simulator.apply(command(math.nan, math.inf, -math.inf, 1e300))
        twin.apply(command(220.0, 230.0, 220.0, 230.0))
    assert simulator.plant.bad_commands == 40
    assert twin.plant.bad_commands == 0
    assert bytes(simulator.state_frame()) == bytes(twin.state_frame())


def test_divergence_is_an_error() -> None:
    push = PlantOptions(Disturbance(torque_frd_n_m=Vector3(1e9, 1e9, 1e9)))
    simulator = Simulator(PAPER, "rigid", push)

    def fly() -> None:
        for _ in range(1000):
            simulator.apply(command(200.0, 200.0, 200.0, 200.0))

    with pytest.raises(PlantDivergedError, match=r"the plant diverged at t=\d"):
        fly()


GUSTS = pytest.mark.parametrize("options", [GUSTY, TWISTED, BOTH_GUSTS], ids=["wind", "torque", "both"])


@GUSTS
def test_same_seed_same_bytes_other_seed_other_bytes(options: PlantOptions) -> None:
    first = flight_digest(options)
    assert flight_digest(options) == first
    assert flight_digest(options._replace(seed=8)) != first


@GUSTS
def test_gusts_do_not_depend_on_how_the_steps_are_batched(options: PlantOptions) -> None:
    """5 s in exchanges of 1, 2, 5 or 500 ms have the same gusts, also across refills of the noise."""
    ends = []
    for interval_us in (1000, 2000, 5000, 500_000):
        simulator = Simulator(X_QUAD, "rigid", options, interval_us=interval_us)
        for _ in range(5_000_000 // interval_us):
            simulator.apply(command(*[690.0] * 4))
        ends.append(simulator.frame.state.tobytes())
    assert len(set(ends)) == 1


def test_gusts_of_wind_and_torque_are_independent() -> None:
    """Without drag or rotors gusts of wind affect the airspeed alone, gusts of torque the rates alone."""
    shown = []
    for options in (GUSTY, BOTH_GUSTS, TWISTED):
        plant = CompiledPlant(PAPER, "rigid", options._replace(ground=False))
        airspeeds, rates = [], []
        for _ in range(50):
            plant.advance(np.zeros(8), 0, 50)
            airspeeds.append(plant.airspeed_m_s())
            rates.append(plant.output[0]["state"][10:13].tolist())
        shown.append((airspeeds, rates))
    wind, both, torque = shown
    assert both == (wind[0], torque[1])
    assert wind[1] != torque[1]
    assert wind[0] != torque[0]


@pytest.mark.parametrize(
    ("interval_us", "physics_hz"), [(50, 1000.0), (1700, 1000.0), (3333, 400.0), (1_000_000, 250.0)]
)
def test_any_interval_is_split_into_whole_steps(interval_us: int, physics_hz: float) -> None:
    start = PlantOptions(initial=InitialState(Vector3(0.0, 0.0, -100.0)))
    simulator = Simulator(PAPER, "rigid", start, physics_hz=physics_hz, interval_us=interval_us)
    for _ in range(3):
        simulator.apply(command(0.0, 0.0, 0.0, 0.0, armed=False))
    fallen = 0.5 * 9.81 * (3e-6 * interval_us) ** 2
    assert simulator.time_us == 3 * interval_us
    assert simulator.frame.state[2] == pytest.approx(-100.0 + fallen, abs=1e-11)


@pytest.mark.parametrize("interval_us", [0, 49, 1_000_001])
def test_intervals_out_of_range_are_rejected(interval_us: int) -> None:
    with pytest.raises(ValueError, match="outside the allowed"):
        Simulator(PAPER).set_interval_us(interval_us)


@pytest.mark.parametrize("air", [Disturbance(Vector3(5.0, 0.0, 0.0)), Disturbance(gust_m_s=1.0)])
def test_wind_without_drag_is_rejected(air: Disturbance) -> None:
    options = PlantOptions(air)
    with pytest.raises(UsageProblemError, match="paper_quad has no drag; add --drag"):
        Simulator(PAPER, options=options)
    with pytest.raises(UsageProblemError, match="the paper's model has no drag"):
        Simulator(X_QUAD, "paper", options)
    Simulator(X_QUAD, options=options)
    Simulator(PAPER.with_drag("rigid"), options=options)
    Simulator(PAPER, "paper")


@pytest.mark.parametrize(
    "air",
    [
        Disturbance(Vector3(5.0, 0.0, 0.0)), Disturbance(gust_m_s=1.0), Disturbance(torque_gust_n_m=0.01),
        Disturbance(force_ned_n=Vector3(0.1, 0.0, 0.0)), Disturbance(torque_frd_n_m=Vector3(0.01, 0.0, 0.0)),
    ],
)  # fmt: skip
@pytest.mark.parametrize("ideal", [False, True])
@pytest.mark.parametrize("plant", ["rigid", "paper"])
def test_each_disturbance_acts_on_each_plant_that_takes_it(plant: str, ideal: bool, air: Disturbance) -> None:
    if plant == "paper" and (any(air.wind_ned_m_s) or air.gust_m_s):
        pytest.skip("refused: test_wind_without_drag_is_rejected")
    vehicle = X_QUAD.with_ideal_rotors() if ideal else X_QUAD
    start = InitialState(position_ned_m=Vector3(0.0, 0.0, -10.0))
    calm, moved = (
        Simulator(vehicle, plant, PlantOptions(disturbance, initial=start))
        for disturbance in (Disturbance(), air)
    )
    for simulator in (calm, moved):
        for _ in range(50):
            simulator.apply(command(650.0, 650.0, 650.0, 650.0))
    assert calm.frame.state.tolist() != moved.frame.state.tolist()


def short_flights() -> str:
    """Digits of the states after 60 ms in all gusts that act, from the ground, on both plants."""
    digits = []
    for plant, vehicle, gusts in (("rigid", X_QUAD, BOTH_GUSTS), ("paper", PAPER, TWISTED)):
        simulator = Simulator(vehicle, plant, gusts)
        for _ in range(30):
            simulator.apply(command(400.0, 410.0, 420.0, 390.0))
        digits += [value.hex() for value in simulator.frame.state.tolist()]
    return " ".join(digits)


def test_plain_python_gives_the_same_flight() -> None:
    code = "from tests.unit.test_simulator import *; print(numba.config.DISABLE_JIT, short_flights())"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=Path(__file__).parents[2],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"}, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert not numba.config.DISABLE_JIT
    assert done.stdout.split() == ["1", *short_flights().split()]
