"""Comparison stage by stage: each output of a target with Python's, computed from the target's own inputs of the stage.

No log is needed for it, and no rounding accumulates, so that its limits are a thousand times closer than those of a
comparison with a log.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import pairwise

import numpy as np

from flightstack.core.contract import FloatArray
from flightstack.firmware.c_loops import OUTPUT_SIZE, LoopsSetup
from flightstack.firmware.stages import StageModel
from gcs_cli.pil.replay import Recording

STAGEWISE = "stages"
"""Name of the expected outputs in a pair of flights."""


def expected_outputs(
    record: Recording, outputs: FloatArray, setup: LoopsSetup, numbers: Mapping[str, float]
) -> FloatArray:
    """Return the outputs (n, 32) that Python's stages compute for a target with these ``outputs`` (n, 32).

    ``numbers`` are the parameters at the start; those that Python's loops do not have are left out.
    """
    model = StageModel(setup)
    _set(model, numbers.items())
    expected = np.empty((len(outputs), OUTPUT_SIZE))
    inputs, flags = np.ascontiguousarray(record.inputs), np.ascontiguousarray(record.flags, np.int64)
    for first, last in _stretches(record):
        _set(model, record.changes.get(first, ()))
        steps = slice(first, last)
        expected[steps] = model.expected(inputs[steps], flags[steps], outputs[steps])
    return expected


def _stretches(record: Recording) -> Iterator[tuple[int, int]]:
    """Yield first and end of each stretch without a change of parameters."""
    edges = sorted({0, len(record.flags), *record.changes})
    yield from pairwise(edges)


def _set(model: StageModel, numbers: Iterable[tuple[str, float]]) -> None:
    for name, value in numbers:
        if name in model.parameters:
            model.set_parameter(name, value)
