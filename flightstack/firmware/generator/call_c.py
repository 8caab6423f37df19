"""Call generated C from Python, with Python's values, and compare it with Python on random and boundary values."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.lib.recfunctions import structured_to_unstructured

from flightstack.core.contract import MAX_ROTORS, FloatArray
from flightstack.core.record_types import dtype_of
from flightstack.firmware.generator.law import Function
from flightstack.firmware.generator.types import (
    BOOL,
    INT,
    NOTHING,
    REAL,
    ROTORS,
    Array,
    Record,
    Scalar,
    Several,
    Table,
    Type,
    has_rotors,
)

ROTOR_COUNT = 4
"""Rotors of random arrays."""
EDGES = [0.0, -0.0, math.nan, math.inf, -math.inf, 5e-324, -1e-310, 1e308, -1e308, 1e-30, 1.0, -1.0]


class Difference(NamedTuple):
    """Arguments for which C and Python differ, and the numbers of both."""

    arguments: Sequence[Any]
    python: list[float]
    c: list[float]


def _layout(kind: Type) -> Any:
    """Return the ctypes type of a value in a library of double."""
    if isinstance(kind, Array):
        made: Any = ctypes.c_int32 if kind.item is INT else ctypes.c_double
        for size in reversed(kind.shape):
            made = made * (MAX_ROTORS if size == ROTORS else int(size))
        return made
    if isinstance(kind, Table):
        return _layout(kind.record) * kind.size
    if isinstance(kind, Record):
        fields = [(f"_{name}", _layout(inner)) for name, inner in kind.fields.items()]
        head = [("rotors", ctypes.c_int32)] if has_rotors(kind) else []
        return type(kind.kind.__name__, (ctypes.Structure,), {"_fields_": [*head, *fields]})
    return {REAL: ctypes.c_double, INT: ctypes.c_int32, BOOL: ctypes.c_bool, NOTHING: None}[kind]  # type: ignore[index]


def _fields(kind: Record, value: Any) -> Iterator[tuple[str, Type, Any]]:
    """Yield name, type and value of the fields of a NamedTuple, or of a record of NumPy."""
    values = [value[name] for name in kind.fields] if kind.is_numpy else value
    for (name, inner), item in zip(kind.fields.items(), values, strict=True):
        yield name, inner, item


def _fill(kind: Type, place: Any, value: Any) -> None:
    """Write the fields of a structure, or the items of an array."""
    if isinstance(kind, Array | Table):
        inner = kind.record if isinstance(kind, Table) else Array(kind.shape[1:], kind.item)
        for at, item in enumerate(value):
            if isinstance(inner, Record) or inner.shape:
                _fill(inner, place[at], item)
            else:
                place[at] = item
        return
    assert isinstance(kind, Record)
    for name, field, item in _fields(kind, value):
        if isinstance(field, Record | Array | Table):
            _fill(field, getattr(place, f"_{name}"), item)
        else:
            setattr(place, f"_{name}", item)


def _read_back(kind: Type, place: Any, value: Any) -> None:
    """Write C's arrays and records to Python's."""
    if isinstance(kind, Array):
        value[...] = np.ctypeslib.as_array(place)[tuple(slice(0, size) for size in value.shape)]
    if isinstance(kind, Table):
        for at, item in enumerate(value):
            _read_back(kind.record, place[at], item)
    if isinstance(kind, Record):
        for name, inner, item in _fields(kind, value):
            made = getattr(place, f"_{name}")
            if kind.is_numpy and isinstance(inner, Scalar):
                value[name] = made
            else:
                _read_back(inner, made, item)


def _flat(kind: Type, value: Any) -> list[float]:
    """Return the numbers of a C value."""
    if isinstance(kind, Record):
        fields = kind.fields.items()
        return [number for name, inner in fields for number in _flat(inner, getattr(value, f"_{name}"))]
    if isinstance(kind, Array):
        return [float(number) for number in np.ctypeslib.as_array(value).ravel()]
    return [float(getattr(value, "value", value))]


class CFunction:
    """A generated function of a library of double, called with Python's values."""

    def __init__(self, library: ctypes.CDLL, function: Function) -> None:
        self.function = function
        self._call = getattr(library, function.c_name)
        self._layouts = [_layout(parameter.type) for parameter in function.parameters]
        self._outputs = [(kind, _layout(kind)) for _, kind in function.outputs]
        result = function.result
        self._call.restype = None if isinstance(result, Several) else _layout(result)

    def __call__(self, *values: Any, rotors: int = ROTOR_COUNT) -> list[float]:
        """Return the numbers of the results; arrays are written in place."""
        arguments: list[Any] = []
        held = []
        for parameter, layout, value in zip(self.function.parameters, self._layouts, values, strict=True):
            if isinstance(parameter.type, Record | Array):
                place = layout()
                _fill(parameter.type, place, value)
                if has_rotors(parameter.type):
                    place.rotors = rotors
                held.append((parameter.type, place, value))
                arguments.append(ctypes.byref(place))
            else:
                arguments.append(layout(value))
        arguments += [ctypes.c_int32(rotors)] if self.function.needs_rotors else []
        outputs = [(kind, layout()) for kind, layout in self._outputs]
        returned = self._call(*arguments, *(ctypes.byref(place) for _, place in outputs))
        for kind, place, value in held:
            _read_back(kind, place, value)
        if outputs:
            return [number for kind, place in outputs for number in _flat(kind, place)]
        return [] if returned is None else _flat(self.function.result, returned)


