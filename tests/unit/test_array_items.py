"""Copies between arrays, tuples and bytes in compiled functions, and their use in kernels."""

from __future__ import annotations

import ast
import os
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba.core.errors import TypingError

from flightstack.core import compiled as module
from flightstack.core.array_items import as_tuple, put, store
from flightstack.core.compiled import compiled
from flightstack.core.contract import ByteArray

JIT = pytest.mark.skipif("NUMBA_DISABLE_JIT" in os.environ, reason="nothing is compiled")
TEMPLATES = ("inner_kernel", "_advance", "_slope_at")
"""Functions that ``specialise`` compiles."""


def test_arrays_become_tuples_and_tuples_arrays() -> None:
    @compiled
    def swapped(x: np.ndarray, out: np.ndarray) -> None:
        a, b, c = as_tuple(x, 3)
        store(out, (c, b, a))

    out = np.zeros(4)
    swapped(np.array([1.0, 2.0, 3.0, 4.0]), out)
    assert out.tolist() == [3.0, 2.0, 1.0, 0.0]
    assert as_tuple(np.array([1.0, 2.0, 3.0]), 2) == (1.0, 2.0)


def test_store_converts_and_follows_strides() -> None:
    @compiled
    def fill(out: np.ndarray, values: np.ndarray) -> None:  # type: ignore[type-arg]
        store(out, (1, 2.5, True))
        store(out[3:], values[::2])

    out = np.zeros(10)[::2]
    fill(out, np.array([4.0, 9.0, 5.0]))
    assert out.tolist() == [1.0, 2.5, 1.0, 4.0, 5.0]


@compiled
def put_numbers(out: ByteArray, value: float, number: int) -> None:
    put(out, 1, np.float32(value))
    put(out, 5, np.float64(value))
    put(out, 13, np.uint16(number))
    put(out, 15, np.int64(number))


def test_put_writes_the_bytes_of_a_number_at_any_place() -> None:
    out = np.full(24, 0xEE, np.uint8)
    put_numbers(out, -1.25e-3, 513)
    assert out.tobytes() == b"\xee" + struct.pack("=fdHq", -1.25e-3, -1.25e-3, 513, 513) + b"\xee"


READ_ONLY_BYTES = np.zeros(9, np.uint8)
READ_ONLY_BYTES.flags.writeable = False


@JIT
@pytest.mark.parametrize(
    "out", [np.zeros(9), np.zeros((3, 9), np.uint8), READ_ONLY_BYTES], ids=["floats", "matrix", "read-only"]
)
def test_put_is_refused_for(out: Any) -> None:
    @compiled
    def write(out: Any) -> None:
        put(out, 0, np.float64(1.0))

    with pytest.raises(TypingError, match="put"):
        write(out)


READ_ONLY = np.zeros(3)
READ_ONLY.flags.writeable = False
NOT_STORED: dict[str, tuple[Any, Any]] = {
    "a matrix": (np.zeros(3), np.zeros((3, 2))),
    "to a matrix": (np.zeros((3, 2)), np.zeros(3)),
    "a tuple to a matrix": (np.zeros((3, 2)), (1.0, 2.0)),
    "to a read-only array": (READ_ONLY, (1.0, 2.0)),
    "complex numbers": (np.zeros(3), np.zeros(3, complex)),
    "a tuple of tuples": (np.zeros(3), ((1.0, 2.0), 3.0)),
}


@JIT
@pytest.mark.parametrize("name", NOT_STORED)
def test_store_is_refused_for(name: str) -> None:
    @compiled
    def write(out: np.ndarray, values: Any) -> None:  # type: ignore[type-arg]
        store(out, values)

    with pytest.raises(TypingError, match="store"):
        write(*NOT_STORED[name])


@JIT
def test_as_tuple_is_refused_for_a_matrix() -> None:
    @compiled
    def read(matrix: np.ndarray) -> tuple[float, float]:  # type: ignore[type-arg]
        return as_tuple(matrix, 2)  # type: ignore[no-any-return]

    with pytest.raises(TypingError, match="as_tuple"):
        read(np.zeros((2, 2)))


def assigned_slices(path: Path) -> list[str]:
    """Slices to which compiled functions of a source file assign more than a constant."""
    return [
        f"{path.name}:{node.lineno}"
        for function in ast.parse(path.read_text()).body
        if isinstance(function, ast.FunctionDef)
        and (function.name in TEMPLATES or any(map(is_compiled, function.decorator_list)))
        for node in ast.walk(function)
        if isinstance(node, ast.Assign) and not isinstance(node.value, ast.Constant)
        for target in node.targets
        if isinstance(target, ast.Subscript) and isinstance(target.slice, ast.Slice)
    ]


def is_compiled(decorator: ast.expr) -> bool:
    return isinstance(decorator, ast.Name) and decorator.id == "compiled"


def test_no_kernel_assigns_an_array_to_a_slice() -> None:
    """One such statement takes two seconds to compile; see ``store``."""
    top = Path(module.__file__).parents[2]
    sources = [path for package in ("flightstack", "sim_bridge") for path in (top / package).rglob("*.py")]
    assert [found for path in sources for found in assigned_slices(path)] == []
