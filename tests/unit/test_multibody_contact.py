"""The multibody plant on the ground: rest, touchdown, friction, takeoff."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flightstack.core.contract import Vector3
from flightstack.params.vehicle import load_vehicle
from sim_bridge.plant.contact import FRICTION
from sim_bridge.plant.disturbance import Disturbance
from sim_bridge.plant.layout import CONTACT
from sim_bridge.plant.plant import InitialState
from tests.support.multibody_flights import BOTH_VEHICLES, Flight, hover

STOPPED = np.zeros(8)


@BOTH_VEHICLES
@pytest.mark.parametrize("step_s", [0.01, 0.002, 1e-3])
def test_rests_at_the_origin(vehicle: str, step_s: float) -> None:
    flight = Flight("multibody", load_vehicle(vehicle), step_s=step_s, ground=True)
    assert flight.result == CONTACT
    flight.plant.advance(STOPPED, 0, min(2000, round(5.0 / step_s)))
    assert np.abs(flight.state - [0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0]).max() < 1e-12  # measured: 6e-14
    assert flight.plant.penetration_m() < 1e-12


@BOTH_VEHICLES
def test_touchdown_has_a_small_bounce(vehicle: str) -> None:
    start = InitialState(Vector3(0.0, 0.0, -0.02), Vector3(0.1, 0.0, 1.0))
    flight = Flight("multibody", load_vehicle(vehicle), start, ground=True)
    heights = []
    for _ in range(1000):
        flight.result = flight.plant.advance(STOPPED, 0, 1)
        heights.append(-flight.state[2])
    first = int(np.argmax(np.array(heights) < 0.0))
    assert max(heights[first:]) < 0.002  # measured: 0.9 mm, as with the rigid plant
    assert min(heights) > -0.006  # measured: 3.5 mm
    assert flight.result == CONTACT
    assert np.abs(flight.state[[2, 3, 4, 5]]).max() < 1e-6


@BOTH_VEHICLES
def test_touchdown_that_slides_has_a_small_bounce(vehicle: str) -> None:
    """MuJoCo's cone turns slip into lift-off: with one time constant for both, the vehicle rose at 1.5 m/s."""
    start = InitialState(Vector3(0.0, 0.0, -0.02), Vector3(4.0, 0.0, 1.0))
    rise_m_s = {}
    for plant in ("rigid", "multibody"):
        flight = Flight(plant, load_vehicle(vehicle), start, ground=True)
        rise_m_s[plant] = 0.0
        for _ in range(200):
            flight.plant.advance(STOPPED, 0, 1)
            rise_m_s[plant] = max(rise_m_s[plant], -flight.state[5])
    print(rise_m_s)
    assert rise_m_s["multibody"] < rise_m_s["rigid"] + 0.2


@BOTH_VEHICLES
@pytest.mark.parametrize("sink_m_s", [2.0, 10.0, 30.0])
def test_hard_landing_stays_finite_and_above_ground(vehicle: str, sink_m_s: float) -> None:
    start = InitialState(
        Vector3(0.0, 0.0, -1.0), Vector3(2.0, 1.0, sink_m_s), Vector3(0.4, -0.3, 1.0), Vector3(3.0, -2.0, 1.0)
    )
    flight = Flight("multibody", load_vehicle(vehicle), start, ground=True)
    for _ in range(160):
        result = flight.plant.advance(STOPPED, 0, 50)
        assert np.isfinite(flight.state).all()
        assert np.linalg.norm(flight.state[3:6]) < math.hypot(sink_m_s, 5.0) + 5.0
    assert result == CONTACT
    assert np.abs(flight.state[3:6]).max() < 1e-3
    assert flight.state[2] < 0.25  # within legs and arms


@pytest.mark.parametrize("euler_deg", [(180.0, 0.0, 0.0), (140.0, 20.0, 0.0)])
def test_tumbled_vehicle_lies_still(euler_deg: tuple[float, ...]) -> None:
    start = InitialState(Vector3(0.0, 0.0, -1.0), euler_rad=Vector3(*np.radians(euler_deg)))
    flight = Flight("multibody", load_vehicle("paper_quad"), start, ground=True)
    flight.plant.advance(STOPPED, 0, 9000)
    before = flight.state
    assert flight.plant.advance(STOPPED, 0, 1000) == CONTACT
    assert np.abs(flight.state - before)[:6].max() < 1e-6


@BOTH_VEHICLES
def test_friction_holds_below_its_limit_and_slides_above(vehicle: str) -> None:
    weight = load_vehicle(vehicle).weight_n

    def pushed(share: float) -> Flight:
        push = Disturbance(force_ned_n=Vector3(share * weight, 0.0, 0.0))
        flight = Flight("multibody", load_vehicle(vehicle), disturbance=push, ground=True)
        flight.plant.advance(STOPPED, 0, 1500)
        return flight

    held = pushed(0.3)
    before = held.state
    assert 0.0 < before[0] < 1e-3
    held.plant.advance(STOPPED, 0, 2000)
    assert np.abs(held.state - before)[:2].max() < 1e-6  # measured: 2e-8
    assert pushed(FRICTION + 0.05).state[3] > 0.3


@BOTH_VEHICLES
def test_takes_off_when_thrust_exceeds_weight(vehicle: str) -> None:
    flight = Flight("multibody", load_vehicle(vehicle), ground=True)
    flight.command[:4] = 0.95 * hover(load_vehicle(vehicle))
    assert flight.fly(2.0).result == CONTACT
    flight.command[:4] = 1.1 * hover(load_vehicle(vehicle))
    assert flight.fly(1.0).result == 0
    assert flight.state[2] < -0.3
    assert np.abs(flight.state[[0, 1, 7, 8, 9]]).max() < 1e-9
