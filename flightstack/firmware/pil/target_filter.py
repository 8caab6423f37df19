"""The estimator in C as a ``FilterCore``: in this process, or on a target behind its link."""

from __future__ import annotations

import numpy as np

from flightstack.core.compiled import direct
from flightstack.core.contract import FloatArray, RecordArray
from flightstack.estimation.clock_origin import ClockOrigin, move_clock_kernel
from flightstack.estimation.estimator_params import EstimatorParams
from flightstack.estimation.memory import MEMORY, EstimatorMemory, Flags
from flightstack.firmware.c_filter import CFilter, c_layout, copy_memory
from flightstack.firmware.pil import sensing
from flightstack.firmware.pil.sensing import MOST_PARAMS, PAGES, WORDS, Event, ReadWords, SenseEvents
from flightstack.firmware.pil.target_loops import TargetLoops

_CURRENT = ("state", "flags", "resets")
"""Fields of the memory that are up to date after each call."""
_DATED = ("position", "velocity")
"""Resets that have a time."""


class _Dates:
    """Lets the times of a memory in Python count as those outside the filter."""

    def __init__(self, memory: RecordArray) -> None:
        self._memory = memory
        self._move = direct(move_clock_kernel, memory, 0.0)

    def put_all(self, origin_s: float) -> None:
        """Do so in the whole memory."""
        if origin_s:
            self._move(self._memory, -origin_s)

    def put_in_resets(self, origin_s: float) -> None:
        """Do so in the resets."""
        if origin_s:
            resets = self._memory["resets"][0]
            for kind in _DATED:
                if resets[kind]["time_s"]:
                    resets[kind]["time_s"] += origin_s


class HostFilter:
    """The estimator in C in this process; implements ``FilterCore``."""

    def __init__(self, real: str = "float") -> None:
        """Compile the estimator if needed; raise BuildError. ``real`` is ``float`` or ``double``."""
        self._filter = CFilter(real=real)
        self._moves_clock = real == "float"
        self._origin = ClockOrigin()
        self.memory: RecordArray = np.zeros(1, MEMORY)
        self._dates = _Dates(self.memory)
        held, shown = self._filter.memory, self.memory
        self._current = [(shown[name], held[name]) for name in _CURRENT]

    def start(self, params: EstimatorParams) -> None:
        """Start with an empty memory."""
        self._origin = ClockOrigin()
        self._filter.start(params)
        self.refresh()

    def set_params(self, params: EstimatorParams) -> None:
        """Set the parameters."""
        self._filter.memory[0]["params"] = params

    def set_landed(self, landed: bool) -> None:
        """Set whether the vehicle stands on the ground."""
        self._filter.memory[0]["flags"]["landed"] = landed

    def set_earth(self, earth: FloatArray, is_known: bool) -> None:
        """Set the Earth's field, shape (4,); correct the state with it if ``is_known``."""
        self._filter.memory[0]["earth"] = earth
        if is_known:
            self._filter.field()
            self._show()

    def imu(self, row: FloatArray) -> None:
        """Take a sample of the IMU in its array form, shape (8,)."""
        self._filter.imu(row, self._follow(row))
        self._show()

    def push(self, ring: int, row: FloatArray) -> None:
        """Store a measurement of a ring."""
        self._filter.push(ring, row, self._follow(row))

    def _follow(self, row: FloatArray) -> float:
        """Move the origin of the filter's clock if it is time; return it [s]."""
        if self._moves_clock and (by_s := self._origin.move(row[0])):
            self._filter.move_clock(by_s)
        return self._origin.at_s

    def refresh(self) -> None:
        """Copy the whole memory."""
        copy_memory(self._filter.memory, self.memory)
        self._dates.put_all(self._origin.at_s)

    def _show(self) -> None:
        for shown, held in self._current:
            shown[:] = held
        self._dates.put_in_resets(self._origin.at_s)


class TargetFilter:
    """The estimator on a target; implements ``FilterCore``.

    Measurements wait for the next sample of the IMU and are sent with it: each exchange costs the latency of the link.
    """

    def __init__(self, loops: TargetLoops) -> None:
        self._loops = loops
        self.memory: RecordArray = np.zeros(1, MEMORY)
        self._dates = _Dates(self.memory)
        self._held: RecordArray = np.zeros(1, c_layout(EstimatorMemory, "f4"))
        self._words = self._held.view("<u4")
        self._record = self.memory[0]
        self._flags = self.memory["flags"].view(np.int64)
        self._resets = self.memory["resets"].view(np.float64)
        self._bits = np.arange(len(Flags._fields))
        self._waiting: list[Event] = []
        self._origin = ClockOrigin()
        self._next = 0
        self._is_fresh = False

    def start(self, params: EstimatorParams) -> None:
        """Start with an empty memory; raise TargetError, also for a target without an estimator."""
        self._origin = ClockOrigin()
        self._waiting = [Event(sensing.CLEAR)]
        self.set_params(params)
        self._waiting.append(Event(sensing.START))
        self.refresh()

    def set_params(self, params: EstimatorParams) -> None:
        """Set the parameters with the next sample."""
        for first in range(0, len(params), MOST_PARAMS):
            values = params[first : first + MOST_PARAMS]
            self._waiting.append(Event(sensing.PARAMS, (float(first), float(len(values)), *values)))

    def set_landed(self, landed: bool) -> None:
        """Set with the next sample whether the vehicle stands on the ground."""
        self._waiting.append(Event(sensing.LANDED, (float(landed),)))

    def set_earth(self, earth: FloatArray, is_known: bool) -> None:
        """Set the Earth's field, shape (4,); correct the state with it if ``is_known``. Raise TargetError."""
        self._waiting.append(Event(sensing.EARTH, (*earth.tolist(), float(is_known))))
        self._send()

    def imu(self, row: FloatArray) -> None:
        """Take a sample of the IMU in its array form, shape (8,); raise TargetError."""
        self._add(sensing.IMU, row)
        self._send()

    def push(self, ring: int, row: FloatArray) -> None:
        """Store a measurement of a ring with the next sample."""
        self._add(ring, row)

    def _add(self, kind: int, row: FloatArray) -> None:
        """Add a measurement; before it, move the origin of the filter's clock if it is time."""
        time_s, *values = row.tolist()
        if by_s := self._origin.move(time_s):
            self._waiting.append(Event(sensing.ORIGIN, (by_s,)))
        self._waiting.append(Event(kind, (time_s - self._origin.at_s, *values)))

    def refresh(self) -> None:
        """Read the whole memory; raise TargetError."""
        if self._waiting:
            self._send()
        if self._is_fresh:
            return
        self._is_fresh = True
        pages = range(0, len(self._words), WORDS)
        for at in range(0, len(pages), PAGES):
            self._loops.run_operation(ReadWords(self._next, pages[at : at + PAGES], self._words))
        copy_memory(self._held, self.memory)
        self._dates.put_all(self._origin.at_s)

    def _send(self) -> None:
        events, self._waiting = self._waiting, []
        answer = self._loops.run_operation(SenseEvents(self._next, events))
        self._next = (self._next + len(events)) & 0xFFFF_FFFF
        self._is_fresh = False
        record = self._record
        if events[-1].kind in (sensing.IMU, sensing.EARTH):
            record["state"], self._resets[:] = answer.state, answer.resets
            self._dates.put_in_resets(self._origin.at_s)
        self._flags[:] = (answer.flags >> self._bits) & 1
