"""Whole flights in one process, on the bytes that go over the wire."""

from __future__ import annotations

import time
from enum import Enum
from typing import NamedTuple

from benchmarks.measure import Figure, figure
from flightstack.flight_log.flight_log import FlightLog
from flightstack.params.config import ESTIMATED, TRUTH
from flightstack.testing import World
from flightstack.testing.engine import Engine

PLAN = "square.plan"


class Station(Enum):
    """What the ground station does once the vehicle flies."""

    READS = "reads all telemetry"
    HEARS = "is sent all telemetry and leaves it unread, as if it were another process"
    IS_GONE = "is not there"


class UnloggedEngine(Engine):
    """Writes no log."""

    def _open_log(self) -> FlightLog | None:  # type: ignore[override]
        return None


def flying(log: bool, station: Station, state: str = TRUTH, inner_hz: float = 500.0) -> World:
    """Return a world that flies its mission, with or without a log and a ground station.

    ``state`` is that of ``Setup``: on sensors, the mission starts once the vehicle is ready.
    """
    world = World(
        telemetry=True,
        make_engine=Engine if log else UnloggedEngine,
        inner_hz=inner_hz,
        outer_hz=inner_hz / 5.0,
        state=state,
    )
    world.upload(PLAN)
    world.wait_until_ready()
    world.arm()
    world.start_mission()
    if station is not Station.READS:
        leave(world, station)
    return world


def leave(world: World, station: Station) -> None:
    """Leave the telemetry unread from now on, or disconnect the ground station."""
    world.link.from_vehicle.cut()
    if station is Station.IS_GONE:
        world.link.to_vehicle.cut()
        world.engine.stack.ground.drop_peer(world.gcs.address)


class Variant(NamedTuple):
    """What is on in a flight."""

    name: str
    log: bool
    station: Station
    state: str = TRUTH


VARIANTS = (
    Variant("log, telemetry sent and read", True, Station.READS),
    Variant("log, telemetry sent", True, Station.HEARS),
    Variant("log", True, Station.IS_GONE),
    Variant("neither", False, Station.IS_GONE),
    Variant("sensors and estimator, log, telemetry sent and read", True, Station.READS, ESTIMATED),
    Variant("sensors and estimator, log, telemetry sent", True, Station.HEARS, ESTIMATED),
    Variant("sensors and estimator, log", True, Station.IS_GONE, ESTIMATED),
)


def fly(variant: Variant) -> tuple[float, float]:
    """Return the real-time factor and the time of a step [µs]."""
    world = flying(variant.log, variant.station, variant.state)
    began_s, simulated_s = time.perf_counter(), world.time_s
    world.run_until("not armed")
    wall_s = time.perf_counter() - began_s
    simulated_s = world.time_s - simulated_s
    return simulated_s / wall_s, wall_s / simulated_s / world.setup.inner_hz * 1e6


def flights(rounds: int) -> dict[str, tuple[Figure, Figure]]:
    """Return real-time factor and µs a step of each variant."""
    seen: dict[str, list[tuple[float, float]]] = {variant.name: [] for variant in VARIANTS}
    for _ in range(rounds):
        for variant in VARIANTS:
            seen[variant.name].append(fly(variant))
    return {
        name: (figure(factor for factor, _ in flown), figure(step for _, step in flown))
        for name, flown in seen.items()
    }
