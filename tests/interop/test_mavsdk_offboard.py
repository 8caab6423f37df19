"""MAVSDK flies the vehicle by setpoints and by sticks."""

from __future__ import annotations

import asyncio
import math
from collections.abc import AsyncIterator
from contextlib import aclosing, asynccontextmanager, suppress

import pytest
from mavsdk.plugins.action import ActionError
from mavsdk.plugins.offboard import (
    Attitude,
    AttitudeRate,
    OffboardError,
    PositionGlobalYaw,
    PositionNedYaw,
    VelocityBodyYawspeed,
    VelocityNedYaw,
)
from mavsdk.plugins.telemetry import PositionVelocityNed

from tests.interop.client import TCP, story
from tests.interop.drone import Drone


async def until_at(drone: Drone, north_m: float, east_m: float, down_m: float) -> None:
    """Wait until the vehicle is within 20 cm of a place."""

    def is_there(now: PositionVelocityNed) -> bool:
        at = now.position
        return math.dist((at.north_m, at.east_m, at.down_m), (north_m, east_m, down_m)) < 0.2

    place = f"{north_m:g}, {east_m:g}, {down_m:g}"
    await drone.until(place, drone.telemetry.subscribe_position_velocity_ned(), is_there)


@story(speeds=(1,))
async def test_offboard_needs_a_setpoint(drone: Drone) -> None:
    with pytest.raises(OffboardError) as refused:
        await drone.offboard.start()
    assert refused.value.result.name == "NO_SETPOINT_SET"
    assert not await drone.offboard.is_active()


@story(by_night=(TCP,))
async def test_positions_are_flown_to(drone: Drone) -> None:
    await drone.take_off()
    await drone.offboard.set_position_ned(PositionNedYaw(0.0, 0.0, -3.0, 0.0))
    await drone.offboard.start()
    assert await drone.offboard.is_active()
    await drone.until_mode("OFFBOARD")
    await until_at(drone, 0.0, 0.0, -3.0)
    await drone.offboard.set_position_ned(PositionNedYaw(4.0, 3.0, -4.0, 90.0))
    await until_at(drone, 4.0, 3.0, -4.0)
    await drone.until(
        "looking east", drone.telemetry.subscribe_heading(), lambda at: abs(at.heading_deg - 90.0) < 3.0
    )
    home = await drone.until("home", drone.telemetry.subscribe_home())
    await drone.offboard.set_position_global(
        PositionGlobalYaw(
            home.latitude_deg, home.longitude_deg, 3.0, 0.0, PositionGlobalYaw.AltitudeType.REL_HOME
        )
    )
    await until_at(drone, 0.0, 0.0, -3.0)
    await drone.offboard.stop()
    await drone.until_mode("HOLD")
    await drone.land()


@story(speeds=(1, 10))
async def test_velocities_are_flown(drone: Drone) -> None:
    await drone.take_off()
    await drone.offboard.set_velocity_ned(VelocityNedYaw(1.5, 0.0, 0.0, 0.0))
    await drone.offboard.start()
    await drone.until(
        "north at 1.5 m/s", drone.telemetry.subscribe_velocity_ned(),
        lambda v: abs(v.north_m_s - 1.5) < 0.1 and abs(v.east_m_s) < 0.1,
    )  # fmt: skip
    await drone.offboard.set_velocity_ned(VelocityNedYaw(0.0, 0.0, 0.0, 90.0))
    await drone.until(
        "looking east", drone.telemetry.subscribe_heading(), lambda at: abs(at.heading_deg - 90.0) < 2.0
    )
    await drone.offboard.set_velocity_body(VelocityBodyYawspeed(1.0, 0.0, -0.5, 0.0))
    await drone.until(
        "forward, so east, and up", drone.telemetry.subscribe_velocity_ned(),
        lambda v: abs(v.east_m_s - 1.0) < 0.1 and abs(v.down_m_s + 0.5) < 0.1,
    )  # fmt: skip
    await drone.offboard.set_velocity_body(VelocityBodyYawspeed(0.0, 0.0, 0.0, 30.0))
    await drone.until(
        "turning", drone.telemetry.subscribe_attitude_angular_velocity_body(),
        lambda rate: abs(math.degrees(rate.yaw_rad_s) - 30.0) < 3.0,
    )  # fmt: skip
    await drone.offboard.set_velocity_body(VelocityBodyYawspeed(0.0, 0.0, 0.0, 0.0))
    await drone.offboard.stop()
    await drone.land()


