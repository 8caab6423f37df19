"""A vehicle behind MAVSDK, in metres relative to home."""

from __future__ import annotations

import asyncio
import math
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import NamedTuple

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk, System
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk.plugins.telemetry import FlightMode

METRES_PER_DEGREE = 111_195.0
COMMANDED_MODES = (FlightMode.TAKEOFF, FlightMode.HOLD)
"""Modes that this program selects while it flies to points."""


class Position(NamedTuple):
    """North and east of home, and height above it."""

    north_m: float
    east_m: float
    altitude_m: float


class VehicleNotFoundError(Exception):
    """No autopilot sends heartbeats on the connection."""


class TakenOverError(Exception):
    """A failsafe or a pilot selected another mode: this program must not send positions any more."""

    def __init__(self, mode: FlightMode) -> None:
        super().__init__(f"the vehicle changed to {mode.name}")
        self.mode = mode


class Vehicle:
    """The commands of an inspection. Each returns when the vehicle has done it."""

    def __init__(self, system: System) -> None:
        self._action = ActionAsync(system)
        self._telemetry = TelemetryAsync(system)
        self._mode = FlightMode.UNKNOWN
        self._home_deg = (0.0, 0.0)
        self._home_amsl_m = 0.0

    @classmethod
    @asynccontextmanager
    async def connect(cls, url: str, timeout_s: float = 30.0) -> AsyncIterator[Vehicle]:
        """Connect to the vehicle at a MAVSDK URL and wait until it can arm."""
        configuration = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
        mavsdk = Mavsdk(configuration)
        configuration.destroy()
        try:
            await mavsdk.add_any_connection(url)
            system = await mavsdk.first_autopilot(timeout_s)
            if system is None:
                raise VehicleNotFoundError(f"no vehicle at {url} within {timeout_s:g} s")
            vehicle = cls(system)
            watch = asyncio.create_task(vehicle._watch_mode())
            try:
                await vehicle._prepare()
                yield vehicle
            finally:
                watch.cancel()
                await asyncio.gather(watch, return_exceptions=True)
        finally:
            mavsdk.destroy()

    async def take_off(self, altitude_m: float) -> None:
        """Arm and climb to a height above home."""
        await self._action.set_takeoff_altitude(altitude_m)
        await self._action.arm()
        await self._action.takeoff()
        await self._reach(lambda position: abs(position.altitude_m - altitude_m) < 0.3)

    async def fly_to(self, target: Position, yaw_deg: float) -> Position:
        """Fly to a position and stop there; return where the vehicle is. Raise TakenOverError."""
        latitude_deg, longitude_deg = self._home_deg
        await self._action.goto_location(
            latitude_deg + target.north_m / METRES_PER_DEGREE,
            longitude_deg + target.east_m / METRES_PER_DEGREE / math.cos(math.radians(latitude_deg)),
            self._home_amsl_m + target.altitude_m,
            yaw_deg,
        )
        return await self._reach(lambda position: math.dist(position, target) < 0.3)

    async def return_to_launch(self) -> None:
        """Return, land and wait until the vehicle has disarmed."""
        await self._action.return_to_launch()
        await self.wait_until_disarmed()

    async def wait_until_disarmed(self) -> None:
        """Wait for the end of the flight."""
        async for is_armed in self._telemetry.subscribe_armed():
            if not is_armed:
                return

    async def _prepare(self) -> None:
        async for is_healthy in self._telemetry.subscribe_health_all_ok():
            if is_healthy:
                break
        async for home in self._telemetry.subscribe_home():
            self._home_deg = (home.latitude_deg, home.longitude_deg)
            self._home_amsl_m = home.absolute_altitude_m
            break

    async def _watch_mode(self) -> None:
        async for mode in self._telemetry.subscribe_flight_mode():
            self._mode = mode

    async def _reach(self, is_there: Callable[[Position], bool]) -> Position:
        """Wait until the vehicle is at a place and slower than 0.3 m/s."""
        async for sample in self._telemetry.subscribe_position_velocity_ned():
            if self._mode not in COMMANDED_MODES:
                raise TakenOverError(self._mode)
            at, velocity = sample.position, sample.velocity
            position = Position(at.north_m, at.east_m, -at.down_m)
            speed_m_s = math.hypot(velocity.north_m_s, velocity.east_m_s, velocity.down_m_s)
            if is_there(position) and speed_m_s < 0.3:
                return position
        raise ConnectionError("telemetry ended")
