"""Guidance after a sample that is not finite: it goes on as if that sample had not come."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flightstack.core.contract import Vector3
from flightstack.core.enums import Mode
from flightstack.guidance.setpoints import AttitudeSetpoint, PointSetpoint
from tests.support.perfect_vehicle import WEIGHT_N, PerfectVehicle

BAD = [math.nan, math.inf, -math.inf]
HOVER = np.array([1.0, 0.0, 0.0, 0.0, WEIGHT_N])


def flying(mode: Mode) -> PerfectVehicle:
    vehicle = PerfectVehicle()
    vehicle.plan((22, 0, 0, 0, math.nan, 0.0, 0.0, -5.0), (16, 0, 0, 0, math.nan, 20.0, 5.0, -5.0))
    vehicle.airborne_at(1.0, 2.0, -5.0)
    vehicle.navigator.set_offboard(PointSetpoint(velocity_ned_m_s=Vector3(1.0, 0.5, -0.2)), 20.0)
    vehicle.enter(mode, 8.0)
    vehicle.run(1.0)
    return vehicle


@pytest.mark.parametrize("bad", BAD)
@pytest.mark.parametrize("mode", [mode for mode in Mode if mode is not Mode.TERMINATION])
def test_one_bad_state_moves_no_reference(mode: Mode, bad: float) -> None:
    disturbed, quiet = flying(mode), flying(mode)
    for index in range(13):
        state = disturbed.state.copy()
        state[index] = bad
        disturbed.navigator.step(mode, state, HOVER, WEIGHT_N)
        disturbed.navigator.reset_reference(state)
        disturbed.navigator.reset_on_ground(state)
    for vehicle in (disturbed, quiet):
        vehicle.run(1.0)
    assert disturbed.state.tolist() == quiet.state.tolist()


@pytest.mark.parametrize("bad", BAD)
def test_one_bad_attitude_target_ends_no_flight_by_body_rates(bad: float) -> None:
    vehicle = flying(Mode.OFFBOARD)
    navigator = vehicle.navigator
    navigator.set_offboard(AttitudeSetpoint(None, Vector3(0.2, 0.0, 0.0), 0.5), 20.0)
    navigator.step(Mode.OFFBOARD, vehicle.state, np.array([1.0, bad, 0.0, 0.0, WEIGHT_N]), WEIGHT_N)
    for _ in range(5):
        navigator.step(Mode.OFFBOARD, vehicle.state, navigator.attitude_target.copy(), WEIGHT_N)
    assert np.isfinite(navigator.attitude_target).all()
