"""Compile the numeric core with Numba, cached on disk, and the same in plain Python for debugging.

``@compiled`` marks a plain function over floats, NamedTuples of floats and float64 arrays. It is compiled on
its first call and read from the cache afterwards. With ``NUMBA_DISABLE_JIT=1`` it is the plain function.

Arrays are the interface of a compiled *kernel* towards Python, because passing them costs a tenth of passing
NamedTuples. Inside, functions pass NamedTuples, so that a control law reads as in a textbook.
"""

from __future__ import annotations

import importlib
import os
from collections.abc import Callable
from types import FunctionType
from typing import Any, TypeVar

import numba
import numpy as np
from numba.extending import overload, register_jitable
from numba.np import linalg
from numba.np.unsafe.ndarray import to_fixed_tuple

from flightstack.core import portable_math
from flightstack.core.kernel_cache import directory, is_own


def _import_without_scipy() -> None:
    """Import Numba's array functions without their early search for a BLAS, which imports scipy.linalg: 0.2 s.

    A kernel that needs BLAS, of a user's controller say, makes the same search when it is compiled.
    """
    search, linalg.ensure_blas = linalg.ensure_blas, lambda: None
    try:
        importlib.import_module("numba.np.arraymath")
    finally:
        linalg.ensure_blas = search


_import_without_scipy()

F = TypeVar("F", bound=Callable[..., Any])

specialised: dict[tuple[Callable[..., Any], str], Callable[..., Any]] = {}
"""The kernels that ``specialise`` made in this process, by template and key."""

for _function in portable_math.FUNCTIONS:
    register_jitable(error_model="numpy")(_function)


def _compile(function: F, modules: frozenset[str]) -> F:
    """Compile ``function``, cached among the kernels that are made from ``modules``."""
    cache = is_own(function.__module__)
    if cache and "NUMBA_CACHE_DIR" not in os.environ:  # Numba reads the setting here, for each function
        numba.config.CACHE_DIR = str(directory(modules, numba.__version__))
    return numba.njit(cache=cache, error_model="numpy")(function)  # type: ignore[no-any-return]


def compiled(function: F) -> F:
    """Compile ``function`` with Numba on first use; IEEE division (no exception), no fast-math, no FMA.

    A function of another package is not cached by itself, only within a kernel whose key names its sources.
    """
    return _compile(function, frozenset({function.__module__}))


def direct(kernel: Callable[..., Any], *examples: Any) -> Callable[..., Any]:
    """Return ``kernel`` for arguments of the types of ``examples``, without Numba's look at the types in each call.

    That look costs 40 ns an array and 115 ns a record. The compiled code takes what it gets for what it was made for:
    arrays must be contiguous and of the examples' types (TypeError for another size of the numbers only).
    """
    if isinstance(kernel, FunctionType):  # NUMBA_DISABLE_JIT
        return kernel
    types = tuple(numba.typeof(example) for example in examples)
    kernel.compile(types)  # type: ignore[attr-defined]
    return kernel.get_overload(types)  # type: ignore[attr-defined,no-any-return]


def specialise(template: Callable[..., Any], key: str, **names: Any) -> Callable[..., Any]:
    """Compile a copy of ``template`` whose global ``names`` are bound to the given functions and types.

    This is how a kernel is joined with a controller chosen at run time without losing the disk cache, which
    closures would (their contents differ from process to process). ``key`` must identify what is bound: within
    a process the same template and key are the same kernel, read from the disk once.
    """
    assert isinstance(template, FunctionType)
    known = specialised.get((template, key))
    if known is not None:
        return known
    copy = FunctionType(template.__code__, {**template.__globals__, **names}, f"{template.__name__}__{key}")
    copy.__qualname__ = copy.__name__
    copy.__module__ = template.__module__
    modules = {getattr(value, "__module__", None) or template.__module__ for value in names.values()}
    specialised[template, key] = _compile(copy, frozenset(filter(is_own, {copy.__module__, *modules})))
    return specialised[template, key]


def as_tuple(array: Any, count: int) -> Any:
    """Return the first ``count`` (a constant) values of a float64 array as a tuple."""
    return tuple(array[:count].tolist())


@overload(as_tuple, prefer_literal=True)
def _as_tuple(array, count):  # type: ignore[no-untyped-def]  # Numba compares the two signatures, annotations too
    if isinstance(count, numba.types.Literal):
        return lambda array, count: to_fixed_tuple(array, count)  # noqa: PLW0108  # its names are compared too
    return None


@compiled
def store(out: np.ndarray[Any, np.dtype[np.float64]], values: Any) -> None:
    """Write a flat tuple or an array of floats to the start of ``out``.

    An array is written item by item because ``out[:] = values`` takes Numba two seconds to compile: it comes with
    the sentence about shapes that do not match.
    """
    for index in range(len(values)):
        out[index] = values[index]
