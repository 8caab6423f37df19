"""The longest flight of ``gcs fly``: three times what the plan needs and a minute more, unless --limit is given."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from flightstack.core.contract import Vector3
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.params.behaviour import Behaviour
from flightstack.plan import Command, Frame, MissionItem, load_plan
from gcs_cli.fly.flight_limit import ENDLESS_S, EXTRA_S, ITEM_S, LONGEST_S, MARGIN, flight_limit_s
from gcs_cli.fly.fly_options import DEFAULT_HOME, FlyOptions, longest_flight_s

MISSIONS = Path(__file__).parents[2] / "missions"
B = Behaviour()
LAND = MissionItem(Command.NAV_LAND, Frame.GLOBAL_RELATIVE_ALT)
LANDING_S = 2 * ITEM_S + 3.0 / B.land_speed_m_s


def at(command: Command, north: float = 0.0, z: float = 0.0, **params: float) -> MissionItem:
    place = LocalFrame(DEFAULT_HOME).to_geo(Vector3(north, 0.0, 0.0))
    x, y = round(place.latitude_deg * 1e7), round(place.longitude_deg * 1e7)
    return MissionItem(command, Frame.GLOBAL_RELATIVE_ALT, x=x, y=y, z=z, **params)


def plain(command: Command, **params: float) -> MissionItem:
    return MissionItem(command, Frame.MISSION, **params)


def needed_s(*items: MissionItem, behaviour: Behaviour = B) -> float:
    """What the items and a landing from 3 m take."""
    return (flight_limit_s((*items, LAND), DEFAULT_HOME, behaviour) - EXTRA_S) / MARGIN


TAKEOFF = at(Command.NAV_TAKEOFF, z=3.0)
TAKEOFF_S = ITEM_S + 3.0 / 1.5


def test_ways_climbs_waits_and_landings_count() -> None:
    wait = plain(Command.NAV_DELAY, param1=20.0)
    assert needed_s(TAKEOFF, wait) == pytest.approx(TAKEOFF_S + ITEM_S + 20.0 + LANDING_S, abs=0.5)
    far = at(Command.NAV_WAYPOINT, north=400.0, z=3.0, param1=7.0)
    way_s = ITEM_S + 400.0 / B.cruise_speed_m_s + 7.0
    assert needed_s(TAKEOFF, far) == pytest.approx(TAKEOFF_S + way_s + LANDING_S, abs=0.5)


def test_a_plan_that_ends_in_the_air_counts_the_return() -> None:
    far = at(Command.NAV_WAYPOINT, north=400.0, z=3.0)
    limit_s = flight_limit_s((TAKEOFF, far), DEFAULT_HOME, B)
    assert limit_s > EXTRA_S + MARGIN * (needed_s(TAKEOFF, far) + 400.0 / B.cruise_speed_m_s)
    back = plain(Command.NAV_RETURN_TO_LAUNCH)
    assert flight_limit_s((TAKEOFF, far, back), DEFAULT_HOME, B) == limit_s


def test_a_slow_speed_allows_more_time() -> None:
    far = at(Command.NAV_WAYPOINT, north=400.0, z=3.0)
    slow = plain(Command.DO_CHANGE_SPEED, param1=1.0, param2=0.5)
    assert needed_s(slow, far) - needed_s(far) == pytest.approx(400.0 / 0.5 - 100.0, abs=0.5)
    assert needed_s(far, behaviour=replace(B, cruise_speed_m_s=0.5)) == pytest.approx(
        needed_s(slow, far), abs=0.5
    )


def test_jumps_count_as_often_as_they_are_made() -> None:
    wait = plain(Command.NAV_DELAY, param1=30.0)
    again = plain(Command.DO_JUMP, param1=1.0, param2=4.0)
    five_s = 5 * (30.0 + ITEM_S)
    assert needed_s(TAKEOFF, wait, again) == pytest.approx(TAKEOFF_S + five_s + LANDING_S, abs=0.5)
    for_ever = plain(Command.DO_JUMP, param1=1.0, param2=-1.0)
    assert flight_limit_s((TAKEOFF, wait, for_ever), DEFAULT_HOME, B) == ENDLESS_S


def test_the_longest_plan_has_a_limit_that_is_found_quickly() -> None:
    wait = plain(Command.NAV_DELAY, param1=1e5)
    again = plain(Command.DO_JUMP, param1=0.0, param2=65535.0)
    assert flight_limit_s((wait, again), DEFAULT_HOME, B) == LONGEST_S


@pytest.mark.parametrize(
    ("name", "flown_s"), [("square.plan", 25.0), ("hop.plan", 12.0), ("every_item.plan", 40.0)]
)
def test_the_limit_of_a_mission_file_is_a_few_times_its_flight(name: str, flown_s: float) -> None:
    plan = load_plan(MISSIONS / name)
    limit_s = longest_flight_s(FlyOptions(MISSIONS / name), plan)
    assert 3.0 * flown_s < limit_s < 600.0


def test_an_option_or_a_parameter_file_changes_the_limit(tmp_path: Path) -> None:
    path, plan = MISSIONS / "square.plan", load_plan(MISSIONS / "square.plan")
    assert longest_flight_s(FlyOptions(path, limit_s=77.0), plan) == 77.0
    params = tmp_path / "slow.params"
    params.write_text("1\t1\tMPC_XY_CRUISE\t0.1\t9\n1\t1\tATT_P_ROLL\t100\t9\n")
    slow = longest_flight_s(FlyOptions(path, params=params), plan)
    assert slow > longest_flight_s(FlyOptions(path), plan) + 3.0 * 50.0


def test_a_plan_with_another_home_is_measured_from_there() -> None:
    elsewhere = GeoPoint(
        DEFAULT_HOME.latitude_deg + 0.01, DEFAULT_HOME.longitude_deg, DEFAULT_HOME.altitude_m
    )
    way = (at(Command.NAV_WAYPOINT),)
    assert flight_limit_s(way, elsewhere, B) > flight_limit_s(way, DEFAULT_HOME, B) + 3.0 * 2 * 1100.0 / 4.0
