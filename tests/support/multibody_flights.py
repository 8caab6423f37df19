"""Flights of the multibody plant beside the rigid one."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest

from flightstack.core.contract import MAX_ROTORS
from flightstack.params.vehicle import Vehicle
from flightstack.simulator_link.hot_frames import ARMED_FLAG
from sim_bridge.multibody.frames import flip_quaternion, flip_vector
from sim_bridge.multibody.mjcf import model_xml
from sim_bridge.plant.disturbance import NO_DISTURBANCE, Disturbance
from sim_bridge.plant.faults.effects import PlantFaults, RotorFault
from sim_bridge.plant.plant import AT_REST, InitialState, Plant, PlantOptions
from sim_bridge.plants import make_plant

BOTH_PLANTS = pytest.mark.parametrize("name", ["rigid", "multibody"])
BOTH_VEHICLES = pytest.mark.parametrize("vehicle", ["paper_quad", "x_quad"])


class Flight:
    """A plant in the air, optionally without aerodynamic forces."""

    def __init__(
        self, name: str, vehicle: Vehicle, initial: InitialState = AT_REST, speeds: tuple[float, ...] = (),
        disturbance: Disturbance = NO_DISTURBANCE, step_s: float = 1e-3, thrust: bool = True, ground: bool = False,
    ) -> None:  # fmt: skip
        options = PlantOptions(disturbance, 1, initial, ground, limits=False, battery=None)
        self.plant: Plant = make_plant(vehicle, name, options)
        self.plant.set_step(step_s)
        self.step_s = step_s
        self.command = np.zeros(8)
        if speeds:
            self.plant.set_rotor_speeds(speeds)
            self.command[: len(speeds)] = speeds
        if not thrust:
            self.plant.set_faults(PlantFaults(rotors=[RotorFault(share=0.0)] * MAX_ROTORS))
        self.result = self.plant.show()

    def fly(self, seconds: float) -> Flight:
        self.result = self.plant.advance(self.command, ARMED_FLAG, round(seconds / self.step_s))
        return self

    @property
    def state(self) -> np.ndarray:
        return self.plant.output[0]["state"].copy()


def hover(vehicle: Vehicle) -> float:
    return math.sqrt(vehicle.weight_n / sum(r.thrust_coefficient_n_s2 for r in vehicle.rotors))


def model_state(
    vehicle: Vehicle, state: np.ndarray, speeds: list[float]
) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """The exported model in this state: independent momentum and energy."""
    model = mujoco.MjModel.from_xml_string(model_xml(vehicle))
    data = mujoco.MjData(model)
    data.qpos[:3], data.qvel[:3] = flip_vector(state[:3]), flip_vector(state[3:6])
    data.qpos[3:7], data.qvel[3:6] = flip_quaternion(state[6:10]), flip_vector(state[10:13])
    data.qvel[6:] = speeds
    mujoco.mj_forward(model, data)
    mujoco.mj_subtreeVel(model, data)
    mujoco.mj_energyVel(model, data)  # of frame and rotors, to data.energy[1]
    return model, data
