"""The paper's equations in SymPy, as printed and as corrected, and their derivation from rigid-body mechanics.

Angles φ θ ψ rotate about x, y, z in the order ψ, θ, φ (equation 1), for either direction of z. ``q`` are the angles,
``v`` and ``a`` their first and second derivatives; ``W`` maps v to the body rates.
"""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import sympy as sp

from flightstack.params.vehicle import GRAVITY_M_S2, load_vehicle

phi, theta, psi = ANGLES = sp.symbols("phi theta psi", real=True)
V = sp.symbols("phi_1 theta_1 psi_1", real=True)
A = sp.symbols("phi_2 theta_2 psi_2", real=True)
p, q, r = RATES = sp.symbols("p q r", real=True)
IX, IY, IZ, JR, MASS, G, ARM, LIFT, DRAG = sp.symbols("I_x I_y I_z J_r m g l b d", positive=True)
OMEGA = sp.symbols("Omega_1:5", real=True)
U = sp.symbols("U_1:5", real=True)
H, H_DOT = sp.symbols("h h_1", real=True)
"""Angular momentum of the rotors about the body's z, Σ s J_r Ω, and its derivative."""
TORQUE = sp.symbols("tau_x tau_y tau_z", real=True)

INERTIA = sp.diag(IX, IY, IZ)
OMEGA_R = OMEGA[1] + OMEGA[3] - OMEGA[0] - OMEGA[2]
"""Ω_r of the paper; seen from above rotors 1 and 3 turn clockwise: about +z of FRD, h = −J_r Ω_r."""


def about_x(angle: sp.Expr) -> sp.Matrix:
    return sp.Matrix([[1, 0, 0], [0, sp.cos(angle), -sp.sin(angle)], [0, sp.sin(angle), sp.cos(angle)]])


def about_y(angle: sp.Expr) -> sp.Matrix:
    return sp.Matrix([[sp.cos(angle), 0, sp.sin(angle)], [0, 1, 0], [-sp.sin(angle), 0, sp.cos(angle)]])


def about_z(angle: sp.Expr) -> sp.Matrix:
    return sp.Matrix([[sp.cos(angle), -sp.sin(angle), 0], [sp.sin(angle), sp.cos(angle), 0], [0, 0, 1]])


ROTATION = about_z(psi) * about_y(theta) * about_x(phi)
"""Body to world, equation 1."""


def in_time(expression: sp.Expr | sp.Matrix) -> sp.Expr | sp.Matrix:
    """Differentiate with respect to time; the derivatives of angles, ``V`` and h are ``V``, ``A`` and h'."""
    moving = (*zip(ANGLES, V, strict=True), *zip(V, A, strict=True), (H, H_DOT))
    return sum((expression.diff(symbol) * rate for symbol, rate in moving), 0 * expression)


