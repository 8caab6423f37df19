"""Whole missions on the multibody plant: as on the rigid one, to disarm on the ground, the same bytes every time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from tests.support.world import World

EVENT_TICKS = 5
"""Inner ticks between two outer ones: an event that one plant has just before such a tick, the other may have after."""


class Flown(NamedTuple):
    """One row a tick."""

    position_m: np.ndarray
    quaternion: np.ndarray
    in_flight: np.ndarray  # from the first to the last moment off the ground
    world: World


def fly(plant: str, vehicle: str, wind: tuple[float, float, float]) -> Flown:
    world = World(plant=plant, vehicle=vehicle, wind=wind)
    world.upload("square.plan")
    assert world.start_mission() == 0
    rows = []
    while world.armed:
        world.tick()
        rows.append([*world.simulator.frame.state[[0, 1, 2, 6, 7, 8, 9]], world.simulator.on_ground])
    table = np.array(rows)
    off = np.flatnonzero(table[:, 7] == 0.0)
    last = off[0] + int(np.argmax(table[off[0] :, 7] != 0.0))  # first touch after the takeoff
    # a spring of the ground may still carry while the rotors speed up
    first = int(np.argmax(table[:, 2] < -0.01))
    in_flight = np.zeros(len(table), dtype=bool)
    in_flight[first : max(last, first) if last > first else off[-1]] = True
    return Flown(table[:, :3], table[:, 3:7], in_flight, world)


def largest_share(a: Flown, b: Flown, late: int) -> np.ndarray:
    """Distance and angle as shares of 1 cm and 0.5°, the larger one, tick by tick; infinite on the ground.

    ``b`` is taken so many ticks later.
    """
    count = min(len(a.position_m), len(b.position_m))
    rows = np.arange(EVENT_TICKS, count - EVENT_TICKS)
    distance = np.linalg.norm(a.position_m[rows] - b.position_m[rows + late], axis=1)
    cosine = np.abs((a.quaternion[rows] * b.quaternion[rows + late]).sum(axis=1)).clip(0.0, 1.0)
    angle = np.degrees(2.0 * np.arccos(cosine))
    flying = a.in_flight[rows] & b.in_flight[rows + late]
    return np.where(flying, np.maximum(distance / 0.01, angle / 0.5), np.inf)


@pytest.mark.parametrize(("vehicle", "wind"), [("paper_quad", (0.0, 0.0, 0.0)), ("x_quad", (3.0, 2.0, 0.0))])
def test_the_square_as_on_the_rigid_plant(vehicle: str, wind: tuple[float, float, float]) -> None:
    """Within 1 cm and 0.5° throughout, up to the tick of the outer loop in which an event of the mission falls."""
    rigid, multibody = (fly(plant, vehicle, wind) for plant in ("rigid", "multibody"))
    for flown in (rigid, multibody):
        assert flown.world.reached == [0, 1, 2, 3, 4, 5]
        assert flown.world.landed
        assert abs(flown.world.altitude) < 0.001
    worse = [largest_share(rigid, multibody, late) for late in (0, -EVENT_TICKS, EVENT_TICKS)]
    share = np.min(worse, axis=0)
    known = np.isfinite(share)
    assert known.sum() > 0.9 * rigid.in_flight.sum()
    assert share[known].max() < 1.0  # measured: 0.65 and 0.25


def test_the_same_seed_gives_the_same_log() -> None:
    logs = []
    for _ in range(2):
        world = World(
            plant="multibody", vehicle="x_quad", wind=(3.0, 2.0, 0.0), gust=1.0, torque_gust=0.02, seed=7
        )
        world.upload("square.plan")
        assert world.start_mission() == 0
        world.run(6.0)
        world.disarm(force=True)
        world.run(3.0)
        logs.append(world.log)
    assert len(logs[0]) > 100_000
    assert logs[0] == logs[1]


def test_a_lost_rotor_ends_on_the_ground() -> None:
    world = World(plant="multibody")
    world.upload("square.plan")
    assert world.start_mission() == 0
    world.until(lambda: world.altitude > 3.0, 20.0)
    world.inject("rotor:2:off")
    world.until(lambda: world.simulator.on_ground, 20.0)
    world.run(5.0)
    assert world.simulator.on_ground
    assert np.isfinite(world.simulator.frame.state).all()
    assert world.altitude < 0.3
