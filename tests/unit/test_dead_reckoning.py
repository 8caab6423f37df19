"""Growth of the errors of dead reckoning against its closed form, for a level vehicle that stands still.

With white noise of the densities q_g of the gyro and q_a of the accelerometer, and constant biases b_g and b_a, the
variances of tilt, velocity and position after t are, with gravity g (Titterton and Weston, Strapdown Inertial
Navigation Technology, chapter 12):

    tilt      q_g t                       b_g² t²
    velocity  q_a t + g² q_g t³ / 3       b_a² t² + g² b_g² t⁴ / 4
    position  q_a t³ / 3 + g² q_g t⁵ / 20 b_a² t⁴ / 4 + g² b_g² t⁶ / 36
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from flightstack.core.contract import Vector3
from flightstack.core.record_types import dtype_of
from flightstack.estimation import prediction
from flightstack.estimation.error_state import (
    ACCEL_BIAS,
    ATTITUDE,
    ERROR_STATES,
    GYRO_BIAS,
    NOMINAL_SIZE,
    POSITION,
    VELOCITY,
)
from flightstack.estimation.estimator_params import EstimatorParams
from flightstack.estimation.fusion import drift_gnss_bias
from flightstack.estimation.kalman import (
    BARO,
    BEHIND_SIZE,
    OBSERVATIONS,
    Filter,
    Observed,
)
from flightstack.estimation.prediction import DeltaSample, ImuNoise
from tests.support.generated_c import in_python

QUIET = EstimatorParams()._replace(
    gyro_noise=0.0, accel_noise=0.0, gyro_bias_walk=0.0, accel_bias_walk=0.0, gyro_scale_error=0.0
)
GRAVITY, STEP_S = QUIET.gravity_m_s2, 0.008
NONE = Vector3(0.0, 0.0, 0.0)
NO_NOISE = ImuNoise(NONE, NONE)
predict_state, predict_errors = in_python(prediction.predict), in_python(prediction.predict_errors)
"""As plain Python, which parity tests hold equal: compiled for this test alone it would take 20 s."""


def predict(f: Filter, sample: DeltaSample, params: EstimatorParams) -> None:
    predict_state(f, sample, params)
    predict_errors(f, NO_NOISE, params)


def still(seconds: float, params: EstimatorParams, gyro_bias: float = 0.0, accel_bias: float = 0.0) -> Filter:
    """Predict a vehicle that stands still, with uncertain biases of these deviations."""
    h, ph, gain = (np.zeros(ERROR_STATES) for _ in range(3))
    f = Filter(
        nominal=np.zeros(NOMINAL_SIZE),
        h=h,
        ph=ph,
        gain=gain,
        clock=np.zeros(2),
        behind=np.zeros(BEHIND_SIZE),
        turn=np.zeros(3),
        drag=np.zeros(2),
        covariance=np.zeros((ERROR_STATES, ERROR_STATES)),
        observations=np.zeros(OBSERVATIONS, dtype_of(Observed)),
    )
    f.nominal[0] = 1.0
    for axis in range(3):
        f.covariance[GYRO_BIAS + axis, GYRO_BIAS + axis] = gyro_bias * gyro_bias
        f.covariance[ACCEL_BIAS + axis, ACCEL_BIAS + axis] = accel_bias * accel_bias
    lift = Vector3(0.0, 0.0, -GRAVITY * STEP_S)
    for step in range(round(seconds / STEP_S)):
        predict(f, DeltaSample((step + 1) * STEP_S, STEP_S, NONE, lift, 0.0, 0.0), params)
    return f


def variances(f: Filter) -> list[float]:
    """Return the variances of tilt, velocity and position along north."""
    return [float(f.covariance[at, at]) for at in (ATTITUDE, VELOCITY, POSITION)]


@pytest.mark.parametrize("t", [1.0, 10.0, 60.0])
def test_white_noise_grows_as_a_random_walk_and_its_integrals(t: float) -> None:
    gyro, accel = 8e-4, 0.012
    found = variances(still(t, QUIET._replace(gyro_noise=gyro, accel_noise=accel)))
    qg, qa = gyro * gyro, accel * accel
    expected = [
        qg * t,
        qa * t + GRAVITY**2 * qg * t**3 / 3.0,
        qa * t**3 / 3.0 + GRAVITY**2 * qg * t**5 / 20.0,
    ]
    assert found == pytest.approx(expected, rel=0.03)  # of steps of 8 ms: 1.2 % after 1 s, less later


@pytest.mark.parametrize("t", [1.0, 10.0, 60.0])
def test_constant_biases_grow_with_powers_of_the_time(t: float) -> None:
    gyro, accel = 0.001, 0.05
    found = variances(still(t, QUIET, gyro, accel))
    expected = [
        gyro**2 * t**2,
        accel**2 * t**2 + GRAVITY**2 * gyro**2 * t**4 / 4.0,
        accel**2 * t**4 / 4.0 + GRAVITY**2 * gyro**2 * t**6 / 36.0,
    ]
    assert found == pytest.approx(expected, rel=0.03)


def test_state_moves_by_a_bias_as_the_covariance_says() -> None:
    """A gyro bias about north by 1 mrad/s accelerates to the east with g b t, and moves by g b t³ / 6."""
    t, bias = 20.0, 1e-3
    f = still(0.0, QUIET)
    for step in range(round(t / STEP_S)):
        angle = Vector3(bias * STEP_S, 0.0, 0.0)
        lift = Vector3(0.0, 0.0, -GRAVITY * STEP_S)
        predict(f, DeltaSample((step + 1) * STEP_S, STEP_S, angle, lift, 0.0, 0.0), QUIET)
    assert f.nominal[5] == pytest.approx(0.5 * GRAVITY * bias * t * t, rel=0.01)
    assert f.nominal[8] == pytest.approx(GRAVITY * bias * t**3 / 6.0, rel=0.01)
    deviation = math.sqrt(variances(still(t, QUIET, bias))[2])
    assert f.nominal[8] == pytest.approx(deviation, rel=0.01)


@pytest.mark.parametrize(("baro_s", "kept"), [(100.0, math.exp(-60.0 / 1800.0)), (90.0, math.exp(-1.0))])
def test_height_error_of_gnss_returns_slowly_with_a_barometer_only(baro_s: float, kept: float) -> None:
    f = still(0.1, EstimatorParams())
    f.clock[0], f.observations[BARO]["fused_s"] = 100.0, baro_s
    f.nominal[27], f.nominal[26] = 1.0, 1.0
    row = np.array([100.0, *[0.0] * 6, 1.0, 1.0, 0.1])
    for _ in range(600):
        drift_gnss_bias(f, row, 0.1, EstimatorParams())
    assert f.nominal[27] == pytest.approx(kept, rel=0.01)
    assert f.nominal[26] == pytest.approx(math.exp(-1.0), rel=0.01)  # horizontal


@pytest.mark.parametrize("seconds", [2.0, 5.0, 40.0])
def test_drag_keeps_the_vertical_bias_of_the_accelerometer_uncertain(seconds: float) -> None:
    """An axis off by e shows the mean drag of about the last 5 s as a bias: the variance is twice its square."""
    drag, params = Vector3(1.2, -0.9, 0.0), QUIET._replace(gyro_scale_error=0.0035)
    f = still(0.0, params)
    for step in range(round(seconds / STEP_S)):
        force = Vector3(drag.x * STEP_S, drag.y * STEP_S, -GRAVITY * STEP_S)
        predict(f, DeltaSample((step + 1) * STEP_S, STEP_S, NONE, force, 0.0, 0.0), params)
    mean = 1.5 * (1.0 - math.exp(-seconds / 5.0))
    assert f.covariance[ACCEL_BIAS + 2, ACCEL_BIAS + 2] == pytest.approx(2.0 * (0.0035 * mean) ** 2, rel=0.01)
