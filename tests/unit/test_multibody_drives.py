"""Rotors of the multibody plant: lag, torque of spin-up, limits of the drives."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from flightstack.core.contract import Vector3
from flightstack.params.vehicle import Vehicle, load_vehicle
from sim_bridge.plant.plant import InitialState
from tests.support.multibody_flights import BOTH_PLANTS, Flight, model_state


def test_ideal_rotors_are_at_their_speeds_at_once() -> None:
    vehicle = load_vehicle("paper_quad").with_ideal_rotors()
    flight = Flight("multibody", vehicle, InitialState(Vector3(0.0, 0.0, -9.0)))
    flight.command[:4] = (100.0, 200.0, 300.0, 400.0)
    flight.fly(1e-3)
    assert flight.plant.rotor_speeds_rad_s() == [100.0, 200.0, 300.0, 400.0]
    flight.plant.set_rotor_speeds((50.0,) * 4)  # not the commanded speeds
    assert flight.plant.acceleration_ned_m_s2().z == pytest.approx(
        9.81 - 4.0 * 2500.0 * 2.93e-5 / 0.55, rel=1e-3
    )  # the frame is tilted a little


@BOTH_PLANTS
@pytest.mark.parametrize("lag_s", [0.0, 0.005])
def test_rotors_without_lag_have_no_spin_up_torque(name: str, lag_s: float) -> None:
    """A convention: without lag the speeds are imposed, without the reaction Σ s·J_r·ΔΩ on the frame.

    The reaction to a jump of the speed would be an impulse of a motor of infinite torque in every tick, and no yaw
    loop is stable with it. So momentum is not conserved, by exactly that sum; with a lag, however short, it is.
    """
    paper = load_vehicle("paper_quad")
    vehicle = replace(paper, rotors=tuple(replace(rotor, lag_s=lag_s) for rotor in paper.rotors))
    flight = Flight(name, vehicle, InitialState(Vector3(0.0, 0.0, -9.0)), (100.0,) * 4, thrust=False)

    def momentum() -> float:
        model, data = model_state(vehicle, flight.state, flight.plant.rotor_speeds_rad_s())
        return -float(data.subtree_angmom[model.body("vehicle").id][2])  # about down

    before = momentum()
    flight.command[:4] = (200.0, 100.0, 200.0, 100.0)
    flight.fly(0.2)
    gained = sum(
        rotor.spin * rotor.inertia_kg_m2 * (speed - 100.0)
        for rotor, speed in zip(vehicle.rotors, flight.command[:4].tolist(), strict=True)
    )
    assert gained == pytest.approx(2.0 * 6.3e-5 * 100.0)
    if lag_s:
        assert abs(momentum() - before) < 1e-6 * gained
    else:
        assert abs(flight.state[12]) < 1e-30
        assert momentum() - before == pytest.approx(gained, rel=1e-9)


LARGEST_TORQUE = 0.2  # N m; a hover takes 0.033


def with_weak_drives() -> Vehicle:
    paper = load_vehicle("paper_quad")
    rotors = tuple(replace(rotor, max_drive_torque_n_m=LARGEST_TORQUE) for rotor in paper.rotors)
    return replace(paper, rotors=rotors)


@BOTH_PLANTS
def test_limited_drive_follows_its_equation(name: str) -> None:
    """J·Ω̇ of the lag, limited so that its sum with the drag is within the torque, against SciPy."""
    vehicle = with_weak_drives()
    rotor = vehicle.rotors[0]
    inertia, drag, lag = rotor.inertia_kg_m2, rotor.torque_coefficient_n_m_s2, rotor.lag_s
    start, commands = np.full(4, 200.0), np.array([330.0, 205.0, 60.0, 120.0])

    def slope(_: float, speed: np.ndarray) -> np.ndarray:
        torque = inertia * (commands - speed) / lag + drag * speed * np.abs(speed)
        clipped: np.ndarray = (
            np.clip(torque, -LARGEST_TORQUE, LARGEST_TORQUE) - drag * speed * np.abs(speed)
        ) / inertia
        return clipped

    flight = Flight(name, vehicle, InitialState(Vector3(0.0, 0.0, -50.0)), tuple(start.tolist()))
    flight.command[:4] = commands
    times = np.arange(1, 301) * 1e-3
    truth = solve_ivp(slope, (0.0, 0.3), start, t_eval=times, max_step=1e-4, rtol=1e-10, atol=1e-8).y.T
    speeds = []
    for _ in times:
        flight.fly(1e-3)
        speeds.append(flight.plant.rotor_speeds_rad_s())
    assert np.abs(np.array(speeds) - truth).max() < 0.05  # of 200 rad/s; measured: 0.011
    assert speeds[-1] == pytest.approx(commands, abs=0.05)
    unlimited = 330.0 - 130.0 * math.exp(-4.0)
    assert speeds[19][0] < unlimited - 50.0  # an unlimited drive is nearly there after four lags


def test_limited_drives_agree_on_both_plants_and_conserve_momentum() -> None:
    ends = []
    for name in ("rigid", "multibody"):
        spin = InitialState(Vector3(0.0, 0.0, -50.0), rates_frd_rad_s=Vector3(1.0, -2.0, 0.5))
        flight = Flight(name, with_weak_drives(), spin, (200.0,) * 4, thrust=False)
        flight.command[:4] = (330.0, 205.0, 60.0, 120.0)

        def momentum(flight: Flight = flight) -> np.ndarray:
            speeds = flight.plant.rotor_speeds_rad_s()
            model, data = model_state(load_vehicle("paper_quad"), flight.state, speeds)
            return data.subtree_angmom[model.body("vehicle").id].copy()

        before = momentum()
        flight.fly(0.3)
        assert np.abs(momentum() - before).max() < 1e-4 * np.linalg.norm(
            before
        )  # measured: 8e-6, where a limit begins or ends within a step
        ends.append(flight.state)
    assert np.abs(ends[0] - ends[1]).max() < 1e-9
