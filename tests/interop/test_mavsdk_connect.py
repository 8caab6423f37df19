"""MAVSDK finds the vehicle on each of its links, and learns what it is and that it is well."""

from __future__ import annotations

import pytest

from flightstack import __version__
from tests.interop.client import API, GROUND, TCP, story
from tests.interop.drone import Drone

LINKS = (API, GROUND, TCP)


@story(speeds=(1,), links=LINKS)
async def test_the_vehicle_is_found_and_says_what_it_is(drone: Drone) -> None:
    assert await drone.system.is_connected()
    assert (await drone.system.autopilot_type()).name == "PX4"
    assert (await drone.system.vehicle_type()).name == "MULTICOPTER"
    version = await drone.info.get_version()
    numbers = (version.flight_sw_major, version.flight_sw_minor, version.flight_sw_patch)
    assert ".".join(map(str, numbers)) == __version__.split("+")[0], version
    identification = await drone.info.get_identification()
    assert identification.hardware_uid


@story(speeds=(1, 10), links=LINKS)
async def test_health_turns_good_and_home_is_known(drone: Drone) -> None:
    await drone.until("all is well", drone.telemetry.subscribe_health_all_ok(), bool)
    home = await drone.until("home", drone.telemetry.subscribe_home())
    position = await drone.until("position", drone.telemetry.subscribe_position())
    # on the ground, at the place of the start: MAVLink's integers hold 1e-7 degrees and millimetres
    assert position.latitude_deg == pytest.approx(home.latitude_deg, abs=2e-6)
    assert position.longitude_deg == pytest.approx(home.longitude_deg, abs=2e-6)
    assert position.absolute_altitude_m == pytest.approx(home.absolute_altitude_m, abs=0.05)
    assert position.relative_altitude_m == pytest.approx(0.0, abs=0.05)
