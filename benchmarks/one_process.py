"""Whole flights in one process, on the bytes that go over the wire."""

from __future__ import annotations

import time
from typing import NamedTuple

from benchmarks.measure import Figure, figure
from flightstack.logging.flight_log import FlightLog
from tests.support.world import World

PLAN = "square.plan"


class BenchWorld(World):
    """A world that can fly without its log or, once it flies, without its ground station."""

    def __init__(self, log: bool, ground: bool, inner_hz: float) -> None:
        self._with_log = log
        self._with_ground = True
        super().__init__(inner_hz=inner_hz, outer_hz=inner_hz / 5.0)
        assert self.upload(PLAN) is not None
        assert self.start_mission() == 0
        self._with_ground = ground

    def _open_log(self) -> FlightLog | None:  # type: ignore[override]
        return super()._open_log() if self._with_log else None

    def exchange_with_ground(self) -> None:
        if self._with_ground:
            super().exchange_with_ground()


class Variant(NamedTuple):
    """What is on in a flight."""

    name: str
    log: bool
    ground: bool
    inner_hz: float = 500.0


VARIANTS = (
    Variant("log, ground station", True, True),
    Variant("log", True, False),
    Variant("neither", False, False),
)


def _fly(variant: Variant) -> tuple[float, float]:
    """Return the real-time factor and the time of a step [µs]."""
    world = BenchWorld(variant.log, variant.ground, variant.inner_hz)
    began_s, simulated_s = time.perf_counter(), world.time_s
    world.until_disarmed()
    wall_s = time.perf_counter() - began_s
    simulated_s = world.time_s - simulated_s
    return simulated_s / wall_s, wall_s / simulated_s / variant.inner_hz * 1e6


def flights(rounds: int) -> dict[str, tuple[Figure, Figure]]:
    """Return real-time factor and µs a step of each variant."""
    seen: dict[str, list[tuple[float, float]]] = {variant.name: [] for variant in VARIANTS}
    for _ in range(rounds):
        for variant in VARIANTS:
            seen[variant.name].append(_fly(variant))
    return {
        name: (figure(factor for factor, _ in flown), figure(step for _, step in flown))
        for name, flown in seen.items()
    }
