"""A vehicle as a program of MAVSDK's users sees it, with a few verbs for stories; runs in a process of its own."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncGenerator, Callable
from contextlib import aclosing
from typing import TypeVar

from tests.interop.needs import needs

needs("mavsdk", "mavsdk")

# ruff: noqa: E402  # the module is skipped where MAVSDK is missing
from mavsdk.asyncio import ComponentType, Configuration, Mavsdk, System
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.ftp import FtpAsync
from mavsdk.asyncio.plugins.geofence import GeofenceAsync
from mavsdk.asyncio.plugins.info import InfoAsync
from mavsdk.asyncio.plugins.log_files import LogFilesAsync
from mavsdk.asyncio.plugins.manual_control import ManualControlAsync
from mavsdk.asyncio.plugins.mission import MissionAsync
from mavsdk.asyncio.plugins.mission_raw import MissionRawAsync
from mavsdk.asyncio.plugins.offboard import OffboardAsync
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync

T = TypeVar("T")
FOR_EVER = -1.0


class Drone:
    """The first autopilot on a connection, and MAVSDK's plugins for it."""

    def __init__(self, mavsdk: Mavsdk, system: System) -> None:
        self.mavsdk = mavsdk
        self.system = system
        self.action = ActionAsync(system)
        self.ftp = FtpAsync(system)
        self.geofence = GeofenceAsync(system)
        self.info = InfoAsync(system)
        self.log_files = LogFilesAsync(system)
        self.manual_control = ManualControlAsync(system)
        self.mission = MissionAsync(system)
        self.mission_raw = MissionRawAsync(system)
        self.offboard = OffboardAsync(system)
        self.param = ParamAsync(system)
        self.telemetry = TelemetryAsync(system)

    @classmethod
    async def connect(cls, url: str) -> Drone:
        """Wait for a vehicle at the connection."""
        configuration = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
        mavsdk = Mavsdk(configuration)
        configuration.destroy()
        await mavsdk.add_any_connection(url)
        system = await mavsdk.first_autopilot(FOR_EVER)
        assert system is not None
        return cls(mavsdk, system)

    async def until(
        self, what: str, stream: AsyncGenerator[T, None], holds: Callable[[T], object] = lambda _: True
    ) -> T:
        """Follow a stream of telemetry until a value for which ``holds``; return that value."""
        self.step(f"until {what}")
        async with aclosing(stream) as values:
            async for value in values:
                if holds(value):
                    return value
        raise AssertionError(f"the stream ended before {what}")

    def later(
        self, what: str, stream: AsyncGenerator[T, None], holds: Callable[[T], object] = lambda _: True
    ) -> asyncio.Task[T]:
        """Begin to follow a stream now, for what the next steps of the story cause; await the result."""
        return asyncio.ensure_future(self.until(what, stream, holds))

    def step(self, text: str) -> None:
        """Say how far the story is: what a test that hangs shows."""
        print(f"  {text}", flush=True)

    async def arm(self) -> None:
        """Wait until the vehicle may be armed, and arm it."""
        await self.until("armable", self.telemetry.subscribe_health(), lambda health: health.is_armable)
        await self.action.arm()

    async def take_off(self) -> None:
        """Arm, take off and wait for the end of the climb."""
        await self.arm()
        await self.action.takeoff()
        await self.until("in the air", self.telemetry.subscribe_in_air(), bool)
        await self.until_mode("HOLD")

    async def until_mode(self, name: str) -> None:
        """Wait for a flight mode, by MAVSDK's name of it."""
        await self.until(name, self.telemetry.subscribe_flight_mode(), lambda mode: mode.name == name)

    def later_mode(self, name: str) -> asyncio.Task[object]:
        """As :meth:`until_mode`, for a mode that may pass before the story comes to it."""
        return self.later(name, self.telemetry.subscribe_flight_mode(), lambda mode: mode.name == name)

    async def land(self) -> None:
        """Land and wait for the vehicle to disarm itself."""
        await self.action.land()
        await self.until_disarmed()

    async def until_disarmed(self) -> None:
        """Wait for the end of the flight."""
        await self.until("disarmed", self.telemetry.subscribe_armed(), lambda armed: not armed)
