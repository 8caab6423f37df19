"""Types of the subset, and their names in C."""

from __future__ import annotations

import ast
import enum
import functools
import sys
import typing
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ForwardRef, TypeAlias, get_args, get_origin

import numpy as np

from flightstack.core import contract
from flightstack.firmware.generator.text import snake_case

ROTORS = "rotors"
"""Symbolic size of an array: the rotors of the vehicle, at most ``MAX_ROTORS``."""


class Scalar(enum.Enum):
    """A number; the value is C's type."""

    REAL = "fs_real"
    INT = "int32_t"
    BOOL = "bool"
    WHOLE = "whole"
    """An integer that C keeps as ``fs_real``, of ``math.floor``: it has no negative zero."""
    NOTHING = "void"


REAL, INT, BOOL, WHOLE, NOTHING = Scalar.REAL, Scalar.INT, Scalar.BOOL, Scalar.WHOLE, Scalar.NOTHING


@dataclass(frozen=True)
class Record:
    """A NamedTuple, or the record of NumPy that it declares, whose fields are written in place."""

    kind: type
    is_numpy: bool = False

    @property
    def fields(self) -> dict[str, Type]:
        """Types of the fields; raise TypeError for one outside the subset."""
        return _fields(self.kind)

    def part_with(self, name: str) -> str | None:
        """Return the field with the part of a NumPy record that has the field ``name``, or None."""
        for part, inner in self.fields.items():
            if has_arrays(inner) and not is_numpy(inner) and name in inner.fields:  # type: ignore[union-attr]
                return part
        return None


@dataclass(frozen=True)
class Single:
    """A NumPy array of one record."""

    record: Record


@dataclass(frozen=True)
class Table:
    """A NumPy array of records, a field of a structure."""

    record: Record
    size: int


@dataclass(frozen=True)
class Several:
    """The results of a function that returns a tuple."""

    items: tuple[Type, ...]


@dataclass(frozen=True)
class Array:
    """An array of floats or integers; a size is a number, ``ROTORS``, or empty if unknown."""

    shape: tuple[int | str, ...]
    item: Scalar = Scalar.REAL


Type: TypeAlias = Scalar | Record | Single | Table | Several | Array


@functools.cache
def _fields(kind: type) -> dict[str, Type]:
    names = vars(sys.modules[kind.__module__])
    return {name: _resolved(text, names) for name, text in kind.__annotations__.items()}


_PLAIN: dict[Any, Type] = {float: REAL, int: INT, bool: BOOL, None: NOTHING, type(None): NOTHING}


def is_record(kind: Any) -> bool:
    """Return True for a NamedTuple class."""
    return isinstance(kind, type) and issubclass(kind, tuple) and hasattr(kind, "_fields")


def is_numpy(kind: Type) -> bool:
    """Return True for a record of NumPy."""
    return isinstance(kind, Record) and kind.is_numpy


def has_rotors(kind: Type) -> bool:
    """Return True for a record with arrays of one item per rotor: its structure has their number."""
    return isinstance(kind, Record) and any(
        isinstance(field, Array) and ROTORS in field.shape for field in kind.fields.values()
    )


def has_arrays(kind: Type) -> bool:
    """Return True for a record with an array, or with a record that has one: it is written in place."""
    return is_numpy(kind) or (
        isinstance(kind, Record)
        and any(isinstance(field, Array | Table) or has_arrays(field) for field in kind.fields.values())
    )


def prefix_of(module: str) -> str:
    """Return the prefix of the C names of a module: ``fs``, or the top-level package of a user."""
    top = module.partition(".")[0]
    return "fs" if top == "flightstack" else snake_case(top)


def record_name(kind: type) -> str:
    """Return the C name of a NamedTuple's structure."""
    return f"{prefix_of(kind.__module__)}_{snake_case(kind.__name__)}"


def c_type(kind: Type) -> str:
    """Return the C type of a number, a record, or an array's items."""
    if isinstance(kind, Array):
        return c_type(kind.item)
    if kind is WHOLE:
        return REAL.value
    if isinstance(kind, Single | Table):
        kind = kind.record
    return record_name(kind.kind) if isinstance(kind, Record) else kind.value  # type: ignore[union-attr]


def c_size(size: int | str) -> str:
    """Return the size of an array in C."""
    return "FS_MAX_ROTORS" if size == ROTORS else str(size)


def annotated(node: ast.expr, names: Mapping[str, Any]) -> Type:
    """Return the type of an annotation in the source; raise TypeError outside the subset."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        node = ast.parse(node.value, mode="eval").body
    try:
        with_typing = {**vars(typing), **names}
        return _resolved(eval(compile(ast.Expression(node), "<annotation>", "eval"), with_typing), names)
    except (NameError, AttributeError) as error:
        raise TypeError(str(error)) from error


_ITEMS: dict[Any, Scalar] = {np.float64: REAL, np.int64: INT}


def _item(base: Any, names: Mapping[str, Any]) -> Scalar | None:
    """Return the type of the items of ``np.ndarray[…, np.dtype[np.float64]]`` or ``[np.int64]``, else None."""
    if isinstance(base, ForwardRef):
        base = base.__forward_arg__
    if isinstance(base, str):
        base = eval(base, {**vars(typing), "np": np, **names})
    dtype = get_args(base)[-1:]
    return _ITEMS.get(get_args(dtype[0])[0]) if dtype and get_args(dtype[0]) else None


def _annotated_type(value: Any, names: Mapping[str, Any]) -> Type | None:
    """Return the type of ``Annotated[FloatArray, N]``, or of NumPy records: ``Annotated[Record, Kind]``; else None."""
    base, *shape = get_args(value)
    if shape and is_record(shape[0]):
        record, *sizes = Record(shape[0], is_numpy=True), *shape[1:]
        if not sizes:
            return record if base is contract.Record else Single(record)
        is_size = len(sizes) == 1 and type(sizes[0]) is int and sizes[0] > 0
        return Table(record, sizes[0]) if is_size and base is not contract.Record else None
    item = _item(base, names)
    is_shape = all(size == ROTORS or (isinstance(size, int) and size > 0) for size in shape)
    return Array(tuple(shape), item) if item is not None and is_shape else None


def _resolved(value: Any, names: Mapping[str, Any]) -> Type:
    if value == contract.FloatArray:
        return Array(("",))
    if isinstance(value, ForwardRef):
        value = value.__forward_arg__
    if isinstance(value, str):
        return annotated(ast.parse(value, mode="eval").body, names)
    if is_record(value):
        return Record(value)
    if get_origin(value) is tuple:
        return Several(tuple(_resolved(item, names) for item in get_args(value)))
    if get_origin(value) is typing.Annotated:
        made = _annotated_type(value, names)
        if made is not None:
            return made
    known = _PLAIN.get(value) if isinstance(value, type | None) else None
    if known is None:
        raise TypeError(f"{value!r} has no C type")
    return known
