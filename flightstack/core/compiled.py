"""Compile numeric functions with Numba and cache them on disk.

``@compiled`` marks a plain function over floats, NamedTuples of floats and float64 arrays. It is compiled on
its first call and read from the cache afterwards. With ``NUMBA_DISABLE_JIT=1`` it is the plain function.

Python passes arrays to a compiled *kernel*, at a tenth of the cost of NamedTuples. Compiled functions pass NamedTuples
to each other, which keeps control laws readable.

Numba is imported at the first use of a kernel: a program that checks options or reads parameters does without it.
"""

from __future__ import annotations

import functools
import importlib
import os
from collections.abc import Callable
from functools import cached_property
from types import FunctionType
from typing import Any, TypeVar

from flightstack.core.kernels.cache import is_own

IS_DISABLED = os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")
"""True if compiled functions are plain Python, for debugging."""

F = TypeVar("F", bound=Callable[..., Any])

specialised: dict[tuple[Callable[..., Any], str], Callable[..., Any]] = {}
"""Kernels made by ``specialise`` in this process, by template and key."""


class Kernel:
    """A function that is compiled at its first use. Its other attributes are those of Numba's dispatcher."""

    def __init__(self, function: Callable[..., Any], modules: frozenset[str]) -> None:
        functools.update_wrapper(self, function)
        self.py_func = function
        self._modules = modules

    @cached_property
    def dispatcher(self) -> Any:
        """Numba's dispatcher of the function."""
        from flightstack.core.kernels.dispatcher import KernelDispatcher

        return KernelDispatcher(self.py_func, self._modules)

    def __call__(self, *arguments: Any) -> Any:
        """Call the function compiled for the types of the arguments."""
        return self.dispatcher(*arguments)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):  # such as the protocols that NumPy looks for
            raise AttributeError(name)
        return getattr(self.dispatcher, name)

    def __reduce__(self) -> str:
        return str(self.__name__)


def compiler_version() -> str:
    """Return the version of Numba."""
    return str(importlib.import_module("numba").__version__)


def renamed(function: FunctionType, suffix: str, names: dict[str, Any]) -> FunctionType:
    """Return a copy of ``function`` named ``function__suffix`` with the globals ``names``."""
    name = f"{function.__name__}__{suffix}"
    copy = FunctionType(function.__code__, names, name, function.__defaults__, function.__closure__)
    copy.__qualname__ = name
    copy.__module__ = function.__module__
    return copy


def _compile(function: F, modules: frozenset[str]) -> F:
    """Compile ``function`` with a cache keyed by the sources of ``modules``."""
    return function if IS_DISABLED else Kernel(function, modules)  # type: ignore[return-value]


def compiled(function: F) -> F:
    """Compile ``function`` with Numba on first use; IEEE division (no exception), no fast-math, no FMA.

    A function of another package is cached only as part of a kernel whose key includes its sources.
    """
    return _compile(function, frozenset({function.__module__}))


def plain(kernel: F) -> F:
    """Return ``kernel`` as a Python function, for calls that are not worth its compilation."""
    return getattr(kernel, "py_func", kernel)


def direct(kernel: Callable[..., Any], *examples: Any) -> Callable[..., Any]:
    """Return ``kernel`` compiled for the types of ``examples``, without Numba's type check at each call.

    The check costs 40 ns per array and 115 ns per record. Without it, arrays must be contiguous and have the examples'
    types; TypeError is raised for another item size only.
    """
    if isinstance(kernel, FunctionType):  # NUMBA_DISABLE_JIT
        return kernel
    assert isinstance(kernel, Kernel)
    return kernel.dispatcher.compiled_for(*examples)  # type: ignore[no-any-return]


def specialise(template: Callable[..., Any], key: str, **names: Any) -> Callable[..., Any]:
    """Compile a copy of ``template`` whose global ``names`` are bound to the given functions and types.

    This binds a kernel to a controller chosen at run time and keeps the disk cache, which closures would defeat because
    their contents differ between processes. ``key`` must identify the bound names: within a process the same template
    and key return the same kernel.
    """
    assert isinstance(template, FunctionType)
    known = specialised.get((template, key))
    if known is not None:
        return known
    copy = renamed(template, key, {**template.__globals__, **names})
    modules = {getattr(value, "__module__", None) or template.__module__ for value in names.values()}
    specialised[template, key] = _compile(copy, frozenset(filter(is_own, {copy.__module__, *modules})))
    return specialised[template, key]
