"""The application flies against real processes: simulator, flight stack and MAVLink over UDP."""

from __future__ import annotations

import asyncio
import math
from typing import NamedTuple

import pytest
from flightstack.testing import Flight, Log
from my_app.inspection import FACADE, Point, Report, inspect
from my_app.vehicle import Position

SPEED = 5.0
"""Multiple of real time. MAVSDK's heartbeat of 1 Hz of wall time comes every 5 s of simulated time."""
FAR = Point(Position(60.0, 0.0, 3.0), 0.0)


class Flown(NamedTuple):
    report: Report
    photos: list[Position]
    flight: Flight
    output: str


def fly(server, points=FACADE) -> Flown:
    """Fly the application to its end, and return what it did and what the vehicle logged."""
    photos: list[Position] = []
    report = asyncio.run(inspect(server.mavsdk_url, lambda _, position: photos.append(position), points))
    server.stop()  # completes the log
    return Flown(report, photos, Flight(Log(server.log.read_bytes())), server.output)


@pytest.fixture(scope="module")
def flown(sitl_server) -> Flown:
    return fly(sitl_server(vehicle="x_quad", speed=SPEED, wind=(5.0, 0.0), gust=1.0, seed=3))


def test_photo_is_taken_at_each_point(flown):
    assert flown.report == Report(photos=4)
    misses_m = [math.dist(photo, point.position) for photo, point in zip(flown.photos, FACADE, strict=True)]
    assert max(misses_m) < 0.5


def test_vehicle_returns_and_stays_low(flown):
    flown.flight.eventually("mode == 'RETURN' after takeoff")
    flown.flight.always("altitude_m < 6 and abs(roll_deg) < 35")
    assert flown.flight.landing_error_m < 1.5


def test_vehicle_follows_its_setpoints_in_gusts(flown):
    assert flown.flight.max_error_m < 1.5


def test_point_beyond_the_fence_ends_the_inspection(sitl_server):
    server = sitl_server(vehicle="x_quad", state="truth", speed=SPEED, params={"GF_MAX_HOR_DIST": 20.0})
    flown = fly(server, [FACADE[0], FAR])
    assert flown.report == Report(photos=1, problem="point 1: COMMAND_DENIED")
    flown.flight.always("distance_to_home_m < 21")
    assert flown.flight.landing_error_m < 1.5


def test_application_obeys_the_battery_failsafe(sitl_server):
    """10 % of the charge last 12 s in flight and minutes on the ground: it acts on the way to the far point."""
    params = {"BAT_LOW_THR": 0.31, "BAT_CRIT_THR": 0.3, "COM_LOW_BAT_ACT": 3, "RTL_RETURN_ALT": 5}
    battery = {"battery_percent": 40.0, "battery_drain": 10.0}
    server = sitl_server(vehicle="x_quad", state="truth", speed=SPEED, params=params, **battery)
    flown = fly(server, [FACADE[0], FAR])
    assert flown.report == Report(photos=1, problem="the vehicle changed to RETURN_TO_LAUNCH")
    flown.flight.eventually("landed and distance_to_home_m < 1.5 after mode_RETURN")
