"""The estimator in generated C: the bits of Python in double, and how far single precision is from it."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.lib.recfunctions import structured_to_unstructured as numbers

from flightstack.core.contract import RecordArray
from tests.support.filter_events import NUMBERS, InC, InPython
from tests.support.filter_flights import STREAMS

COMPARED_EVERY = 200


def unequal(python: RecordArray, c: RecordArray) -> list[str]:
    """Return the fields of the memories that differ in a bit; a NaN equals any NaN."""
    return [
        name
        for name in python.dtype.names or ()
        if not np.array_equal(numbers(python[[name]]), numbers(c[[name]]), equal_nan=True)
        or not np.array_equal(np.signbit(numbers(python[[name]])), np.signbit(numbers(c[[name]])))
    ]


@pytest.mark.parametrize("name", STREAMS)
def test_filter_in_c_has_the_bits_of_python(name: str) -> None:
    python, c = InPython(), InC()
    for number, event in enumerate(STREAMS[name]()):
        python.take(event)
        c.take(event)
        if number % COMPARED_EVERY == 0:
            assert not unequal(python.memory, c.memory), f"event {number}"
    assert python.memory[0]["flags"]["aligned"] == 1
    assert not unequal(python.memory, c.memory)
    assert np.array_equal(python.summary, c.summary)
    assert np.array_equal(python.numbers, c.numbers, equal_nan=True)


def test_single_precision_follows_double_within_centimetres() -> None:
    double, single = InC(), InC("float")
    apart, settled, aligned_s = np.zeros(13), np.zeros(13), np.inf
    for event in STREAMS["as flown"]():
        double.take(event)
        if event.kind != NUMBERS:
            single.take(event)
        memory = double.filter.memory[0]
        time_s = float(memory["last_imu_s"])
        if memory["flags"]["aligned"] == 1:
            aligned_s = min(aligned_s, time_s)
        difference = np.abs(memory["state"] - single.filter.memory[0]["state"])
        apart = np.maximum(apart, difference)
        if time_s > aligned_s + 2.0:
            settled = np.maximum(settled, difference)
    assert time_s > aligned_s + 4.0
    assert max(apart[:3]) < 0.04  # m; measured: 0.0195, in the step that fuses the first height
    assert max(apart[3:6]) < 0.01  # m/s; measured: 0.0038
    assert (
        max(apart[6:10]) < 1e-2
    )  # measured: 4.3e-3, while one fuses the first fields a step later than the other
    assert max(settled[6:10]) < 1e-3  # measured: 2.4e-4