@story()
async def test_attitudes_and_rates_are_flown(drone: Drone) -> None:
    await drone.take_off()
    hover = Attitude(0.0, 0.0, 0.0, 0.5)
    await drone.offboard.set_attitude(hover)
    await drone.offboard.start()
    await drone.offboard.set_attitude(Attitude(5.0, 0.0, 0.0, 0.55))
    await drone.until(
        "rolled", drone.telemetry.subscribe_attitude_euler(), lambda now: abs(now.roll_deg - 5.0) < 0.5
    )
    await drone.offboard.set_attitude_rate(AttitudeRate(0.0, 0.0, 20.0, 0.55))
    await drone.until(
        "turning", drone.telemetry.subscribe_attitude_angular_velocity_body(),
        lambda rate: abs(math.degrees(rate.yaw_rad_s) - 20.0) < 2.0,
    )  # fmt: skip
    await drone.offboard.stop()
    await drone.until_mode("HOLD")
    await drone.land()


@asynccontextmanager
async def sticks_held(drone: Drone, x: float, y: float, z: float, r: float) -> AsyncIterator[None]:
    """Send the sticks again and again, as a joystick's program does, as often as the attitude comes in."""

    async def send_always() -> None:
        async with aclosing(drone.telemetry.subscribe_attitude_euler()) as attitudes:
            async for _ in attitudes:
                await drone.manual_control.set_manual_control_input(x, y, z, r)

    await drone.manual_control.set_manual_control_input(x, y, z, r)
    sending = asyncio.ensure_future(send_always())
    yield
    sending.cancel()
    with suppress(asyncio.CancelledError):
        await sending


@story(by_night=(TCP,))
async def test_sticks_fly_in_position_and_altitude_mode(drone: Drone) -> None:
    telemetry = drone.telemetry
    await drone.take_off()
    yaw_rad = math.radians((await drone.until("attitude", telemetry.subscribe_attitude_euler())).yaw_deg)
    async with sticks_held(drone, 0.0, 0.0, 0.5, 0.0):
        await drone.manual_control.start_position_control()
        await drone.until_mode("POSCTL")
    async with sticks_held(drone, 0.6, 0.0, 0.5, 0.0):
        await drone.until(
            "flying forward", telemetry.subscribe_velocity_ned(),
            lambda v: v.north_m_s * math.cos(yaw_rad) + v.east_m_s * math.sin(yaw_rad) > 1.0,
        )  # fmt: skip
    async with sticks_held(drone, 0.0, 0.0, 0.5, 0.0):
        await drone.manual_control.start_altitude_control()
        await drone.until_mode("ALTCTL")
    async with sticks_held(drone, 0.0, 0.0, 0.8, 0.0):
        await drone.until("climbing", telemetry.subscribe_velocity_ned(), lambda v: v.down_m_s < -0.3)
    await drone.action.hold()
    await drone.until_mode("HOLD")
    await drone.land()


@story()
async def test_sticks_that_were_moved_once_arm_nothing(drone: Drone) -> None:
    """A disarmed vehicle takes any mode, as PX4 does; it arms only while the sticks come."""
    await drone.manual_control.set_manual_control_input(0.0, 0.0, 0.5, 0.0)
    await drone.manual_control.start_altitude_control()
    await drone.until_mode("ALTCTL")
    await drone.until("not armable", drone.telemetry.subscribe_health(), lambda health: not health.is_armable)
    with pytest.raises(ActionError) as refused:
        await drone.action.arm()
    assert refused.value.result.name == "COMMAND_DENIED"
    await drone.action.hold()
    await drone.until_mode("HOLD")
