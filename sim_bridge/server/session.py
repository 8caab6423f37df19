"""The session of one client: exchanges in lockstep, or in real time if the client has a clock of its own.

``Pacer`` waits for the wall-clock deadlines of simulated time; ``Lateness`` counts how much later it went on.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from flightstack.transports.cpu_affinity import AffinityLeader
from sim_bridge.server.connection import Connection, PeerClosedError, StoppedError, StopSignal
from sim_bridge.server.endpoint import FlightStackEndpoint

if TYPE_CHECKING:
    from sim_bridge.server.quiet_exchanges import QuietExchanges

_BINS = 100_000  # of 1 µs; one more counts longer delays
_SLIP_NS = 500_000_000
_LONGEST_SLEEP_S = 0.1
LEAD_NS = 10_000_000
"""In lockstep, simulated time runs ahead of wall time by less than this before the simulator sleeps.

Most of a tick in real time is the return from sleep, with cold caches, in both processes. ArduPilot's simulator
accumulates its sleep likewise.
"""


class Lateness:
    """Distribution of the delays after deadlines, in bins of 1 µs."""

    def __init__(self) -> None:
        self._bins = [0] * (_BINS + 1)
        self._sum_ns = 0
        self.count = 0
        self.max_us = 0.0

    def add(self, late_ns: int) -> None:
        """Count one delay."""
        self._bins[min(late_ns // 1000, _BINS)] += 1
        self._sum_ns += late_ns
        self.count += 1
        self.max_us = max(self.max_us, late_ns / 1000.0)

    def mean_us(self) -> float:
        """Return the mean delay."""
        return self._sum_ns / 1000.0 / max(1, self.count)

    def percentile_text(self, percent: float) -> str:
        """Return a percentile of the delays with its unit, to 1 µs; above the bins, their end."""
        wanted, seen = self.count * percent / 100.0, 0
        for us, number in enumerate(self._bins):
            seen += number
            if seen >= wanted and us < _BINS:
                return f"{us + 1} µs"
        return f"> {_BINS // 1000} ms"


class Pacer:
    """Paces simulated time at ``speed`` times wall time, by absolute deadlines."""

    def __init__(self, speed: float, stopped: Callable[[], bool], from_us: int = 0) -> None:
        """Simulated time before ``from_us`` passes as fast as possible."""
        self._ns_per_us = 1000.0 / speed
        self._from_us = from_us
        self._stopped = stopped
        self._base_ns: int | None = None
        self._base_us = 0
        self.lateness = Lateness()
        self.slips = 0

    def end_head_start(self) -> None:
        """Hold the speed from now on."""
        self._from_us = 0

    def wait_until(self, time_us: int, lead_ns: int = 0) -> None:
        """Sleep until the deadline of ``time_us``, if it is at least ``lead_ns`` ahead; the first call sets the origin.

        A delay of more than 0.5 s (a suspended machine, a debugger) resets the origin.
        """
        if time_us < self._from_us:
            return
        now = time.monotonic_ns()
        if self._base_ns is None:
            self._base_ns, self._base_us = now, time_us
            return
        deadline = self._base_ns + round((time_us - self._base_us) * self._ns_per_us)
        if 0 < deadline - now < lead_ns:
            return
        while now < deadline and not self._stopped():
            time.sleep(min(_LONGEST_SLEEP_S, (deadline - now) * 1e-9))
            now = time.monotonic_ns()
        late = max(0, now - deadline)
        self.lateness.add(late)
        if late > _SLIP_NS:
            self.slips += 1
            self._base_ns, self._base_us = now, time_us


FREEWHEEL_S = 0.05
"""Wait for an answer while the client's answers have not begun; PX4 takes 20 to 40 steps to start."""


class Pace(NamedTuple):
    """How fast simulated time passes."""

    speed: float
    """Simulated time over wall time; infinite without a limit."""
    from_us: int = 0
    """Simulated time from which the speed is held [µs]."""


