"""The mixer: closed forms, exactness within the limits, and what gives way first beyond them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from flightstack.control.mixer import WORK_ROWS, mix, mixer_for, relative_rotor_speed
from flightstack.core.contract import Vector3, Wrench
from flightstack.params.vehicle import Vehicle, load_vehicle
from tests.support.rotor_sets import irregular_vehicles, ring

PAPER, X_QUAD = load_vehicle("paper_quad"), load_vehicle("x_quad")
VEHICLES = {"paper": PAPER, "x": X_QUAD, "hexa": ring(6, first_deg=30.0), "octo": ring(8, first_deg=22.5)}

properties = settings(max_examples=60)
demands = st.tuples(*[st.floats(-1.0, 1.0)] * 4)


def run(vehicle: Vehicle, wrench: tuple[float, float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Return rotor speeds and the wrench that the mixer reports."""
    mixer, n = mixer_for(vehicle), len(vehicle.rotors)
    speeds = np.zeros(n)
    achieved = mix(Wrench(wrench[0], Vector3(*wrench[1:])), mixer, speeds, np.zeros((WORK_ROWS, n)))
    return speeds, np.array([achieved.thrust_n, *achieved.torque_frd_n_m])


def forces_and_moments(vehicle: Vehicle, speeds: np.ndarray) -> np.ndarray:
    """Thrust and torque of spinning rotors from mechanics: Σ F, Σ r × F, and the air's reaction on each."""
    force, torque = np.zeros(3), np.zeros(3)
    for rotor, speed in zip(vehicle.rotors, speeds, strict=True):
        push = np.array([0.0, 0.0, -rotor.thrust_coefficient_n_s2 * speed * abs(speed)])
        force += push
        torque += np.cross(rotor.position_frd_m, push)
        torque[2] += -rotor.spin * rotor.torque_coefficient_n_m_s2 * speed * abs(speed)
    return np.array([-force[2], *torque])


def scaled(vehicle: Vehicle, shares: tuple[float, float, float, float], size: float) -> tuple[float, ...]:
    """Turn shares in [−1, 1] into a wrench around hover, of a size the vehicle could about make."""
    arm = max(math.hypot(*r.position_frd_m[:2]) for r in vehicle.rotors)
    ratio = vehicle.rotors[0].torque_coefficient_n_m_s2 / vehicle.rotors[0].thrust_coefficient_n_s2
    weight = vehicle.weight_n
    thrust, roll, pitch, yaw = (size * share for share in shares)
    return (weight * (1 + thrust), weight * arm * roll, weight * arm * pitch, weight * ratio * yaw)


@properties
@given(demands)
def test_paper_vehicle_follows_the_inverse_of_equation_7(shares: tuple[float, float, float, float]) -> None:
    b, d, arm = 2.93e-5, 7.2e-7, 0.2
    u1, roll, pitch, u4 = scaled(PAPER, shares, 0.15)
    u2, u3 = roll / arm, pitch / arm
    squares = [
        u1 / (4 * b) + u3 / (2 * b) - u4 / (4 * d),
        u1 / (4 * b) - u2 / (2 * b) + u4 / (4 * d),
        u1 / (4 * b) - u3 / (2 * b) - u4 / (4 * d),
        u1 / (4 * b) + u2 / (2 * b) + u4 / (4 * d),
    ]
    speeds, _ = run(PAPER, (u1, roll, pitch, u4))
    assert np.allclose(speeds, np.sqrt(squares), rtol=1e-12)  # 4e-16 seen


@pytest.mark.parametrize("name", VEHICLES)
@properties
@given(demands)
def test_a_wrench_within_the_limits_is_made_exactly(
    name: str, shares: tuple[float, float, float, float]
) -> None:
    vehicle = VEHICLES[name]
    wrench = scaled(vehicle, shares, 0.12)
    speeds, reported = run(vehicle, wrench)
    # relative to the largest entry 3e-16 is seen
    assert np.allclose(forces_and_moments(vehicle, speeds), wrench, rtol=0.0, atol=1e-12 * vehicle.weight_n)
    assert np.allclose(reported, wrench, rtol=0.0, atol=1e-12 * vehicle.weight_n)


@properties
@given(irregular_vehicles(), demands, st.floats(0.1, 3.0))
def test_what_the_mixer_reports_is_what_the_rotors_make_within_their_limits(
    vehicle: Vehicle, shares: tuple[float, float, float, float], size: float
) -> None:
    speeds, reported = run(vehicle, scaled(vehicle, shares, size))
    for speed, rotor in zip(speeds, vehicle.rotors, strict=True):
        # the square root's rounding: 2e-16 seen
        assert rotor.min_speed_rad_s * (1 - 1e-14) <= speed <= rotor.max_speed_rad_s * (1 + 1e-14)
    assert np.allclose(reported, forces_and_moments(vehicle, speeds), rtol=0.0, atol=1e-12 * vehicle.weight_n)


