"""Every failsafe in every phase of flight: a table of what must come of it, and all of its cells flown."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
import pytest

from flightstack.commander.failsafe import Failsafe, Phase
from tests.support import refusals
from tests.support.failsafe_faults import (
    begin_setpoints,
    begin_sticks,
    blow_away,
    breach_fence,
    inject,
    jump_gnss,
    lose_states,
    nothing,
    set_param,
    stop_heartbeats,
    stop_stream,
    tip_over,
)
from tests.support.failsafe_phases import ENTER, MODE_IN, QUICK
from tests.support.truth import World

F, P = Failsafe, Phase
REJECTED = 1

# ---------------------------------------------------------------------- faults


class Case(NamedTuple):
    """How a failsafe is provoked: parameters, what is done before the phase and in it, and what is said."""

    params: Mapping[str, float]
    before: Callable[[World], None]
    fault: Callable[[World], None]
    says: str
    refusal: str
    state: str = "truth"


CASES: dict[Failsafe, Case] = {
    F.GCS_LOST: Case(
        {"NAV_DLL_ACT": 2, "COM_DL_LOSS_T": 5},
        stop_heartbeats,
        nothing,
        "Ground station lost",
        "ground station",
    ),
    F.OFFBOARD_LOST: Case(
        {"COM_OBL_RC_ACT": 4, "COM_OF_LOSS_T": 0.3},
        begin_setpoints,
        stop_stream("setpoint"),
        "Offboard setpoints lost",
        "no offboard setpoints",
    ),
    F.MANUAL_LOST: Case(
        {"NAV_RCL_ACT": 3}, begin_sticks, stop_stream("sticks"), "Manual control lost", "no manual control"
    ),
    F.BATTERY_LOW: Case({}, nothing, inject("battery:level=0.13"), "Battery level is low", "battery is low"),
    F.BATTERY_CRITICAL: Case(
        {"COM_LOW_BAT_ACT": 3},
        nothing,
        inject("battery:level=0.068"),
        "Battery level is critical",
        "battery is low",
    ),
    F.BATTERY_EMERGENCY: Case(
        {"COM_LOW_BAT_ACT": 3},
        nothing,
        inject("battery:level=0.04"),
        "Battery level is dangerously low",
        "battery is low",
    ),
    F.FENCE: Case({"GF_ACTION": 3}, nothing, breach_fence, "Geofence breached", "outside the geofence"),
    F.POSITION_ERROR: Case(
        {"FS_POS_ERR_T": 0.1}, nothing, blow_away, "Position is far from its setpoint", ""
    ),
    F.ATTITUDE: Case(
        {"FD_FAIL_R_TTRI": 0.02}, nothing, tip_over, "Attitude is beyond its limits", "tilted by more than"
    ),
    F.ROTOR: Case(
        {"COM_ACT_FAIL_ACT": 4}, nothing, inject("rotor:1:off"), "A rotor does not follow its command", ""
    ),
    F.STATE_STALE: Case(
        {"FS_STALE_T": 0.05, "FS_BLIND_T": 0.3},
        nothing,
        lose_states,
        "State is frozen or missing",
        "the state is frozen or missing",
    ),
    F.IMU_FAULT: Case(
        {"FS_BLIND_T": 0.3},
        nothing,
        inject("sensor:imu:off"),
        "Inertial sensor is missing or stuck",
        "inertial sensor is missing or stuck",
        "estimated",
    ),
    F.ATTITUDE_DOUBTFUL: Case(
        {},
        nothing,
        set_param("FS_TILT_DEV", 0.01),
        "Attitude estimate is doubtful",
        "attitude estimate is doubtful",
        "estimated",
    ),
    F.POSITION_LOST: Case(
        {"COM_POSCTL_NAVL": 1},
        nothing,
        set_param("COM_POS_FS_EPH", 0.01),
        "Position is lost",
        "position is lost",
        "estimated",
    ),
    F.GNSS_REFUSED: Case(
        {"FS_GNSS_ACT": 2}, nothing, jump_gnss, "Spoofed GNSS suspected", "estimate", "estimated"
    ),
    F.NOT_FINITE: Case(
        {"FS_BLIND_T": 0.3},
        nothing,
        inject("state:nan"),
        "State or controller output",
        "no valid position and attitude",
    ),
}

# ---------------------------------------------------------------------- ends


def refused(world: World, case: Case, phase: Phase) -> None:
    """Arming is refused, with the reason."""
    world.run_for(0.6)
    with refusals.refused(REJECTED, case.refusal):
        world.arm()
    assert not world.state.armed


def arms(world: World, case: Case, phase: Phase) -> None:
    """There is nothing to see on the ground: the vehicle arms."""
    world.arm()


def disarms(world: World, case: Case, phase: Phase) -> None:
    """The vehicle never leaves the ground and disarms."""
    world.run_until("not armed", 3.0)
    assert world.state.altitude_m < 0.05
    assert said(world, case)


def returns(world: World, case: Case, phase: Phase) -> None:
    """Home, on the ground, disarmed."""
    world.run_until("mode == 'RETURN'", 5.0)
    assert said(world, case)
    world.run_until("not armed", 40.0)
    assert world.state.altitude_m < 0.05
    assert np.linalg.norm(world.state.position_ned_m[:2]) < 0.6


def lands(world: World, case: Case, phase: Phase) -> None:
    """On the ground near where it was, disarmed."""
    world.run_until("mode == 'LAND'", 5.0)
    assert said(world, case)
    here = world.state.position_ned_m
    world.run_until("not armed", 25.0)
    assert world.state.altitude_m < 0.05
    assert math.dist(world.state.position_ned_m[:2], here[:2]) < 3.0


def ends(world: World, case: Case, phase: Phase) -> None:
    """Rotors off for good."""
    world.run_until("mode == 'TERMINATION'", 3.0)
    assert said(world, case)
    assert not world.state.armed
    assert float(np.abs(world.engine.stack.now.row[31:39]).max()) == 0.0
    with refusals.refused(REJECTED):
        world.arm()
    with refusals.refused(REJECTED):
        world.set_mode("HOLD")


def goes_on(world: World, case: Case, phase: Phase) -> None:
    """A warning at most: the phase is not disturbed."""
    before = world.state.mode
    world.run_for(1.0)
    assert world.state.armed
    assert world.state.mode == before
    assert phase is P.STANDING or world.state.mode == MODE_IN[phase].name


def warns(world: World, case: Case, phase: Phase) -> None:
    """The phase goes on, and the operator knows."""
    goes_on(world, case, phase)
    assert said(world, case)


def said(world: World, case: Case) -> bool:
    """Tell whether the failsafe was announced, once."""
    world.run_for(0.02)
    return sum(case.says in text and "again" not in text for text in world.texts) == 1


PHASES = (
    P.DISARMED,
    P.STANDING,
    P.TAKEOFF,
    P.MISSION,
    P.HOLD,
    P.GOTO,
    P.MANUAL,
    P.OFFBOARD,
    P.RETURN,
    P.LAND,
)
# fmt: off
TABLE = {
    #                     disarmed standing takeoff  mission  hold     goto     manual   offboard return   land
    F.NOT_FINITE:        (refused, disarms, ends,    ends,    ends,    ends,    ends,    ends,    ends,    ends),
    F.IMU_FAULT:         (refused, disarms, ends,    ends,    ends,    ends,    ends,    ends,    ends,    ends),
    F.STATE_STALE:       (refused, disarms, ends,    ends,    ends,    ends,    ends,    ends,    ends,    ends),
    F.ATTITUDE:          (refused, disarms, ends,    ends,    ends,    ends,    ends,    ends,    ends,    ends),
    F.ATTITUDE_DOUBTFUL: (refused, disarms, lands,   lands,   lands,   lands,   lands,   lands,   lands,   warns),
    F.ROTOR:             (arms,    disarms, ends,    ends,    ends,    ends,    ends,    ends,    ends,    ends),
    F.BATTERY_EMERGENCY: (refused, disarms, lands,   lands,   lands,   lands,   lands,   lands,   lands,   warns),
    F.POSITION_LOST:     (refused, disarms, lands,   lands,   lands,   lands,   lands,   lands,   lands,   warns),
    F.FENCE:             (refused, disarms, lands,   returns, returns, returns, returns, returns, warns,   warns),
    F.POSITION_ERROR:    (arms,    goes_on, lands,   lands,   lands,   lands,   goes_on, lands,   lands,   warns),
    F.BATTERY_CRITICAL:  (refused, disarms, returns, returns, returns, returns, returns, returns, warns,   warns),
    F.MANUAL_LOST:       (refused, disarms, goes_on, goes_on, goes_on, goes_on, lands,   goes_on, goes_on, goes_on),
    F.OFFBOARD_LOST:     (refused, disarms, goes_on, goes_on, goes_on, goes_on, goes_on, lands,   goes_on, goes_on),
    F.GCS_LOST:          (refused, disarms, returns, returns, returns, returns, returns, returns, warns,   goes_on),
    F.BATTERY_LOW:       (refused, warns,   warns,   warns,   warns,   warns,   warns,   warns,   warns,   warns),
    F.GNSS_REFUSED:      (refused, disarms, lands,   lands,   lands,   lands,   lands,   lands,   lands,   warns),
}
# fmt: on


def test_the_table_has_every_failsafe_in_every_phase() -> None:
    assert set(TABLE) == set(CASES) == set(Failsafe)
    assert set(PHASES) == set(ENTER) == set(Phase)
    assert all(len(row) == len(PHASES) for row in TABLE.values())


@pytest.mark.parametrize("phase", PHASES, ids=lambda phase: phase.name.lower())
@pytest.mark.parametrize("failsafe", list(TABLE), ids=lambda failsafe: failsafe.name.lower())
def test_each_failsafe_in_each_phase(failsafe: Failsafe, phase: Phase) -> None:
    case = CASES[failsafe]
    world = World(vehicle="x_quad", params={**QUICK, **case.params}, state=case.state)
    world.wait_until_ready()
    ENTER[phase](world, lambda: case.before(world))
    case.fault(world)
    TABLE[failsafe][PHASES.index(phase)](world, case, phase)
