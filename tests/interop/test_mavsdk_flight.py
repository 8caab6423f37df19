"""MAVSDK arms, takes off, goes to places, holds, returns, lands and kills."""

from __future__ import annotations

import asyncio
import math

import pytest
from mavsdk.plugins.action import ActionError
from mavsdk.plugins.telemetry import PositionVelocityNed, VelocityNed

from tests.interop.client import GROUND, TCP, story
from tests.interop.drone import Drone

METRES_A_DEGREE = 111_195.0
"""Of latitude, on a sphere of 6371 km; half a per cent from the ellipsoid's."""


@story(speeds=(1, 10))
async def test_takeoff_goto_and_land(drone: Drone) -> None:
    await drone.action.set_takeoff_altitude(3.0)
    assert await drone.action.get_takeoff_altitude() == 3.0
    await drone.take_off()
    start = await drone.until(
        "3 m up", drone.telemetry.subscribe_position(), lambda at: abs(at.relative_altitude_m - 3.0) < 0.1
    )
    assert (await drone.until("state", drone.telemetry.subscribe_landed_state())).name == "IN_AIR"
    north_deg = start.latitude_deg + 6.0 / METRES_A_DEGREE
    height_m = start.absolute_altitude_m - start.relative_altitude_m + 5.0
    await drone.action.goto_location(north_deg, start.longitude_deg, height_m, 90.0)
    await drone.until(
        "6 m north, 2 m up", drone.telemetry.subscribe_position(),
        lambda at: abs(at.latitude_deg - north_deg) * METRES_A_DEGREE < 0.3
        and abs(at.relative_altitude_m - 5.0) < 0.3,
    )  # fmt: skip
    await drone.until(
        "looking east", drone.telemetry.subscribe_heading(), lambda at: abs(at.heading_deg - 90.0) < 3.0
    )
    await drone.land()
    assert (await drone.until("state", drone.telemetry.subscribe_landed_state())).name == "ON_GROUND"


@story(links=(GROUND, TCP))
async def test_return_climbs_comes_home_and_lands(drone: Drone) -> None:
    await drone.action.set_return_to_launch_altitude(6.0)
    assert await drone.action.get_return_to_launch_altitude() == 6.0
    await drone.take_off()
    home = await drone.until("home", drone.telemetry.subscribe_home())
    place = home.longitude_deg + 15.0 / METRES_A_DEGREE / math.cos(math.radians(home.latitude_deg))
    await drone.action.goto_location(home.latitude_deg, place, home.absolute_altitude_m + 3.0, math.nan)
    await drone.until(
        "15 m east", drone.telemetry.subscribe_position(), lambda at: abs(at.longitude_deg - place) < 3e-6
    )
    await drone.action.return_to_launch()
    await drone.until(
        "the return's altitude", drone.telemetry.subscribe_position(), lambda at: at.relative_altitude_m > 5.7
    )
    await drone.until_disarmed()
    end = await drone.until("position", drone.telemetry.subscribe_position())
    assert abs(end.longitude_deg - home.longitude_deg) < 3e-6
    assert abs(end.relative_altitude_m) < 0.1


@story()
async def test_hold_stops_on_the_way(drone: Drone) -> None:
    await drone.take_off()
    start = await drone.until("position", drone.telemetry.subscribe_position())
    await drone.action.goto_location(
        start.latitude_deg + 60.0 / METRES_A_DEGREE, start.longitude_deg, start.absolute_altitude_m, 0.0
    )
    moving = drone.telemetry.subscribe_velocity_ned()
    await drone.until("on its way", moving, lambda velocity: velocity.north_m_s > 2.0)
    await drone.action.hold()
    still = drone.telemetry.subscribe_velocity_ned()
    await drone.until("standing", still, lambda velocity: abs(velocity.north_m_s) < 0.05)
    end = await drone.until("position", drone.telemetry.subscribe_position())
    assert 0.0 < (end.latitude_deg - start.latitude_deg) * METRES_A_DEGREE < 50.0
    await drone.land()


@story(speeds=(1,))
async def test_what_cannot_be_done_is_refused(drone: Drone) -> None:
    drone.step("land while on the ground")
    with pytest.raises(ActionError) as grounded:
        await drone.action.land()
    assert grounded.value.result.name == "COMMAND_DENIED"
    drone.step("select a return while disarmed: a mode like any other, as with PX4")
    await drone.action.return_to_launch()
    await drone.until_mode("RETURN_TO_LAUNCH")
    await drone.action.hold()
    await drone.until_mode("HOLD")
    await drone.take_off()
    drone.step("disarm in the air")
    with pytest.raises(ActionError) as flying:
        await drone.action.disarm()
    assert flying.value.result.name in ("COMMAND_DENIED", "COMMAND_DENIED_NOT_LANDED")
    drone.step("go to a place beyond MIS_DIST_WPS")
    with pytest.raises(ActionError) as far:
        await drone.action.goto_location(10.0, 10.0, 500.0, 0.0)
    assert far.value.result.name == "COMMAND_DENIED"
    drone.step("reboot in the air")
    with pytest.raises(ActionError) as reboot:
        await drone.action.reboot()
    assert reboot.value.result.name == "COMMAND_DENIED"
    await drone.land()
    drone.step("a disarmed vehicle is disarmed, and armed on the ground it may be disarmed")
    await drone.action.disarm()
    await drone.arm()
    await drone.action.disarm()
    await drone.until_disarmed()


@story()
async def test_kill_stops_the_rotors_in_the_air(drone: Drone) -> None:
    await drone.take_off()
    await drone.action.kill()
    await drone.until_disarmed()
    await drone.until("at rest on the ground", drone.telemetry.subscribe_position_velocity_ned(), AtRest())


class AtRest:
    """Tells when a vehicle that fell has stopped jumping: still on the ground in several reports in a row.

    At the lowest point of each jump, too, it is on the ground and has no speed.
    """

    reports = 0

    def __call__(self, now: PositionVelocityNed) -> bool:
        still = abs(now.position.down_m) < 0.02 and abs(now.velocity.down_m_s) < 0.02
        self.reports = self.reports + 1 if still else 0
        return self.reports == 5


@story()
async def test_speed_and_home_are_set(drone: Drone) -> None:
    await drone.take_off()
    home = await drone.until("home", drone.telemetry.subscribe_home())
    await drone.action.set_current_speed(1.0)
    start = await drone.until("position", drone.telemetry.subscribe_position())
    north_deg = start.latitude_deg + 8.0 / METRES_A_DEGREE
    await drone.action.goto_location(north_deg, start.longitude_deg, start.absolute_altitude_m, 0.0)
    fastest = 0.0

    def see(now: VelocityNed) -> None:
        nonlocal fastest
        fastest = max(fastest, now.north_m_s)

    watch = asyncio.ensure_future(drone.until("for ever", drone.telemetry.subscribe_velocity_ned(), see))
    await drone.until(
        "8 m north", drone.telemetry.subscribe_position(), lambda at: at.latitude_deg > north_deg - 1e-6
    )
    watch.cancel()
    assert fastest == pytest.approx(1.0, abs=0.1)
    await drone.action.set_home(True, 0.0, 0.0, 0.0)
    await drone.until(
        "home here", drone.telemetry.subscribe_home(), lambda at: abs(at.latitude_deg - north_deg) < 3e-6
    )
    await drone.action.set_home(False, home.latitude_deg, home.longitude_deg, home.absolute_altitude_m)
    await drone.until(
        "home where it was", drone.telemetry.subscribe_home(),
        lambda at: abs(at.latitude_deg - home.latitude_deg) < 1e-7,
    )  # fmt: skip
    await drone.land()
