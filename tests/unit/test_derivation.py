"""The model derived twice, and the paper's printing errors shown to be errors.

Everything symbolic is exact; figures are for Table I and the gains of Tables II and III.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy as sp

from flightstack.control.attitude_pid import read_pid_params
from flightstack.control.position_pid import read_position_params
from flightstack.params.gains_file import open_gains
from flightstack.params.vehicle import GRAVITY_M_S2
from tests.support.paper_model import (
    ANGLES,
    ARM,
    CORRECTED,
    DRAG,
    E1,
    E2,
    H_DOT,
    HOVER_RAD_S,
    INPUTS,
    IX,
    IZ,
    JR,
    LAW,
    LIFT,
    MASS,
    OMEGA,
    OMEGA_R,
    PAPER,
    PRINTED_B3,
    RATES,
    ROTATION,
    TABLE_I,
    A,
    G,
    H,
    U,
    V,
    a1d,
    about_x,
    about_y,
    about_z,
    attitude_rows,
    body_rates,
    c1,
    c2,
    drift,
    euler_lagrange,
    gain,
    in_time,
    kinetic_energy,
    newton_euler,
    phi,
    position_rows,
    psi,
    rates_matrix,
    reduced,
    theta,
    v1d,
    x1,
    x1d,
    x2,
)

LEVEL = {phi: 0, theta: 0, psi: 0}


# ---------------------------------------------------------------------- two derivations, one model


def test_equation_1_is_the_product_of_the_three_rotations() -> None:
    assert reduced((ROTATION.T * ROTATION - sp.eye(3))[0, 1]) == 0
    expected = sp.Matrix([[sp.cos(psi) * sp.cos(theta)], [sp.sin(psi) * sp.cos(theta)], [-sp.sin(theta)]])
    assert ROTATION[:, 0] == expected


def test_rotations_of_the_model_are_right_handed() -> None:
    """A positive roll lowers the right side in NED (y right, z down), a positive pitch lifts the nose."""
    small = sp.Rational(1, 10)
    assert (about_x(small) * sp.Matrix([0, 1, 0]))[2] > 0
    assert (about_y(small) * sp.Matrix([1, 0, 0]))[2] < 0
    assert (about_z(small) * sp.Matrix([1, 0, 0]))[1] > 0


def test_brackets_of_the_kinetic_energy_are_the_body_rates() -> None:
    roll, pitch, yaw = body_rates()
    assert sp.expand(roll - (V[0] - V[2] * sp.sin(theta))) == 0
    assert sp.expand(pitch - (V[1] * sp.cos(phi) + V[2] * sp.sin(phi) * sp.cos(theta))) == 0
    assert (
        sp.expand(yaw + (V[1] * sp.sin(phi) - V[2] * sp.cos(phi) * sp.cos(theta))) == 0
    )  # the bracket is −r


def test_euler_lagrange_is_newton_euler_with_full_kinematics() -> None:
    """Virtual work: Γ = Wᵀ τ. Exact, at any angle and rate, with rotors that spin up."""
    rates, turn = body_rates(), rates_matrix()
    acceleration = in_time(rates)
    difference = euler_lagrange() - turn.T * newton_euler(rates, acceleration)
    assert [reduced(entry) for entry in difference] == [0, 0, 0]


def test_lagrange_and_newton_agree_on_the_translation() -> None:
    """L = ½ m |v|² + m g z (z down); the thrust does the work −U1 (R e_z)·δr."""
    velocity = sp.Matrix(sp.symbols("v_x v_y v_z"))
    z = sp.Symbol("z")
    lagrangian = MASS * (velocity.T * velocity)[0] / 2 + MASS * G * z
    momentum = sp.Matrix([lagrangian.diff(component) for component in velocity])
    mass_matrix = momentum.jacobian(velocity)
    forces = sp.Matrix([0, 0, lagrangian.diff(z)]) - U[0] * ROTATION[:, 2]
    difference = mass_matrix.inv() * forces - position_rows()
    assert [sp.expand(entry) for entry in difference] == [0, 0, 0]


def test_newton_euler_in_body_rates_is_equation_7() -> None:
    """With h = −J_r Ω_r, and without the torque of rotors that spin up, which the paper leaves out."""
    acceleration = sp.Matrix(sp.symbols("dp dq dr"))
    torque = sp.Matrix([ARM * U[1], ARM * U[2], U[3]])
    balance = newton_euler(sp.Matrix(RATES), acceleration).subs({H: -JR * OMEGA_R, H_DOT: 0}) - torque
    solved = sp.solve(list(balance), list(acceleration))
    difference = sp.Matrix([solved[entry] for entry in acceleration]) - attitude_rows(OMEGA_R)
    assert [sp.simplify(entry) for entry in difference] == [0, 0, 0]


def test_torques_of_the_rotors_are_the_inputs_of_equation_7() -> None:
    """Σ r × F and the reactions −s d Ω² for rotors 1 front, 2 right, 3 back, 4 left; 1 and 3 clockwise."""
    places = [(ARM, 0), (0, ARM), (-ARM, 0), (0, -ARM)]
    total = sp.zeros(3, 1)
    for (x, y), spin, speed in zip(places, (1, -1, 1, -1), OMEGA, strict=True):
        force = sp.Matrix([0, 0, -LIFT * speed**2])
        total += sp.Matrix([x, y, 0]).cross(force) + sp.Matrix([0, 0, -spin * DRAG * speed**2])
    expected = sp.Matrix([ARM * INPUTS[1], ARM * INPUTS[2], INPUTS[3]])
    assert [sp.expand(entry) for entry in total - expected] == [0, 0, 0]
    squares = sp.symbols("s_1:5")  # and the vehicle's own matrix is the same
    rows = sp.Matrix([INPUTS[0], *expected]).subs({w**2: s for w, s in zip(OMEGA, squares, strict=True)})
    assert np.allclose(
        np.array(rows.jacobian(sp.Matrix(squares)).subs(TABLE_I), float), PAPER.effectiveness(), rtol=1e-14
    )


def test_small_angles_leave_out_products_of_rates_only() -> None:
    """Level, φ'' is p' + θ'ψ', θ'' is q' − φ'ψ', ψ'' is r' + φ'θ': the linearisation loses nothing."""
    acceleration = in_time(body_rates()).subs(LEVEL)
    angles = sp.solve(list(acceleration - sp.Matrix(sp.symbols("dp dq dr"))), list(A))
    dp, dq, dr = sp.symbols("dp dq dr")
    assert sp.expand(angles[A[0]] - dp - V[1] * V[2]) == 0
    assert sp.expand(angles[A[1]] - dq + V[0] * V[2]) == 0
    assert sp.expand(angles[A[2]] - dr - V[0] * V[1]) == 0


