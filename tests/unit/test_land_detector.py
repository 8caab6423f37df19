"""The land detector: contact, landing, what ends them, and what is neither."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from flightstack.core.contract import Quaternion, Vector3, VehicleState
from flightstack.guidance.land_detector import (
    BLOCKED_M_S,
    BOUNCE_SHARE,
    CARRIED_M_S,
    CLIMB_M,
    CONTACT_M_S,
    LANDED_S,
    REST_M_S,
    SETTLING_M_S,
    STANDING_M_S,
    STILL_M_S,
    SUPPORT_LIFT,
    LandMemory,
    land_detector_step,
    lift_share,
)
from flightstack.params.vehicle import GRAVITY_M_S2

DT_S, DESCENT_M_S = 0.01, 0.7
FLYING = LandMemory(0.0, 0.0, 0.0, 0.0)
TOUCHING = LandMemory(0.0, CONTACT_M_S, 0.0, 0.0)
RESTING = LandMemory(0.0, REST_M_S, 0.0, 0.0)
LEVEL = Quaternion(1.0, 0.0, 0.0, 0.0)


def moving(down: float = 0.0, north: float = 0.0, roll_rate: float = 0.0, z: float = -0.02) -> VehicleState:
    return VehicleState(Vector3(0.0, 0.0, z), Vector3(north, 0.0, down), LEVEL, Vector3(roll_rate, 0.0, 0.0))


def watch(
    seconds: float,
    state: VehicleState,
    lift: float = 0.4,
    descent_m_s: float = DESCENT_M_S,
    memory: LandMemory = FLYING,
    rotor_lift: float = 0.0,
) -> LandMemory:
    for _ in range(round(seconds / DT_S)):
        memory = land_detector_step(memory, state, lift, rotor_lift, descent_m_s, DT_S)
    return memory


def touches(memory: LandMemory) -> bool:
    return memory.missing_m_s >= CONTACT_M_S


@pytest.mark.parametrize("lift", [0.0, 0.5, 0.65])
def test_contact_takes_the_time_of_the_missing_fall(lift: float) -> None:
    needed_s = CONTACT_M_S / ((SUPPORT_LIFT - lift) * GRAVITY_M_S2)
    assert not touches(watch(needed_s - 2 * DT_S, moving(), lift))
    assert touches(watch(needed_s + 2 * DT_S, moving(), lift))


@pytest.mark.parametrize(
    ("state", "lift", "descent_m_s"),
    [
        (moving(down=0.3), 0.4, DESCENT_M_S),
        (moving(down=-0.3), 0.4, DESCENT_M_S),
        (moving(down=0.06), 0.4, 0.1),
        (moving(), 0.7, DESCENT_M_S),
        (moving(), 0.0, 0.0),
        (moving(), 0.0, -1.0),
    ],
    ids=["sinking", "rising", "slow landing", "carried by its rotors", "holding", "climbing"],
)
def test_one_missing_sign_is_enough_for_no_contact(
    state: VehicleState, lift: float, descent_m_s: float
) -> None:
    assert watch(10.0, state, lift, descent_m_s) == (0.0, 0.0, 0.0, -0.02)


def test_thrust_or_a_fall_clears_the_signs_of_contact_and_a_bounce_does_not() -> None:
    almost = watch(0.25, moving())
    assert 0.5 < almost.missing_m_s < CONTACT_M_S
    assert watch(0.3, moving(), lift=1.0, memory=almost).missing_m_s == 0.0
    assert watch(DT_S, moving(), descent_m_s=0.0, memory=almost).missing_m_s == 0.0
    assert watch(0.04, moving(down=-0.4), memory=almost).missing_m_s > 0.5 * almost.missing_m_s
    assert watch(0.3, moving(down=0.5), memory=almost).missing_m_s == 0.0


def fly(
    lift_of: Callable[[float], float], updraft: float = 0.0, vz: float = 0.0, seconds: float = 5.0
) -> float:
    """Return the most that was missed in the air, with the vertical acceleration that the lift leads to."""
    memory, most, time_s = FLYING, 0.0, 0.0
    while time_s < seconds:
        lift = lift_of(time_s)
        vz += (1.0 - lift - updraft) * GRAVITY_M_S2 * DT_S
        memory = land_detector_step(memory, moving(down=vz), lift, lift, math.inf, DT_S)
        most = max(most, memory.missing_m_s)
        time_s += DT_S
    return most


@pytest.mark.parametrize("updraft", [0.0, 0.1, 0.2, 0.3])
@pytest.mark.parametrize("lift", [0.0, 0.3, 0.6, 0.69])
def test_a_fall_through_the_apex_of_a_throw_is_no_contact(lift: float, updraft: float) -> None:
    assert fly(lambda _: lift, updraft, vz=-2.0) <= 2.0 * STILL_M_S + GRAVITY_M_S2 * DT_S


@pytest.mark.parametrize("updraft", [0.0, 0.3])
@pytest.mark.parametrize("period_s", [0.1, 0.5, 2.0])
def test_a_throttle_that_swings_in_the_air_is_no_contact(period_s: float, updraft: float) -> None:
    """At most 0.58 m/s in all: the width of the band, and one step."""
    hovering = 1.0 - updraft
    for swing in (0.3, 0.8):
        most = fly(lambda t: max(0.0, hovering + swing * math.sin(2.0 * math.pi * t / period_s)), updraft)  # noqa: B023
        assert most <= 2.0 * STILL_M_S + GRAVITY_M_S2 * DT_S


def test_hovering_with_an_upward_force_is_no_contact() -> None:
    """Above 0.3 of the weight a descent that does not come is a contact, and no landing: the vehicle falls."""
    for updraft in (0.0, 0.1, 0.3):
        assert watch(60.0, moving(), lift=1.0 - updraft, descent_m_s=math.inf).missing_m_s < 1e-9
    for updraft in (0.4, 0.8):
        assert watch(60.0, moving(), lift=1.0 - updraft, descent_m_s=0.0).missing_m_s == 0.0
        memory, vz = watch(0.5, moving(), lift=1.0 - updraft, descent_m_s=math.inf), 0.0
        while memory.missing_m_s >= 0.0 and vz < 2.0 * SETTLING_M_S:
            vz += (1.0 - updraft) * GRAVITY_M_S2 * DT_S  # guidance takes the thrust away
            memory = land_detector_step(memory, moving(down=vz), 0.0, 0.0, DESCENT_M_S, DT_S)
            assert memory.landed == 0.0
        assert not touches(memory)


def test_contact_that_ended_in_a_fall_is_blocked_for_two_seconds() -> None:
    fell = watch(DT_S, moving(down=SETTLING_M_S + 0.1), memory=TOUCHING)
    assert fell.missing_m_s == -BLOCKED_M_S
    blocked_s = BLOCKED_M_S / (BOUNCE_SHARE * GRAVITY_M_S2)
    assert blocked_s == pytest.approx(2.0, abs=0.1)
    assert not touches(watch(blocked_s, moving(), 0.0, memory=fell))
    assert touches(watch(blocked_s + 0.2, moving(), 0.0, memory=fell))


def test_contact_lasts_while_the_reference_rests() -> None:
    """A pilot who centres the throttle on the ground has landed."""
    assert watch(LANDED_S + DT_S, moving(), 0.0, descent_m_s=0.0, memory=RESTING).landed == 1.0


def test_landed_means_standing_without_thrust_for_a_while() -> None:
    assert watch(0.25, moving(), 0.0, memory=TOUCHING).stood_s == 0.0  # the loops still run
    assert watch(LANDED_S - 2 * DT_S, moving(), 0.0, memory=RESTING).landed == 0.0
    landed = watch(LANDED_S + DT_S, moving(), 0.0, memory=RESTING)
    assert landed.landed == 1.0
    assert landed.ground_z_m == -0.02


@pytest.mark.parametrize("updraft", [0.0, 0.3, 0.5])
def test_saturated_loops_that_carry_the_vehicle_are_no_landing(updraft: float) -> None:
    """The setpoint is near zero, the rotors carry the vehicle: contact, and a fall once the loops stop."""
    memory = watch(0.5, moving(), 0.0, rotor_lift=1.0 - updraft)
    assert memory.missing_m_s >= REST_M_S
    vz, carries = -0.2, 1.0 - updraft
    while touches(memory):
        carries *= 0.6  # a lag of 20 ms
        vz += (1.0 - carries - updraft) * GRAVITY_M_S2 * DT_S
        memory = land_detector_step(memory, moving(down=vz), 0.0, carries, DESCENT_M_S, DT_S)
        assert memory.landed == 0.0
    assert memory.missing_m_s == -BLOCKED_M_S


def test_rotors_that_do_not_stop_at_rest_end_contact_without_landing() -> None:
    carried = watch(0.2, moving(), 0.0, memory=RESTING, rotor_lift=1.0)
    assert touches(carried)
    assert carried.stood_s == 0.0
    still_s = (CARRIED_M_S - REST_M_S) / (SUPPORT_LIFT * GRAVITY_M_S2)
    assert not touches(watch(still_s + DT_S, moving(), 0.0, memory=RESTING, rotor_lift=1.0))


@pytest.mark.parametrize(
    ("state", "lift"),
    [(moving(), 0.2), (moving(down=STANDING_M_S + 0.01), 0.0)],
    ids=["under thrust", "settling"],
)
def test_a_vehicle_that_does_not_stand_stays_in_contact(state: VehicleState, lift: float) -> None:
    memory = watch(10.0, state, lift, memory=TOUCHING)
    assert memory.landed == memory.stood_s == 0.0
    assert memory.missing_m_s > REST_M_S


def test_wind_that_pushes_a_vehicle_along_the_ground_does_not_prevent_landing() -> None:
    assert watch(1.0, moving(north=6.0, roll_rate=2.0), 0.0).landed == 1.0


def test_rest_begins_a_third_of_a_second_after_contact() -> None:
    assert watch(0.25, moving(), 0.08, memory=TOUCHING).missing_m_s < REST_M_S
    assert watch(0.35, moving(), 0.08, memory=TOUCHING).missing_m_s >= REST_M_S


@pytest.mark.parametrize("down", [SETTLING_M_S + 0.01, -SETTLING_M_S - 0.01])
def test_a_fall_or_a_jump_ends_contact(down: float) -> None:
    assert not touches(watch(DT_S, moving(down=down), 0.0, memory=TOUCHING))


def test_a_demand_to_climb_ends_contact_at_once() -> None:
    assert not touches(watch(DT_S, moving(), 0.0, descent_m_s=-0.5, memory=TOUCHING))
    assert not touches(watch(DT_S, moving(), 1.05, memory=TOUCHING))


def test_a_landing_ends_with_a_rise_and_with_nothing_else() -> None:
    landed = watch(1.0, moving(), 0.0)
    assert watch(5.0, moving(down=3.0, north=2.0), 2.0, -1.0, landed) == landed
    assert watch(1.0, moving(z=-0.02 - CLIMB_M + 0.001), 1.2, -1.0, landed).landed == 1.0
    assert watch(DT_S, moving(z=-0.02 - CLIMB_M - 0.001), 1.2, -1.0, landed).landed == 0.0


def test_ground_is_wherever_it_landed() -> None:
    """A hill of 30 m: the next takeoff is measured from there."""
    landed = watch(1.0, moving(z=-30.0), 0.0)
    assert (landed.landed, landed.ground_z_m) == (1.0, -30.0)
    assert watch(1.0, moving(z=-30.1), memory=landed).landed == 1.0
    assert watch(1.0, moving(z=-30.2), 1.2, -1.0, landed).landed == 0.0


def test_lift_is_the_vertical_part_of_the_thrust() -> None:
    tilted = Quaternion(math.cos(math.pi / 6), math.sin(math.pi / 6), 0.0, 0.0)  # by 60°
    assert lift_share(moving()._replace(attitude=tilted), 10.0, 10.0) == pytest.approx(0.5)
