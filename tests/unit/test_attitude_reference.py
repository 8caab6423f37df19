"""The attitude reference filter against the second-order system it is, and its limits."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from flightstack.control.attitude_reference import (
    ReferenceMemory,
    ReferenceParams,
    attitude_reference_step,
    in_body_frame,
)
from flightstack.core.contract import AttitudeReference, Quaternion, Vector3
from flightstack.core.geometry import rotation_vector

START = ReferenceMemory(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
AXIS = np.array([0.6, -0.48, 0.64])


def about(angle: float) -> Quaternion:
    return Quaternion(math.cos(angle / 2), *(math.sin(angle / 2) * AXIS))


def respond(params: ReferenceParams, target: Quaternion, dt_s: float, seconds: float) -> np.ndarray:
    """Rows of time, angle along the axis, rate and acceleration along the axis."""
    memory, rows = START, []
    for tick in range(1, round(seconds / dt_s) + 1):
        memory, reference = attitude_reference_step(memory, target, params, dt_s)
        rows.append(
            (
                tick * dt_s,
                AXIS @ rotation_vector(reference.attitude),
                AXIS @ reference.rates_frd_rad_s,
                AXIS @ reference.acceleration_frd_rad_s2,
            )
        )
    return np.array(rows)


def closed_form(t: np.ndarray, natural: float, damping: float, angle: float) -> np.ndarray:
    """Step response of ω²/(s² + 2 ζ ω s + ω²)."""
    if damping == 1.0:
        return angle * (1.0 - (1.0 + natural * t) * np.exp(-natural * t))
    damped = natural * math.sqrt(1.0 - damping**2)
    decay = np.exp(-damping * natural * t)
    return angle * (1.0 - decay * (np.cos(damped * t) + damping * natural / damped * np.sin(damped * t)))


@pytest.mark.parametrize("damping", [0.6, 1.0])
def test_step_response_is_the_closed_form_to_first_order_of_the_step(damping: float) -> None:
    natural, angle = 30.0, 0.8
    params = ReferenceParams(natural, damping, 1e3, 1e6)
    errors = []
    for dt in (1e-3, 5e-4):
        rows = respond(params, about(angle), dt, 0.3)
        errors.append(np.abs(rows[:, 1] - closed_form(rows[:, 0], natural, damping, angle)).max())
    assert errors[0] < 0.016 * angle  # 1.2 % and 0.9 % seen: ω dt is 3 %
    assert errors[0] / errors[1] == pytest.approx(2.0, abs=0.1)  # 2.005 seen


def test_rates_and_acceleration_are_the_derivatives_of_what_it_shows() -> None:
    dt = 0.002
    rows = respond(ReferenceParams(60.0, 1.0, 4.0, 150.0), about(0.8), dt, 0.5)  # meets both limits
    angle, rate, acceleration = rows[:, 1], rows[:, 2], rows[:, 3]
    assert np.allclose(np.diff(angle) / dt, rate[1:], rtol=0.0, atol=1e-11)  # 2e-13 seen
    assert np.allclose(np.diff(rate) / dt, acceleration[1:], rtol=0.0, atol=1e-10)  # 4e-13 seen


def test_limits_hold_and_the_target_is_reached_without_overshoot() -> None:
    params = ReferenceParams(60.0, 1.0, 3.0, 80.0)
    rows = respond(params, about(2.5), 0.002, 2.0)
    assert np.abs(rows[:, 2]).max() == pytest.approx(3.0, abs=1e-9)
    assert np.abs(rows[:, 3]).max() == pytest.approx(80.0, abs=1e-9)
    assert rows[-1, 1] == pytest.approx(2.5, abs=1e-9)
    assert rows[:, 1].max() < 2.5 + 1e-9


def test_no_bandwidth_passes_the_target_through() -> None:
    target = about(0.5)
    memory, reference = attitude_reference_step(START, target, ReferenceParams(0.0, 1.0, 1.0, 1.0), 0.002)
    assert reference == (target, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    assert memory == (*target, 0.0, 0.0, 0.0)


def test_it_goes_the_short_way_and_stays_a_unit_quaternion() -> None:
    target = about(-0.5)
    flipped = Quaternion(*(-np.array(target)))
    memory = START
    for _ in range(5_000):
        memory, reference = attitude_reference_step(
            memory, flipped, ReferenceParams(60.0, 1.0, 8.0, 150.0), 0.002
        )
        assert abs(AXIS @ rotation_vector(reference.attitude)) < 0.5 + 1e-9
    assert math.hypot(*memory[:4]) == pytest.approx(1.0, abs=1e-14)


def test_rates_are_turned_into_the_vehicles_frame() -> None:
    vehicle, reference = Rotation.random(rng=1), Rotation.random(rng=2)
    x, y, z, w = reference.as_quat()
    rates, acceleration = Vector3(1.0, -2.0, 0.5), Vector3(10.0, 5.0, -3.0)
    vx, vy, vz, vw = vehicle.as_quat()
    turned = in_body_frame(
        AttitudeReference(Quaternion(w, x, y, z), rates, acceleration), Quaternion(vw, vx, vy, vz)
    )
    assert np.allclose(vehicle.apply(turned.rates_frd_rad_s), reference.apply(rates), atol=1e-14)
    assert np.allclose(
        vehicle.apply(turned.acceleration_frd_rad_s2), reference.apply(acceleration), atol=1e-13
    )
    assert turned.attitude == (w, x, y, z)
