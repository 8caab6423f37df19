"""The state as it is sent during a fault of the state or of the clock: frozen, NaN, late, with another time stamp."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from flightstack.simulator_link.hot_frames import PlantStateFrame
from sim_bridge.plant.faults.table import Fault, Kind


class _Past(NamedTuple):
    time_us: int
    frame: bytes
    flags: int


class SentState:
    """Makes the frames that are sent instead of the true state."""

    def __init__(self, truth: PlantStateFrame, frame: PlantStateFrame) -> None:
        self._truth, self._altered = truth, frame
        self._fault: Fault | None = None
        self._flags = 0  # of the altered state
        self._past: deque[_Past] = deque()
        self._lead_us = 0
        self._stalled_us: int | None = None  # time stamp of all states

    def stamp_us(self, time_us: int) -> int:
        """Return the time stamp of a state."""
        return time_us + self._lead_us if self._stalled_us is None else self._stalled_us

    @property
    def is_dropped(self) -> bool:
        """True if no state is sent."""
        return self._fault is not None and self._fault.kind is Kind.STATE_DROP

    @property
    def is_late(self) -> bool:
        """True if ``update`` is due after each exchange."""
        return self._fault is not None and self._fault.kind is Kind.STATE_LATE

    @property
    def is_true(self) -> bool:
        """True if the true state is sent, with its time."""
        return self._fault is None and self._stalled_us is None and self._lead_us == 0

    @property
    def frame(self) -> PlantStateFrame:
        """The state as sent; read only."""
        return self._truth if self._fault is None or self.is_dropped else self._altered

    def jump(self, seconds: float, time_us: int) -> None:
        """Shift the time stamps, backwards at most to zero."""
        shift_us = round(seconds * 1e6)
        if self._stalled_us is None:
            self._lead_us = max(self._lead_us + shift_us, -time_us)
        else:
            self._stalled_us = max(self._stalled_us + shift_us, 0)

    def stall(self, stalls: bool, time_us: int) -> None:
        """Stop the clock of the time stamps, or start it from where it stopped."""
        if stalls and self._stalled_us is None:
            self._stalled_us = self.stamp_us(time_us)
        elif not stalls and self._stalled_us is not None:
            self._lead_us, self._stalled_us = self._stalled_us - time_us, None

    def select(self, fault: Fault | None, time_us: int, flags: int) -> None:
        """Begin, keep or end a fault of the state; ``flags`` are those of the true state."""
        if fault is None or self._fault is None or fault.kind is not self._fault.kind:
            self._past.clear()  # otherwise a frozen state stays, and so do the states that wait
        self._fault = fault
        self.update(time_us, flags)

    def update(self, time_us: int, flags: int) -> None:
        """Follow the true state of this time."""
        fault = self._fault
        if fault is None:
            return
        if not self._past or (self.is_late and self._past[-1].time_us < time_us):
            self._past.append(_Past(time_us, bytes(self._truth.frame), flags))
        due_us = time_us - round(fault.value * 1e6)
        while len(self._past) > 1 and self._past[1].time_us <= due_us:
            self._past.popleft()
        self._altered.frame[:], self._flags = self._past[0].frame, self._past[0].flags
        if fault.kind is Kind.STATE_NAN:
            self._altered.state[:] = math.nan

    def seal(self, time_us: int, flags: int) -> memoryview:
        """Return the frame to send, valid until the next call; ``flags`` are those of the true state."""
        frame = self.frame
        return frame.seal(self.stamp_us(time_us), flags if frame is self._truth else self._flags)
