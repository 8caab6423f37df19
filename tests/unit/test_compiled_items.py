"""Items of arrays and records in compiled functions: the same as in Python, for all kinds of arrays and indices."""

from __future__ import annotations

import os
from types import FunctionType
from typing import Any

import numpy as np
import pytest
from numba import TypingError

from flightstack.core.array_items import local_zeros
from flightstack.core.compiled import compiled, renamed
from flightstack.core.contract import FloatArray

JIT = pytest.mark.skipif("NUMBA_DISABLE_JIT" in os.environ, reason="nothing is compiled")
_RNG = np.random.default_rng(3)


@compiled
def read(x: Any, i: Any, j: Any) -> float:
    return x[i, j] + x[i][j]


@compiled
def write(x: Any, i: Any, j: Any, value: Any) -> None:
    x[i, j] = value


@compiled
def sum_of_row(x: Any, i: int) -> float:
    total, row = 0.0, x[i]
    for k in range(len(row)):
        total += row[k] + row[k - len(row)]
    return total


@compiled
def ends_of_row(x: Any) -> tuple[float, float, float]:
    row = x[-1]
    return row[0], row[-1], row[2]


MATRICES = {
    "contiguous": _RNG.normal(size=(4, 3)),
    "columns first": np.asfortranarray(_RNG.normal(size=(4, 3))),
    "every other": _RNG.normal(size=(8, 6))[::2, ::2],
    "reversed": _RNG.normal(size=(4, 3))[::-1, ::-1],
    "float32": _RNG.normal(size=(4, 3)).astype(np.float32),
    "whole numbers": _RNG.integers(-5, 5, size=(4, 3)),
}


@pytest.mark.parametrize("name", MATRICES)
def test_items_of_a_matrix_are_those_of_python(name: str) -> None:
    matrix = MATRICES[name]
    for i in (0, 3, -1, -4, np.uint8(2), np.int32(-2)):
        assert sum_of_row(matrix, int(i)) == pytest.approx(2.0 * float(matrix[i].sum()), abs=1e-5)
        for j in (0, 2, -3, np.uint64(1)):
            assert read(matrix, i, j) == matrix[i, j] + matrix[i, j]
            copy, expected = matrix.copy(order="K"), matrix.copy()
            write(copy, i, j, 7)
            expected[i, j] = 7
            assert np.array_equal(copy, expected)
    assert ends_of_row(matrix) == (matrix[-1, 0], matrix[-1, -1], matrix[-1, 2])


@compiled
def planes(x: Any, i: int, j: int) -> float:
    plane = x[i]
    row = x[i, j]
    return plane[j, 1] + row[-1] + x[i, j, 0] + len(x) + len(plane) + len(row)


def test_rows_and_planes_of_an_array_of_three_dimensions() -> None:
    array = _RNG.normal(size=(2, 3, 4))
    for x in (array, array[:, ::-1], np.asfortranarray(array)):
        assert planes(x, 1, -1) == x[1, -1, 1] + x[1, -1, -1] + x[1, -1, 0] + 2 + 3 + 4


INNER = np.dtype([("weight", "f8"), ("place", "f8", (3,))])
OUTER = np.dtype([("count", "i8"), ("matrix", "f8", (2, 3)), ("inner", INNER, (2,)), ("one", INNER)])


@compiled
def use_record(records: Any, value: float) -> float:
    record = records[-1]
    record["count"] += 1
    record["matrix"][1, 2] = value
    record["inner"][1]["place"][0] = value + 1.0
    record["one"]["weight"] = value + 2.0
    total: float = record["inner"][1]["place"][0] + record["matrix"][-1][-1]
    for k in range(len(record["inner"])):
        total += record["inner"][k]["weight"]
    return total


def test_fields_of_records_are_read_and_written_in_place() -> None:
    records = np.zeros(2, OUTER)
    records["inner"]["weight"] = [[1.0, 2.0], [3.0, 4.0]]
    assert use_record(records, 5.0) == 6.0 + 5.0 + 3.0 + 4.0
    expected = np.zeros(2, OUTER)
    expected["inner"]["weight"] = [[1.0, 2.0], [3.0, 4.0]]
    expected[1]["count"], expected[1]["matrix"][1, 2] = 1, 5.0
    expected[1]["inner"][1]["place"][0], expected[1]["one"]["weight"] = 6.0, 7.0
    assert records.tobytes() == expected.tobytes()


@compiled
def filled(rows: FloatArray, fresh: bool) -> float:
    total = 0.0
    for k in range(len(rows)):
        local, matrix = local_zeros(3), local_zeros(2, 3)
        total += local[0] + matrix[1, 2]  # zero in each turn
        local[0] = matrix[1, 2] = rows[k]
        total += local[0] + matrix[-1, -1] + len(local) + len(matrix)
    return total


def test_local_zeros_are_zero_in_each_turn_of_a_loop() -> None:
    assert filled(np.array([1.0, 2.0, 4.0]), True) == 2.0 * 7.0 + 3.0 * 5.0


@JIT
def test_local_zeros_need_constant_sizes() -> None:
    @compiled
    def of_size(size: int) -> float:
        return local_zeros(size)[0]  # type: ignore[no-any-return]

    with pytest.raises(TypingError, match="local_zeros"):
        of_size(3)


@compiled
def third(row: FloatArray, at: int) -> float:
    return row[at + 2]


@compiled
def thirds(records: Any, row: FloatArray) -> float:
    return third(records[0]["inner"][0]["place"], 0) + third(row, 1) + third(row, 0)


@JIT
def test_a_called_function_is_compiled_once_for_all_constants_and_vectors() -> None:
    records = np.zeros(1, OUTER)
    records[0]["inner"][0]["place"][2] = 8.0
    assert thirds(records, np.arange(4.0)) == 8.0 + 3.0 + 2.0
    assert len(third.part.overloads) == 1  # type: ignore[attr-defined]


def _new_array(count: int) -> FloatArray:
    return np.zeros(count)


@JIT
def test_a_kernel_of_this_project_must_not_make_an_array() -> None:
    assert compiled(_new_array)(2).tolist() == [0.0, 0.0]  # one of a user may
    with pytest.raises(TypingError, match="Only accept returning of array passed into the function"):
        compiled(_own(_new_array))(2)


def _own(function: FunctionType) -> FunctionType:
    """Return a copy of a function that counts as one of this project."""
    copy = renamed(function, "own", globals())
    copy.__module__ = "flightstack.core.arrays"
    return copy


def _same(x: FloatArray) -> FloatArray:
    return x


def _with_first(x: FloatArray) -> tuple[FloatArray, float]:
    return x, x[0]


@JIT
@pytest.mark.parametrize("function", [_same, _with_first])
def test_a_kernel_of_this_project_must_not_return_its_array(function: FunctionType) -> None:
    """A caller that counts references would free it."""
    own = compiled(_own(function))
    with pytest.raises(TypingError, match=r"returns an array: a kernel of this project must not"):
        own(np.zeros(3))

    @compiled
    def law(count: int) -> float:
        own(np.zeros(count))
        return 0.0

    with pytest.raises(TypingError, match=r"returns an array: a kernel of this project must not"):
        law(3)
