"""The complete state of an estimator as bytes, from which another one continues exactly."""

from __future__ import annotations

import struct
from zlib import crc32

import numpy as np

from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.estimation.estimator import Estimator
from flightstack.estimation.estimator_params import EstimatorParams
from flightstack.estimation.memory import MEMORY

ESTIMATOR_START = "estimator_start"
"""Key of the snapshot at the start of a log, an information message."""
_HEAD = struct.Struct("<I?3d")
_LAYOUT = crc32(repr((MEMORY.descr, EstimatorParams._fields)).encode())
"""Names a layout of the memory: that of another version of the filter is refused."""
_NOWHERE = GeoPoint(0.0, 0.0, 0.0)


def snapshot(estimator: Estimator) -> bytes:
    """Return the estimator's state."""
    frame = estimator.frame
    origin = _NOWHERE if frame is None else frame.origin
    return _HEAD.pack(_LAYOUT, frame is not None, *origin) + estimator.memory.tobytes()


def restored(data: bytes) -> Estimator | None:
    """Return an estimator with the state of a snapshot; None for that of another version of the filter."""
    if len(data) != _HEAD.size + MEMORY.itemsize:
        return None
    layout, has_frame, *origin = _HEAD.unpack_from(data)
    if layout != _LAYOUT:
        return None
    memory = np.frombuffer(data, MEMORY, 1, _HEAD.size)
    estimator = Estimator(EstimatorParams(*memory["params"][0].tolist()))
    estimator.memory[:] = memory
    estimator.frame = LocalFrame(GeoPoint(*origin)) if has_frame else None
    return estimator
