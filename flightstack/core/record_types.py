"""Records of arrays that are declared as NamedTuples, of which NumPy, Numba and the generator of C take a layout."""

from __future__ import annotations

import typing
from typing import Any, get_args, get_type_hints

import numpy as np


def dtype_of(kind: type) -> np.dtype[np.void]:
    """Return the dtype of a record with the fields of the NamedTuple ``kind``; raise TypeError for another annotation.

    A field ``Annotated[FloatArray, N, …]`` is an array of that shape, of float64 or int64. A NamedTuple of floats is a
    row of them, which ``kind(*as_tuple(record[name], size))`` reads. The fields of a NamedTuple of arrays stand in the
    record themselves; in C they are a structure within that of the record.
    """
    return np.dtype(_fields(kind))


_NAMES = {**vars(typing), "np": np}
"""Names in the alias ``FloatArray``, which modules need not import."""


def _fields(kind: type) -> list[tuple[str, str, tuple[int, ...]]]:
    fields: list[tuple[str, str, tuple[int, ...]]] = []
    for name, hint in get_type_hints(kind, localns=_NAMES, include_extras=True).items():
        parts = tuple(get_type_hints(hint, localns=_NAMES).values()) if hasattr(hint, "_fields") else ()
        if parts and all(part is float for part in parts):
            fields.append((name, "f8", (len(parts),)))
        elif parts:
            fields += _fields(hint)
        else:
            fields.append(_array(kind, name, hint))
    return fields


def _array(kind: type, name: str, hint: Any) -> tuple[str, str, tuple[int, ...]]:
    base, *shape = get_args(hint) or (None,)
    item = np.dtype(get_args(get_args(base)[1])[0]).str[1:] if get_args(base) else ""
    if item not in ("f8", "i8") or not shape or not all(type(size) is int and size > 0 for size in shape):
        raise TypeError(f"{kind.__name__}.{name}: annotate it: Annotated[FloatArray, N]")
    return name, item, tuple(shape)
