"""The end of a mission in the view, on vehicles with and without MISSION_STATE."""

from __future__ import annotations

from typing import Any

import pytest

from flightstack.mavlink.dialect import mavlink
from gcs_cli.vehicle.view_types import MISSION_ACTIVE, MISSION_COMPLETE, Mission
from tests.support.folded_vehicle import HOLD_MODE, MISSION_MODE, RETURN_MODE, Vehicle, heartbeat

ARMED = 129
RETURN, WAYPOINT, LAND = (
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH,
    mavlink.MAV_CMD_NAV_WAYPOINT,
    mavlink.MAV_CMD_NAV_LAND,
)
ON_GROUND, IN_AIR = mavlink.MAV_LANDED_STATE_ON_GROUND, mavlink.MAV_LANDED_STATE_IN_AIR
FIRST_ID, SECOND_ID = 7, 8


class Px4(Vehicle):
    """As PX4 without MISSION_STATE: a mission of three items, with the messages of its flight."""

    def __init__(self, last: int = RETURN) -> None:
        super().__init__()
        self.send(heartbeat(mode=HOLD_MODE))
        self.land()
        self.is_at(0)
        self.send_items(WAYPOINT, WAYPOINT, last)

    def send_items(self, *commands: int, mission_id: int = FIRST_ID) -> None:
        """Send the items as to a client that downloads them."""
        kind = mavlink.MAV_MISSION_TYPE_MISSION
        self.send(mavlink.MAVLink_mission_count_message(255, 190, len(commands), kind, mission_id))
        for seq, command in enumerate(commands):
            place = (seq, 3, command, 0, 1, 0.0, 0.0, 0.0, 0.0, 0, 0, 0.0)
            self.send(mavlink.MAVLink_mission_item_int_message(255, 190, *place, kind))

    def is_at(self, seq: int, total: int = 3, mission_id: int = FIRST_ID) -> Mission:
        message = mavlink.MAVLink_mission_current_message(seq, total, 0, 0, mission_id)
        return self.send(message).mission

    def reaches(self, seq: int) -> Mission:
        return self.send(mavlink.MAVLink_mission_item_reached_message(seq)).mission

    def beats(self, mode: int, base: int = ARMED) -> Mission:
        return self.send(heartbeat(base, mode)).mission

    def take_off(self) -> None:
        self.beats(MISSION_MODE)
        self.send(mavlink.MAVLink_extended_sys_state_message(0, IN_AIR))

    def land(self) -> Mission:
        return self.send(mavlink.MAVLink_extended_sys_state_message(0, ON_GROUND)).mission

    def disarm(self) -> Mission:
        return self.beats(HOLD_MODE, 1)

    def fly_to_last(self) -> None:
        self.take_off()
        for seq in (0, 1):
            self.is_at(seq)
            self.beats(MISSION_MODE)
            self.reaches(seq)
        self.is_at(2)


def ends(mission: Mission) -> tuple[bool, bool]:
    """Return whether the mission is complete, and whether its end is unknown."""
    assert mission.complete == mission.is_flown
    return mission.complete, mission.is_end_unknown


def test_mission_that_ends_with_a_return_is_complete_when_it_begins() -> None:
    vehicle = Px4()
    vehicle.fly_to_last()
    assert ends(vehicle.view.mission) == (False, True)
    assert ends(vehicle.beats(RETURN_MODE)) == (True, False)
    vehicle.land()
    assert ends(vehicle.disarm()) == (True, False)
    assert ends(vehicle.beats(MISSION_MODE)) == (False, True)  # the next flight


def test_heartbeat_before_the_return_does_not_hide_the_end() -> None:
    vehicle = Px4()
    vehicle.fly_to_last()
    vehicle.beats(MISSION_MODE)  # PX4 changes the mode some milliseconds after the item
    assert ends(vehicle.beats(RETURN_MODE)) == (True, False)


def test_items_sent_during_the_return_show_the_end() -> None:
    vehicle = Px4(last=LAND)
    vehicle.fly_to_last()
    assert ends(vehicle.beats(RETURN_MODE)) == (False, True)
    vehicle.send_items(WAYPOINT, WAYPOINT, RETURN)
    assert ends(vehicle.view.mission) == (True, False)


@pytest.mark.parametrize("last", [LAND, WAYPOINT])
def test_failsafe_return_at_another_last_item_is_not_the_end(last: int) -> None:
    vehicle = Px4(last)
    vehicle.fly_to_last()
    vehicle.beats(RETURN_MODE)
    vehicle.land()
    assert ends(vehicle.disarm()) == (False, True)


