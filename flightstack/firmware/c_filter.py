"""The estimator in C, compiled for this machine, with the kernels' signatures."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from typing import Any

import numpy as np

from flightstack.core.contract import FloatArray, RecordArray
from flightstack.estimation.estimator_params import EstimatorParams
from flightstack.estimation.health import SUMMARY, HealthSummary
from flightstack.estimation.memory import MEMORY, EstimatorMemory
from flightstack.firmware.generator.types import INT, Array, Table, has_arrays
from flightstack.firmware.generator.types import Record as RecordType
from flightstack.firmware.sources import c_files, files, firmware_root
from flightstack.firmware.toolchain.build import EXACT, cached, host_compiler, includes

FOLDERS = ("core", "core/estimation", "laws")
"""Folders with the headers of the estimator."""
MOST_VALUES = 10
"""Of a measurement."""


def filter_sources() -> list[Any]:
    """Return the C files of the estimator and of the mathematics that it calls."""
    core = firmware_root() / "core"
    return [*c_files("core/estimation"), core / "fs_math.c", core / "fs_portable_math.c"]


def c_layout(kind: type, real: str) -> np.dtype[np.void]:
    """Return the layout in C of a record that a NamedTuple declares; ``real``: f4 or f8."""
    fields: list[Any] = []
    for name, inner in RecordType(kind).fields.items():
        if isinstance(inner, Array):
            fields.append((name, "i4" if inner.item is INT else real, inner.shape))
        elif isinstance(inner, Table):
            fields.append((name, c_layout(inner.record.kind, real), inner.size))
        elif isinstance(inner, RecordType):
            is_row = not has_arrays(inner)
            fields.append((name, real, len(inner.fields)) if is_row else (name, c_layout(inner.kind, real)))
        else:
            fields.append((name, "i4" if inner is INT else real))
    return np.dtype(fields, align=True)


class CFilter:
    """One estimator in C: a memory, and the functions on it. ``real`` is ``double`` or ``float``."""

    def __init__(self, params: EstimatorParams | None = None, real: str = "double") -> None:
        """Compile the estimator if needed; raise BuildError."""
        self._item = "f8" if real == "double" else "f4"
        self.memory: RecordArray = np.zeros(1, c_layout(EstimatorMemory, self._item))
        """The memory in C, shape (1,)."""
        self._real = ctypes.c_double if real == "double" else ctypes.c_float
        self._library = _library(real)
        self._place = self.memory.ctypes.data_as(ctypes.c_void_p)
        self._row = np.zeros(MOST_VALUES, self._item)
        self._row_place = self._row.ctypes.data_as(ctypes.c_void_p)
        self.start(params or EstimatorParams())

    def start(self, params: EstimatorParams) -> None:
        """Start with an empty memory."""
        self.memory[:] = np.zeros(1, self.memory.dtype)
        self.memory[0]["params"] = params
        self._library.fs_start_memory(self._place)

    def imu(self, row: FloatArray, origin_s: float = 0.0) -> None:
        """Take a sample of the IMU in its array form, shape (8,); the filter's clock counts from ``origin_s``."""
        self._library.fs_imu_kernel(self._place, self._pointer(row, origin_s))

    def push(self, ring: int, row: FloatArray, origin_s: float = 0.0) -> None:
        """Store a measurement of a ring."""
        self._library.fs_push_kernel(self._place, ring, self._pointer(row, origin_s), len(row))

    def move_clock(self, by_s: float) -> None:
        """Let the clock count from an origin that is ``by_s`` later."""
        self._library.fs_move_clock_kernel(self._place, self._real(by_s))

    def field(self) -> None:
        """Take the Earth's field in the memory."""
        self._library.fs_field_kernel(self._place)

    def health(self, summary: RecordArray) -> RecordArray:
        """Return the summary of the health, an array of ``SUMMARY``, after ``summary``."""
        made = summary.astype(c_layout(HealthSummary, self._item))
        self._library.fs_health_kernel(self._place, made.ctypes.data_as(ctypes.c_void_p))
        return made.astype(SUMMARY)

    def call(self, name: str, *numbers: float) -> float:
        """Return the result of a function of numbers, in double: ``exp``, ``log`` or ``atan2``."""
        function = self._library[f"fs_{name}"]
        function.restype, function.argtypes = ctypes.c_double, [ctypes.c_double] * len(numbers)
        result: float = function(*numbers)
        return result

    def _pointer(self, row: FloatArray, origin_s: float) -> ctypes.c_void_p:
        self._row[: len(row)] = row
        self._row[0] = row[0] - origin_s
        return self._row_place

    def read(self) -> RecordArray:
        """Return the memory as the estimator in Python has it, shape (1,)."""
        made = np.zeros(1, MEMORY)
        copy_memory(self.memory, made)
        return made

    def write(self, memory: RecordArray) -> None:
        """Take over the memory of an estimator in Python."""
        for held, shown in _pairs(self.memory, memory):
            held[...] = shown


def copy_memory(held: RecordArray, shown: RecordArray) -> None:
    """Copy a memory in C, shape (1,), to one in Python's layout."""
    for values, place in _pairs(held, shown):
        place[...] = values


def _pairs(held: RecordArray, shown: RecordArray) -> Iterator[tuple[Any, Any]]:
    """Yield the arrays of numbers in records of C, and those of Python, where the fields of a part stand themselves."""
    for name in held.dtype.names or ():
        inner = held[name]
        if inner.dtype.names is None:
            yield inner, shown[name]
        else:
            yield from _pairs(inner, shown[name] if name in (shown.dtype.names or ()) else shown)


def _library(real: str) -> ctypes.CDLL:
    flags = [*EXACT, "-shared", "-fPIC", *includes(*FOLDERS), *(["-DFS_DOUBLE"] if real == "double" else [])]
    headers = files(*FOLDERS)
    library = ctypes.CDLL(str(cached(f"filter-{real}.so", host_compiler(), flags, filter_sources(), headers)))
    library.fs_push_kernel.argtypes = [ctypes.c_void_p, ctypes.c_int32, ctypes.c_void_p, ctypes.c_int32]
    return library
