"""Fly the inspection: ``python -m my_app udpin://127.0.0.1:14540``."""

import asyncio
import sys

from my_app.inspection import inspect
from my_app.vehicle import Position


def take_photo(number: int, position: Position) -> None:
    """Print where the photo was taken, in place of a camera's trigger."""
    north_m, east_m, altitude_m = position
    print(f"photo {number}: {north_m:.2f} m north, {east_m:.2f} m east, {altitude_m:.2f} m high")


report = asyncio.run(inspect(sys.argv[1], take_photo))
sys.exit(report.problem or 0)
