"""RotorPy flies a square: its vehicle, SE(3) controller, minimum-snap trajectory and environment."""

from __future__ import annotations

from functools import cache

import numpy as np
from answering import ALTITUDE_M, CORNERS_M, RATE_HZ, SIDE_M, SPEED_M_S, answer
from rotorpy.controllers.quadrotor_control import SE3Control
from rotorpy.environments import Environment
from rotorpy.trajectories.minsnap import MinSnap
from rotorpy.vehicles.crazyflie_params import quad_params
from rotorpy.vehicles.multirotor import Multirotor
from rotorpy.world import World


@cache
def _trajectory(seconds: float) -> MinSnap:
    """Return the way through as many corners as the time allows; its solution is no part of a flight."""
    sides = round(seconds * SPEED_M_S / SIDE_M)
    points = np.array([(*CORNERS_M[number % 4], ALTITUDE_M) for number in range(sides + 1)])
    return MinSnap(points, v_avg=SPEED_M_S)


def _fly(seconds: float) -> tuple[float, float]:
    trajectory = _trajectory(seconds)
    vehicle = Multirotor(quad_params)
    vehicle.initial_state["x"] = np.array([*CORNERS_M[0], ALTITUDE_M])
    environment = Environment(
        vehicle,
        SE3Control(quad_params),
        trajectory,
        world=World.empty((-50.0, 50.0, -50.0, 50.0, -50.0, 50.0)),
        sim_rate=RATE_HZ,
    )
    flown = environment.run(t_final=seconds, terminate=False)
    error_m = np.linalg.norm(flown["state"]["x"][-1] - flown["flat"]["x"][-1])
    return float(flown["time"][-1]), error_m


if __name__ == "__main__":
    answer(_fly)
