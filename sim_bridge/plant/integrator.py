"""The integrator of the compiled plants: classic fixed-step Runge-Kutta of order 4.

The rotors are not part of the Runge-Kutta state: the exact solution of their first-order lag gives their speeds at the
start, the middle and the end of each step.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

from flightstack.core.compiled import compiled, specialise
from flightstack.core.contract import STATE_SIZE, FloatArray, Record, RecordArray
from sim_bridge.plant import paper, rigid
from sim_bridge.plant.battery import discharge
from sim_bridge.plant.layout import DIVERGED
from sim_bridge.plant.rotors import half_step, rotor_forces, take_commands

LARGEST_TURN_RAD = 1.0
"""Largest valid rotation in one step; beyond it the attitude is not accurate."""

# defaults of the names that ``specialise`` binds in the templates below
derivative = rigid.derivative
before_step = rigid.before_step
after_step = rigid.after_step
show = rigid.show


@compiled
def _stage(x: FloatArray, scale: float, slope: FloatArray, out: FloatArray) -> None:
    for i in range(STATE_SIZE):
        out[i] = x[i] + scale * slope[i]


@compiled
def _combine(x: FloatArray, h: float, a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> None:
    for i in range(STATE_SIZE):
        x[i] += h / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i])


@compiled
def next_gust(m: Record) -> None:
    """Advance the Gauss-Markov processes of wind and torque: exact at the steps, constant within a step."""
    row = m["noise_row"]
    gust, scale, noise = m["gust"], m["gust_scale"], m["noise"]
    twist, twist_scale, twist_noise = m["torque_gust"], m["torque_gust_scale"], m["torque_noise"]
    torque, steady = m["torque"], m["steady_torque"]
    for i in range(3):
        gust[i] = m["gust_decay"] * gust[i] + scale[i] * noise[row, i]
        twist[i] = m["torque_gust_decay"] * twist[i] + twist_scale[i] * twist_noise[row, i]
        torque[i] = steady[i] + twist[i]
    m["noise_row"] += 1


@compiled
def _has_diverged(x: FloatArray, state: FloatArray, h: float) -> bool:
    """Return True if the state ``x`` is not finite, or the rotation per step is too large."""
    total = 0.0
    for i in range(STATE_SIZE):
        total += abs(x[i])
    p, q, r = state[10], state[11], state[12]
    turn = math.sqrt(p * p + q * q + r * r) * h
    return not (math.isfinite(total) and turn <= LARGEST_TURN_RAD)


def _advance(memory: RecordArray, command: FloatArray, flags: int, steps: int, output: RecordArray) -> int:
    """Advance by ``steps`` steps with the commands [rad/s] held; write the state to ``output``.

    ``memory`` has dtype ``MEMORY``, shape (1,), ``output`` ``OUTPUT``, shape (1,); ``flags`` are those of
    FS_ACTUATORS. Returns the bits CONTACT and DIVERGED (not finite, or too large a rotation per step).
    """
    m, o = memory[0], output[0]
    x, stage, slopes = m["body"], m["stage"], m["slope"]
    k1, k2, k3, k4 = slopes[0], slopes[1], slopes[2], slopes[3]
    h = m["step_s"]
    gusty = m["gust_scale"][0] > 0.0 or m["torque_gust_scale"][0] > 0.0
    has_battery = m["curve_count"] > 0
    if steps > 0:
        take_commands(m, command, flags)
    at_end = rotor_forces(m)
    for _ in range(steps):
        if gusty:
            next_gust(m)
        before_step(x, m)
        at_start = at_end
        half_step(m)
        at_middle = rotor_forces(m)
        half_step(m)
        at_end = rotor_forces(m)
        derivative(x, at_start, m, k1)
        _stage(x, 0.5 * h, k1, stage)
        derivative(stage, at_middle, m, k2)
        _stage(x, 0.5 * h, k2, stage)
        derivative(stage, at_middle, m, k3)
        _stage(x, h, k3, stage)
        derivative(stage, at_end, m, k4)
        _combine(x, h, k1, k2, k3, k4)
        after_step(x)
        if has_battery:
            discharge(m, (at_start.power_w + 4.0 * at_middle.power_w + at_end.power_w) / 6.0, h)
    result = show(m, o["state"])
    speeds, shown = m["rotor_speed"], o["rotor_speed"]
    for i in range(m["rotor_count"]):
        shown[i] = speeds[i]
    return result | DIVERGED if _has_diverged(x, o["state"], h) else result


def _slope_at(memory: RecordArray) -> None:
    """Write the derivative of the present state to the first row of ``slope``."""
    m = memory[0]
    derivative(m["body"], rotor_forces(m), m, m["slope"][0])


@cache  # reading a kernel from disk takes longer than a second of flight
def _join(template: Callable[..., Any], plant: str) -> Callable[..., Any]:
    module = {"rigid": rigid, "paper": paper}[plant]
    parts = ("derivative", "before_step", "after_step", "show")
    return specialise(template, plant, **{name: getattr(module, name) for name in parts})


def advance_kernel(plant: str) -> Callable[[RecordArray, FloatArray, int, int, RecordArray], int]:
    """Return the compiled ``_advance`` of a plant, "rigid" or "paper"."""
    return _join(_advance, plant)


def slope_kernel(plant: str) -> Callable[[RecordArray], None]:
    """Return the compiled ``_slope_at`` of a plant."""
    return _join(_slope_at, plant)