def test_both_models_have_the_same_linearisation_at_hover() -> None:
    """Six double integrators; tilt accelerates by g; nothing couples, and Ω_r is zero."""
    full = (rates_matrix().inv() * sp.Matrix(RATES)).jacobian([*ANGLES, *RATES])
    hover = {**LEVEL, **dict.fromkeys(RATES, 0)}
    assert sp.simplify(full.subs(hover)) == sp.Matrix.hstack(sp.zeros(3), sp.eye(3))
    rows = attitude_rows(sp.Integer(0))
    assert rows.jacobian(RATES).subs(hover) == sp.zeros(3)
    moved = position_rows().jacobian([phi, theta, U[0]]).subs({**hover, U[0]: MASS * G})
    assert sp.simplify(moved) == sp.Matrix([[0, -G, 0], [G, 0, 0], [0, 0, -1 / MASS]])


# ---------------------------------------------------------------------- what is printed, and why it is wrong


def test_inertia_has_no_half() -> None:
    """Two halves of a dumbbell on the body's x, turned about z: ½ ∫ r'² dm is ½ I ψ'² with I = ∫ x² dm."""
    half, reach = sp.symbols("mu x", positive=True)
    speed = in_time(ROTATION * sp.Matrix([reach, 0, 0])).subs({phi: 0, theta: 0, V[0]: 0, V[1]: 0})
    energy = reduced(2 * half * (speed.T * speed)[0] / 2)
    integral = 2 * half * reach**2
    turned = kinetic_energy().subs({phi: 0, theta: 0, V[0]: 0, V[1]: 0, H: 0})
    assert sp.expand(energy - turned.subs(IZ, integral)) == 0
    assert sp.simplify(energy / turned.subs(IZ, integral / 2)) == 2  # as printed


