"""Detect a lost vehicle and a stalled simulation. Pure.

The flight stack sends heartbeats while it waits for the simulator: if they continue and simulated time stands still,
the simulator does not answer. A process without compiled kernels compiles them once: before its first answer, and
those that only some flights need in the first step. That may take a minute on a busy machine.
"""

from __future__ import annotations

from gcs_cli.vehicle.view_types import LOST_AFTER_S

STALL_S = 10.0
"""Longest time without progress of simulated time in flight, at real time or faster."""
_ONCE = "done once, may take longer than that on a busy machine: see {log}, and fly again or raise --timeout"
_STACK = "compiling its loops, " + _ONCE.format(log="flightstack.log")
_SIMULATOR = "compiling its plant, " + _ONCE.format(log="sim-bridge.log")


def no_vehicle(after_s: float) -> str:
    """Return the reason of a flight without a flight stack."""
    return f"no vehicle answered within {after_s:g} s: flightstack has not started; {_STACK}"


def no_state(after_s: float) -> str:
    """Return the reason of a flight without a state from the simulator."""
    return f"the vehicle has no position and attitude after {after_s:g} s: sim-bridge has sent no state; {_SIMULATOR}"


class Watch:
    """Monitors simulated time and heartbeats; the first step may take ``first_s``, others ``stall_s``."""

    def __init__(self, stall_s: float, first_s: float) -> None:
        self._stall_s, self._first_s = stall_s, max(stall_s, first_s)
        self._time_s: float | None = None
        self._since_s: float | None = None
        self._stepped = False

    def begin(self, time_s: float | None, now_s: float) -> None:
        """Start to monitor; ``time_s`` is the simulated time before the first step."""
        self._time_s, self._since_s, self._stepped = time_s, now_s, False

    @property
    def is_first_step(self) -> bool:
        """True until the first step is answered."""
        return self._since_s is not None and not self._stepped

    def stall(self, time_s: float | None, now_s: float) -> str | None:
        """Return the reason if simulated time has stood still for too long, or None."""
        if self._since_s is None:
            return None
        if time_s is not None and time_s != self._time_s:
            self._time_s, self._since_s, self._stepped = time_s, now_s, True
        timeout_s = self._first_s if self.is_first_step else self._stall_s
        if now_s - self._since_s <= timeout_s:
            return None
        still = f"simulated time stood still for {timeout_s:g} s at t = {self._time_s or 0.0:.1f} s: "
        if self.is_first_step:
            return f"{still}sim-bridge has not answered the first step; {_SIMULATOR}"
        return f"{still}sim-bridge does not answer: see sim-bridge.log"

    def loss(self, silent_s: float | None, time_s: float | None, doing: str) -> str | None:
        """Return the reason if a vehicle silent for ``silent_s`` is lost, or None; ``doing`` describes the phase."""
        timeout_s = max(LOST_AFTER_S, self._first_s) if self.is_first_step else LOST_AFTER_S
        if silent_s is None or silent_s <= timeout_s:
            return None
        at = "" if time_s is None else f" at t = {time_s:.1f} s"
        return (
            f"the vehicle was lost{at}: no heartbeat for {timeout_s:g} s while {doing}: see flightstack.log"
        )
