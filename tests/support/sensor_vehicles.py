"""Vehicles with chosen sensors, states, and records of measurements."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flightstack.core.contract import FloatArray
from flightstack.params.sensors import IDEAL, TABLES, Sensors
from flightstack.params.vehicle import Vehicle, load_vehicle

X_QUAD = load_vehicle("x_quad")
ALL = dict.fromkeys(TABLES)


def with_sensors(grade: str = IDEAL, vehicle: Vehicle = X_QUAD, **changes: dict[str, object]) -> Vehicle:
    """Return a vehicle with all sensors of a grade and the given numbers: ``imu={"count": 2.0}``."""
    numbers = {
        name: {item.key: item.default(grade) for item in items} | changes.get(name, {})
        for name, items in TABLES.items()
    }
    return replace(vehicle, sensors=Sensors(grade, numbers))


def state_at(
    position=(0.0, 0.0, 0.0), velocity=(0.0, 0.0, 0.0), attitude=(1.0, 0.0, 0.0, 0.0), rates=(0.0, 0.0, 0.0)
) -> FloatArray:
    """Return the array form of a state."""
    return np.array([*position, *velocity, *attitude, *rates])
