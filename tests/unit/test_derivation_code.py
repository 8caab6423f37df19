"""Plants and backstepping law as they run against the derived equations, at random points."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache
from typing import TypeAlias

import numpy as np
import pytest
import sympy as sp

from flightstack.control.attitude_backstepping import (
    BacksteppingMemory,
    BacksteppingParams,
    attitude_backstepping_step,
)
from flightstack.control.control_law import AttitudeInputs
from flightstack.core.contract import AttitudeReference, Quaternion, Vector3
from sim_bridge.plant.compiled_plant import CompiledPlant
from sim_bridge.plant.plant import InitialState, PlantOptions
from tests.support.paper_model import (
    ANGLES,
    ARM,
    H_DOT,
    HOVER_RAD_S,
    INERTIA,
    INPUTS,
    JR,
    LAW,
    OMEGA,
    OMEGA_R,
    PAPER,
    RATES,
    ROTOR,
    TABLE_I,
    TORQUE,
    U,
    a1d,
    attitude_rows,
    c1,
    c2,
    drift,
    gain,
    newton_euler,
    position_rows,
    rates_matrix,
    v1d,
    x1,
    x1d,
    x2,
)

Evaluator: TypeAlias = Callable[[Sequence[float]], np.ndarray]


def random_start(random: np.random.Generator) -> tuple[InitialState, tuple[float, ...]]:
    def vector(scale: float) -> Vector3:
        return Vector3(*(scale * random.uniform(-1.0, 1.0, 3)))

    start = InitialState(vector(5.0), vector(3.0), vector(1.2), vector(4.0))
    return start, tuple(HOVER_RAD_S * random.uniform(0.6, 1.4, 4))


def slopes(plant: CompiledPlant) -> np.ndarray:
    """Return the state vector's derivative as the plant itself computes it."""
    plant.acceleration_ned_m_s2()
    slope: np.ndarray = plant.memory[0]["slope"][0]
    return slope.copy()


def values(start: InitialState, speeds: tuple[float, ...]) -> list[float]:
    return [*start.euler_rad, *start.rates_frd_rad_s, *speeds]


ARGUMENTS = [*ANGLES, *RATES, *OMEGA]


def evaluator(rows: sp.Matrix) -> Evaluator:
    """Return a function of angles, rates and rotor speeds, with Table I filled in."""
    given_inputs = dict(zip(U, INPUTS, strict=True))
    function = sp.lambdify(ARGUMENTS, rows.subs(given_inputs).subs(TABLE_I), "numpy", cse=True)
    return lambda at: function(*at)[:, 0]


@cache
def equation_7() -> tuple[Evaluator, Evaluator]:
    """Acceleration, and the derivative of the rates."""
    return evaluator(position_rows()), evaluator(attitude_rows(OMEGA_R))


@cache
def rigid_body() -> tuple[Evaluator, Evaluator, Evaluator]:
    """Attitude quaternion, its derivative by W⁻¹ ω, and the derivative of the rates by Newton and Euler."""
    turned = quaternion(*ANGLES)
    kinematics = turned.jacobian(ANGLES) * rates_matrix().inv() * sp.Matrix(RATES)
    torque = sp.Matrix([ARM * INPUTS[1], ARM * INPUTS[2], INPUTS[3]])
    momentum = INERTIA * sp.Matrix(RATES) + sp.Matrix([0, 0, -JR * OMEGA_R])
    rates = INERTIA.inv() * (torque - sp.Matrix(RATES).cross(momentum))
    return evaluator(turned), evaluator(kinematics), evaluator(rates)


def test_paper_plant_is_equation_7_corrected() -> None:
    acceleration, rates = equation_7()
    for seed in range(20):
        start, speeds = random_start(np.random.default_rng(seed))
        plant = CompiledPlant(PAPER, "paper", PlantOptions(initial=start, ground=False, limits=False))
        plant.set_rotor_speeds(speeds)
        slope, at = slopes(plant), values(start, speeds)
        assert np.allclose(slope[3:6], acceleration(at), rtol=1e-13, atol=1e-12), seed
        assert slope[6:9] == pytest.approx(start.rates_frd_rad_s), seed
        assert np.allclose(slope[9:12], rates(at), rtol=1e-12, atol=1e-11), seed


def quaternion(*angles: sp.Expr) -> sp.Matrix:
    """Yaw, pitch, roll as half-angle quaternions, multiplied."""

    def product(a: list[sp.Expr], b: list[sp.Expr]) -> list[sp.Expr]:
        left, right = sp.Matrix(a[1:]), sp.Matrix(b[1:])
        return [a[0] * b[0] - left.dot(right), *(a[0] * right + b[0] * left + left.cross(right))]

    halves = [(sp.cos(angle / 2), sp.sin(angle / 2)) for angle in angles]
    roll, pitch, yaw = ([c, *(s * int(i == axis) for i in range(3))] for axis, (c, s) in enumerate(halves))
    return sp.Matrix(product(product(yaw, pitch), roll))