def test_return_without_known_items_is_not_the_end() -> None:
    vehicle = Px4()
    vehicle.is_at(0, mission_id=SECOND_ID)  # of another mission than the items
    vehicle.take_off()
    vehicle.is_at(2, mission_id=SECOND_ID)
    assert ends(vehicle.beats(RETURN_MODE)) == (False, True)


def test_mission_that_was_never_begun_is_not_complete() -> None:
    vehicle = Px4()
    vehicle.send_items(RETURN)
    vehicle.is_at(0, total=1)
    for mode in (HOLD_MODE, RETURN_MODE):
        vehicle.beats(mode)
    vehicle.land()
    assert ends(vehicle.disarm()) == (False, True)


def test_return_after_a_manual_flight_is_not_the_end() -> None:
    vehicle = Px4()
    vehicle.is_at(2)  # left there by the flight before
    for mode in (HOLD_MODE, RETURN_MODE):
        vehicle.beats(mode)
    vehicle.send(mavlink.MAVLink_extended_sys_state_message(0, IN_AIR))
    assert ends(vehicle.disarm()) == (False, True)


def test_return_that_ends_in_the_air_is_not_complete() -> None:
    disarmed, left = Px4(), Px4()
    for vehicle in (disarmed, left):
        vehicle.fly_to_last()
        vehicle.beats(RETURN_MODE)
    assert ends(disarmed.disarm()) == (False, True)
    assert ends(disarmed.land()) == (False, True)
    assert ends(left.beats(HOLD_MODE)) == (False, True)
    assert ends(left.beats(RETURN_MODE)) == (False, True)


def test_mission_at_its_last_item_on_the_ground_is_of_unknown_end() -> None:
    """A client that connects before a flight sees the same as one that connects after it."""
    vehicle = Px4()
    assert ends(vehicle.is_at(2)) == (False, True)
    assert ends(vehicle.reaches(2)) == (False, True)  # PX4 repeats it after the flight


def test_last_item_reached_completes_a_mission() -> None:
    vehicle = Px4(LAND)
    vehicle.fly_to_last()
    assert ends(vehicle.reaches(2)) == (True, False)
    assert ends(vehicle.disarm()) == (True, False)


def test_second_flight_does_not_begin_complete() -> None:
    vehicle = Px4(LAND)
    vehicle.fly_to_last()
    vehicle.reaches(2)
    vehicle.disarm()
    mission = vehicle.beats(MISSION_MODE)
    assert (mission.reached, ends(mission)) == (None, (False, True))
    vehicle.is_at(0)
    assert ends(vehicle.reaches(2)) == (False, False)  # repeated, of the first flight
    vehicle.fly_to_last()
    assert ends(vehicle.reaches(2)) == (True, False)


def test_completed_mission_that_begins_again_in_the_air_is_not_complete() -> None:
    vehicle = Px4(WAYPOINT)
    vehicle.fly_to_last()
    vehicle.reaches(2)
    assert ends(vehicle.is_at(2)) == (True, False)
    mission = vehicle.is_at(0)
    assert (mission.reached, ends(mission)) == (None, (False, False))
    assert ends(vehicle.is_at(2)) == (False, True)


def test_item_reached_before_a_jump_back_is_kept() -> None:
    vehicle = Px4(WAYPOINT)
    vehicle.take_off()
    vehicle.is_at(1)
    vehicle.reaches(1)
    assert vehicle.is_at(0).reached == 1  # DO_JUMP


def test_another_mission_is_not_complete() -> None:
    vehicle = Px4(LAND)
    vehicle.fly_to_last()
    vehicle.reaches(2)
    vehicle.disarm()
    mission = vehicle.is_at(2, mission_id=SECOND_ID)
    assert (mission.reached, ends(mission)) == (None, (False, True))


def test_reported_completion_counts_until_the_mission_begins_again(vehicle: Vehicle) -> None:
    """A vehicle may clear the state when it disarms."""

    def flown(state: int) -> bool:
        message: Any = mavlink.MAVLink_mission_current_message(2, 3, state, 0)
        return vehicle.send(message).mission.is_flown

    states = (MISSION_ACTIVE, MISSION_COMPLETE, mavlink.MISSION_STATE_NOT_STARTED, MISSION_ACTIVE)
    assert [flown(state) for state in states] == [False, True, True, False]
    vehicle.send(heartbeat(ARMED))
    vehicle.send(mavlink.MAVLink_mission_item_reached_message(2))
    assert not flown(MISSION_ACTIVE)  # the state decides


@pytest.fixture
def vehicle() -> Vehicle:
    made = Vehicle()
    made.send(heartbeat())
    return made
