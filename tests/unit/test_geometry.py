"""Rotations against SciPy's, over random attitudes and at the edges."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from flightstack.core.contract import Quaternion, Vector3
from flightstack.core.geometry import (
    blend,
    conjugate,
    cross,
    euler_from_quaternion,
    normalised,
    quaternion_from_euler,
    quaternion_product,
    rotate,
    rotation_vector,
    wrap_pi,
)

EXACT = (
    1e-13  # largest difference seen over 10 000 random rotations: 2e-15 (vectors of length up to 20: 1e-14)
)

angles = st.floats(-math.pi, math.pi)
components = st.floats(-10.0, 10.0).map(lambda value: value if abs(value) > 1e-6 else 0.0)
vectors = st.builds(Vector3, components, components, components)
attitudes = (
    st.tuples(components, components, components, components)
    .filter(lambda q: np.linalg.norm(q) > 0.1)
    .map(lambda q: Quaternion(*(np.array(q) / np.linalg.norm(q)).tolist()))
)
properties = settings(max_examples=60)


def scipy_rotation(q: Quaternion) -> Rotation:
    return Rotation.from_quat([q.x, q.y, q.z, q.w])


def same_rotation(a: Quaternion, b: Rotation) -> bool:
    return (scipy_rotation(a) * b.inv()).magnitude() < 1e-7  # arccos near 1 has no more digits: 4e-8 seen


@properties
@given(attitudes, attitudes, vectors)
def test_product_conjugate_and_rotation_agree_with_scipy(a: Quaternion, b: Quaternion, v: Vector3) -> None:
    ra, rb = scipy_rotation(a), scipy_rotation(b)
    assert np.allclose(rotate(a, v), ra.apply(v), rtol=0.0, atol=EXACT)
    assert np.allclose(rotate(conjugate(a), v), ra.inv().apply(v), rtol=0.0, atol=EXACT)
    assert np.allclose(rotate(quaternion_product(a, b), v), (ra * rb).apply(v), rtol=0.0, atol=EXACT)
    assert np.allclose(cross(v, Vector3(1.0, -2.0, 3.0)), np.cross(v, (1.0, -2.0, 3.0)), rtol=0.0, atol=EXACT)


@properties
@given(attitudes)
def test_rotation_vector_agrees_with_scipy_for_both_signs_of_the_quaternion(q: Quaternion) -> None:
    expected = scipy_rotation(q).as_rotvec()
    for same in (q, Quaternion(-q.w, -q.x, -q.y, -q.z)):
        found = np.array(rotation_vector(same))
        if np.linalg.norm(expected) < math.pi - 1e-6:  # at half a turn the axis has two signs
            assert np.allclose(found, expected, rtol=0.0, atol=EXACT)
        else:
            assert same_rotation(q, Rotation.from_rotvec(found))


@pytest.mark.parametrize("angle", [0.0, 1e-300, 1e-12, 1e-9, 1e-8, 1e-3, 1.0, math.pi - 1e-9, math.pi])
def test_rotation_vector_keeps_all_digits_of_small_and_large_angles(angle: float) -> None:
    q = Quaternion(math.cos(angle / 2), 0.0, math.sin(angle / 2), 0.0)
    assert rotation_vector(q) == pytest.approx((0.0, angle, 0.0), rel=1e-15, abs=0.0)


@properties
@given(angles, st.floats(-1.57, 1.57), angles)
def test_euler_angles_are_intrinsic_yaw_pitch_roll(roll: float, pitch: float, yaw: float) -> None:
    q = quaternion_from_euler(roll, pitch, yaw)
    assert same_rotation(q, Rotation.from_euler("ZYX", [yaw, pitch, roll]))
    back = euler_from_quaternion(q)
    assert same_rotation(q, Rotation.from_euler("ZYX", [back.z, back.y, back.x]))
    if abs(pitch) < 1.5:  # nearer to the pole roll and yaw lose digits
        expected = scipy_rotation(q).as_euler("ZYX")[::-1]
        difference = (np.array(back) - expected + math.pi) % (2.0 * math.pi) - math.pi
        assert np.abs(difference).max() < 1e-12  # 6e-15 seen; the margin covers pitch near the pole


@pytest.mark.parametrize("pitch", [math.pi / 2, -math.pi / 2])
def test_straight_up_and_down_the_euler_angles_are_finite(pitch: float) -> None:
    euler = euler_from_quaternion(quaternion_from_euler(0.3, pitch, -0.7))
    assert euler.y == pytest.approx(pitch, abs=1e-7)
    assert all(math.isfinite(value) for value in euler)


@properties
@given(attitudes, vectors, st.floats(0.0, 1.0))
def test_blend_turns_about_the_axis_between_both(a: Quaternion, axis: Vector3, fraction: float) -> None:
    length = np.linalg.norm(axis)
    angle = 0.1
    turn = Rotation.from_rotvec(np.array(axis) / length * angle if length > 0.1 else (angle, 0.0, 0.0))
    x, y, z, w = (scipy_rotation(a) * turn).as_quat()
    for b in (Quaternion(w, x, y, z), Quaternion(-w, -x, -y, -z)):  # the short way for either sign
        between = blend(a, b, fraction)
        expected = scipy_rotation(a) * Rotation.from_rotvec(turn.as_rotvec() * fraction)
        # the chord instead of the arc: 0.01 % of 0.1 rad at most, 8e-6 rad seen
        assert (scipy_rotation(between) * expected.inv()).magnitude() < 1.2e-5
        assert math.hypot(*between) == pytest.approx(1.0, abs=1e-14)


def test_normalising_nothing_gives_the_identity() -> None:
    assert normalised(Quaternion(0.0, 0.0, 0.0, 0.0)) == (1.0, 0.0, 0.0, 0.0)
    assert normalised(Quaternion(0.0, 3.0, 0.0, -4.0)) == pytest.approx((0.0, 0.6, 0.0, -0.8), abs=1e-15)


@properties
@given(st.floats(-1e3, 1e3))
def test_wrapped_angles_are_the_same_direction_within_half_a_turn(angle: float) -> None:
    wrapped = wrap_pi(angle)
    assert -math.pi <= wrapped <= math.pi
    assert math.cos(wrapped - angle) == pytest.approx(1.0, abs=1e-12)
    assert math.sin(wrapped - angle) == pytest.approx(0.0, abs=1e-12)  # 2e-13 at 1000 rad
