"""Fly a plant with constant rotor speeds: the tool with which anyone checks the physics."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from flightstack.contract import MAX_ROTORS, Quaternion
from flightstack.geometry import euler_from_quaternion
from flightstack.mavlink.hot_frames import ARMED_FLAG
from flightstack.params.vehicle import Vehicle
from sim_bridge.compiled_plant import CompiledPlant
from sim_bridge.disturbance import Disturbance
from sim_bridge.errors import PlantDivergedError
from sim_bridge.layout import DIVERGED
from sim_bridge.plant import InitialState, PlantOptions

_STEPS_AT_ONCE = 100_000  # between two looks at Ctrl-C


class OpenLoop(NamedTuple):
    """One open-loop flight."""

    vehicle: Vehicle
    plant: str
    rotor_speed_rad_s: tuple[float, ...]
    initial: InitialState
    seconds: float
    dt_s: float
    ground: bool
    lag: bool
    disturbance: Disturbance
    seed: int


def split_time(seconds: float, dt_s: float) -> tuple[int, float, float]:
    """Return the number of whole steps, their length [s], and the length of a last shorter step (or 0).

    A time that is a multiple of the step but for rounding has no last step.
    """
    ratio = seconds / dt_s
    whole = round(ratio)
    if whole > 0 and abs(ratio - whole) <= 1e-9 * max(1.0, ratio):
        return whole, seconds / whole, 0.0
    count = math.floor(ratio)
    return count, dt_s, seconds - count * dt_s


def run_open_loop(run: OpenLoop) -> dict[str, Any]:
    """Return the state after the flight as plain numbers, keyed by name with unit and frame.

    Rotor speeds are taken as given, without the vehicle's limits. With lag the rotors start at rest, without
    they are at their speeds from the start. Raises PlantDivergedError.
    """
    vehicle = run.vehicle if run.lag else run.vehicle.with_ideal_rotors()
    options = PlantOptions(run.disturbance, run.seed, run.initial, run.ground, limits=False)
    plant = CompiledPlant(vehicle, run.plant, options)
    command = np.zeros(MAX_ROTORS)
    command[: len(run.rotor_speed_rad_s)] = run.rotor_speed_rad_s
    if not run.lag:
        plant.set_rotor_speeds(run.rotor_speed_rad_s)
    count, step_s, rest_s = split_time(run.seconds, run.dt_s)
    result = plant.show()
    for steps, length_s in ((count, step_s), (1 if rest_s > 0.0 else 0, rest_s)):
        if steps:
            plant.set_step(length_s)
        for done in range(0, steps, _STEPS_AT_ONCE):
            result = plant.advance(command, ARMED_FLAG, min(_STEPS_AT_ONCE, steps - done))
            if result & DIVERGED:
                raise PlantDivergedError("the plant diverged: forces or rates are too large for --dt")
    return _state(plant, run.seconds)


def _state(plant: CompiledPlant, time_s: float) -> dict[str, Any]:
    x = plant.output[0]["state"].tolist()
    euler = plant.euler_rad() or euler_from_quaternion(Quaternion(*x[6:10]))
    return {
        "time_s": time_s,
        "pos_ned_m": x[0:3],
        "vel_ned_m_s": x[3:6],
        "quaternion": x[6:10],
        "euler_rad": list(euler),
        "rates_frd_rad_s": x[10:13],
        "rotor_speed_rad_s": plant.rotor_speeds_rad_s(),
    }
