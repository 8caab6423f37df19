"""One client's flight: exchanges in lockstep, or on the wall clock when the client has a clock of its own."""

from __future__ import annotations

import math
import time

from flightstack.transports.cpu_affinity import AffinityLeader
from sim_bridge.server.connection import Connection, StoppedError, StopSignal
from sim_bridge.server.lockstep import SimulatorLink
from sim_bridge.server.pacing import Pacer


class Session:
    """One client's flight."""

    def __init__(self, link: SimulatorLink, connection: Connection, speed: float, stop: StopSignal) -> None:
        self.link = link
        self.exchanges = 0
        self.wall_s = 0.0
        self._speed = speed
        self.pacer = None if math.isinf(speed) else Pacer(speed, stop.is_set)
        # at a given speed there is time to sleep, and the scheduler finds the processor that wakes up first
        self._leader = AffinityLeader() if self.pacer is None else None
        self._move_at = 1
        self._connection = connection
        self._stop = stop

    def run(self) -> None:
        """Exchange until the client ends, is lost, or the user stops; the exception says which."""
        link, connection = self.link, self._connection
        started = time.monotonic()
        try:
            while link.fault is None:
                if self._stop.stopped:
                    raise StoppedError
                if not link.ready:
                    self._take(connection.receive())
                elif link.free_running:
                    self._tick_on_wall_clock()
                else:
                    self._exchange_in_lockstep()
                    if self.exchanges == 1:
                        started = time.monotonic()
        finally:
            self.wall_s = time.monotonic() - started

    def _take(self, data: memoryview) -> None:
        self.link.receive(data)
        for reply in self.link.replies():
            self._connection.send(reply)

    def _exchange_in_lockstep(self) -> None:
        link, connection = self.link, self._connection
        connection.send(link.state())
        while not link.answered:
            self._take(connection.receive())
            if link.free_running or link.fault is not None:
                return
        link.step()
        self.exchanges += 1
        if self.exchanges == self._move_at and self._leader is not None:
            self._move_at += self._leader.step()
        if self.pacer is not None:
            self.pacer.wait_until(link.simulator.time_us)

    def _tick_on_wall_clock(self) -> None:
        link, connection = self.link, self._connection
        if self.pacer is None:  # as fast as it goes means nothing to a client with a clock of its own
            self.pacer = Pacer(1.0, self._stop.is_set)
        if self._leader is not None:
            self._leader.leave()
            self._leader = None
        self.pacer.wait_until(link.simulator.time_us)
        heard = False
        while (data := connection.receive_now()) is not None:
            heard = True
            self._take(data)
        connection.check_alive(heard)
        link.step()
        self.exchanges += 1
        connection.send(link.state())

    def report(self) -> list[str]:
        """Return the figures of the session, as lines for the user."""
        simulated_s = self.link.simulator.time_us * 1e-6
        factor = simulated_s / self.wall_s if self.wall_s > 0.0 else 0.0
        lines = [
            f"{simulated_s:.3f} s simulated in {self.wall_s:.3f} s ({factor:.1f} times real time), "
            f"{self.exchanges} exchanges, {self.link.stale} stale and {self.link.bad} bad messages, "
            f"{self.link.simulator.plant.bad_commands} bad commands"
        ]
        if math.isinf(self._speed) and self.link.free_running:
            lines.append("the flight stack kept real time, so that --speed max did not act: flown at speed 1")
        if self.pacer is not None and self.pacer.lateness.count:
            late = self.pacer.lateness
            lines.append(
                f"lateness mean {late.mean_us():.0f} µs, 99 % {late.percentile_us(99.0):.0f} µs, "
                f"max {late.max_us:.0f} µs; {self.pacer.slips} slips"
            )
        return lines
