"""Whole flights in one process, on the bytes that go over the wire."""

from __future__ import annotations

import time
from enum import Enum
from typing import NamedTuple

from benchmarks.measure import Figure, figure
from flightstack.flight_log.flight_log import FlightLog
from flightstack.mavlink.dialect import mavlink
from gcs_cli.clients.mission_client import Done
from tests.support.world import World

PLAN = "square.plan"


class Station(Enum):
    """What the ground station does once the vehicle flies."""

    READS = "reads all telemetry"
    HEARS = "is sent all telemetry and leaves it unread, as if it were another process"
    IS_GONE = "is not there"


class BenchWorld(World):
    """A world that flies its mission, with or without a log and a ground station."""

    def __init__(self, log: bool, station: Station, inner_hz: float = 500.0) -> None:
        self._with_log = log
        self._station = Station.READS
        super().__init__(inner_hz=inner_hz, outer_hz=inner_hz / 5.0)
        assert isinstance(self.upload(PLAN), Done)
        assert self.start_mission() == 0
        self._station = station

    def _open_log(self) -> FlightLog | None:  # type: ignore[override]
        return super()._open_log() if self._with_log else None

    def exchange_with_ground(self) -> None:
        if self._station is Station.READS:
            super().exchange_with_ground()
        elif self._station is Station.HEARS:
            if self.time_s >= self._heartbeat_due_s:
                self._heartbeat_due_s = self.time_s + 1.0
                self.send(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
            for _ in self.stack.ground.poll(self.link_now_s()):
                pass


class Variant(NamedTuple):
    """What is on in a flight."""

    name: str
    log: bool
    station: Station


VARIANTS = (
    Variant("log, telemetry sent and read", True, Station.READS),
    Variant("log, telemetry sent", True, Station.HEARS),
    Variant("log", True, Station.IS_GONE),
    Variant("neither", False, Station.IS_GONE),
)


def _fly(variant: Variant) -> tuple[float, float]:
    """Return the real-time factor and the time of a step [µs]."""
    world = BenchWorld(variant.log, variant.station)
    began_s, simulated_s = time.perf_counter(), world.time_s
    world.until_disarmed()
    wall_s = time.perf_counter() - began_s
    simulated_s = world.time_s - simulated_s
    return simulated_s / wall_s, wall_s / simulated_s / world.config.inner_hz * 1e6


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
