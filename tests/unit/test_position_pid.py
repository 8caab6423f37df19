"""The position loop: thrust direction by rotation matrices, integrators, limits, the paper's altitude."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from flightstack.control.position_pid import (
    PositionMemory,
    PositionParams,
    position_pid_step,
    read_position_params,
)
from flightstack.core.contract import AttitudeTarget, PositionSetpoint, Quaternion, Vector3, VehicleState
from flightstack.params.gains_file import open_gains
from flightstack.params.vehicle import GRAVITY_M_S2, load_vehicle

PAPER = load_vehicle("paper_quad")
G = GRAVITY_M_S2
ZERO, LEVEL = Vector3(0.0, 0.0, 0.0), Quaternion(1.0, 0.0, 0.0, 0.0)
EMPTY = PositionMemory(0.0, 0.0, 0.0)
TUNED = read_position_params(PAPER, open_gains("tuned"), math.radians(45.0))

properties = settings(max_examples=60)


def vehicle_at(position=ZERO, velocity=ZERO, attitude: Quaternion = LEVEL) -> VehicleState:
    return VehicleState(Vector3(*position), Vector3(*velocity), attitude, ZERO)


def wanted(position=ZERO, velocity=ZERO, acceleration=ZERO, yaw: float = 0.0) -> PositionSetpoint:
    return PositionSetpoint(Vector3(*position), Vector3(*velocity), Vector3(*acceleration), yaw, 0.0)


def rotation(q: Quaternion) -> Rotation:
    return Rotation.from_quat([q.x, q.y, q.z, q.w])


def acceleration_of(target: AttitudeTarget, mass_kg: float) -> np.ndarray:
    """Acceleration at the target's attitude and thrust: thrust along −z of the body, and gravity."""
    return rotation(target.attitude).apply((0.0, 0.0, -target.thrust_n / mass_kg)) + np.array([0.0, 0.0, G])


@properties
@given(st.floats(-4.0, 4.0), st.floats(-4.0, 4.0), st.floats(-3.0, 3.0), st.floats(-math.pi, math.pi))
def test_target_makes_the_acceleration_asked_for(north: float, east: float, down: float, yaw: float) -> None:
    """A vehicle that has the attitude makes exactly this acceleration, and looks along the yaw setpoint."""
    asked = wanted(acceleration=(north, east, down), yaw=yaw)
    _, target = position_pid_step(EMPTY, vehicle_at(), asked, TUNED, 0.01)
    _, settled = position_pid_step(EMPTY, vehicle_at(attitude=target.attitude), asked, TUNED, 0.01)
    assert np.allclose(acceleration_of(settled, PAPER.mass_kg), (north, east, down), rtol=0.0, atol=1e-12)
    nose = rotation(settled.attitude).apply((1.0, 0.0, 0.0))
    assert math.remainder(math.atan2(nose[1], nose[0]) - yaw, 2 * math.pi) == pytest.approx(0.0, abs=1e-12)


@properties
@given(*[st.tuples(*[st.floats(-0.3, 0.3)] * 3)] * 3, st.tuples(*[st.floats(-0.5, 0.5)] * 3))
def test_demand_is_a_pid_on_position_with_feed_forward(p, v, a, integral) -> None:
    memory = PositionMemory(*integral)
    dt = 0.01
    state, setpoint = vehicle_at((0.1, -0.2, 0.05), (0.2, 0.1, -0.1)), wanted(p, v, a)
    advanced, target = position_pid_step(memory, state, setpoint, TUNED, dt)
    _, settled = position_pid_step(memory, state._replace(attitude=target.attitude), setpoint, TUNED, dt)
    error, error_v = np.array(p) - state.position_ned_m, np.array(v) - state.velocity_ned_m_s
    kp, ki, kd = np.array([8.75, 8.75, 12.0]), np.array([3.125, 3.125, 4.5]), np.array([5.5, 5.5, 6.5])
    demand = kp * error + kd * error_v + a + integral
    if (
        math.hypot(demand[0], demand[1]) < 0.99 * (G - demand[2]) and abs(demand[2]) < 0.5 * G
    ):  # within all limits
        assert np.allclose(acceleration_of(settled, PAPER.mass_kg), demand, rtol=0.0, atol=1e-11)
        assert np.allclose(advanced, np.array(integral) + ki * error * dt, rtol=0.0, atol=1e-14)


def test_hover_is_the_weight() -> None:
    _, target = position_pid_step(EMPTY, vehicle_at(), wanted(), TUNED, 0.01)
    assert target.thrust_n == pytest.approx(PAPER.weight_n, rel=1e-15)
    assert target.attitude == LEVEL