def reduced(expression: sp.Expr) -> sp.Expr:
    """Return the normal form of a polynomial in sines and cosines of the angles: 0 if and only if it is zero."""
    expression = sp.expand(expression)
    for angle in ANGLES:
        sine, cosine = sp.sin(angle), sp.cos(angle)
        powers = sp.Poly(expression, sine) if expression.has(sine) else None
        if powers is not None:
            terms = powers.as_dict().items()
            expression = sum(
                coefficient * (1 - cosine**2) ** (power // 2) * sine ** (power % 2)
                for (power,), coefficient in terms
            )
        expression = sp.expand(expression)
    return expression


@cache
def body_rates() -> sp.Matrix:
    """ω from Rᵀ R' = [ω]×, as functions of angles and their derivatives."""
    spin = ROTATION.T * in_time(ROTATION)
    return sp.Matrix([reduced(spin[2, 1]), reduced(spin[0, 2]), reduced(spin[1, 0])])


@cache
def rates_matrix() -> sp.Matrix:
    """W of ω = W·(φ', θ', ψ')."""
    return body_rates().jacobian(sp.Matrix(V))


def kinetic_energy() -> sp.Expr:
    """The paper's T with true moments of inertia, and the rotors' spin: ½ ωᵀ I ω + h r (what has no ω is left out).

    The last bracket of the paper is −r; it is squared.
    """
    roll = V[0] - V[2] * sp.sin(theta)
    pitch = V[1] * sp.cos(phi) + V[2] * sp.sin(phi) * sp.cos(theta)
    yaw = V[1] * sp.sin(phi) - V[2] * sp.cos(phi) * sp.cos(theta)
    return sp.Rational(1, 2) * (IX * roll**2 + IY * pitch**2 + IZ * yaw**2) - H * yaw


def euler_lagrange() -> sp.Matrix:
    """Γ_i = d/dt ∂T/∂q'_i − ∂T/∂q_i of the angles (equation 2)."""
    energy = kinetic_energy()
    return sp.Matrix(
        [in_time(energy.diff(rate)) - energy.diff(angle) for angle, rate in zip(ANGLES, V, strict=True)]
    )


def newton_euler(rates: sp.Matrix, acceleration: sp.Matrix) -> sp.Matrix:
    """I ω' + ω × (I ω + h e_z) + h' e_z: torque on a body with spinning rotors."""
    momentum = INERTIA * rates + sp.Matrix([0, 0, H])
    return INERTIA * acceleration + rates.cross(momentum) + sp.Matrix([0, 0, H_DOT])


class Coefficients(NamedTuple):
    """a1 … a5 and b1 … b3 of equation 7."""

    a1: sp.Expr
    a2: sp.Expr
    a3: sp.Expr
    a4: sp.Expr
    a5: sp.Expr
    b1: sp.Expr
    b2: sp.Expr
    b3: sp.Expr


CORRECTED = Coefficients(
    (IY - IZ) / IX, JR / IX, (IZ - IX) / IY, JR / IY, (IX - IY) / IZ, ARM / IX, ARM / IY, 1 / IZ
)
PRINTED_B3 = ARM / IZ


def attitude_rows(omega_r: sp.Expr, c: Coefficients = CORRECTED) -> sp.Matrix:
    """p', q', r' of equation 7, with p, q, r where the paper writes φ', θ', ψ'."""
    return sp.Matrix(
        [
            c.a1 * q * r + c.a2 * q * omega_r + c.b1 * U[1],
            c.a3 * p * r - c.a4 * p * omega_r + c.b2 * U[2],
            c.a5 * p * q + c.b3 * U[3],
        ]
    )


def position_rows(horizontal_sign: int = -1) -> sp.Matrix:
    """x'', y'', z'' of equation 7 in NED; ``horizontal_sign`` is printed as +1."""
    sf, cf, st, ct, sy, cy = (f(angle) for angle in ANGLES for f in (sp.sin, sp.cos))
    return sp.Matrix(
        [
            horizontal_sign * (cf * st * cy + sf * sy) * U[0] / MASS,
            horizontal_sign * (cf * st * sy - sf * cy) * U[0] / MASS,
            G - cf * ct * U[0] / MASS,
        ]
    )


INPUTS = sp.Matrix(
    [
        LIFT * sum(w**2 for w in OMEGA),
        LIFT * (OMEGA[3] ** 2 - OMEGA[1] ** 2),
        LIFT * (OMEGA[0] ** 2 - OMEGA[2] ** 2),
        DRAG * (OMEGA[1] ** 2 + OMEGA[3] ** 2 - OMEGA[0] ** 2 - OMEGA[2] ** 2),
    ]
)
"""U1 … U4 below equation 7."""

x1, x2, x1d, v1d, a1d = sp.symbols("x_1 x_2 x_1d v_1d a_1d", real=True)
c1, c2 = sp.symbols("c_1 c_2", positive=True)
drift, gain = sp.symbols("f b_1", real=True)
E1 = x1d - x1
E2 = x2 - v1d - c1 * E1
LAW = (E1 - c2 * E2 - c1 * (c1 * E1 + E2) + a1d - drift) / gain
"""The corrected law, for x1' = x2, x2' = f + b1 U."""

PAPER = load_vehicle("paper_quad")
ROTOR = PAPER.rotors[0]
TABLE_I = {
    IX: PAPER.inertia_kg_m2[0],
    IY: PAPER.inertia_kg_m2[1],
    IZ: PAPER.inertia_kg_m2[2],
    JR: ROTOR.inertia_kg_m2,
    MASS: PAPER.mass_kg,
    G: GRAVITY_M_S2,
    ARM: ROTOR.position_frd_m[0],
    LIFT: ROTOR.thrust_coefficient_n_s2,
    DRAG: ROTOR.torque_coefficient_n_m_s2,
}
HOVER_RAD_S = math.sqrt(PAPER.weight_n / 4.0 / ROTOR.thrust_coefficient_n_s2)
