"""Attitude laws of different kinds, as a user would write them: material for the generator."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np

from flightstack.control.control_law import AttitudeInputs
from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Quaternion, Vector3
from flightstack.core.geometry import conjugate, cross, quaternion_product, rotate
from flightstack.core.portable_math import exp

# ------------------------------------------------------------------ sliding mode


class SlidingMemory(NamedTuple):
    """Integral of the sliding variable, for the super-twisting law."""

    x: float
    y: float
    z: float


class SlidingParams(NamedTuple):
    """Slope of the surface [1/s], gains of the reaching law, width of the boundary layer, inertias."""

    slope: float
    reach: float
    twist: float
    width: float
    ix_kg_m2: float
    iy_kg_m2: float
    iz_kg_m2: float


@compiled
def _saturated(value: float, width: float) -> float:
    if abs(value) > width:
        return 1.0 if value > 0.0 else -1.0
    return value / width


@compiled
def _sliding_axis(s: float, integral: float, params: SlidingParams, dt_s: float) -> tuple[float, float]:
    """Return the acceleration [rad/s²] and the next integral of the super-twisting law."""
    direction = _saturated(s, params.width)
    integral += params.twist * direction * dt_s
    return params.reach * math.sqrt(abs(s)) * direction + integral, integral


@compiled
def sliding_mode_step(
    memory: SlidingMemory, inputs: AttitudeInputs, params: SlidingParams, dt_s: float
) -> tuple[SlidingMemory, Vector3]:
    """Super-twisting sliding mode on s = ω_d − ω + λ e of each axis."""
    e, w, wanted = inputs.error_rad, inputs.rates_frd_rad_s, inputs.reference.rates_frd_rad_s
    s = Vector3(
        wanted.x - w.x + params.slope * e.x,
        wanted.y - w.y + params.slope * e.y,
        wanted.z - w.z + params.slope * e.z,
    )
    roll, ix = _sliding_axis(s.x, memory.x, params, dt_s)
    pitch, iy = _sliding_axis(s.y, memory.y, params, dt_s)
    yaw, iz = _sliding_axis(s.z, memory.z, params, dt_s)
    return SlidingMemory(ix, iy, iz), Vector3(
        params.ix_kg_m2 * roll, params.iy_kg_m2 * pitch, params.iz_kg_m2 * yaw
    )


# ------------------------------------------------------------------ geometric, on SE(3)


class GeometricMemory(NamedTuple):
    """The law has no memory."""

    unused: float


class GeometricParams(NamedTuple):
    """Gains of attitude [N m] and rate [N m s], and inertias."""

    k_r: float
    k_w: float
    ix_kg_m2: float
    iy_kg_m2: float
    iz_kg_m2: float


@compiled
def geometric_step(
    memory: GeometricMemory, inputs: AttitudeInputs, params: GeometricParams, dt_s: float
) -> tuple[GeometricMemory, Vector3]:
    """Lee's geometric control: M = −k_R e_R − k_Ω e_Ω + Ω × JΩ − J(Ω × R'R_d Ω_d − R'R_d Ω̇_d), e_R by quaternion."""
    w = inputs.rates_frd_rad_s
    turn = quaternion_product(conjugate(inputs.reference.attitude), inputs.attitude)
    sign = 1.0 if turn.w >= 0.0 else -1.0
    e_r = Vector3(2.0 * sign * turn.w * turn.x, 2.0 * sign * turn.w * turn.y, 2.0 * sign * turn.w * turn.z)
    w_d = rotate(conjugate(turn), inputs.reference.rates_frd_rad_s)
    e_w = Vector3(w.x - w_d.x, w.y - w_d.y, w.z - w_d.z)
    momentum = Vector3(params.ix_kg_m2 * w.x, params.iy_kg_m2 * w.y, params.iz_kg_m2 * w.z)
    gyro, carried = cross(w, momentum), cross(w, w_d)
    ahead = inputs.reference.acceleration_frd_rad_s2
    return memory, Vector3(
        -params.k_r * e_r.x - params.k_w * e_w.x + gyro.x - params.ix_kg_m2 * (carried.x - ahead.x),
        -params.k_r * e_r.y - params.k_w * e_w.y + gyro.y - params.iy_kg_m2 * (carried.y - ahead.y),
        -params.k_r * e_r.z - params.k_w * e_w.z + gyro.z - params.iz_kg_m2 * (carried.z - ahead.z),
    )


# ------------------------------------------------------------------ incremental dynamic inversion


class IndiMemory(NamedTuple):
    """Filtered rates and accelerations, and the last torque."""

    rates: Vector3
    accelerations: Vector3
    torque: Vector3


class IndiParams(NamedTuple):
    """Gains, cut-off of the filter [rad/s] and inertias."""

    k_angle: float
    k_rate: float
    cutoff_rad_s: float
    inertia_kg_m2: Vector3


@compiled
def _low_pass(old: float, new: float, share: float) -> float:
    return old + share * (new - old)


