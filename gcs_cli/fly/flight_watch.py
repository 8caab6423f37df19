"""Whether a flight goes on, and who holds it up if not. Pure.

The flight stack sends heartbeats while it waits for the simulator: when they go on and time stands still, it is the
simulator that does not answer. Whoever has no compiled kernels yet compiles them, once: before it answers, and for
what only some flights need, in the first step. That may take a minute on a busy machine, and is no failure.
"""

from __future__ import annotations

from gcs_cli.vehicle.view_types import LOST_AFTER_S

STALL_S = 10.0
"""How long simulated time may stand still in flight, at real time or faster."""
_ONCE = "which it does once, may take so long on a busy machine: see {log}, and fly again or allow more by --timeout"
_STACK = "compiling its loops, " + _ONCE.format(log="flightstack.log")
_SIMULATOR = "compiling its plant, " + _ONCE.format(log="sim-bridge.log")


def no_vehicle(after_s: float) -> str:
    """Say that no flight stack was heard."""
    return f"no vehicle answered within {after_s:g} s: flightstack has not begun; {_STACK}"


def no_state(after_s: float) -> str:
    """Say that the flight stack was heard, and no state came from the simulator."""
    return f"the vehicle has no position and attitude after {after_s:g} s: sim-bridge has sent no state; {_SIMULATOR}"


class Watch:
    """Sees to it that time passes and the vehicle is heard; the first step may take ``first_s``, others ``stall_s``."""

    def __init__(self, stall_s: float, first_s: float) -> None:
        self._stall_s, self._first_s = stall_s, max(stall_s, first_s)
        self._time_s: float | None = None
        self._since_s: float | None = None
        self._stepped = False

    def begin(self, time_s: float | None, now_s: float) -> None:
        """Take note that time runs from here on; ``time_s`` is where it stood before."""
        self._time_s, self._since_s, self._stepped = time_s, now_s, False

    @property
    def is_first_step(self) -> bool:
        """Whether time runs, and the first step is not answered yet."""
        return self._since_s is not None and not self._stepped

    def held_up(self, time_s: float | None, now_s: float) -> str | None:
        """Say that simulated time has stood still for too long while the vehicle was heard; None if it has not."""
        if self._since_s is None:
            return None
        if time_s is not None and time_s != self._time_s:
            self._time_s, self._since_s, self._stepped = time_s, now_s, True
        patience_s = self._first_s if self.is_first_step else self._stall_s
        if now_s - self._since_s <= patience_s:
            return None
        still = f"simulated time stood still for {patience_s:g} s at t = {self._time_s or 0.0:.1f} s: "
        if self.is_first_step:
            return f"{still}sim-bridge has not answered the first step; {_SIMULATOR}"
        return f"{still}sim-bridge does not answer: see sim-bridge.log"

    def lost(self, silent_s: float | None, time_s: float | None, doing: str) -> str | None:
        """Say that the vehicle, silent for so long, is lost while ``doing`` something; None if it is not."""
        patience_s = max(LOST_AFTER_S, self._first_s) if self.is_first_step else LOST_AFTER_S
        if silent_s is None or silent_s <= patience_s:
            return None
        at = "" if time_s is None else f" at t = {time_s:.1f} s"
        return (
            f"the vehicle was lost{at}: no heartbeat for {patience_s:g} s while {doing}: see flightstack.log"
        )
