"""Excitation of the loops: inputs that reach every term, limit and rotor. Pure.

A flight leaves terms unused: a limit that is never reached hides a wrong limit. These inputs are not those of a flight,
and need not be, because nothing is fed back in a replay. All components are sums of sines with frequencies of their
own, so that no two of them are proportional; they grow from a hundredth of the full size to the full size, so that the
laws are exercised within the rotors' limits first and beyond them later.
"""

from __future__ import annotations

import math

import numpy as np

from flightstack.core.contract import FloatArray, LoopFlags
from flightstack.firmware.c_loops import SETPOINT_AT, TARGET_AT, LoopsSetup
from gcs_cli.pil.replay import INPUT_SIZE, FlagArray, Recording

DURATION_S = 16.0
_BIASED_S, _GIVEN_S = 10.0, 13.0
"""Start of a constant position error, which fills the integrators, and start of given attitude targets."""
_SMALLEST = 0.01
_PHASE = 2.399963  # golden angle: phases of the components are spread evenly
_SIZES = {
    "position": (0, (1.5, 1.5, 0.6)),  # m
    "velocity": (3, (1.0, 1.0, 0.8)),  # m/s
    "rates": (10, (2.0, 2.0, 1.5)),  # rad/s
    "velocity setpoint": (16, (0.3, 0.3, 0.2)),
    "acceleration setpoint": (19, (1.0, 1.0, 1.0)),
}
_TILT_RAD, _YAW_RAD = 0.25, 1.2
_BIAS_M, _BIAS_M_S = (0.4, -0.4, 0.25), (0.6, -0.6, 0.4)
"""Position error and velocity towards the setpoint: their terms nearly cancel, and only the integrals grow."""
_STEP_S, _STEP_RAD = 0.4, 0.9
_GIVEN_THRUST = 1.1
"""Given thrust in weights."""


def excitation(setup: LoopsSetup) -> Recording:
    """Return the inputs of ``DURATION_S`` for loops of this configuration; the same ones each time."""
    count = round(DURATION_S * setup.inner_hz)
    time_s = np.arange(count) / setup.inner_hz
    size = np.maximum(_SMALLEST, np.minimum(1.0, (time_s / 8.0) ** 3))
    inputs = np.zeros((count, INPUT_SIZE))
    for at, sizes in _SIZES.values():
        for axis, largest in enumerate(sizes):
            inputs[:, at + axis] = largest * size * _wave(time_s, at + axis)
    roll, pitch = (_TILT_RAD * size * _wave(time_s, number) for number in (30, 31))
    yaw = _YAW_RAD * size * _wave(time_s, 32)
    inputs[:, 6:10] = _quaternions(roll, pitch, yaw)
    inputs[:, SETPOINT_AT:TARGET_AT][:, 9] = yaw + 0.1 * size * _wave(time_s, 33)
    is_outer = np.arange(count) % setup.divisor == 0
    flags = np.where(is_outer, LoopFlags.OUTER_DUE, 0)
    _add_bias(inputs, time_s)
    _add_given(inputs, flags, time_s, is_outer, setup)
    flags[0] |= LoopFlags.RESET
    held = np.maximum.accumulate(np.where(is_outer, np.arange(count), 0))
    outer_only = np.r_[0:6, SETPOINT_AT:INPUT_SIZE]
    inputs[:, outer_only] = inputs[held][:, outer_only]
    times_us = np.round(time_s * 1e6).astype(np.int64)
    return Recording(times_us, inputs.astype(np.float32).astype(np.float64), flags, is_outer, {}, True)


def _wave(time_s: FloatArray, number: int) -> FloatArray:
    """Return a component's own sum of two sines, within ±1."""
    slow, fast = 0.3 + 0.071 * number, 1.1 + 0.137 * number  # Hz
    phase = _PHASE * number
    wave: FloatArray = 0.65 * np.sin(2.0 * math.pi * slow * time_s + phase)
    return wave + 0.35 * np.sin(2.0 * math.pi * fast * time_s - phase)


def _quaternions(roll: FloatArray, pitch: FloatArray, yaw: FloatArray) -> FloatArray:
    (cr, sr), (cp, sp), (cy, sy) = ((np.cos(0.5 * a), np.sin(0.5 * a)) for a in (roll, pitch, yaw))
    return np.column_stack(
        [
            cy * cp * cr + sy * sp * sr,
            cy * cp * sr - sy * sp * cr,
            cy * sp * cr + sy * cp * sr,
            sy * cp * cr - cy * sp * sr,
        ]
    )


def _add_bias(inputs: FloatArray, time_s: FloatArray) -> None:
    """Replace position and velocity by small ones beside a constant error, for the limit of the integrals."""
    at = (time_s >= _BIASED_S) & (time_s < _GIVEN_S)
    for axis in range(3):
        inputs[at, axis] = 0.02 * inputs[at, axis] - _BIAS_M[axis]
        inputs[at, 3 + axis] = 0.02 * inputs[at, 3 + axis] + _BIAS_M_S[axis]


def _add_given(
    inputs: FloatArray, flags: FlagArray, time_s: FloatArray, is_outer: np.ndarray, setup: LoopsSetup
) -> None:
    """Give attitude targets in steps about each axis, which reach the reference's limits of rate and acceleration."""
    given = time_s >= _GIVEN_S
    flags[given & is_outer] = LoopFlags.SET_TARGET
    number = np.floor((time_s - _GIVEN_S) / _STEP_S).astype(int)
    sign = np.where(number % 2 == 0, 1.0, -1.0) * _STEP_RAD
    axes = [np.where((number // 2) % 3 == axis, sign, 0.0) for axis in range(3)]
    inputs[given, TARGET_AT : TARGET_AT + 4] = _quaternions(*axes)[given]
    weight_n = setup.vehicle.mass_kg * 9.80665
    inputs[given, -1] = _GIVEN_THRUST * weight_n * (1.0 + 0.2 * _wave(time_s, 34)[given])
