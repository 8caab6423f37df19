"""Copies between arrays, tuples and bytes. In compiled functions they are LLVM code: see ``kernels.intrinsics``."""

from __future__ import annotations

from typing import Any

import numpy as np

from flightstack.core.contract import ByteArray, FloatArray


def as_tuple(array: Any, count: int) -> Any:
    """Return the first ``count`` (a constant) values of a float64 array as a tuple."""
    return tuple(array[:count].tolist())


def store(out: np.ndarray[Any, np.dtype[np.float64]], values: Any) -> None:
    """Write a flat tuple or an array of floats to the start of ``out``.

    ``out[:] = values`` takes Numba two seconds to compile, for the message about shapes that do not match.
    """
    for index in range(len(values)):
        out[index] = values[index]


def put(out: ByteArray, at: int, number: np.generic) -> None:
    """Write the bytes of a NumPy number from ``out[at]`` on, in the order of the machine."""
    out[at : at + number.itemsize] = np.frombuffer(number.tobytes(), np.uint8)


def local_zeros(*shape: int) -> FloatArray:
    """Return an array of zeros for use in the calling function alone, which must not return it.

    Sizes are constants. Compiled code has it on the stack: no memory is allocated.
    """
    return np.zeros(shape)
