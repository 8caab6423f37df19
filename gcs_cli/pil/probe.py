"""Measurement of the link to a target: its identity, the round trip, lost exchanges."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from flightstack.core.contract import LoopFlags
from flightstack.firmware.pil.client import DEFAULT_TIMING, PilCounters, PilTiming
from flightstack.firmware.pil.identity import described
from flightstack.firmware.pil.session import PilSession
from flightstack.transports.byte_link import ByteLink

EXCHANGES = 300
"""Default number of measured steps."""
HELLO_ATTEMPTS, STEADY_ATTEMPTS = 4, 5
"""Fewer attempts than in flight, to detect a bad link sooner."""
LEVEL = [0.0] * 6 + [1.0] + [0.0] * 16 + [1e-3]
"""A level vehicle at its setpoint: each step resets the loops, so that they stay at rest. The last number makes the
frame as long as those of a flight: zeros at the end are not sent."""
_TROUBLES = ("bad_frames", "skipped_octets", "uart_overruns", "uart_errors", "dropped_frames")


class Measurement(NamedTuple):
    """Measurement at one baud rate."""

    baud: int | None
    """None if it is not a serial port."""
    identity: dict[str, Any] | None
    """The target's identity; None without an answer."""
    problem: str | None = None
    """The reason of an early end, as a clause about the target."""
    round_trips_s: tuple[float, ...] = ()
    """Round trip of each exchange, from the first attempt to the answer [s]."""
    counters: PilCounters | None = None
    troubles: dict[str, int] = {}  # noqa: RUF012  # never changed
    """Nonzero differences of the target's own counters."""
    before: dict[str, Any] | None = None
    """The target's FS_PIL_STATUS before its first step, the only one that shows a restart by the watchdog."""

    @property
    def steps_per_s(self) -> float | None:
        """Steps per second that the link can carry in flight."""
        return len(self.round_trips_s) / sum(self.round_trips_s) if sum(self.round_trips_s) > 0.0 else None

    @property
    def lost(self) -> int:
        """Exchanges that were not answered at the first attempt."""
        return 0 if self.counters is None else self.counters.resent

    @property
    def loss(self) -> float:
        """Ratio of lost exchanges, 0 to 1."""
        sent = len(self.round_trips_s) + self.lost
        return self.lost / sent if sent else 0.0

    @property
    def wire_s(self) -> float | None:
        """Time of an exchange on the wire, 8N1: the shortest possible round trip."""
        if self.baud is None or self.counters is None or not self.round_trips_s:
            return None
        octets = self.counters.octets_sent + self.counters.octets_received
        return octets / len(self.round_trips_s) * 10.0 / self.baud

    def percentile_s(self, share: float) -> float | None:
        """Return a percentile (0 to 100) of the round trips."""
        return float(np.percentile(self.round_trips_s, share)) if self.round_trips_s else None


class Probe:
    """Runs single exchanges on a link."""

    def __init__(
        self, link: ByteLink, timing: PilTiming, clock_s: Callable[[], float] = time.monotonic
    ) -> None:
        """``timing`` is that of flights on this link; see ``targets.timing_of``."""
        self._session = PilSession(link, timing, clock_s)
        self._timing, self.client = timing, self._session.client

    def request(self, name: str) -> Any | None:
        """Request a message; return None without an answer. Raise LineError."""
        return self._session.request(name, HELLO_ATTEMPTS)

    def step(self) -> float | None:
        """Run a step at rest and return its round trip [s]; None without an answer. Raise LineError."""
        self.client.timing = self._timing._replace(attempts=STEADY_ATTEMPTS)
        self.client.start_step(LoopFlags.RESET | LoopFlags.OUTER_DUE, LEVEL)
        began_s = self._session.now_s
        return None if self._session.finish() is None else self._session.now_s - began_s


def measured(
    link: ByteLink,
    baud: int | None,
    exchanges: int,
    progress: Callable[[int, int], None],
    timing: PilTiming = DEFAULT_TIMING,
    clock_s: Callable[[], float] = time.monotonic,
) -> Measurement:
    """Measure a link; raise LineError if it breaks. Firmware from other sources is measured as well."""
    probe = Probe(link, timing, clock_s)
    identity = probe.request("FS_PIL_IDENTITY")
    if identity is None:
        return Measurement(baud, None, probe.client.failure)
    before = probe.request("FS_PIL_STATUS")
    probe.client.counters = PilCounters()
    trips: list[float] = []
    problem = None
    for done in range(exchanges):
        trip_s = probe.step()
        if trip_s is None:
            problem = probe.client.failure
            break
        trips.append(trip_s)
        progress(done + 1, exchanges)
    counters, probe.client.counters = probe.client.counters, PilCounters()
    after = probe.request("FS_PIL_STATUS")
    troubles = _troubles(before, after)
    return Measurement(baud, described(identity), problem, tuple(trips), counters, troubles, _fields(before))


def _fields(status: Any | None) -> dict[str, Any] | None:
    if status is None:
        return None
    return {name: value for name, value in status.to_dict().items() if name != "mavpackettype"}


def _troubles(before: Any | None, after: Any | None) -> dict[str, int]:
    if before is None or after is None:
        return {}
    counts = {name: (getattr(after, name) - getattr(before, name)) & 0xFFFF_FFFF for name in _TROUBLES}
    return {name: count for name, count in counts.items() if count}