@compiled
def indi_step(
    memory: IndiMemory, inputs: AttitudeInputs, params: IndiParams, dt_s: float
) -> tuple[IndiMemory, Vector3]:
    """Incremental nonlinear dynamic inversion: the torque changes by the error of the measured acceleration."""
    share = params.cutoff_rad_s * dt_s / (1.0 + params.cutoff_rad_s * dt_s)
    old, w = memory.rates, inputs.rates_frd_rad_s
    rates = Vector3(_low_pass(old.x, w.x, share), _low_pass(old.y, w.y, share), _low_pass(old.z, w.z, share))
    measured = Vector3((rates.x - old.x) / dt_s, (rates.y - old.y) / dt_s, (rates.z - old.z) / dt_s)
    error, inertia = inputs.error_rad, params.inertia_kg_m2
    wanted, before = inputs.reference.acceleration_frd_rad_s2, memory.torque
    torque = Vector3(
        before.x + inertia.x * (wanted.x + params.k_angle * error.x - params.k_rate * w.x - measured.x),
        before.y + inertia.y * (wanted.y + params.k_angle * error.y - params.k_rate * w.y - measured.y),
        before.z + inertia.z * (wanted.z + params.k_angle * error.z - params.k_rate * w.z - measured.z),
    )
    if not (math.isfinite(torque.x) and math.isfinite(torque.y) and math.isfinite(torque.z)):
        torque = before
    return IndiMemory(rates, measured, torque), torque


# ------------------------------------------------------------------ model reference adaptive control


class MracMemory(NamedTuple):
    """State of the reference model and the adapted gains of one axis each."""

    roll_rad: float
    rate_rad_s: float
    k_state: float
    k_input: float


class MracParams(NamedTuple):
    """Reference model, rate of adaptation, and their limit."""

    bandwidth_rad_s: float
    damping: float
    adaptation: float
    largest_gain: float


STEPS = 4
LEAKAGE = np.float64(1e-3)


@compiled
def mrac_step(
    memory: MracMemory, inputs: AttitudeInputs, params: MracParams, dt_s: float
) -> tuple[MracMemory, Vector3]:
    """Adapt the gains of roll by Lyapunov's rule, the model integrated in ``STEPS`` parts; the other axes by PD."""
    angle, rate = memory.roll_rad, memory.rate_rad_s
    error = inputs.error_rad.x
    part = dt_s / STEPS
    for i in range(STEPS):
        acceleration = params.bandwidth_rad_s * params.bandwidth_rad_s * (error - angle)
        acceleration -= 2.0 * params.damping * params.bandwidth_rad_s * rate
        rate += acceleration * part
        if i > 0 and abs(rate) > 1e6:
            break
        angle += rate * part
    slip = rate - inputs.rates_frd_rad_s.x
    k_state = memory.k_state + dt_s * (
        params.adaptation * slip * inputs.rates_frd_rad_s.x - LEAKAGE * memory.k_state
    )
    k_input = memory.k_input + dt_s * (params.adaptation * slip * error - LEAKAGE * memory.k_input)
    k_state = min(max(k_state, -params.largest_gain), params.largest_gain)
    k_input = min(max(k_input, -params.largest_gain), params.largest_gain)
    torque = Vector3(
        k_state * inputs.rates_frd_rad_s.x + k_input * error,
        inputs.error_rad.y - 0.2 * inputs.rates_frd_rad_s.y,
        inputs.error_rad.z - 0.2 * inputs.rates_frd_rad_s.z,
    )
    return MracMemory(angle, rate, k_state, k_input), torque


# ------------------------------------------------------------------ a small neural network

HIDDEN = 5
_random = np.random.default_rng(4)
WEIGHTS_1 = _random.normal(size=(HIDDEN, 6)).round(6)
BIAS_1 = _random.normal(size=HIDDEN).round(6)
WEIGHTS_2 = tuple(tuple(row) for row in _random.normal(size=(3, HIDDEN)).round(6).tolist())


class NeuralParams(NamedTuple):
    """Scale of the output."""

    largest_torque_n_m: float


@compiled
def _tanh(x: float) -> float:
    """Hyperbolic tangent by the exponential function."""
    if x > 20.0 or x < -20.0:
        return 1.0 if x > 0.0 else -1.0
    both = exp(2.0 * x)
    return (both - 1.0) / (both + 1.0)


@compiled
def _layer(values: Annotated[FloatArray, 6], out: Annotated[FloatArray, HIDDEN]) -> None:
    for row in range(HIDDEN):
        total = BIAS_1[row]
        for column in range(6):
            total += WEIGHTS_1[row, column] * values[column]
        out[row] = _tanh(total)


@compiled
def neural_step(
    memory: GeometricMemory, inputs: AttitudeInputs, params: NeuralParams, dt_s: float
) -> tuple[GeometricMemory, Vector3]:
    """A network of one hidden layer from angle and rate errors to torque."""
    values = np.zeros(6)
    hidden = np.empty(HIDDEN)
    output = np.zeros(3)
    values[0], values[1], values[2] = inputs.error_rad
    values[3], values[4], values[5] = inputs.rates_frd_rad_s
    _layer(values, hidden)
    for row in range(3):
        for column in range(HIDDEN):
            output[row] += WEIGHTS_2[row][column] * hidden[column]
        output[row] *= params.largest_torque_n_m
    return memory, Vector3(output[0], output[1], output[2])


LAWS = {
    "sliding mode": sliding_mode_step,
    "geometric": geometric_step,
    "INDI": indi_step,
    "MRAC": mrac_step,
    "neural network": neural_step,
}
UNIT = Quaternion(1.0, 0.0, 0.0, 0.0)
