"""What an estimator was given in a flight, for another estimator to repeat."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np
import pytest

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Record, RecordArray
from flightstack.core.portable_math import atan2, exp, log
from flightstack.estimation import filter_core
from flightstack.estimation.clock_origin import move_clock_kernel
from flightstack.estimation.delayed_filter import field_kernel, imu_kernel, push_kernel
from flightstack.estimation.estimator import Estimator
from flightstack.estimation.health import SUMMARY, health_kernel
from flightstack.firmware.c_filter import CFilter
from flightstack.testing import quiet_ticks

IMU, FIELD, LANDING, EARTH, PARAMS, HEALTH, NUMBERS, ORIGIN = 10, 11, 12, 13, 14, 15, 16, 17
"""Kinds of events beside the rings' numbers: an IMU sample, the Earth's field is known, changes of the memory, the
health, calls of functions with numbers that the filter does not give them, and a move of the clock's origin."""
TIMED = frozenset(range(4)) | {IMU}
"""Kinds of events that begin with a time: measurements of the rings, and of the IMU."""
FIELDS = {EARTH: "earth", PARAMS: "params"}


class Event(NamedTuple):
    """A call of a kernel, or a change of the memory before one."""

    kind: int
    row: FloatArray


@contextmanager
def recorded() -> Iterator[dict[int, list[Event]]]:
    """Record what each estimator is given within the context, by the address of its memory."""
    events: dict[int, list[Event]] = defaultdict(list)
    recorders: dict[int, _Recorder] = {}

    def wrapped(name: str, kernel: Any) -> Any:
        def call(memory: RecordArray, *given: Any) -> None:
            address = memory.ctypes.data
            if address not in recorders:
                recorders[address] = _Recorder(memory[0], events[address])
            recorders[address].note(name, *given)
            kernel(memory, *given)

        return call

    with pytest.MonkeyPatch.context() as patch:
        for name in ("imu_kernel", "push_kernel", "field_kernel"):
            patch.setattr(filter_core, name, wrapped(name, getattr(filter_core, name)))
        patch.setattr(quiet_ticks, "compiles", lambda *_: False)  # a compiled call passes these by
        yield events


class _Recorder:
    def __init__(self, record: Record, events: list[Event]) -> None:
        self._record, self._events = record, events
        self._landed, self._earth, self._params = 0, np.array([0.0, 0.0, 0.0, np.nan]), np.zeros(0)

    def note(self, name: str, *given: Any) -> None:
        """Note changes of the memory since the last call, and a call."""
        record = self._record
        if not np.array_equal(record["params"], self._params):
            self._params = record["params"].copy()
            self._events.append(Event(PARAMS, self._params))
        if record["flags"]["landed"] != self._landed:
            self._landed = int(record["flags"]["landed"])
            self._events.append(Event(LANDING, np.array([float(self._landed)])))
        if not np.array_equal(record["earth"], self._earth, equal_nan=True):
            self._earth = record["earth"].copy()
            self._events.append(Event(EARTH, self._earth))
        if name == "push_kernel":
            self._events.append(Event(given[0], given[1].copy()))
        else:
            row = given[0].copy() if name == "imu_kernel" else np.zeros(1)
            self._events.append(Event(IMU if name == "imu_kernel" else FIELD, row))


class InPython:
    """The estimator in Python."""

    def __init__(self) -> None:
        self.memory = Estimator().memory
        self.summary = np.zeros(1, SUMMARY)
        self.numbers: list[float] = []
        """Results of functions."""

    def take(self, event: Event) -> None:
        """Take an event."""
        memory, record, (kind, row) = self.memory, self.memory[0], event
        if kind == IMU:
            imu_kernel(memory, row)
        elif kind == FIELD:
            field_kernel(memory)
        elif kind == HEALTH:
            health_kernel(memory, self.summary)
        elif kind == NUMBERS:
            self.numbers += _functions(*row)
        elif kind == ORIGIN:
            move_clock_kernel(memory, row[0])
        elif kind in FIELDS:
            record[FIELDS[kind]] = row
        elif kind == LANDING:
            record["flags"]["landed"] = int(row[0])
        else:
            push_kernel(memory, kind, row.copy())


@compiled
def _functions(x: float, y: float) -> tuple[float, float, float]:
    return exp(x), log(x), atan2(x, y)


class InC:
    """The estimator in C."""

    def __init__(self, real: str = "double") -> None:
        self.filter = CFilter(real=real)
        self.summary = np.zeros(1, SUMMARY)
        self.numbers: list[float] = []
        """Results of functions."""

    @property
    def memory(self) -> RecordArray:
        """The memory as the estimator in Python has it."""
        return self.filter.read()

    def take(self, event: Event) -> None:
        """Take an event."""
        record, (kind, row) = self.filter.memory[0], event
        if kind == IMU:
            self.filter.imu(row)
        elif kind == FIELD:
            self.filter.field()
        elif kind == HEALTH:
            self.summary = self.filter.health(self.summary)
        elif kind == NUMBERS:
            x, y = row
            call = self.filter.call
            self.numbers += [call("exp", x), call("log", x), call("atan2", x, y)]
        elif kind == ORIGIN:
            self.filter.move_clock(row[0])
        elif kind in FIELDS:
            record[FIELDS[kind]] = row
        elif kind == LANDING:
            record["flags"]["landed"] = int(row[0])
        else:
            self.filter.push(kind, row)