def test_papers_altitude_gains_are_squares_of_rotor_speed() -> None:
    """ΣΩ² per metre, b Σ Ω² newton: ωn 3.88 rad/s, with the corrected Kdz ζ 0.9; x and y 3.2 and 0.47."""
    params = read_position_params(PAPER, open_gains("paper"), math.radians(45.0))
    assert params.kp_z == pytest.approx(2.93e-5 * 2.83e5 / 0.55, rel=1e-12)
    assert params.kd_z / (2.0 * math.sqrt(params.kp_z)) == pytest.approx(0.9, abs=0.002)
    assert math.sqrt(params.kp_xy) == pytest.approx(3.2, abs=0.05)
    assert params.kd_xy / (2.0 * math.sqrt(params.kp_xy)) == pytest.approx(0.474, abs=0.001)


@properties
@given(st.floats(-500.0, 500.0), st.floats(-500.0, 500.0), st.floats(-500.0, 500.0), st.floats(0.1, 1.2))
def test_limits_hold_for_any_error(north: float, east: float, down: float, max_tilt: float) -> None:
    params = TUNED._replace(max_tilt_rad=max_tilt)
    _, target = position_pid_step(EMPTY, vehicle_at(), wanted((north, east, down)), params, 0.01)
    assert params.min_thrust_n <= target.thrust_n <= params.max_thrust_n
    up = rotation(target.attitude).apply((0.0, 0.0, -1.0))
    # the tilt limit refers to a thrust of half the weight at least: tilts seen exceed it by 2e-16 only
    assert math.acos(min(1.0, -up[2])) <= max_tilt + 1e-7
    if math.hypot(north, east) > 1.0:  # a limited demand keeps its direction
        assert up[0] * east == pytest.approx(up[1] * north, abs=1e-9 * math.hypot(north, east))
        assert up[0] * north + up[1] * east > 0.0


def run_memory(position, ticks: int = 300, memory: PositionMemory = EMPTY, params: PositionParams = TUNED):
    for _ in range(ticks):
        memory, _ = position_pid_step(memory, vehicle_at(), wanted(position), params, 0.01)
    return memory


def test_integrators_wait_while_tilt_or_thrust_is_at_its_limit() -> None:
    assert run_memory((100.0, 0.0, 0.0)) == (0.0, 0.0, 0.0)
    down = run_memory((0.0, 0.0, -100.0))
    assert down == (0.0, 0.0, 0.0)
    # one axis at its limit leaves the other free
    mixed = run_memory((0.2, 0.0, -100.0), ticks=10)
    assert mixed.z == 0.0
    assert mixed.x == pytest.approx(3.125 * 0.2 * 0.1, rel=1e-12)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_integrators_are_bounded(sign: float) -> None:
    assert run_memory((0.1 * sign, 0.0, 0.0), ticks=3_000).x == sign * TUNED.max_integral_m_s2
    assert run_memory((0.0, 0.1 * sign, 0.0), ticks=3_000).y == sign * TUNED.max_integral_m_s2
    assert run_memory((0.0, 0.0, 0.1 * sign), ticks=3_000).z == sign * TUNED.max_integral_m_s2


def test_thrust_carries_the_weight_at_the_present_tilt_but_not_of_a_capsized_vehicle() -> None:
    tilted = Quaternion(math.cos(0.25), math.sin(0.25), 0.0, 0.0)
    _, target = position_pid_step(EMPTY, vehicle_at(attitude=tilted), wanted(), TUNED, 0.01)
    assert target.thrust_n == pytest.approx(PAPER.weight_n / math.cos(0.5), rel=1e-12)
    upside_down = Quaternion(0.0, 1.0, 0.0, 0.0)
    _, target = position_pid_step(EMPTY, vehicle_at(attitude=upside_down), wanted(), TUNED, 0.01)
    assert target.thrust_n == pytest.approx(min(2.0 * PAPER.weight_n, TUNED.max_thrust_n), rel=1e-12)


def test_ideal_rotors_lift_the_thrust_limit() -> None:
    params = read_position_params(PAPER.with_ideal_rotors(), open_gains("tuned"), 0.5)
    assert params.max_thrust_n == pytest.approx(10.0 * PAPER.weight_n)


def test_the_vertical_integrator_stops_only_in_the_direction_the_mixer_cannot_follow() -> None:
    """+1: less thrust than demanded; more lift (a setpoint above) must not wind up, less must still count."""
    for setpoint_z, saturation, moves in (
        (-0.1, 1.0, False),
        (0.1, 1.0, True),
        (0.1, -1.0, False),
        (-0.1, 0.0, True),
    ):
        memory, _ = position_pid_step(
            EMPTY, vehicle_at(), wanted((0.0, 0.0, setpoint_z)), TUNED, 0.01, saturation
        )
        assert (memory.z != 0.0) is moves, (setpoint_z, saturation)
