"""Whole missions on the multibody plant: as on the rigid one, to disarm on the ground, the same bytes every time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from tests.support.tools import NIGHTLY
from tests.support.truth import World

pytestmark = pytest.mark.long

OUTER_TICKS = 5
"""Inner ticks between two outer ones: an event that one plant has just before such a tick, the other may have after."""


class Flown(NamedTuple):
    """One row a tick."""

    position_m: np.ndarray
    quaternion: np.ndarray
    in_flight: np.ndarray  # from the first to the last moment off the ground
    reached_at: list[int]  # ticks at which the items of the mission were reached
    world: World


def fly(plant: str, vehicle: str, wind: tuple[float, float, float]) -> Flown:
    world = World(plant=plant, vehicle=vehicle, wind=wind)
    world.upload("square.plan")
    world.arm()
    world.start_mission()
    rows: list[list[float]] = []
    reached_at: list[int] = []
    while world.state.armed:
        world.tick()
        reached_at += [len(rows)] * (len(world.reached) - len(reached_at))
        rows.append(
            [*world.engine.simulator.frame.state[[0, 1, 2, 6, 7, 8, 9]], world.engine.simulator.on_ground]
        )
    table = np.array(rows)
    off = np.flatnonzero(table[:, 7] == 0.0)
    last = off[0] + int(np.argmax(table[off[0] :, 7] != 0.0))  # first touch after the takeoff
    # a spring of the ground may still carry while the rotors speed up
    first = int(np.argmax(table[:, 2] < -0.01))
    in_flight = np.zeros(len(table), dtype=bool)
    in_flight[first : max(last, first) if last > first else off[-1]] = True
    return Flown(table[:, :3], table[:, 3:7], in_flight, reached_at, world)


class Leg(NamedTuple):
    """How far two flights are apart between two events of the mission."""

    ticks: int  # in flight
    late: int  # ticks by which the second one had the leg's first event later: the only shift of the leg
    distance_m: float
    angle_deg: float


def legs(a: Flown, b: Flown) -> list[Leg]:
    """Compare leg by leg; both have the same time since the event with which the leg began."""
    found = []
    begins = zip([0, *a.reached_at], [0, *b.reached_at], [*a.reached_at, len(a.position_m)], strict=True)
    for begin, b_begin, end in begins:
        late = b_begin - begin
        rows = np.arange(begin, min(end, len(b.position_m) - late))
        rows = rows[a.in_flight[rows] & b.in_flight[rows + late]]
        if not len(rows):
            continue
        distance = np.linalg.norm(a.position_m[rows] - b.position_m[rows + late], axis=1)
        cosine = np.abs((a.quaternion[rows] * b.quaternion[rows + late]).sum(axis=1)).clip(0.0, 1.0)
        angle = np.degrees(2.0 * np.arccos(cosine))
        found.append(Leg(len(rows), late, float(distance.max()), float(angle.max())))
    return found


@pytest.mark.parametrize(
    ("vehicle", "wind"), [("x_quad", (3.0, 2.0, 0.0))] + NIGHTLY * [("paper_quad", (0.0, 0.0, 0.0))]
)
def test_the_square_as_on_the_rigid_plant(vehicle: str, wind: tuple[float, float, float]) -> None:
    """Within 1 cm throughout, each leg counted from the tick at which it began.

    Their grounds are made differently, so that the takeoffs differ a little, and an event may fall into the next tick
    of the outer loop: that tick is the only shift of a leg. What is left of the takeoff dies away leg by leg.
    """
    rigid, multibody = (fly(plant, vehicle, wind) for plant in ("rigid", "multibody"))
    for flown in (rigid, multibody):
        assert flown.world.reached == [0, 1, 2, 3, 4, 5]
        assert flown.world.state.landed
        assert abs(flown.world.state.altitude_m) < 0.001
    found = legs(rigid, multibody)
    for leg in found:
        print(f"{leg.ticks} ticks, {leg.late} late: {leg.distance_m * 1e3:.4f} mm, {leg.angle_deg:.4f}°")
    assert len(found) == 6  # the takeoff, four sides, the landing
    assert sum(leg.ticks for leg in found) > 0.99 * rigid.in_flight.sum()
    assert {leg.late for leg in found} <= {-OUTER_TICKS, 0, OUTER_TICKS}
    takeoff, first, *later, landing = found
    assert takeoff.distance_m < 0.004  # measured: 2.1 mm and 0.8 mm
    assert takeoff.angle_deg < 0.8  # measured: 0.54 and 0.13
    assert first.distance_m < 0.01  # measured: 6.5 mm, the way flown in an outer tick, and 0.2 mm
    assert first.angle_deg < 0.05  # measured: 0.02
    assert max(leg.distance_m for leg in later) < 2e-4  # measured: 7e-5
    assert max(leg.angle_deg for leg in later) < 2e-3  # measured: 6e-4
    assert landing.distance_m < 1e-6  # measured: 1e-7


def test_the_same_seed_gives_the_same_log() -> None:
    logs = []
    for _ in range(2):
        world = World(
            plant="multibody", vehicle="x_quad", wind=(3.0, 2.0, 0.0), gust=1.0, torque_gust=0.02, seed=7
        )
        world.upload("square.plan")
        world.arm()
        world.start_mission()
        world.run_for(6.0)
        world.disarm(force=True)
        world.run_for(3.0)
        logs.append(world.flight().log.content)
    assert len(logs[0]) > 100_000
    assert logs[0] == logs[1]


def test_a_lost_rotor_ends_on_the_ground() -> None:
    world = World(plant="multibody")
    world.upload("square.plan")
    world.arm()
    world.start_mission()
    world.run_until("altitude_m > 3.0", 20.0)
    world.fault("rotor:2:off")
    world.run_until(lambda _: world.engine.simulator.on_ground, 20.0)
    world.run_for(5.0)
    assert world.engine.simulator.on_ground
    assert np.isfinite(world.engine.simulator.frame.state).all()
    assert world.state.altitude_m < 0.3
