"""The derived covariance prediction and Jacobians against finite differences of the nominal model.

They run as plain Python: to compile them alone takes 20 s, and tests/parity compares compiled code with plain Python.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from flightstack.core.contract import Quaternion, Vector3
from flightstack.core.geometry import (
    conjugate,
    quaternion_from_euler,
    quaternion_product,
    rotate,
    rotation_vector,
)
from flightstack.estimation import derived_generated as derived
from flightstack.estimation import error_state, prediction
from flightstack.estimation.error_state import ERROR_STATES, NOMINAL_SIZE, Nominal
from tests.support.generated_c import in_python
from tools import derive_estimator

ANGLE, VELOCITY, DT_S, GRAVITY = Vector3(0.004, -0.007, 0.003), Vector3(0.02, -0.03, -0.08), 0.008, 9.80665
STEP = 1e-6
read_nominal, write_nominal = in_python(error_state.read_nominal), in_python(error_state.write_nominal)
correct, less_bias = in_python(error_state.correct), in_python(prediction.less_bias)
motion_of, with_motion = in_python(prediction.motion_of), in_python(prediction.with_motion)
moved = in_python(prediction.moved)
predict_covariance = in_python(derived.predict_covariance)


def nominal() -> Nominal:
    x = np.random.default_rng(5).normal(0.0, 0.3, NOMINAL_SIZE)
    x[:4] = quaternion_from_euler(0.4, -0.3, 2.0)
    return read_nominal(x)


def difference(after: Nominal, before: Nominal) -> Any:
    """Return the error state that leads from ``before`` to ``after``."""
    a, b = np.zeros(NOMINAL_SIZE), np.zeros(NOMINAL_SIZE)
    write_nominal(a, after)
    write_nominal(b, before)
    turn = rotation_vector(quaternion_product(after.attitude, conjugate(before.attitude)))
    return np.concatenate([turn, (a - b)[4:]])


def propagated(n: Nominal) -> Nominal:
    angle, velocity = less_bias(ANGLE, n.gyro_bias_rad_s, DT_S), less_bias(VELOCITY, n.accel_bias_m_s2, DT_S)
    return with_motion(n, moved(motion_of(n), angle, velocity, DT_S, GRAVITY))


def perturbed(n: Nominal, index: int, size: float) -> Nominal:
    x, error = np.zeros(NOMINAL_SIZE), np.zeros(ERROR_STATES)
    write_nominal(x, n)
    error[index] = 1.0
    correct(x, error, size)
    return read_nominal(x)


def test_covariance_prediction_is_that_of_the_propagated_state() -> None:
    n = nominal()
    numeric = np.zeros((ERROR_STATES, ERROR_STATES))
    for i in range(ERROR_STATES):
        ahead, behind = propagated(perturbed(n, i, STEP)), propagated(perturbed(n, i, -STEP))
        numeric[:, i] = difference(ahead, behind) / (2.0 * STEP)
    root = np.random.default_rng(7).normal(size=(ERROR_STATES, ERROR_STATES))
    p = root @ root.T
    expected = numeric @ p @ numeric.T
    predict_covariance(p, n.attitude, less_bias(VELOCITY, n.accel_bias_m_s2, DT_S), DT_S)
    upper = np.triu_indices(ERROR_STATES)
    # first order in the step: 7.5e-3 of values around 25; an element read after its change would give 0.2
    assert np.abs(p[upper] - expected[upper]).max() < 1e-2


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_field_jacobian_is_the_derivative_of_the_field(axis: int) -> None:
    def field(n: Nominal) -> float:
        body = rotate(conjugate(n.attitude), n.earth_field_ned_gauss)
        return float(body[axis] + n.body_field_frd_gauss[axis])

    n, h = nominal(), np.zeros(ERROR_STATES)
    jacobian = in_python(getattr(derived, f"field_{'xyz'[axis]}_jacobian"))
    predicted = jacobian(n.attitude, n.earth_field_ned_gauss, n.body_field_frd_gauss, h)
    numeric = [
        (field(perturbed(n, i, STEP)) - field(perturbed(n, i, -STEP))) / (2.0 * STEP)
        for i in range(ERROR_STATES)
    ]
    assert predicted == pytest.approx(field(n), abs=1e-14)
    assert h == pytest.approx(numeric, abs=1e-9)


@pytest.mark.parametrize("axis", [0, 1])
def test_drag_jacobian_is_the_derivative_of_the_drag(axis: int) -> None:
    rate = 0.3

    def drag(n: Nominal) -> float:
        v = n.velocity_ned_m_s
        relative = rotate(conjugate(n.attitude), Vector3(v.x - n.wind_north_m_s, v.y - n.wind_east_m_s, v.z))
        return float(n.accel_bias_m_s2[axis] - rate * relative[axis])

    n, h = nominal(), np.zeros(ERROR_STATES)
    jacobian = in_python(getattr(derived, f"drag_{'xy'[axis]}_jacobian"))
    predicted = jacobian(
        n.attitude, n.velocity_ned_m_s, n.accel_bias_m_s2, n.wind_north_m_s, n.wind_east_m_s, rate, h
    )
    numeric = [
        (drag(perturbed(n, i, STEP)) - drag(perturbed(n, i, -STEP))) / (2.0 * STEP)
        for i in range(ERROR_STATES)
    ]
    assert predicted == pytest.approx(drag(n), abs=1e-14)
    assert h == pytest.approx(numeric, abs=1e-9)


def test_nominal_state_survives_its_array_form() -> None:
    n, x = nominal(), np.zeros(NOMINAL_SIZE)
    write_nominal(x, n)
    assert read_nominal(x) == n
    assert isinstance(n.attitude, Quaternion)


@pytest.mark.long
def test_derived_module_is_up_to_date() -> None:
    assert derive_estimator.MODULE.read_text(encoding="utf-8") == derive_estimator.generated()
