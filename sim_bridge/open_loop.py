"""Fly a plant with constant rotor speeds, to check its physics."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from flightstack.core.contract import MAX_ROTORS, FloatArray, Quaternion
from flightstack.core.geometry import euler_from_quaternion
from flightstack.params.vehicle import Vehicle
from flightstack.simulator_link.hot_frames import ARMED_FLAG
from sim_bridge.errors import PlantDivergedError, UsageProblemError
from sim_bridge.plant.disturbance import Disturbance
from sim_bridge.plant.layout import CONTACT, DIVERGED
from sim_bridge.plant.plant import InitialState, Plant, PlantOptions
from sim_bridge.plants import make_plant

MAX_STEPS = 100_000_000  # about a minute of computing
_STEPS_AT_ONCE = 100_000  # between two checks for Ctrl-C
_MAX_REST_DEPTH_M = 0.012


class OpenLoop(NamedTuple):
    """Configuration of an open-loop flight."""

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
    """Return the number of whole steps, their length [s], and the length of a last shorter step, or 0.

    A time that is a multiple of the step within rounding has no last step.
    """
    ratio = seconds / dt_s
    whole = round(ratio)
    if whole > 0 and abs(ratio - whole) <= 1e-9 * max(1.0, ratio):
        return whole, seconds / whole, 0.0
    count = math.floor(ratio)
    return count, dt_s, seconds - count * dt_s


def check_length(seconds: float, dt_s: float) -> None:
    """Raise UsageProblemError if the flight would take too many steps."""
    if seconds / dt_s > MAX_STEPS * (1.0 + 1e-9):
        raise UsageProblemError(
            f"--seconds {seconds:g} in steps of {dt_s:g} s are {seconds / dt_s:.3g} steps, more than "
            f"{MAX_STEPS:g}; raise --dt or lower --seconds"
        )


def start_warning(plant: Plant, ground: bool) -> str | None:
    """Return a warning if the vehicle starts below the ground, else None."""
    depth_m = plant.penetration_m()
    if not ground or depth_m < 1e-6:
        return None
    return (
        f"the vehicle starts {depth_m:.3g} m below the ground, whose contact force throws it up; "
        "start higher (--pos) or add --no-ground"
    )


def _fly(plant: Plant, command: FloatArray, steps: int, step_s: float, ground: bool) -> None:
    """Fly ``steps`` equal steps; raise PlantDivergedError, or UsageProblemError at a contact with too soft a ground."""
    plant.set_step(step_s)
    soft = ground and plant.rest_depth_m > _MAX_REST_DEPTH_M
    at_once = 1 if soft else _STEPS_AT_ONCE  # a soft ground matters at the contact alone
    result = plant.show()
    for done in range(0, steps, at_once):
        if not (soft and result & CONTACT):
            result = plant.advance(command, ARMED_FLAG, min(at_once, steps - done))
        if result & DIVERGED:
            raise PlantDivergedError("the plant diverged: forces or rates are too large for --dt")
        if soft and result & CONTACT:
            raise UsageProblemError(
                f"--dt: with steps of {step_s:g} s the vehicle sinks {plant.rest_depth_m:.2g} m into the ground; "
                "use a smaller --dt or --no-ground"
            )


def run_open_loop(run: OpenLoop, warn: Callable[[str], None] = lambda _: None) -> dict[str, Any]:
    """Return the state after the flight as plain numbers, keyed by name with unit and frame.

    Rotor speeds are not limited. With lag the rotors start at rest, without lag at their speeds. ``warn`` takes
    warnings. Raises PlantDivergedError, and UsageProblemError for options that conflict.
    """
    check_length(run.seconds, run.dt_s)
    vehicle = run.vehicle if run.lag else run.vehicle.with_ideal_rotors()
    options = PlantOptions(run.disturbance, run.seed, run.initial, run.ground, limits=False, battery=None)
    plant = make_plant(vehicle, run.plant, options)
    command = np.zeros(MAX_ROTORS)
    command[: len(run.rotor_speed_rad_s)] = run.rotor_speed_rad_s
    if not run.lag:
        plant.set_rotor_speeds(run.rotor_speed_rad_s)
    count, step_s, rest_s = split_time(run.seconds, run.dt_s)
    plant.show()
    warning = start_warning(plant, run.ground)
    if warning:
        warn(f"warning: {warning}")
    for steps, length_s in ((count, step_s), (1 if rest_s > 0.0 else 0, rest_s)):
        if steps:
            _fly(plant, command, steps, length_s, run.ground)
    return _state(plant, run.seconds)


def _state(plant: Plant, time_s: float) -> dict[str, Any]:
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
