"""NamedTuples declare the layout of records of NumPy."""

from typing import Annotated, NamedTuple

import numpy as np
import pytest

from flightstack.core.contract import FloatArray, Record, RecordArray
from flightstack.core.record_types import dtype_of


class Pair(NamedTuple):
    x: float
    y: float


class Part(NamedTuple):
    values: Annotated[FloatArray, 2, 3]
    numbers: Annotated[np.ndarray[tuple[int], np.dtype[np.int64]], 4]


class Whole(NamedTuple):
    time_s: float
    count: int
    is_new: bool
    row: Pair
    part: Part
    pair: Annotated[Record, Pair]
    pairs: Annotated[RecordArray, Pair, 3]


def test_dtype_has_numbers_arrays_rows_parts_and_records() -> None:
    pair = [("x", "<f8"), ("y", "<f8")]
    assert dtype_of(Whole) == np.dtype(
        [
            ("time_s", "<f8"), ("count", "<i8"), ("is_new", "?"), ("row", "<f8", (2,)), ("values", "<f8", (2, 3)),
            ("numbers", "<i8", (4,)), ("pair", pair), ("pairs", pair, (3,)),
        ]
    )  # fmt: skip


@pytest.mark.parametrize(
    "hint",
    [complex, str, FloatArray, Annotated[FloatArray, 0], Annotated[FloatArray, Pair, 2], Annotated[Record, Pair, 2],
     Annotated[RecordArray, Pair], Annotated[RecordArray, 3], Annotated[Record, 3]],
)  # fmt: skip
def test_other_annotation_is_refused(hint: object) -> None:
    class Kind(NamedTuple):
        field: hint  # type: ignore[valid-type]

    with pytest.raises(TypeError, match=r"Kind\.field: annotate it"):
        dtype_of(Kind)
