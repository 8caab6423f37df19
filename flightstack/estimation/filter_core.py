"""Where the filter runs: in this process, compiled from Python, or elsewhere behind the same interface."""

from __future__ import annotations

from functools import partial
from typing import Any, Protocol

import numpy as np

from flightstack.core.compiled import direct, plain
from flightstack.core.contract import FloatArray, RecordArray
from flightstack.estimation.delayed_filter import field_kernel, imu_kernel, push_kernel
from flightstack.estimation.estimator_params import EstimatorParams
from flightstack.estimation.imu_track import IMU_SIZE
from flightstack.estimation.memory import MEMORY, start_memory
from flightstack.estimation.rings import MAG_RING

EARTH_SIZE = 4
"""Earth's field NED [gauss], declination [rad]."""


class FilterCore(Protocol):
    """A filter with its memory. State, flags and resets of the memory are up to date after each call."""

    memory: RecordArray
    """The estimator's memory, shape (1,), for reading."""

    def start(self, params: EstimatorParams) -> None:
        """Start with an empty memory."""

    def set_params(self, params: EstimatorParams) -> None:
        """Set the parameters."""

    def set_landed(self, landed: bool) -> None:
        """Set whether the vehicle stands on the ground."""

    def set_earth(self, earth: FloatArray, is_known: bool) -> None:
        """Set the Earth's field, shape (4,); correct the state with it if ``is_known``."""

    def imu(self, row: FloatArray) -> None:
        """Take a sample of the IMU in its array form, shape (8,)."""

    def push(self, ring: int, row: FloatArray) -> None:
        """Store a measurement of a ring; ``row`` may change."""

    def refresh(self) -> None:
        """Bring the whole memory up to date."""


class PythonCore:
    """The filter of this package, compiled by Numba."""

    def __init__(self) -> None:
        self.memory: RecordArray = np.zeros(1, MEMORY)
        self._record: Any = self.memory[0]
        self._landed = self.memory["flags"]["landed"].data
        self.imu = partial(direct(imu_kernel, self.memory, np.zeros(IMU_SIZE)), self.memory)
        self.push = partial(direct(push_kernel, self.memory, MAG_RING, np.zeros(4)), self.memory)

    def start(self, params: EstimatorParams) -> None:
        """Start with an empty memory."""
        self.memory[:] = 0
        self.set_params(params)
        plain(start_memory)(self.memory)

    def set_params(self, params: EstimatorParams) -> None:
        """Set the parameters."""
        self._record["params"] = params

    def set_landed(self, landed: bool) -> None:
        """Set whether the vehicle stands on the ground."""
        self._landed[0] = landed

    def set_earth(self, earth: FloatArray, is_known: bool) -> None:
        """Set the Earth's field, shape (4,); correct the state with it if ``is_known``."""
        self._record["earth"] = earth
        if is_known:
            field_kernel(self.memory)

    def refresh(self) -> None:
        """Do nothing: the memory is the filter's own."""