class Vectors:
    """Random and boundary values of a function's parameters; the same for the same seed."""

    def __init__(self, seed: int, edges: float = 0.1) -> None:
        """Take a share ``edges`` of the numbers from ``EDGES``."""
        self._random, self._edges = np.random.default_rng(seed), edges

    def value(self, kind: Type) -> Any:
        """Return a value: NumPy's floats, so that divisions by zero do not raise."""
        if isinstance(kind, Record):
            return self._record(kind)
        if isinstance(kind, Array | Table):
            return self._array(kind)
        if kind is INT:
            return int(self._random.integers(-3, 4))
        if kind is BOOL:
            return bool(self._random.integers(0, 2))
        if self._random.random() < self._edges:
            return np.float64(self._random.choice(EDGES))
        return np.float64(self._random.normal() * self._random.choice([1e-3, 1.0, 1.0, 30.0]))

    def _array(self, kind: Array | Table) -> Any:
        if isinstance(kind, Table):
            return np.array([self._record(kind.record) for _ in range(kind.size)])
        sizes = [ROTOR_COUNT if size == ROTORS else int(size) for size in kind.shape]
        return np.array([self.value(kind.item) for _ in range(math.prod(sizes))]).reshape(sizes)

    def _record(self, kind: Record) -> Any:
        values = tuple(self.value(inner) for inner in kind.fields.values())
        return np.array([values], dtype_of(kind.kind))[0] if kind.is_numpy else kind.kind(*values)

    def arguments(self, function: Function) -> list[Any]:
        """Return arguments of a function."""
        return [self.value(parameter.type) for parameter in function.parameters]


def flattened(value: Any) -> list[float]:
    """Return the numbers of nested tuples."""
    if isinstance(value, tuple):
        return [number for item in value for number in flattened(item)]
    if isinstance(value, np.ndarray):
        return [float(number) for number in value.ravel()]
    return [] if value is None else [float(value)]


def _outcome(function: Callable[..., Any], values: Sequence[Any]) -> FloatArray:
    """Return the numbers of the results, and of the arrays that were given, after a call with copies of them."""
    given = [_copied(value) for value in values]
    result = function(*given)
    numbers = result if isinstance(result, list) else flattened(result)
    arrays = [array.ravel() for value in given for array in _arrays(value)]
    return np.concatenate([np.array(numbers, dtype=np.float64), *arrays])


def _copied(value: Any) -> Any:
    if isinstance(value, tuple):
        return type(value)(*(_copied(item) for item in value))
    return value.copy() if isinstance(value, np.ndarray | np.void) else value


def _arrays(value: Any) -> list[FloatArray]:
    if isinstance(value, tuple):
        return [array for item in value for array in _arrays(item)]
    if isinstance(value, np.ndarray | np.void) and value.dtype.names:
        return [structured_to_unstructured(np.asarray(value))]
    return [value] if isinstance(value, np.ndarray) else []


def differences(
    c: CFunction, python: Callable[..., Any], vectors: Sequence[Sequence[Any]]
) -> list[Difference]:
    """Return the vectors for which C and Python differ in a bit; a NaN equals any NaN."""
    found = []
    with np.errstate(all="ignore"):
        for values in vectors:
            wanted, made = _outcome(python, values), _outcome(c, values)
            equal = (wanted.view(np.int64) == made.view(np.int64)) | (np.isnan(wanted) & np.isnan(made))
            if not equal.all():
                found.append(Difference(values, wanted.tolist(), made.tolist()))
    return found
