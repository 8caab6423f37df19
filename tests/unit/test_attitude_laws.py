"""The attitude laws against their formulas, their poles, and Newton and Euler's equations."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flightstack.control.attitude_backstepping import (
    BacksteppingMemory,
    BacksteppingParams,
    attitude_backstepping_step,
    read_backstepping_params,
)
from flightstack.control.attitude_pid import (
    PidMemory,
    PidParams,
    attitude_pid_step,
    paper_arm_m,
    read_pid_params,
)
from flightstack.control.control_law import AttitudeInputs
from flightstack.core.contract import AttitudeReference, Quaternion, Vector3
from flightstack.params.gains_file import open_gains
from flightstack.params.vehicle import load_vehicle

PAPER, X_QUAD = load_vehicle("paper_quad"), load_vehicle("x_quad")
IX, IY, IZ = PAPER.inertia_kg_m2
ROTOR_INERTIA = 6.3e-5
IDENTITY = Quaternion(1.0, 0.0, 0.0, 0.0)
AXES = ["roll", "pitch", "yaw"]
AT_REST, NO_MEMORY = PidMemory(0.0, 0.0, 0.0), BacksteppingMemory(0.0)

properties = settings(max_examples=60)
vectors = st.tuples(*[st.floats(-5.0, 5.0)] * 3)


def inputs(
    error=(0.0, 0.0, 0.0), rates=(0.0, 0.0, 0.0), rates_d=(0.0, 0.0, 0.0), acceleration_d=(0.0, 0.0, 0.0),
    rotor_speed: float = 0.0, saturation=(0.0, 0.0, 0.0),
) -> AttitudeInputs:  # fmt: skip
    reference = AttitudeReference(IDENTITY, Vector3(*rates_d), Vector3(*acceleration_d))
    return AttitudeInputs(
        IDENTITY, Vector3(*rates), reference, Vector3(*error), rotor_speed, Vector3(*saturation)
    )


def pid_params(gains: str, vehicle=PAPER) -> PidParams:
    return read_pid_params(vehicle, open_gains(gains).table("attitude_pid"))


def backstepping_params(gains: str, vehicle=PAPER) -> BacksteppingParams:
    return read_backstepping_params(vehicle, open_gains(gains).table("attitude_backstepping"))


def poles(torque, axis: int) -> np.ndarray:
    """Poles of one axis, linearised: torque as a function of error and rate acts on φ'' = τ/I."""
    step = 1e-6
    unit = np.eye(3)[axis] * step
    inertia = PAPER.inertia_kg_m2[axis]
    stiffness = (torque(error=unit)[axis] - torque(error=-unit)[axis]) / (2 * step * inertia)
    friction = (torque(rates=unit)[axis] - torque(rates=-unit)[axis]) / (2 * step * inertia)
    return np.sort(np.linalg.eigvals([[0.0, 1.0], [-stiffness, friction]]))


# ---------------------------------------------------------------------- poles of the paper's tables


@pytest.mark.parametrize(
    ("axis", "expected"), [(0, (-285.7, -27.8)), (1, (-45.0, -4.7)), (2, (-21.6, -4.6))], ids=AXES
)  # fmt: skip
def test_backstepping_has_the_poles_of_table_iii(axis: int, expected: tuple[float, float]) -> None:
    params = backstepping_params("paper")._replace(rate_feedforward=0.0)
    found = poles(
        lambda **given: attitude_backstepping_step(NO_MEMORY, inputs(**given), params, 1e-3)[1], axis
    )
    assert found.imag == pytest.approx(0.0)
    assert found.real == pytest.approx(expected, abs=0.06)  # the figures have one decimal


@pytest.mark.parametrize(
    ("axis", "natural", "damping"), [(0, 88.3, 0.97), (1, 38.5, 0.52), (2, 48.2, 0.90)], ids=AXES
)  # fmt: skip
def test_paper_pid_has_the_frequency_and_damping_of_table_ii(
    axis: int, natural: float, damping: float
) -> None:
    params = pid_params("paper")
    pair = poles(lambda **given: attitude_pid_step(AT_REST, inputs(**given), params, 0.0)[1], axis)
    frequency = math.sqrt((pair[0] * pair[1]).real)
    assert frequency == pytest.approx(natural, abs=0.06)
    assert -pair.sum().real / (2.0 * frequency) == pytest.approx(damping, abs=0.006)


def test_tuned_laws_have_the_same_stiffness() -> None:
    """1 + c1 c2 = 225 and 25 rad/s² per rad; friction 30 beside 27 in roll and pitch, 10 in yaw."""
    pid, backstepping = pid_params("tuned"), backstepping_params("tuned")
    for axis in range(3):
        first = poles(lambda **given: attitude_pid_step(AT_REST, inputs(**given), pid, 0.0)[1], axis)
        second = poles(
            lambda **given: attitude_backstepping_step(NO_MEMORY, inputs(**given), backstepping, 1e-3)[1],
            axis,
        )
        assert (first[0] * first[1]).real == pytest.approx((second[0] * second[1]).real, rel=1e-6)


# ---------------------------------------------------------------------- formulas


@properties
@given(vectors, vectors, vectors, vectors, vectors)
def test_pid_is_its_formula(error, rates, rates_d, acceleration_d, integral) -> None:
    kp, ki, kd = np.array([3.0, 5.0, 7.0]), np.array([0.3, 0.5, 0.7]), np.array([1.1, 1.3, 1.7])
    params = PidParams(*kp, *ki, *kd, 0.8, 0.6, IX, IY, IZ)
    dt = 0.01
    memory, torque = attitude_pid_step(
        PidMemory(*integral), inputs(error, rates, rates_d, acceleration_d), params, dt
    )
    summed = np.array(integral) + dt * np.array(error)
    demand = (
        kp * error + ki * summed + kd * (0.8 * np.array(rates_d) - rates) + 0.6 * np.array(acceleration_d)
    )
    assert np.allclose(memory, summed, rtol=0.0, atol=1e-15)
    assert np.allclose(torque, np.array([IX, IY, IZ]) * demand, rtol=0.0, atol=1e-14)


@properties
@given(vectors, vectors, vectors, vectors, st.floats(-600.0, 600.0))
def test_backstepping_is_the_corrected_law(error, rates, rates_d, acceleration_d, rotor_speed) -> None:
    """U = (1/b)[ε1 − c2 ε2 − c1 (c1 ε1 + ε2) + ẍd − coupling − gyro], Ω_r as in the corrected eq. 7."""
    c = np.array([2.0, 3.0, 2.5, 4.0, 1.5, 2.2])
    params = BacksteppingParams(*c, 1.0, 1.0, IX, IY, IZ, ROTOR_INERTIA)
    _, torque = attitude_backstepping_step(
        NO_MEMORY, inputs(error, rates, rates_d, acceleration_d, rotor_speed), params, 1e-3
    )
    p, q, r = rates
    a1, a2, a3, a4, a5 = (
        (IY - IZ) / IX,
        ROTOR_INERTIA / IX,
        (IZ - IX) / IY,
        ROTOR_INERTIA / IY,
        (IX - IY) / IZ,
    )
    model = (a1 * q * r + a2 * q * rotor_speed, a3 * p * r - a4 * p * rotor_speed, a5 * p * q)
    for axis, inertia in enumerate((IX, IY, IZ)):
        c1, c2 = c[2 * axis], c[2 * axis + 1]
        e1 = error[axis]
        e2 = rates[axis] - rates_d[axis] - c1 * e1
        demand = e1 - c2 * e2 - c1 * (c1 * e1 + e2) + acceleration_d[axis] - model[axis]
        assert torque[axis] == pytest.approx(inertia * demand, rel=1e-12, abs=1e-14)


@properties
@given(vectors, vectors, st.tuples(*[st.floats(0.0, 400.0)] * 4))
def test_backstepping_cancels_coupling_and_gyroscopic_torque_of_a_rigid_body(
    rates, acceleration_d, speeds
) -> None:
    """On the reference, a rigid body turns exactly as ẍd says, whatever its rates and its rotors' are."""
    params = backstepping_params("tuned")
    relative = speeds[1] + speeds[3] - speeds[0] - speeds[2]
    reference = inputs((0.0, 0.0, 0.0), rates, rates, acceleration_d, relative)
    _, torque = attitude_backstepping_step(NO_MEMORY, reference, params, 1e-3)
    # rotors 1 and 3 turn clockwise seen from above: about +z of FRD
    spin = ROTOR_INERTIA * (speeds[0] + speeds[2] - speeds[1] - speeds[3])
    inertia = np.diag(PAPER.inertia_kg_m2)
    momentum = inertia @ rates + (0.0, 0.0, spin)
    turned = np.linalg.solve(inertia, np.array(torque) - np.cross(rates, momentum))
    assert np.allclose(turned, acceleration_d, rtol=0.0, atol=1e-11)  # 4e-14 seen


