"""How the loops follow the simulator's clock in lockstep. No I/O: the machine's time is an argument.

The loops run at their own fixed step whatever the simulator's is: each state is followed by as many ticks as its time
makes due. That is one where both steps are the same, two of 2 ms after a state 4 ms later, and none where a state
comes early or twice: it is answered with the last commands. So no loop, timer or failsafe counts another time than
the simulator's.
"""

from __future__ import annotations

from flightstack.core.contract import FloatArray, LoopRow
from flightstack.core.enums import Severity
from flightstack.simulator_link.endpoint import SimulatorEndpoint
from flightstack.simulator_link.state_steps import is_gap
from flightstack.vehicle.autopilot import Autopilot

STALL_NS = 1_000_000_000
"""When states keep coming whose time has stood still for so long, the vehicle's clock goes on by the machine's."""


class Lockstep:
    """Runs the ticks that are due after each state."""

    def __init__(self, link: SimulatorEndpoint, autopilot: Autopilot, interval_us: int) -> None:
        self._link = link
        self._autopilot = autopilot
        self._now = autopilot.now
        self._interval_us = interval_us
        self._begun = False
        self._lead_us = 0  # time that the vehicle's clock went on while the simulator's stood still
        self._seen_us = 0  # the simulator's time at the last tick or look out of step
        self._seen_ns = 0  # the machine's time then
        self._stalled = False

    def tick(self, now_ns: int) -> FloatArray:
        """Run what the newest state makes due; return the commands to answer it with."""
        time_us = self._now.time_us + self._interval_us
        if self._link.time_us + self._lead_us == time_us and self._begun:  # the usual
            return self._autopilot.tick(time_us)
        return self._catch_up(now_ns)

    def _catch_up(self, now_ns: int) -> FloatArray:
        link, interval_us = self._link, self._interval_us
        if not self._begun:
            self._begun = True
            self._seen_us, self._seen_ns = link.time_us, now_ns
            return self._autopilot.tick(link.time_us)
        self._watch_clock(now_ns)
        due_us = link.time_us + self._lead_us - self._now.time_us
        ticks = (
            due_us + interval_us // 2
        ) // interval_us  # to the nearest: clocks are rounded to microseconds
        arrived = link.has_arrived
        if is_gap(due_us):  # the loops must not take the state after a gap for one of before
            link.has_arrived = False
        for left in reversed(range(ticks)):
            if left == 0:
                link.has_arrived = arrived
            self._autopilot.tick(self._now.time_us + interval_us)
        commands: FloatArray = self._now.row[LoopRow.ROTOR_COMMAND]
        return commands

    def _watch_clock(self, now_ns: int) -> None:
        """Find out whether the simulator's clock stands still, and let the machine's stand in for it."""
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
