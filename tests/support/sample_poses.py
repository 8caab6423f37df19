"""Poses of a short synthetic flight: a climb and a circle."""

from __future__ import annotations

import numpy as np

from flightstack.core.geometry_bulk import quaternions_from_euler
from flightstack.flight_log.poses_file import Poses


def sample_poses(seconds: float = 4.0, rotors: int = 4, vehicle: str = "paper_quad") -> Poses:
    """Return ``seconds`` of flight at 50 Hz: a climb to 2 m and a banked circle, heading along the path."""
    time_s = np.arange(0.0, seconds + 0.01, 0.02)
    turn = 0.8 * time_s
    position = np.column_stack((3.0 * np.sin(turn), 3.0 * (1.0 - np.cos(turn)), -np.minimum(2.0, time_s)))
    euler = np.column_stack((np.full_like(turn, 0.3), np.full_like(turn, -0.1), turn))
    speed = np.tile(np.linspace(0.0, 250.0, len(time_s))[:, None], (1, rotors))
    places = np.array([[0.0, 0.0, -2.0], [3.0, 3.0, -2.0]])
    return Poses(
        time_s, position, quaternions_from_euler(euler), speed, position + 0.05, places, vehicle, "circle"
    )