# ---------------------------------------------------------------------- anti-windup, params


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("error", [0.4, -0.4])
@pytest.mark.parametrize("saturation", [-1.0, 0.0, 1.0])
def test_integrators_stop_only_in_the_direction_that_is_saturated(
    axis: int, error: float, saturation: float
) -> None:
    errors, saturations = np.zeros(3), np.zeros(3)
    errors[axis], saturations[axis] = error, saturation
    memory, _ = attitude_pid_step(AT_REST, inputs(errors, saturation=saturations), pid_params("tuned"), 0.01)
    expected = 0.0 if error * saturation > 0.0 else error * 0.01
    assert memory[axis] == pytest.approx(expected, abs=1e-16)


def test_paper_gains_are_forces_at_the_arm_and_a_yaw_torque() -> None:
    assert paper_arm_m(PAPER) == 0.2
    _, torque = attitude_pid_step(AT_REST, inputs(error=(0.01, 0.02, 0.03)), pid_params("paper"), 0.0)
    assert torque == pytest.approx((280.55 * 0.01 * 0.2, 53.39 * 0.02 * 0.2, 25.52 * 0.03), rel=1e-12)


def test_tuned_gains_fit_any_vehicle() -> None:
    """Normalised gains: the same error turns either vehicle alike."""
    for vehicle in (PAPER, X_QUAD):
        _, torque = attitude_pid_step(
            AT_REST, inputs(error=(0.1, 0.1, 0.1)), pid_params("tuned", vehicle), 0.0
        )
        assert np.array(torque) / vehicle.inertia_kg_m2 == pytest.approx([22.5, 22.5, 2.5], rel=1e-12)