def test_potential_energy_as_printed_has_no_weight() -> None:
    """Two masses on a body in NED: V = −g Σ m (z + (R r)_z). The printed V has the second part alone: nothing falls."""
    masses = sp.symbols("m_1 m_2", positive=True)
    places = [sp.Matrix(sp.symbols(f"x_{i} y_{i} z_{i}")) for i in (1, 2)]
    z, fall = sp.symbols("z v_z")
    heights = [z + (ROTATION * place)[2] for place in places]
    whole = -sum(G * mass * height for mass, height in zip(masses, heights, strict=True))
    offsets = sum((mass * place for mass, place in zip(masses, places, strict=True)), sp.zeros(3, 1))
    printed = -G * (ROTATION[2, :] * offsets)[0]
    kinetic = sum(masses) * fall**2 / 2

    def falling(potential: sp.Expr) -> sp.Expr:
        """Lagrange's z'' of a body that only falls: (∂L/∂z)/(∂²L/∂ż²)."""
        lagrangian = kinetic - potential
        return sp.simplify(lagrangian.diff(z) / lagrangian.diff(fall, 2))

    assert sp.expand(whole - printed + sum(masses) * G * z) == 0  # m g z is what is missing
    assert falling(whole) == position_rows()[2].subs(U[0], 0)
    assert falling(printed) == 0
    for angle in ANGLES:  # both turn a body that does not hang in its centre of gravity, in the same way
        assert sp.expand(whole.diff(angle) - printed.diff(angle)) == 0
    assert printed.diff(phi) != 0
    balanced = {
        place: -masses[0] / masses[1] * other for place, other in zip(places[1], places[0], strict=True)
    }
    assert sp.simplify(printed.diff(phi).subs(balanced)) == 0  # in the centre of gravity no moment is left


def test_pitch_of_equation_6_as_printed_halves_the_gain_and_leaks_roll() -> None:
    """Printed b l (Ω3² − Ω2²), right Ω3² − Ω1²."""
    squares = sp.symbols("s_1:5")
    printed, right = squares[2] - squares[1], squares[2] - squares[0]
    push = sp.Symbol("delta")
    pitching = {squares[0]: 1 - push, squares[1]: 1, squares[2]: 1 + push, squares[3]: 1}
    rolling = {squares[0]: 1, squares[1]: 1 - push, squares[2]: 1, squares[3]: 1 + push}
    assert printed.subs(pitching) / right.subs(pitching) == sp.Rational(1, 2)
    assert printed.subs(rolling) / (2 * push) == sp.Rational(1, 2)  # of the roll torque
    assert right.subs(rolling) == 0


def test_yaw_of_equation_6_over_ix_is_too_strong() -> None:
    assert float((IZ / IX).subs(TABLE_I)) == pytest.approx(1.53, abs=0.003)


def test_b3_as_printed_takes_an_arm_that_a_torque_does_not_have() -> None:
    """U4 is d ΣΩ², N m already: l/I_z has the unit of a force's effect, and makes yaw five times too weak."""
    assert sp.simplify(PRINTED_B3 / CORRECTED.b3) == ARM
    assert float((CORRECTED.b3 / PRINTED_B3).subs(TABLE_I)) == pytest.approx(5.0)


def test_x_and_y_as_printed_have_the_sign_of_a_frame_with_z_up() -> None:
    """In NED the thrust is −U1 R e_z. Turned by π about x (y and z, θ and ψ change sign) it is printed so."""
    thrust = -U[0] / MASS * ROTATION[:, 2]
    assert [sp.expand(entry) for entry in (thrust - position_rows())[:2, 0]] == [0, 0]
    assert [sp.expand(entry) for entry in (thrust + position_rows(+1))[:2, 0]] == [0, 0]
    up = U[0] / MASS * ROTATION[:, 2]  # z up: the printed rows, unchanged
    assert [sp.expand(entry) for entry in (up - position_rows(+1))[:2, 0]] == [0, 0]


def test_frames_of_equations_5_and_7_differ_by_half_a_turn_about_x() -> None:
    """τ of equation 5 (z up) and b1 U2, b2 U3, b3 U4 of equation 7 (z down): y and z change sign, x does not."""
    up = sp.Matrix(
        [
            LIFT * ARM * (OMEGA[3] ** 2 - OMEGA[1] ** 2),
            LIFT * ARM * (OMEGA[2] ** 2 - OMEGA[0] ** 2),
            DRAG * (OMEGA[0] ** 2 + OMEGA[2] ** 2 - OMEGA[1] ** 2 - OMEGA[3] ** 2),
        ]
    )
    down = sp.Matrix([ARM * INPUTS[1], ARM * INPUTS[2], INPUTS[3]])
    assert sp.expand(up - sp.diag(1, -1, -1) * down) == sp.zeros(3, 1)


@pytest.mark.parametrize(("axis", "pole"), [("pitch", 63.0), ("yaw", 108.0)])
def test_mixed_frames_are_unstable(axis: str, pole: float) -> None:
    """Inputs of equation 7 on torques of equation 5: the sign of pitch and yaw turns, s² − kd s − kp."""
    params = read_pid_params(PAPER, open_gains("paper").table("attitude_pid"))
    kp, kd = getattr(params, f"kp_{axis}"), getattr(params, f"kd_{axis}")
    assert np.roots([1.0, -kd, -kp]).max() == pytest.approx(pole, abs=0.5)
    assert np.roots([1.0, kd, kp]).real.max() < 0.0


