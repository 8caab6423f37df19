"""What the choice of the plant costs: whole flights, and a millisecond of the plant alone."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from benchmarks.measure import Figure, figure, interleaved_us
from benchmarks.three_processes import fly
from flightstack.core.contract import Vector3
from flightstack.params.vehicle import load_vehicle
from flightstack.simulator_link.hot_frames import ARMED_FLAG
from sim_bridge.plant.plant import InitialState, PlantOptions
from sim_bridge.plants import make_plant

PLANTS = ("rigid", "multibody")
INNER_HZ = 500.0
STEPS = 100


class PlantCost(NamedTuple):
    """Figures of one plant."""

    factor: Figure  # of ``gcs fly``, times real time
    step_us: Figure  # of the same, a step of the inner loop
    physics_us: Figure  # a physics step of 1 ms in the air, the plant alone


def plants(rounds: int, seconds: float) -> dict[str, PlantCost]:
    """Fly with each plant, interleaved; the first flight with each only warms the caches."""
    for name in PLANTS:
        fly(INNER_HZ, name)
    factors: dict[str, list[float]] = {name: [] for name in PLANTS}
    for _ in range(rounds):
        for name in PLANTS:
            factors[name].append(fly(INNER_HZ, name)[0]["real_time_factor"])
    alone = interleaved_us({name: _in_hover(name) for name in PLANTS}, rounds, seconds)
    return {
        name: PlantCost(
            figure(seen),
            figure(1e6 / factor / INNER_HZ for factor in seen),
            figure(value / STEPS for value in (alone[name].least, alone[name].median, alone[name].greatest)),
        )
        for name, seen in factors.items()
    }


def _in_hover(name: str) -> Callable[[], object]:
    """Return a call that advances a hovering vehicle by ``STEPS`` physics steps."""
    vehicle = load_vehicle("paper_quad")
    high = PlantOptions(initial=InitialState(Vector3(0.0, 0.0, -1e6)), battery=None)
    plant = make_plant(vehicle, name, high)
    rotor = vehicle.rotors[0]
    command = np.full(8, (vehicle.weight_n / len(vehicle.rotors) / rotor.thrust_coefficient_n_s2) ** 0.5)
    return lambda: plant.advance(command, ARMED_FLAG, STEPS)
