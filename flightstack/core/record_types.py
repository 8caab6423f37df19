"""Records that are declared as NamedTuples, of which NumPy, Numba and the generator of C take a layout."""

from __future__ import annotations

import typing
from typing import Any, TypeAlias, get_args, get_type_hints

import numpy as np

from flightstack.core.contract import Record

_Field: TypeAlias = tuple[str, Any] | tuple[str, Any, tuple[int, ...]]


def dtype_of(kind: type) -> np.dtype[np.void]:
    """Return the dtype of a record with the fields of the NamedTuple ``kind``; raise TypeError for another annotation.

    A field ``float``, ``int`` or ``bool`` is a float64, an int64 or a byte, and ``Annotated[FloatArray, N, …]`` an
    array of floats of that shape. ``Annotated[Record, Kind]`` is a record in the record, ``Annotated[RecordArray,
    Kind, N]`` an array of records. A NamedTuple of floats is a row of them, which ``kind(*as_tuple(record[name],
    size))`` reads. The fields of a NamedTuple of arrays stand in the record themselves; in C they are a structure
    within that of the record.
    """
    return np.dtype(_fields(kind))


_NAMES = {**vars(typing), "np": np}
"""Names in the alias ``FloatArray``, which modules need not import."""


def _fields(kind: type) -> list[_Field]:
    fields: list[_Field] = []
    for name, hint in get_type_hints(kind, localns=_NAMES, include_extras=True).items():
        parts = tuple(get_type_hints(hint, localns=_NAMES).values()) if hasattr(hint, "_fields") else ()
        if parts and all(part is float for part in parts):
            fields.append((name, "f8", (len(parts),)))
        elif parts:
            fields += _fields(hint)
        else:
            fields.append(_field(kind, name, hint))
    return fields


_NUMBERS: dict[Any, str] = {float: "f8", int: "i8", bool: "?"}
_ITEMS: dict[Any, str] = {np.float64: "f8", np.int64: "i8"}


def _field(kind: type, name: str, hint: Any) -> _Field:
    if hint in _NUMBERS:
        return name, _NUMBERS[hint]
    base, *shape = get_args(hint) or (None,)
    inner = dtype_of(shape.pop(0)) if shape and hasattr(shape[0], "_fields") else None
    if base is Record and inner is not None and not shape:
        return name, inner
    items = get_args(get_args(base)[1])[0] if len(get_args(base)) > 1 else None
    item = inner if items is np.void else None if inner is not None else _ITEMS.get(items)
    if item is None or not shape or not all(type(size) is int and size > 0 for size in shape):
        raise TypeError(f"{kind.__name__}.{name}: annotate it: float, int, bool or Annotated[FloatArray, N]")
    return name, item, tuple(shape)
