"""Contact with the ground: rest, drops, friction, tumbles, hard landings."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flightstack.core.contract import Vector3
from flightstack.params.vehicle import Vehicle, load_vehicle
from flightstack.simulator_link.hot_frames import ARMED_FLAG
from sim_bridge.plant import compiled_plant
from sim_bridge.plant.compiled_plant import CompiledPlant
from sim_bridge.plant.contact import FRICTION, ContactModel, contact_model
from sim_bridge.plant.disturbance import NO_DISTURBANCE, Disturbance
from sim_bridge.plant.layout import CONTACT
from sim_bridge.plant.plant import AT_REST, InitialState, PlantOptions
from sim_bridge.plant.record_plant import DEFAULT_STEP_S

BOTH_PLANTS = pytest.mark.parametrize("plant", ["rigid", "paper"])
BOTH_VEHICLES = pytest.mark.parametrize("vehicle", ["paper_quad", "x_quad"])
STOPPED = np.zeros(8)


class OnGround:
    def __init__(
        self, vehicle: str, plant: str = "rigid", initial: InitialState = AT_REST,
        disturbance: Disturbance = NO_DISTURBANCE, step_s: float = 1e-3,
    ) -> None:  # fmt: skip
        self.vehicle = load_vehicle(vehicle)
        self.plant = CompiledPlant(self.vehicle, plant, PlantOptions(disturbance, 1, initial))
        self.plant.set_step(step_s)
        self.step_s = step_s
        self.result = self.plant.show()

    def wait(self, seconds: float, command: np.ndarray = STOPPED) -> OnGround:
        self.result = self.plant.advance(
            command, ARMED_FLAG if command.any() else 0, round(seconds / self.step_s)
        )
        return self

    @property
    def state(self) -> np.ndarray:
        return self.plant.output[0]["state"].copy()


@BOTH_PLANTS
@BOTH_VEHICLES
@pytest.mark.parametrize("step_s", [0.01, 0.002, 1e-3, 1e-4])
def test_rests_at_the_origin(vehicle: str, plant: str, step_s: float) -> None:
    ground = OnGround(vehicle, plant, step_s=step_s)
    assert ground.result == CONTACT
    ground.wait(20.0)
    assert ground.result == CONTACT
    assert np.abs(ground.state - [0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0]).max() < 1e-14  # measured: 2.1e-16


@BOTH_PLANTS
def test_contact_is_designed_once_for_each_step(plant: str, monkeypatch: pytest.MonkeyPatch) -> None:
    steps_s: list[float] = []

    def design(vehicle: Vehicle, step_s: float, single_point: bool) -> ContactModel:
        steps_s.append(step_s)
        return contact_model(vehicle, step_s, single_point)

    monkeypatch.setattr(compiled_plant, "contact_model", design)
    ground = OnGround("x_quad", plant, step_s=DEFAULT_STEP_S)
    assert steps_s == [DEFAULT_STEP_S]
    ground.plant.set_step(0.01)
    assert steps_s == [DEFAULT_STEP_S, 0.01]


@BOTH_PLANTS
@BOTH_VEHICLES
def test_drop_comes_to_rest_level_and_stays_exactly(vehicle: str, plant: str) -> None:
    start = InitialState(Vector3(1.0, 2.0, -2.0), Vector3(0.5, -0.5, 0.0), Vector3(0.1, -0.08, 0.7))
    ground = OnGround(vehicle, plant, start).wait(6.0)
    rest = ground.state
    assert np.abs(rest[[3, 4, 5, 10, 11, 12]]).max() < 1e-11  # measured: 5.4e-14
    assert np.abs(rest[[2, 7, 8]]).max() < 1e-11  # level, at height zero; measured: 4e-17
    moved = np.abs(ground.wait(60.0).state - rest).max()
    assert moved < 1e-13  # measured: 5.2e-16


@BOTH_PLANTS
@BOTH_VEHICLES
@pytest.mark.parametrize("sink_m_s", [2.0, 10.0, 30.0])
def test_hard_landing_stays_finite_and_above_ground(vehicle: str, plant: str, sink_m_s: float) -> None:
    start = InitialState(
        Vector3(0.0, 0.0, -1.0), Vector3(2.0, 1.0, sink_m_s), Vector3(0.4, -0.3, 1.0), Vector3(3.0, -2.0, 1.0)
    )
    ground = OnGround(vehicle, plant, start)
    speeds = []
    for _ in range(400):
        ground.wait(0.05)
        assert np.isfinite(ground.state).all()
        speeds.append(np.linalg.norm(ground.state[3:6]))
    assert max(speeds) < math.hypot(sink_m_s, 5.0) + 5.0
    assert ground.result == CONTACT
    assert speeds[-1] < 1e-9  # measured: 3.3e-13
    assert ground.state[2] < 0.25  # within legs and arms


@BOTH_VEHICLES
@pytest.mark.parametrize(
    "euler_deg", [(180.0, 0.0, 0.0), (90.0, 0.0, 30.0), (0.0, 100.0, 0.0), (140.0, 20.0, 0.0)]
)
def test_tumbled_vehicle_lies_still(vehicle: str, euler_deg: tuple[float, float, float]) -> None:
    start = InitialState(Vector3(0.0, 0.0, -1.0), euler_rad=Vector3(*np.radians(euler_deg)))
    ground = OnGround(vehicle, "rigid", start).wait(30.0)
    before = ground.state
    assert ground.result == CONTACT
    assert np.abs(ground.wait(10.0).state - before)[[0, 1, 2, 3, 4, 5]].max() < 1e-9


@BOTH_PLANTS
@BOTH_VEHICLES
def test_friction_holds_below_its_limit_without_creep(vehicle: str, plant: str) -> None:
    weight = load_vehicle(vehicle).weight_n
    push = Disturbance(force_ned_n=Vector3(0.3 * weight, 0.0, 0.0))
    ground = OnGround(vehicle, plant, disturbance=push).wait(5.0)
    before = ground.state
    assert 0.0 < before[0] < 2e-3  # deflection of the springs
    assert np.abs(ground.wait(60.0).state - before).max() < 1e-12  # measured: 1.8e-15


def test_friction_slides_above_its_limit() -> None:
    vehicle = load_vehicle("paper_quad")
    push = Disturbance(force_ned_n=Vector3((FRICTION + 0.1) * vehicle.weight_n, 0.0, 0.0))
    state = OnGround("paper_quad", "paper", disturbance=push).wait(2.0).state
    assert state[3] == pytest.approx(0.1 * 9.81 * 2.0, rel=0.01)


@BOTH_PLANTS
@BOTH_VEHICLES
def test_takes_off_when_thrust_exceeds_weight(vehicle: str, plant: str) -> None:
    ground = OnGround(vehicle, plant)
    hover = math.sqrt(ground.vehicle.weight_n / sum(r.thrust_coefficient_n_s2 for r in ground.vehicle.rotors))
    command = np.zeros(8)
    command[:4] = 0.95 * hover
    assert ground.wait(2.0, command).result == CONTACT
    command[:4] = 1.1 * hover
    assert ground.wait(1.0, command).result == 0
    assert ground.state[2] < -0.3
    assert np.abs(ground.state[[0, 1, 7, 8, 9]]).max() < 1e-9
