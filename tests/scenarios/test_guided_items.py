"""Items that are flown at once: dronekit's ``simple_goto`` and its kin."""

from __future__ import annotations

import math

import pytest

from flightstack.core.contract import Vector3
from flightstack.core.geodesy import LocalFrame
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Message
from flightstack.params.config import DEFAULT_HOME
from tests.support.truth import World

ACCEPTED, ERROR, UNSUPPORTED_FRAME, UNSUPPORTED, DENIED = 0, 1, 2, 3, 14
ABSOLUTE, RELATIVE, RELATIVE_INT, TERRAIN = 0, 3, 6, 10
WAYPOINT, LOITER = 16, 17


@pytest.fixture
def hovering() -> World:
    world = World()
    world.arm()
    world.takeoff(5.0)
    world.run_until("mode == 'HOLD'")
    world.run_for(4.0)
    return world


def item(
    north: float,
    east: float,
    altitude: float,
    *,
    current: int = 2,
    frame: int = RELATIVE,
    command: int = WAYPOINT,
    is_int: bool = False,
    kind: int = 0,
) -> Message:
    """An item as dronekit's ``simple_goto`` writes it, or its integer form."""
    place = LocalFrame(DEFAULT_HOME).to_geo(Vector3(north, east, 0.0))
    numbers = (1, 1, 0, frame, command, current, 0, 0.0, 0.0, 0.0, 0.0)
    if is_int:
        x, y = round(place.latitude_deg * 1e7), round(place.longitude_deg * 1e7)
        return mavlink.MAVLink_mission_item_int_message(*numbers, x, y, altitude, kind)
    return mavlink.MAVLink_mission_item_message(
        *numbers, place.latitude_deg, place.longitude_deg, altitude, kind
    )


def answer(world: World, message: Message) -> int:
    """Send an item; return the result of its MISSION_ACK."""
    world.gcs.received.pop("MISSION_ACK", None)
    world.gcs.send(message)
    world.run_for(0.01)
    return int(world.gcs.received["MISSION_ACK"].type)


@pytest.mark.parametrize(("is_int", "frame"), [(False, RELATIVE), (True, RELATIVE_INT), (True, RELATIVE)])
def test_the_vehicle_goes_to_the_place_of_an_item(hovering: World, is_int: bool, frame: int) -> None:
    world = hovering
    assert answer(world, item(12.0, -7.0, 8.0, is_int=is_int, frame=frame)) == ACCEPTED
    assert world.state.mode == "HOLD"
    world.run_for(14.0)
    # a float of MISSION_ITEM holds a latitude to 2e-6 degrees (0.2 m) only
    assert world.state.position_ned_m[:2] == pytest.approx((12.0, -7.0), abs=0.1 if is_int else 0.4)
    assert world.state.altitude_m == pytest.approx(8.0, abs=0.1)


def test_an_altitude_above_the_sea(hovering: World) -> None:
    world = hovering
    assert answer(world, item(3.0, 0.0, DEFAULT_HOME.altitude_m + 7.0, frame=ABSOLUTE)) == ACCEPTED
    world.run_for(10.0)
    assert world.state.altitude_m == pytest.approx(7.0, abs=0.1)


def test_current_3_changes_the_altitude_alone(hovering: World) -> None:
    world = hovering
    assert answer(world, item(30.0, 30.0, 9.0, current=3)) == ACCEPTED
    world.run_for(10.0)
    assert world.state.position_ned_m[:2] == pytest.approx((0.0, 0.0), abs=0.1)
    assert world.state.altitude_m == pytest.approx(9.0, abs=0.1)


def test_the_mission_stays_as_it_was(hovering: World) -> None:
    world = hovering
    world.upload("square.plan")
    assert answer(world, item(3.0, 0.0, 5.0)) == ACCEPTED
    assert len(world.download()) == 6


def test_an_upload_goes_on_when_an_item_to_fly_comes_between(hovering: World) -> None:
    """Nothing of it gets into the plan: the server still waits for item 0."""
    world = hovering
    world.gcs.send(mavlink.MAVLink_mission_count_message(1, 1, 1, 0))
    assert answer(world, item(3.0, 0.0, 5.0)) == ACCEPTED
    assert not world.engine.stack.parts.mission.items
    assert answer(world, item(4.0, 0.0, 5.0, current=0)) == ACCEPTED
    assert len(world.engine.stack.parts.mission.items) == 1


@pytest.mark.parametrize(
    ("message", "result"),
    [
        (item(1.0, 0.0, 5.0, command=LOITER), UNSUPPORTED),
        (item(1.0, 0.0, 5.0, kind=1), UNSUPPORTED),
        (item(1.0, 0.0, 5.0, frame=TERRAIN), UNSUPPORTED_FRAME),
        (item(1.0, 0.0, math.inf), DENIED),
        (mavlink.MAVLink_mission_item_message(1, 1, 0, 3, 16, 2, 0, 0, 0, 0, 0, math.nan, 8.0, 5.0), DENIED),
        (mavlink.MAVLink_mission_item_message(1, 1, 0, 3, 16, 2, 0, 0, 0, 0, 0, math.inf, 8.0, 5.0), DENIED),
        (
            mavlink.MAVLink_mission_item_int_message(
                1, 1, 0, 3, 16, 2, 0, 0, 0, 0, 0, 2**31 - 1, 2**31 - 1, 5.0
            ),
            DENIED,
        ),
    ],
)
def test_an_item_that_cannot_be_flown_is_refused(hovering: World, message: Message, result: int) -> None:
    world = hovering
    assert answer(world, message) == result
    world.run_for(3.0)
    assert world.state.position_ned_m[:2] == pytest.approx((0.0, 0.0), abs=0.1)


def test_the_fence_holds_for_items_too(hovering: World) -> None:
    world = hovering
    world.engine.stack.params.set("GF_MAX_HOR_DIST", 30.0)
    assert answer(world, item(50.0, 0.0, 5.0)) == DENIED
    world.run_for(0.02)
    assert "Goto refused: the place is more than 30 m from home (GF_MAX_HOR_DIST)" in world.texts, world.texts


def test_a_standing_vehicle_goes_nowhere() -> None:
    world = World()
    assert answer(world, item(5.0, 0.0, 5.0)) == ERROR
    world.run_for(0.02)
    assert "Goto refused: the vehicle is on the ground" in world.texts, world.texts


def test_items_for_another_vehicle_are_none_of_ours(hovering: World) -> None:
    world = hovering
    message = item(5.0, 0.0, 5.0)
    message.target_system = 9
    world.gcs.received.pop("MISSION_ACK", None)
    world.gcs.send(message)
    world.run_for(2.0)
    assert "MISSION_ACK" not in world.gcs.received
    assert world.state.position_ned_m[:2] == pytest.approx((0.0, 0.0), abs=0.1)
