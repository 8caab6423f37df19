"""Dependencies of the compiled step of a user's law: source files, and constants of modules.

Numba compiles the functions that a step calls, and the constants that they use, into the kernel of the loops. The key
of a cached kernel covers both, wherever they come from: a module beside the law, another package, or a file that a
module reads when it is imported.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any, NamedTuple

from flightstack.core.kernels.cache import is_own

_COMPILERS = frozenset(("numba", "llvmlite", "numpy", "scipy"))
"""Packages that are not followed."""


class LawSources(NamedTuple):
    """Source files and constants that decide what a step computes."""

    files: list[Path]
    constants: list[str]


def law_sources(step: Callable[..., Any], types: Iterable[type]) -> LawSources:
    """Return files and constants of a compiled ``step`` and of its ``types``.

    In a package all of its files count, as the law may register more with the compiler than it names.
    """
    files, constants = set(_own_files(step.__module__)), set[str]()
    waiting: list[tuple[str, object]] = [("", step), *(("", kind) for kind in types)]
    seen = set[int]()
    while waiting:
        name, value = waiting.pop()
        value = getattr(value, "py_func", value)
        if isinstance(value, FunctionType | type):
            if id(value) in seen or not _is_followed(value.__module__):
                continue
            seen.add(id(value))
            files |= _file(value.__module__)
            if isinstance(value, FunctionType):
                waiting += _used(value)
        elif isinstance(value, tuple | list):
            waiting += [(f"{name}[{place}]", item) for place, item in enumerate(value)]
        elif (text := _constant(value)) is not None:
            constants.add(f"{name}={text}")
    return LawSources(sorted(files), sorted(constants))


def _used(function: FunctionType) -> Iterator[tuple[str, object]]:
    """Yield the values outside of a function that its code names, also through modules."""
    names = _names(function.__code__)
    for space in (function.__globals__, *_modules(function.__globals__, names)):
        yield from ((name, space[name]) for name in names if name in space)
    yield from (("default", value) for value in function.__defaults__ or ())
    cells = zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
    yield from ((name, cell.cell_contents) for name, cell in cells)


def _modules(space: dict[str, Any], names: set[str]) -> Iterator[dict[str, Any]]:
    """Yield the contents of the modules in ``space`` that code names, and of those that it names through them."""
    waiting, seen = [space], set[int]()
    while waiting:
        for value in (space[name] for space in [waiting.pop()] for name in names if name in space):
            if isinstance(value, ModuleType) and id(value) not in seen and _is_followed(value.__name__):
                seen.add(id(value))
                waiting.append(vars(value))
                yield vars(value)


def _names(code: CodeType) -> set[str]:
    inner = (const for const in code.co_consts if isinstance(const, CodeType))
    return set(code.co_names).union(*map(_names, inner))


def _constant(value: object) -> str | None:
    """Return the value of a number, text or array that a compiler takes as constant; None for anything else."""
    if isinstance(value, int | float | complex | str | bytes):
        return repr(value)
    if hasattr(value, "tobytes"):  # an array or a scalar of NumPy
        return f"{getattr(value, 'dtype', '')} {getattr(value, 'shape', '')} {value.tobytes().hex()}"
    return None


def _is_followed(module_name: str) -> bool:
    top = module_name.partition(".")[0]
    return not is_own(module_name) and top not in sys.stdlib_module_names and top not in _COMPILERS


def _file(module_name: str) -> set[Path]:
    file = getattr(sys.modules.get(module_name), "__file__", None)
    return set() if file is None else {Path(file)}


def _own_files(module_name: str) -> Iterable[Path]:
    """Return the module's file and, in a user's package, all files of its directory tree."""
    files = _file(module_name)
    if is_own(module_name) or not getattr(sys.modules.get(module_name), "__package__", None):
        return files
    return [path for file in files for path in file.parent.rglob("*.py")]