def test_altitude_gain_as_printed_hardly_damps() -> None:
    """ΣΩ² per metre: ζ = 0.042 with Kd_z = 6.15e3, 0.9 with ours; without the weight it would hang 0.65 m low."""
    params = read_position_params(PAPER, open_gains("paper"), 0.5)
    scale = float((LIFT / MASS).subs(TABLE_I))
    natural = math.sqrt(params.kp_z)
    assert params.kp_z == pytest.approx(2.83e5 * scale)
    assert 6.15e3 * scale / (2.0 * natural) == pytest.approx(0.042, abs=0.001)
    assert params.kd_z / (2.0 * natural) == pytest.approx(0.9, abs=0.001)
    assert GRAVITY_M_S2 / params.kp_z == pytest.approx(0.65, abs=0.005)


def test_a_roll_error_of_055_degrees_asks_a_rotor_to_stop() -> None:
    """Kpφ e = b (Ω4² − Ω2²): rotor 2 gives Ω²_hover − Kpφ e/(2 b)."""
    angle = math.degrees(2.0 * TABLE_I[LIFT] * HOVER_RAD_S**2 / 280.55)
    assert angle == pytest.approx(0.55, abs=0.005)


# ---------------------------------------------------------------------- backstepping


def decay(law: sp.Expr, error_2: sp.Expr = E2) -> sp.Expr:
    """V2' = ε1 ε1' + ε2 ε2' along the motion, V2 = ½ ε1² + ½ ε2²."""
    moving = ((x1, x2), (x2, drift + gain * law), (x1d, v1d), (v1d, a1d))
    energy = (E1**2 + error_2**2) / 2
    return sum(energy.diff(symbol) * rate for symbol, rate in moving)


def test_corrected_backstepping_law_makes_the_lyapunov_function_decay() -> None:
    assert sp.expand(decay(LAW) + c1 * E1**2 + c2 * E2**2) == 0


def test_law_with_an_angle_for_the_reference_rate_does_not() -> None:
    """ε4 and ε6 as printed have x3d, x5d where their derivatives belong: the law leaves where it should rest."""
    printed_e2 = x2 - x1d - c1 * E1
    printed = (E1 - c2 * printed_e2 - c1 * (c1 * E1 + printed_e2) + a1d - drift) / gain
    rest = sp.factor(decay(printed) + c1 * E1**2 + c2 * E2**2)
    assert sp.expand(rest - (c1 + c2) * E2 * (x1d - v1d)) == 0
    standing = {x1: 1, x1d: 1, v1d: 0, a1d: 0, c1: 1, c2: 1}  # on a constant reference, slightly moved
    moved = {**standing, x2: sp.Rational(1, 2)}
    assert decay(printed).subs(moved) > 0
    assert decay(LAW).subs(moved) < 0
    at_rest = {**standing, x2: 0, drift: 0, gain: 1}
    assert printed.subs(at_rest) == 2
    assert LAW.subs(at_rest) == 0


def test_virtual_command_as_printed_does_not_make_v1_decay() -> None:
    """α1 = ẋ1d + c1 ε1 gives V1' = −c1 ε1²; printed with ε̇1, it asks a rate of itself."""
    right = sp.expand(E1 * (v1d - (v1d + c1 * E1)))
    assert sp.expand(right + c1 * E1**2) == 0
    error_rate = v1d - x2
    printed = E1 * (v1d - (v1d + c1 * error_rate))
    assert sp.expand(printed + c1 * E1**2) != 0


def test_gyroscopic_term_of_u3_as_printed_doubles_what_it_should_cancel() -> None:
    """x4' = a3 x2 x6 − a4 x2 Ωr + b2 U3, and the printed U3 has −a4 x2 Ωr."""
    a4, x2_, omega = sp.symbols("a_4 x_2 Omega_r")
    left_by = {sign: -a4 * x2_ * omega + sign * a4 * x2_ * omega for sign in (+1, -1)}
    assert left_by[+1] == 0
    assert left_by[-1] == -2 * a4 * x2_ * omega
    plant = attitude_rows(sp.Symbol("W"))[1]  # and the sign in the plant is the one of the mechanics
    assert plant.diff(sp.Symbol("W")) == -CORRECTED.a4 * RATES[0]


def test_backstepping_is_a_pd_with_feed_forward() -> None:
    demand = sp.expand(gain * LAW + drift)
    expected = (1 + c1 * c2) * E1 + (c1 + c2) * (v1d - x2) + a1d
    assert sp.expand(demand - expected) == 0