def best_by_linear_programming(vehicle: Vehicle, wrench: tuple[float, ...]) -> np.ndarray:
    """Return the wrench of the stated priorities: most of roll and pitch, then thrust, then yaw.

    Unknowns are the scale k of roll and pitch, the thrust T, the distance e of T from the demand, and the
    scale s of yaw; Ω² = A (T, k·roll, k·pitch, s·yaw) lies within the limits.
    """
    allocation = vehicle.allocation()
    columns = np.stack(
        [
            allocation[:, 1] * wrench[1] + allocation[:, 2] * wrench[2],
            allocation[:, 0],
            np.zeros(len(vehicle.rotors)),
            allocation[:, 3] * wrench[3],
        ],
        axis=1,
    )
    low = np.array([r.min_speed_rad_s**2 for r in vehicle.rotors])
    high = np.array([r.max_speed_rad_s**2 for r in vehicle.rotors])
    distance = np.array([[0.0, 1.0, -1.0, 0.0], [0.0, -1.0, -1.0, 0.0]])
    # rows as shares of each rotor's range: the solver's tolerances are absolute
    share = 1.0 / high
    upper = np.vstack([columns * share[:, None], -columns * share[:, None], distance])
    right = np.concatenate([high * share, -low * share, [wrench[0], -wrench[0]]])
    bounds: list[tuple[float, float | None]] = [(0.0, 1.0), (-1e3, 1e3), (0.0, None), (0.0, 1.0)]
    # roll and pitch without any yaw, then thrust beside them, then yaw beside both
    for variable, aim in ((0, -1.0), (2, 1.0), (3, -1.0)):
        fixed = [*bounds[:3], (0.0, 0.0)] if variable < 3 else bounds
        cost = [aim if index == variable else 0.0 for index in range(4)]
        found = linprog(cost, upper, right, bounds=fixed, method="highs")
        assert found.status == 0, found.message
        # with the distance, thrust is settled too; the width is the solver's own tolerance
        for settled in (variable, 1) if variable == 2 else (variable,):
            bounds[settled] = (found.x[settled] - 1e-7, found.x[settled] + 1e-7)
    k, thrust, _, s = found.x
    return np.array([thrust, k * wrench[1], k * wrench[2], s * wrench[3]])


@settings(max_examples=60)
@given(
    st.one_of(irregular_vehicles(), st.sampled_from(list(VEHICLES.values()))), demands, st.floats(0.3, 3.0)
)
def test_beyond_the_limits_roll_and_pitch_come_first_then_thrust_then_yaw(
    vehicle: Vehicle, shares: tuple[float, float, float, float], size: float
) -> None:
    wrench = scaled(vehicle, shares, size)
    assume(wrench[0] > 0.0)
    expected = best_by_linear_programming(vehicle, wrench)
    _, achieved = run(vehicle, wrench)
    # the solver's own tolerance is 1e-7 of Ω²; 2e-7 of the weight seen
    assert np.allclose(achieved, expected, rtol=0.0, atol=2e-6 * vehicle.weight_n)


def test_a_full_climb_gives_up_yaw_and_a_roll_gives_up_the_climb() -> None:
    most = PAPER.max_thrust_n
    _, achieved = run(PAPER, (most, 0.0, 0.0, 0.05))
    assert achieved == pytest.approx([most, 0.0, 0.0, 0.0], abs=1e-12)
    _, achieved = run(PAPER, (most, 0.3, 0.0, 0.0))
    assert achieved[1] == pytest.approx(0.3, abs=1e-12)
    assert achieved[0] == pytest.approx(most - 2 * 0.3 / 0.2, abs=1e-9)  # the other pair gives way alike


def test_a_falling_vehicle_still_turns_upright_by_adding_thrust() -> None:
    _, achieved = run(PAPER, (0.0, 0.2, 0.0, 0.0))
    assert achieved[1] == pytest.approx(0.2, abs=1e-12)
    assert achieved[0] > 2 * 0.2 / 0.2


@properties
@given(demands)
def test_ideal_rotors_have_no_limits_and_may_turn_backwards(
    shares: tuple[float, float, float, float],
) -> None:
    ideal = PAPER.with_ideal_rotors()
    wrench = scaled(PAPER, shares, 50.0)
    speeds, reported = run(ideal, wrench)
    assert np.allclose(forces_and_moments(ideal, speeds), wrench, rtol=0.0, atol=1e-10)  # 6e-14 seen
    assert np.allclose(reported, wrench, rtol=0.0, atol=1e-10)


def test_a_strong_roll_turns_an_ideal_rotor_backwards() -> None:
    speeds, _ = run(PAPER.with_ideal_rotors(), (PAPER.weight_n, 1.0, 0.0, 0.0))
    assert speeds[1] < 0.0 < speeds[3]


def test_relative_rotor_speed_is_counter_clockwise_minus_clockwise() -> None:
    spin = mixer_for(PAPER).spin
    assert relative_rotor_speed(np.array([100.0, 220.0, 110.0, 230.0]), spin) == 220.0 + 230.0 - 100.0 - 110.0
