"""The real loops and plant with signals so small that they are linear, to check the analysis."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from flightstack.core.contract import (
    ATTITUDE_TARGET_SIZE,
    MAX_ROTORS,
    SETPOINT_SIZE,
    STATE_SIZE,
    FloatArray,
    LoopRow,
)
from flightstack.core.geometry import quaternion_from_euler
from flightstack.params.vehicle import Vehicle, load_vehicle
from gcs_cli.experiments.paper.flights.closed_loop import Exchange, make_loops
from gcs_cli.experiments.paper.flights.types import Case
from gcs_cli.experiments.paper.linear.gains import (
    ATTITUDE_AXES,
    BACKSTEPPING,
    BACKSTEPPING_C,
    POSITION_AXES,
    Gains,
    gains_from,
)
from gcs_cli.experiments.paper.linear.sampled import Actuators

VELOCITY_AT, RATES_AT = 3, 10
"""Columns of the state: velocity NED, body rates FRD."""
STEP_RAD, STEP_M = 1e-4, 1e-4
"""Steps so small that nonlinear effects stay below a millionth of them."""
TRAJECTORY = "step_roll"
"""A case must name one; it is not flown here."""


def small_case(controller: str, gains: str, inner_hz: int, *, plant: str = "paper", lag_s: float = 0.0,
               delay_steps: int = 0, divisor: int = 1) -> Case:  # fmt: skip
    """Return a case with rotors without limits, with the given lag, and an outer tick in every ``divisor``."""
    return Case(
        f"small-{controller}-{gains}-{inner_hz}",
        TRAJECTORY,
        controller,
        gains,
        plant,
        limits=False,
        inner_hz=inner_hz,
        outer_hz=max(1, inner_hz // divisor),
        lag_s=lag_s,
        delay_steps=delay_steps,
    )


def flown_gains(controller: str, gains: str) -> Gains:
    """Read the gains from the loops themselves; raise ConfigError."""
    loops = make_loops(small_case(controller, gains, 1000))
    return gains_from(
        controller, {spec.name: loops.get_parameter(spec.name) for spec in loops.parameter_specs}
    )


def actuators_of(case: Case, axis: str) -> Actuators:
    """Return the actuators of the case on one axis for the analysis."""
    vehicle = load_vehicle(case.vehicle)
    lag_s = vehicle.rotors[0].lag_s if case.lag_s is None else case.lag_s
    has_spin_up = axis == "yaw" and case.plant != "paper"
    return Actuators(case.delay_steps, lag_s, spin_up_lead_s(vehicle) if has_spin_up else 0.0)


def spin_up_lead_s(vehicle: Vehicle) -> float:
    """Return J_r/(2 d Ω) at hover, the lead of the spin-up torque over the drag torque of the rotors.

    Rotors moved by ε against and along their spin give 2 d Ω ε of drag torque and J_r ε' of reaction each.
    """
    rotor = vehicle.rotors[0]
    thrust_n = vehicle.weight_n / len(vehicle.rotors)
    speed = math.sqrt(thrust_n / rotor.thrust_coefficient_n_s2)
    return rotor.inertia_kg_m2 / (2.0 * rotor.torque_coefficient_n_m_s2 * speed)


class End(NamedTuple):
    """A flight ends early where the magnitude of a column of the state is not below ``above``."""

    column: int
    above: float


class Flight(NamedTuple):
    """One row for each inner tick, before the loops ran."""

    time_s: FloatArray
    """Shape (n,)."""
    states: FloatArray
    """Shape (n, 13), array form of ``VehicleState``."""


def fly_attitude(case: Case, ticks: int, axis: str, *, step_rad: float = 0.0, kick_rad_s: float = 0.0,
                 alone: bool = False, ends_at_rad_s: float = math.inf) -> Flight:  # fmt: skip
    """Fly a step of the attitude target, or a kick, without the reference filter.

    The kick is a torque over the first tick that turns the vehicle by ``kick_rad_s``. The attitude loop of a case
    whose outer rate is its inner rate gets the step at once. ``alone`` gives the other axes gains that are stable at
    any rate, because an unstable axis would disturb this one. The flight ends where the axis turns
    faster than ``ends_at_rad_s``.
    """
    target = np.zeros(ATTITUDE_TARGET_SIZE)
    angles = [step_rad if name == axis else 0.0 for name in ATTITUDE_AXES]
    target[:4], target[4] = quaternion_from_euler(*angles), load_vehicle(case.vehicle).weight_n
    parameters = {"ATT_REF_BW": 0.0}
    if alone:
        others = [name.upper() for name in ATTITUDE_AXES if name != axis]
        parameters |= {
            name: value for other in others for name, value in _quiet(case.controller, other).items()
        }
    kick = _kicked(case, axis, kick_rad_s) if kick_rad_s else None
    ends = End(RATES_AT + ATTITUDE_AXES.index(axis), ends_at_rad_s)
    return _fly(case, ticks, target, parameters, first_command=kick, ends=ends)


def _quiet(controller: str, axis: str) -> dict[str, float]:
    """Return parameters that give an axis kp = 1 and kd = 1."""
    if controller == BACKSTEPPING:
        outer, inner = BACKSTEPPING_C[axis.lower()]
        return {f"BS_{axis}_{outer}": 0.0, f"BS_{axis}_{inner}": 1.0}
    return {f"PID_{axis}_P": 1.0, f"PID_{axis}_I": 0.0, f"PID_{axis}_D": 1.0}


def fly_position(case: Case, ticks: int, axis: str, step_m: float = STEP_M, *, divisor: int | None = None,
                 alone: bool = False, ends_at_m_s: float = math.inf) -> Flight:  # fmt: skip
    """Fly a step of the position setpoint on one axis with all loops and the reference filter.

    ``divisor`` is the number of inner ticks in an outer period, None for the case's: the outer rate need not be an
    integer. ``alone`` gives the other axes gains that are stable at any rate. The
    flight ends where the axis moves faster than ``ends_at_m_s``.
    """
    setpoint, column = np.zeros(SETPOINT_SIZE), POSITION_AXES.index(axis)
    setpoint[column] = step_m
    parameters = _quiet_position("XY" if axis == "z" else "Z") if alone else {}
    ends = End(VELOCITY_AT + column, ends_at_m_s)
    return _fly(case, ticks, setpoint, parameters, divisor=divisor, ends=ends)


def _quiet_position(loop: str) -> dict[str, float]:
    return {f"POS_{loop}_P": 0.05, f"POS_{loop}_I": 0.0, f"POS_{loop}_D": 0.5}


def _kicked(case: Case, axis: str, rate_rad_s: float) -> FloatArray:
    """Return the commands that give the vehicle at hover ``rate_rad_s`` in one tick."""
    vehicle = load_vehicle(case.vehicle)
    index = ATTITUDE_AXES.index(axis)
    wrench = np.zeros(4)
    wrench[0], wrench[index + 1] = vehicle.weight_n, vehicle.inertia_kg_m2[index] * rate_rad_s * case.inner_hz
    squared = np.linalg.pinv(vehicle.effectiveness()) @ wrench
    command = np.zeros(MAX_ROTORS)
    command[: len(squared)] = np.sign(squared) * np.sqrt(np.abs(squared))
    return command


def _fly(case: Case, ticks: int, wanted: FloatArray, parameters: dict[str, float], *, ends: End,
         divisor: int | None = None, first_command: FloatArray | None = None) -> Flight:  # fmt: skip
    """Fly a constant attitude target (5,) or setpoint (11,); ``first_command`` replaces that of the first tick."""
    every = divisor or round(case.inner_hz / case.outer_hz)
    exchange = Exchange(case, case.inner_hz / every)
    is_target = len(wanted) == ATTITUDE_TARGET_SIZE
    for name, value in parameters.items():
        exchange.loops.set_parameter(name, value)
    exchange.loops.reset(exchange.state)
    row, states = np.zeros(LoopRow.SIZE), np.empty((ticks, STATE_SIZE))
    for tick in range(ticks):
        states[tick] = exchange.state
        exchange.tick(wanted, tick % every == 0, is_target, row, None if tick else first_command)
        if not abs(exchange.state[ends.column]) < ends.above:
            states = states[: tick + 1]
            break
    return Flight(np.arange(len(states)) / case.inner_hz, states)
