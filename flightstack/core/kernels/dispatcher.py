"""Numba's dispatchers of kernels. Imported by ``compiled`` at the first use of a kernel."""

from __future__ import annotations

import gc
from collections.abc import Callable
from contextlib import suppress
from functools import cached_property
from types import FunctionType
from typing import Any

import numba
import numpy as np
from numba.core.caching import FunctionCache
from numba.core.compiler import Compiler
from numba.core.errors import NumbaNotImplementedError, NumbaValueError
from numba.core.registry import CPUDispatcher
from numpy.typing import NDArray

from flightstack.core.compiled import renamed
from flightstack.core.kernels.cache import directory, is_own

_TESTED_NUMBA = {(0, minor) for minor in range(60, 69)}
"""Versions of Numba that the module ``compiler`` extends; another compiles the same in a longer time."""

KernelCompiler: type[Compiler] = Compiler
PartDispatcher: type[CPUDispatcher] = CPUDispatcher
PartCompiler: type[Compiler] = Compiler
KernelCache: type[FunctionCache] = FunctionCache
PartCache: type[FunctionCache] = FunctionCache
if numba.version_info.short in _TESTED_NUMBA:
    from flightstack.core.kernels.compiler import (
        KernelCache,
        KernelCompiler,
        PartCache,
        PartCompiler,
        PartDispatcher,
    )
else:
    from flightstack.core.kernels.intrinsics import register

    register(PartCompiler)  # type: ignore[arg-type]  # of no type


_NUMBERS = (bool, float)


def _key_of(example: Any) -> Any:
    """Return what Numba derives the type of ``example`` from, or the type: that of records takes it a millisecond."""
    kind = type(example)
    if kind is np.ndarray:
        dtype, flags = example.dtype, example.flags
        return (
            dtype, dtype.isalignedstruct, example.ndim,
            flags.c_contiguous, flags.f_contiguous, flags.writeable, flags.aligned,
        )  # fmt: skip
    if isinstance(example, tuple):
        return (kind, *map(_key_of, example))
    return kind if kind in _NUMBERS else numba.typeof(example)


_types: dict[Any, numba.types.Type] = {}
"""Types by ``_key_of``."""


def _type_of(example: Any, key: Any) -> numba.types.Type:
    """Return Numba's type of ``example``, whose key is ``key``."""
    found = _types.get(key)
    if found is None:
        if isinstance(example, tuple):
            items = [_type_of(item, of_item) for item, of_item in zip(example, key[1:], strict=True)]
            found = numba.types.BaseTuple.from_types(items, type(example))
        elif type(example) is np.ndarray:
            found = _type_of_array(example)
        else:
            found = numba.typeof(example)
        _types[key] = found
    return found


def _type_of_array(example: NDArray[Any]) -> numba.types.Type:
    """Return Numba's type of an array; ``numba.typeof`` imports ``numpy.ma`` for it, which takes 10 ms."""
    try:
        item = numba.from_dtype(example.dtype)
    except NumbaNotImplementedError:  # it raises another error, with the reason
        return numba.typeof(example)
    flags = example.flags
    layout = "C" if flags.c_contiguous else "F" if flags.f_contiguous else "A"
    return numba.types.Array(item, example.ndim, layout, readonly=not flags.writeable)


def _enable_cache(dispatcher: CPUDispatcher, modules: frozenset[str], cache: type[FunctionCache]) -> None:
    """Keep the results of a dispatcher in the directory for these modules, unless it is a function of a user."""
    folder = directory(modules, numba.__version__) if is_own(dispatcher.py_func.__module__) else None
    if folder is None:
        return
    others = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(folder)
    try:
        dispatcher._cache = cache(dispatcher.py_func)
    finally:
        numba.config.CACHE_DIR = others


def _options(function: Callable[..., Any]) -> dict[str, bool | str]:
    """Return Numba's options. Kernels of this project allocate no memory, so that no references need be counted."""
    return {
        "nopython": True,
        "error_model": "numpy",
        "no_cfunc_wrapper": True,
        "_nrt": not is_own(function.__module__),
    }


class KernelDispatcher(CPUDispatcher):  # type: ignore[misc]  # Numba has no types
    """A compiled function that Python calls. Compiled functions call its ``part``."""

    def __init__(self, function: Callable[..., Any], modules: frozenset[str]) -> None:
        super().__init__(function, targetoptions=_options(function), pipeline_class=KernelCompiler)
        self._modules = modules
        self._results: dict[Any, Any] = {}  # by the keys of the arguments
        _enable_cache(self, modules, KernelCache)

    @cached_property
    def part(self) -> CPUDispatcher:
        """The same function without machine code and without the wrapper for Python."""
        assert isinstance(self.py_func, FunctionType)
        copy = renamed(self.py_func, "part", self.py_func.__globals__)
        options = {**_options(copy), "no_cpython_wrapper": True}
        part = PartDispatcher(copy, targetoptions=options, pipeline_class=PartCompiler)
        _enable_cache(part, self._modules, PartCache)  # under the name of the copy
        return part

    def part_result(self, *kinds: Any) -> Any:
        """Compile the part for Numba's types ``kinds``, or read it from the cache; return the type of its result."""
        _template, _signature, found, _ = self.part.get_call_template(kinds, {})
        return self.part.overloads[tuple(found)].signature.return_type

    @property
    def _numba_type_(self) -> numba.types.Type:
        return numba.types.Dispatcher(self.part)

    def typeof_pyval(self, val: Any) -> numba.types.Type:
        """Return the type of an argument of a call that is the first one of its types."""
        if type(val) is np.ndarray and not val.dtype.hasobject:
            with suppress(
                NumbaValueError
            ):  # of an array that Numba does not know, which it reports with its place
                return _type_of(val, _key_of(val))
        return super().typeof_pyval(val)

    def compile(self, sig: Any) -> Any:
        """Compile without garbage collection, which would take a tenth of the time."""
        collects = gc.isenabled()
        gc.disable()
        try:
            return super().compile(sig)
        finally:
            if collects:
                gc.enable()

    def result_for(self, *examples: Any) -> Any:
        """Return Numba's result of the compilation for the types of ``examples``."""
        keys = tuple(map(_key_of, examples))
        found = self._results.get(keys)
        if found is None:
            types = tuple(map(_type_of, examples, keys))
            if types not in self.overloads:
                self.compile(types)
            found = self._results[keys] = self.overloads[types]
        return found

    def compiled_for(self, *examples: Any) -> Callable[..., Any]:
        """Return the compiled function for the types of ``examples``, which it does not check."""
        return self.result_for(*examples).entry_point  # type: ignore[no-any-return]
