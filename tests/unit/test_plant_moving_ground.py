"""Ground with a slope, and ground that moves as a boat: rest, drops, and what the sensors measure there."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flightstack.core.contract import Quaternion, Vector3
from flightstack.core.geodesy import GeoPoint
from flightstack.core.geometry import rotate
from flightstack.params.vehicle import load_vehicle
from flightstack.simulator_link.hot_frames import ARMED_FLAG, ActuatorsFrame
from sim_bridge import arguments
from sim_bridge.errors import UsageProblemError
from sim_bridge.plant.disturbance import Disturbance
from sim_bridge.plant.faults.schedule import parse_fault
from sim_bridge.plant.layout import CONTACT
from sim_bridge.plant.plant import InitialState, PlantOptions
from sim_bridge.plants import make_plant
from sim_bridge.sensors.optical_flow import OpticalFlow
from sim_bridge.sensors.rangefinder import Rangefinder
from sim_bridge.simulator import Simulator
from tests.support.sensor_vehicles import X_QUAD, state_at, with_sensors

HOME = GeoPoint(47.397742, 8.545594, 488.0)
SLOPE = math.radians(10.0)
BOAT = Vector3(1.5, -0.8, 0.0)
STOPPED = np.zeros(8)


def stands(options: PlantOptions, seconds: float, plant: str = "rigid") -> np.ndarray:
    """Return the state of a vehicle that stands for a time."""
    made = make_plant(load_vehicle("x_quad"), plant, options)
    assert made.show() == CONTACT
    assert made.advance(STOPPED, 0, round(seconds * 1000)) == CONTACT
    state: np.ndarray = made.output[0]["state"].copy()
    return state


@pytest.mark.parametrize("slope_deg", [-30.0, 10.0, 30.0])
def test_vehicle_rests_on_a_slope(slope_deg: float) -> None:
    """Nose up the slope, without creep: friction of 0.7 holds up to 35°."""
    state = stands(PlantOptions(slope_rad=math.radians(slope_deg)), 10.0)
    half = math.radians(slope_deg) / 2.0
    expected = [0, 0, 0, 0, 0, 0, math.cos(half), 0, math.sin(half), 0, 0, 0, 0]
    assert np.abs(state - expected)[:3].max() < 1e-3  # the springs turn to the weight; measured: 2.5e-4
    assert np.abs(state - expected)[3:].max() < 2e-3


def test_vehicle_that_drops_on_a_slope_comes_to_rest_along_it() -> None:
    """Level at first, 0.25 m above the ground and east of the start; its down axis is then the normal of the ground."""
    start = InitialState(Vector3(2.0, 5.0, -0.6), euler_rad=Vector3(0.0, 0.0, 0.6))
    plant = make_plant(X_QUAD, "rigid", PlantOptions(initial=start, slope_rad=SLOPE))
    assert plant.advance(STOPPED, 0, 4000) == CONTACT
    state = plant.output[0]["state"]
    down = rotate(Quaternion(*state[6:10].tolist()), Vector3(0.0, 0.0, 1.0))
    assert down == pytest.approx((math.sin(SLOPE), 0.0, math.cos(SLOPE)), abs=2e-3)
    assert np.abs(state[3:6]).max() < 1e-6
    assert abs(plant.penetration_m()) < 1e-3


def test_sensors_that_look_down_see_the_slope() -> None:
    """10 m north of the start and 20 m above it the ground is 10·tan 10° nearer."""
    options = PlantOptions(slope_rad=SLOPE)
    sensor = Rangefinder(with_sensors(), options)
    half = SLOPE / 2.0
    standing = state_at(attitude=(math.cos(half), 0.0, math.sin(half), 0.0))
    assert sensor.measure(standing)[0] == pytest.approx(X_QUAD.leg_height_m)
    foot_m = X_QUAD.leg_height_m / math.cos(SLOPE)  # the plane below the origin
    expected = 20.0 + foot_m - 10.0 * math.tan(SLOPE)
    assert sensor.measure(state_at(position=(10.0, 0.0, -20.0)))[0] == pytest.approx(expected)
    flow = OpticalFlow(with_sensors(), options)
    out = flow.measure(state_at(position=(10.0, 0.0, -20.0), velocity=(3.0, 0.0, 0.0)))
    assert out[1] == pytest.approx(3.0 / expected)


@pytest.mark.parametrize("plant", ["rigid", "paper", "multibody"])
def test_vehicle_on_a_boat_moves_with_it(plant: str) -> None:
    if plant == "multibody":
        pytest.importorskip("mujoco")
    state = stands(PlantOptions(boat_ned_m_s=BOAT), 5.0, plant)
    assert state[0:2] == pytest.approx((7.5, -4.0), abs=1e-4)  # the apparent wind bends the legs: 3e-5
    assert state[3:5] == pytest.approx((1.5, -0.8), abs=1e-6)
    assert state[6] == pytest.approx(1.0, abs=1e-8)


def test_sensors_on_a_boat_measure_its_motion() -> None:
    """Its velocity by GNSS, no acceleration, and no flow of the deck."""
    simulator = Simulator(with_sensors("ideal"), options=PlantOptions(boat_ned_m_s=BOAT))
    simulator.start_sensors(HOME)
    command = ActuatorsFrame()
    command.set_rotor_count(4)
    command.seal(0, 0)
    for _ in range(1000):
        simulator.apply(command)
    suite = simulator.sensors
    assert suite is not None
    assert suite.imus.records["out"][0] == pytest.approx(
        [0.0, 0.0, 0.0, 0.0, 0.0, -9.81],
        abs=2e-3,  # the apparent wind tilts the vehicle on its legs: 8.4e-4
    )
    assert suite.gnss.records["out"][0][3:5] == pytest.approx(BOAT[:2])
    assert suite.gnss.records["out"][0][:2] == pytest.approx((3.0, -1.6), abs=0.2)
    assert OpticalFlow(with_sensors(), PlantOptions(boat_ned_m_s=BOAT)).measure(
        state_at(position=(0.0, 0.0, -1.0), velocity=BOAT)
    )[:2] == pytest.approx((0.0, 0.0))


def test_wind_on_a_boat_is_that_against_the_water() -> None:
    """A wind with the velocity of the boat is calm air on deck; in the air it carries the vehicle along."""
    options = PlantOptions(Disturbance(wind_ned_m_s=BOAT), boat_ned_m_s=BOAT)
    plant = make_plant(X_QUAD, "rigid", options)
    assert plant.airspeed_m_s() == pytest.approx(0.0)
    speed = np.zeros(8)
    speed[:4] = 700.0
    plant.advance(speed, ARMED_FLAG, 3000)
    state = plant.output[0]["state"]
    assert state[2] < -1.0
    assert state[3:5] == pytest.approx(BOAT[:2], abs=1e-6)


def test_options_without_effect_are_refused() -> None:
    with pytest.raises(UsageProblemError, match="--slope: the ground of the paper plant is level"):
        arguments.check_slope(10.0, "paper", Vector3(0.0, 0.0, 0.0))
    with pytest.raises(UsageProblemError, match="--slope: the deck of a boat is level"):
        arguments.check_slope(10.0, "rigid", BOAT)
    with pytest.raises(UsageProblemError, match="--slope: 40 is outside the allowed range -30 to 30"):
        arguments.check_slope(40.0, "rigid", BOAT)
    with pytest.raises(UsageProblemError, match="--boat: 30 is outside the allowed range -20 to 20"):
        arguments.parse_boat("30,0")
    simulator = Simulator(X_QUAD, options=PlantOptions(boat_ned_m_s=BOAT))
    with pytest.raises(UsageProblemError, match="the wind on a boat does not change with the height"):
        simulator.inject(parse_fault("wind:step=3,0,0", 4), parse_fault("wind:shear=0.2", 4))
