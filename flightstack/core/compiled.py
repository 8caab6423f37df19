"""Compile numeric functions with Numba and cache them on disk.

``@compiled`` marks a plain function over floats, NamedTuples of floats and float64 arrays. It is compiled on
its first call and read from the cache afterwards. With ``NUMBA_DISABLE_JIT=1`` it is the plain function.

Python passes arrays to a compiled *kernel*, at a tenth of the cost of NamedTuples. Compiled functions pass NamedTuples
to each other, which keeps control laws readable.
"""

from __future__ import annotations

import gc
import importlib
from collections.abc import Callable
from functools import cached_property
from types import FunctionType
from typing import Any, ClassVar, TypeVar

import numba
from numba.core.caching import FunctionCache
from numba.core.compiler import Compiler
from numba.core.registry import CPUDispatcher
from numba.extending import register_jitable
from numba.np import linalg

from flightstack.core import portable_math
from flightstack.core.kernel_cache import directory, is_own

_TESTED_NUMBA = {(0, minor) for minor in range(60, 69)}
"""Versions whose compiler ``kernel_compiler`` extends; another compiles the same in a longer time."""

KernelCompiler: type[Compiler] = Compiler
PartCompiler: type[Compiler] = Compiler
KernelCache: type[FunctionCache] = FunctionCache
PartCache: type[FunctionCache] = FunctionCache
if numba.version_info.short in _TESTED_NUMBA:
    from flightstack.core.kernel_compiler import KernelCache, KernelCompiler, PartCache, PartCompiler


def _import_without_scipy() -> None:
    """Import Numba's array functions without their search for BLAS, which imports scipy.linalg and takes 0.2 s.

    A kernel that needs BLAS, such as a plug-in controller, repeats the search when it is compiled.
    """
    search, linalg.ensure_blas = linalg.ensure_blas, lambda: None
    try:
        importlib.import_module("numba.np.arraymath")
    finally:
        linalg.ensure_blas = search


_import_without_scipy()

F = TypeVar("F", bound=Callable[..., Any])

specialised: dict[tuple[Callable[..., Any], str], Callable[..., Any]] = {}
"""Kernels made by ``specialise`` in this process, by template and key."""

for _function in portable_math.FUNCTIONS:
    register_jitable(error_model="numpy", no_cfunc_wrapper=True, pipeline_class=PartCompiler)(_function)


class _Kernel(CPUDispatcher):  # type: ignore[misc]  # Numba has no types
    """A compiled function that Python calls. Compiled functions call its ``part``."""

    _OPTIONS: ClassVar = {"nopython": True, "error_model": "numpy", "no_cfunc_wrapper": True}

    def __init__(self, function: Callable[..., Any], modules: frozenset[str]) -> None:
        super().__init__(function, targetoptions=self._OPTIONS, pipeline_class=KernelCompiler)
        self._modules = modules
        self._enable_cache(self, KernelCache)

    def _enable_cache(self, dispatcher: CPUDispatcher, cache: type[FunctionCache]) -> None:
        if not is_own(self.py_func.__module__):
            return
        others = numba.config.CACHE_DIR
        numba.config.CACHE_DIR = str(directory(self._modules, numba.__version__))
        try:
            dispatcher._cache = cache(dispatcher.py_func)
        finally:
            numba.config.CACHE_DIR = others

    @cached_property
    def part(self) -> CPUDispatcher:
        """The same function without machine code and without the wrapper for Python."""
        copy = _renamed(self.py_func, "part", self.py_func.__globals__)
        options = {**self._OPTIONS, "no_cpython_wrapper": True}
        part = CPUDispatcher(copy, targetoptions=options, pipeline_class=PartCompiler)
        self._enable_cache(part, PartCache)  # under the name of the copy
        return part

    @property
    def _numba_type_(self) -> numba.types.Type:
        return numba.types.Dispatcher(self.part)

    def compile(self, sig: Any) -> Any:
        """Compile without garbage collection, which would take a tenth of the time."""
        collects = gc.isenabled()
        gc.disable()
        try:
            return super().compile(sig)
        finally:
            if collects:
                gc.enable()


def _renamed(function: FunctionType, suffix: str, names: dict[str, Any]) -> FunctionType:
    """Return a copy of ``function`` named ``function__suffix`` with the globals ``names``."""
    name = f"{function.__name__}__{suffix}"
    copy = FunctionType(function.__code__, names, name, function.__defaults__, function.__closure__)
    copy.__qualname__ = name
    copy.__module__ = function.__module__
    return copy


def _compile(function: F, modules: frozenset[str]) -> F:
    """Compile ``function`` with a cache keyed by the sources of ``modules``."""
    if numba.config.DISABLE_JIT:
        return function
    return _Kernel(function, modules)


def compiled(function: F) -> F:
    """Compile ``function`` with Numba on first use; IEEE division (no exception), no fast-math, no FMA.

    A function of another package is cached only as part of a kernel whose key includes its sources.
    """
    return _compile(function, frozenset({function.__module__}))


def direct(kernel: Callable[..., Any], *examples: Any) -> Callable[..., Any]:
    """Return ``kernel`` compiled for the types of ``examples``, without Numba's type check at each call.

    The check costs 40 ns per array and 115 ns per record. Without it, arrays must be contiguous and have the examples'
    types; TypeError is raised for another item size only.
    """
    if isinstance(kernel, FunctionType):  # NUMBA_DISABLE_JIT
        return kernel
    types = tuple(numba.typeof(example) for example in examples)
    kernel.compile(types)  # type: ignore[attr-defined]
    return kernel.get_overload(types)  # type: ignore[attr-defined,no-any-return]


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
    copy = _renamed(template, key, {**template.__globals__, **names})
    modules = {getattr(value, "__module__", None) or template.__module__ for value in names.values()}
    specialised[template, key] = _compile(copy, frozenset(filter(is_own, {copy.__module__, *modules})))
    return specialised[template, key]