def test_rigid_plant_is_newton_euler_with_full_kinematics() -> None:
    """Its quaternion turns as φ, θ, ψ do by W⁻¹ ω; its rates by I ω' + ω × (I ω + h e_z) = τ."""
    turned, kinematics, rates = rigid_body()
    ideal = PAPER.with_ideal_rotors()
    for seed in range(1000, 1020):
        start, speeds = random_start(np.random.default_rng(seed))
        plant = CompiledPlant(ideal, "rigid", PlantOptions(initial=start, ground=False, limits=False))
        plant.set_rotor_speeds(speeds)
        plant.memory[0]["command"][:4] = speeds
        slope, at = slopes(plant), values(start, speeds)
        assert np.allclose(slope[3:6], equation_7()[0](at), rtol=1e-12, atol=1e-11), seed
        sign = math.copysign(1.0, float(turned(at) @ plant.memory[0]["body"][6:10]))
        assert np.allclose(slope[6:10], sign * kinematics(at), rtol=1e-11, atol=1e-11), seed
        assert np.allclose(slope[10:13], rates(at), rtol=1e-12, atol=1e-11), seed


def test_rigid_plant_feels_its_rotors_spin_up() -> None:
    """h' = Σ s J_r (command − Ω)/lag acts on yaw, as Lagrange says and the paper leaves out."""
    start, speeds = random_start(np.random.default_rng(7))
    command = tuple(1.1 * speed for speed in speeds)
    found = []
    for wanted in (speeds, command):
        plant = CompiledPlant(PAPER, "rigid", PlantOptions(initial=start, ground=False, limits=False))
        plant.set_rotor_speeds(speeds)
        plant.memory[0]["command"][:4] = wanted
        found.append(slopes(plant))
    h_dot = sum(
        rotor.spin * rotor.inertia_kg_m2 * 0.1 * speed / rotor.lag_s
        for rotor, speed in zip(PAPER.rotors, speeds, strict=True)
    )
    balance = newton_euler(sp.Matrix(RATES), sp.Matrix(sp.symbols("dp dq dr"))) - sp.Matrix(TORQUE)
    expected = sp.solve(balance[2], sp.Symbol("dr"))[0].diff(H_DOT) * h_dot
    difference = found[1] - found[0]
    assert difference[12] == pytest.approx(float(expected.subs(TABLE_I)), rel=1e-9)
    assert difference[:12] == pytest.approx(0.0, abs=1e-12)


@cache
def law() -> Callable[..., float]:
    return sp.lambdify([x1, x2, x1d, v1d, a1d, c1, c2, drift, gain], LAW)


def test_backstepping_code_is_the_corrected_law() -> None:
    """U2, U3, U4 from the law with f = the model's row without its input, turned into torques."""
    for seed in range(20):
        random = np.random.default_rng(seed)
        c = random.uniform(1.0, 300.0, 6)
        error, rates, rates_d, push = (random.uniform(-2.0, 2.0, 3) for _ in range(4))
        omega_r = float(random.uniform(-200.0, 200.0))
        ix, iy, iz = PAPER.inertia_kg_m2
        params = BacksteppingParams(*c, 1.0, 1.0, ix, iy, iz, ROTOR.inertia_kg_m2)
        upright = Quaternion(1.0, 0.0, 0.0, 0.0)
        inputs = AttitudeInputs(
            upright,
            Vector3(*rates),
            AttitudeReference(upright, Vector3(*rates_d), Vector3(*push)),
            Vector3(*error),
            omega_r,
            Vector3(0.0, 0.0, 0.0),
        )
        _, torque = attitude_backstepping_step(BacksteppingMemory(0.0), inputs, params, 1e-3)
        spin = sp.Symbol("W")
        arms = (float(ARM.subs(TABLE_I)), float(ARM.subs(TABLE_I)), 1.0)
        for axis, row in enumerate(attitude_rows(spin)):
            known = {**dict(zip(RATES, rates, strict=True)), spin: omega_r, **TABLE_I}
            effect = float(row.diff(U[axis + 1]).subs(known))
            model = float(row.subs(U[axis + 1], 0).subs(known))
            u = law()(
                0.0,
                rates[axis],
                error[axis],
                rates_d[axis],
                push[axis],
                c[2 * axis],
                c[2 * axis + 1],
                model,
                effect,
            )
            assert torque[axis] == pytest.approx(arms[axis] * u, rel=1e-11, abs=1e-12), (seed, axis)