class Session:
    """The session of one client."""

    def __init__(
        self,
        link: FlightStackEndpoint,
        connection: Connection,
        pace: Pace,
        stop: StopSignal,
        quiet: QuietExchanges | None = None,
    ) -> None:
        """``quiet`` runs exchanges at full speed; where the speed is held, the process sleeps between two."""
        self.link = link
        self.exchanges = 0
        self.wall_s = 0.0
        self._pace = pace
        self.pacer = None if math.isinf(pace.speed) else Pacer(pace.speed, stop.is_set, pace.from_us)
        # at a limited speed the process sleeps, and the scheduler chooses the processor
        self._leader = AffinityLeader() if self.pacer is None else None
        self._move_at = sys.maxsize if self._leader is None else 1
        self._held_from_us = sys.maxsize if self.pacer is None else pace.from_us
        self._connection = connection
        self._stop = stop
        self._quiet = quiet

    def run(self) -> None:
        """Exchange until an error of the link; raise an exception if the client ends, is lost, or the user stops."""
        link, connection = self.link, self._connection
        started = time.monotonic()
        try:
            while link.error is None:
                if self._stop.stopped:
                    raise StoppedError
                if not link.ready:
                    self._receive(connection.receive())
                elif link.free_running:
                    self._tick_on_wall_clock()
                else:
                    self._exchange_in_lockstep()
                    if self.exchanges == 1:
                        started = time.monotonic()
        finally:
            self.wall_s = time.monotonic() - started

    def _receive(self, data: memoryview) -> None:
        self.link.receive(data)
        for reply in self.link.replies():
            self._connection.send(reply)

    def _exchange_in_lockstep(self) -> None:
        link, connection = self.link, self._connection
        if link.freewheels and link.simulator.time_us == 0:
            link.step()  # PX4 takes its clock from the sensors, and zero is no time
        if not link.is_sent:
            connection.send(link.state())
        if (
            self._quiet is not None
            and self.exchanges
            and (count := min(self._most(), self._quiet.room())) > 0
        ):
            ran_all = self._run_quietly(self._quiet, count)
            if ran_all or link.free_running or link.error is not None:
                return
        while not link.answered:
            data = connection.receive_within(FREEWHEEL_S) if link.freewheels else connection.receive()
            if data is None:
                break
            self._receive(data)
            if link.free_running or link.error is not None:
                return
        link.step()
        self.exchanges += 1
        if self.exchanges >= self._move_at and self._leader is not None:
            self._move_at = self.exchanges + self._leader.update()
        if self.pacer is not None:
            self.pacer.wait_until(link.simulator.time_us, LEAD_NS)

    def _most(self) -> int:
        """Return how many exchanges are before the one that may move the process, and before the speed is held."""
        simulator = self.link.simulator
        hasty = (self._held_from_us - simulator.time_us - 1) // simulator.interval_us
        return min(self._move_at - self.exchanges - 1, hasty)

    def _run_quietly(self, quiet: QuietExchanges, count: int) -> bool:
        """Run ``count`` exchanges without Python; return False after fewer, and take what was received besides."""
        before = quiet.count
        try:
            quiet.run(count)
        finally:
            self.exchanges += quiet.count - before
        if quiet.unsent:
            self._connection.send(quiet.unsent)
        if (data := quiet.received) is not None:
            if not data:
                raise PeerClosedError
            self._receive(data)
        return quiet.count - before == count

    def _tick_on_wall_clock(self) -> None:
        link, connection = self.link, self._connection
        if self.pacer is None:  # --speed max has no effect on a client with a clock of its own
            self.pacer = Pacer(1.0, self._stop.is_set)
        self.pacer.end_head_start()  # a client on its own clock takes the newest state only
        if self._leader is not None:
            self._leader.release()
            self._leader = None
        self.pacer.wait_until(link.simulator.time_us)
        received = False
        while (data := connection.receive_now()) is not None:
            received = True
            self._receive(data)
        connection.check_alive(received)
        link.step()
        self.exchanges += 1
        connection.send(link.state())

    def report(self) -> list[str]:
        """Return the statistics of the session as lines for the user."""
        simulated_s = self.link.simulator.time_us * 1e-6
        factor = simulated_s / self.wall_s if self.wall_s > 0.0 else 0.0
        lines = [
            f"{simulated_s:.3f} s simulated in {self.wall_s:.3f} s ({factor:.1f} times real time), "
            f"{self.exchanges} exchanges, {self.link.stale} stale and {self.link.bad} bad messages, "
            f"{self.link.simulator.plant.bad_commands} bad commands"
        ]
        if math.isinf(self._pace.speed) and self.link.free_running:
            lines.append("--speed max had no effect: the flight stack runs in real time")
        if self.pacer is not None and self.pacer.lateness.count:
            late = self.pacer.lateness
            lines.append(
                f"lateness mean {late.mean_us():.0f} µs, 99 % {late.percentile_text(99.0)}, "
                f"max {late.max_us:.0f} µs; {self.pacer.slips} slips"
            )
        return lines
