"""Ticks of the loops on the simulator clock in lockstep. No I/O: wall time is an argument.

The step of the loops is fixed and independent of the simulator's. Each state is followed by the ticks that its time
makes due: one tick if both steps are equal, two of 2 ms after a state 4 ms later, and none after an early or repeated
state, which is answered with the last commands. Loops, timers and failsafes thus all count simulator time.
A module of its own: real time has ticks without it.
"""

from __future__ import annotations

from flightstack.core.contract import FloatArray, LoopRow
from flightstack.core.enums import Severity
from flightstack.simulator_link.endpoint import SimulatorEndpoint
from flightstack.simulator_link.state_steps import is_gap
from flightstack.vehicle.autopilot import TickingAutopilot

STALL_NS = 1_000_000_000
"""If states arrive whose time has not changed for this wall time, the vehicle clock advances with wall time."""


class Lockstep:
    """Runs the ticks that are due after each state."""

    def __init__(self, link: SimulatorEndpoint, autopilot: TickingAutopilot, interval_us: int) -> None:
        self._link = link
        self._autopilot = autopilot
        self._now = autopilot.now
        self._interval_us = interval_us
        self._begun = False
        self._lead_us = 0  # advance of the vehicle clock while the simulator clock stood still
        self._seen_us = 0  # simulator time at the last call of ``_update_stall``
        self._seen_ns = 0  # wall time then
        self._stalled = False

    def tick(self, now_ns: int) -> FloatArray:
        """Run the ticks that the newest state makes due; return the commands to answer it with."""
        time_us = self._now.time_us + self._interval_us
        if self._link.time_us + self._lead_us == time_us and self._begun:  # the usual case
            return self._autopilot.tick(time_us)
        return self._catch_up(now_ns)

    @property
    def is_due(self) -> bool:
        """True if the next tick is that of the newest state, one interval after the last, and nothing else waits."""
        time_us = self._now.time_us + self._interval_us
        return self._begun and not self._lead_us and self._link.is_quiet(time_us)

    @property
    def is_quiet(self) -> bool:
        """True if the last tick was that of the newest state, and the vehicle's clock is the simulator's."""
        return self._begun and not self._lead_us and self._link.is_quiet(self._now.time_us)

    def _catch_up(self, now_ns: int) -> FloatArray:
        link, interval_us = self._link, self._interval_us
        if not self._begun:
            self._begun = True
            self._seen_us, self._seen_ns = link.time_us, now_ns
            return self._autopilot.tick(link.time_us)
        self._update_stall(now_ns)
        due_us = link.time_us + self._lead_us - self._now.time_us
        ticks = (due_us + interval_us // 2) // interval_us  # rounded: clocks have a resolution of 1 µs
        arrived = link.has_arrived
        if is_gap(due_us):  # ticks before the last one must not use the state after the gap as new
            link.has_arrived = False
        for left in reversed(range(ticks)):
            if left == 0:
                link.has_arrived = arrived
            self._autopilot.tick(self._now.time_us + interval_us)
        commands: FloatArray = self._now.row[LoopRow.ROTOR_COMMAND]
        return commands

    def _update_stall(self, now_ns: int) -> None:
        """Detect a stall of the simulator clock, and advance the vehicle clock by wall time during it."""
        if self._link.time_us != self._seen_us:
            self._seen_us, self._seen_ns = self._link.time_us, now_ns
            if self._stalled:
                self._stalled = False
                self._link.steps.tell(Severity.NOTICE, "Simulator clock runs again")
        elif self._stalled:
            passed_us = (now_ns - self._seen_ns) // 1000
            self._lead_us += passed_us
            self._seen_ns += passed_us * 1000
        elif now_ns - self._seen_ns > STALL_NS:
            self._stalled, self._seen_ns = True, now_ns
            self._link.steps.tell(Severity.CRITICAL, "Simulator clock stands still")
