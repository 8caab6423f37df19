"""The inspection: which points, and what happens at each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from mavsdk.plugins.action import ActionError

from my_app.vehicle import Position, TakenOverError, Vehicle


class Point(NamedTuple):
    """A place for a photo and the direction of the camera."""

    position: Position
    yaw_deg: float


FACADE = (
    Point(Position(6.0, 0.0, 3.0), 90.0),
    Point(Position(6.0, 0.0, 5.0), 90.0),
    Point(Position(6.0, 5.0, 5.0), 180.0),
    Point(Position(0.0, 5.0, 4.0), 270.0),
)

TakePhoto = Callable[[int, Position], None]


class Report(NamedTuple):
    """What an inspection did."""

    photos: int
    problem: str = ""
    """Why it ended early; empty if it is complete."""


async def inspect(url: str, take_photo: TakePhoto, points: Sequence[Point] = FACADE) -> Report:
    """Fly to all points, take a photo at each, and return; return early if that is refused or taken over."""
    photos = 0
    async with Vehicle.connect(url) as vehicle:
        await vehicle.take_off(points[0].position.altitude_m)
        try:
            for number, point in enumerate(points):
                take_photo(number, await vehicle.fly_to(*point))
                photos += 1
        except TakenOverError as error:
            await vehicle.wait_until_disarmed()
            return Report(photos, str(error))
        except ActionError as error:
            await vehicle.return_to_launch()
            return Report(photos, f"point {photos}: {error.result.name}")
        await vehicle.return_to_launch()
    return Report(photos)
