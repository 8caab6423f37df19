"""Faults of the sensors: which parts of which sensors they affect, and how.

Bias, noise and a frozen output act in the record of a sensor; drop-out, loss and delay on its output, in ``Channel``.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple, TypeVar

import numpy as np

from flightstack.core.contract import FloatArray, RecordArray, Vector3
from sim_bridge.plant.fault_table import Fault, Kind
from sim_bridge.sensors.noise import UniformStream

T = TypeVar("T")

_STILL = Vector3(0.0, 0.0, 0.0)


class ChannelFault(NamedTuple):
    """Fault of one sensor, or of one part of the inertial sensor; by default none."""

    bias: Vector3 = _STILL
    drift_s: Vector3 = _STILL  # bias per second since ``begin_us``
    begin_us: int = 0
    noise: float = 0.0
    is_frozen: bool = False
    is_off: bool = False
    late_us: int = 0
    loss: float = 0.0  # share of the measurements


HEALTHY = ChannelFault()


_EFFECTS: Mapping[Kind, Callable[[Fault], dict[str, Any]]] = MappingProxyType(
    {
        Kind.SENSOR_OFF: lambda _: {"is_off": True},
        Kind.SENSOR_FREEZE: lambda _: {"is_frozen": True},
        Kind.SENSOR_BIAS: lambda cause: {"bias": cause.vector},
        Kind.SENSOR_DRIFT: lambda cause: {"drift_s": cause.vector, "begin_us": cause.begin_us},
        Kind.SENSOR_NOISE: lambda cause: {"noise": cause.value},
        Kind.SENSOR_LATE: lambda cause: {"late_us": round(cause.value * 1e6)},
        Kind.SENSOR_LOSS: lambda cause: {"loss": cause.value},
    }
)
"""Changes of a channel. If two faults of a kind affect the same channel, the last one wins."""


def channel_faults(active: Iterable[Fault], imu_count: int) -> Mapping[tuple[str, int], ChannelFault]:
    """Return the fault of each affected channel, by name and number from 0."""
    faults: dict[tuple[str, int], ChannelFault] = {}
    for cause in active:
        change = _EFFECTS.get(cause.kind)
        if change is None:
            continue
        for name, index in channels_of(cause.sensor, imu_count):
            faults[name, index] = faults.get((name, index), HEALTHY)._replace(**change(cause))
    return MappingProxyType(faults)


def channels_of(sensor: str, imu_count: int) -> list[tuple[str, int]]:
    """Return the channels of a sensor as a fault names it: "gyro2", "imu" for gyro and accelerometer of all."""
    name, number = sensor.rstrip("0123456789"), sensor.lstrip("abcdefghijklmnopqrstuvwxyz")
    parts = ("gyro", "accel") if name == "imu" else (name,)
    count = imu_count if parts[0] in ("gyro", "accel") else 1
    indices = range(count) if not number else range(int(number) - 1, int(number))
    return [(part, index) for part in parts for index in indices if name]


class Channel:
    """One sensor, or one part of the inertial sensor, in its faults."""

    def __init__(
        self, records: RecordArray, index: int = 0, part: int | None = None, scale: float = 1.0
    ) -> None:
        """``part``: of a record with several channels; ``scale``: from the unit of faults to that of the record."""
        of_part = slice(None) if part is None else slice(3 * part, 3 * part + 3)
        self._bias: FloatArray = records["fault_bias"][index, of_part]
        at = index if part is None else (index, part)
        self._flat = (records["fault_noise"], records["is_frozen"], at)
        self._scale = scale
        self._fault = HEALTHY
        self._past: deque[tuple[int, Any]] = deque()
        self._losses: UniformStream | None = None

    @property
    def is_healthy(self) -> bool:
        """True without a fault."""
        return self._fault == HEALTHY

    def set(self, fault: ChannelFault, losses: UniformStream) -> None:
        """Begin, change or end the fault; ``losses`` decides which measurements are lost."""
        if fault.late_us != self._fault.late_us:
            self._past.clear()
        self._fault, self._losses = fault, losses
        noise, frozen, at = self._flat
        noise[at], frozen[at] = fault.noise * self._scale, fault.is_frozen
        self.update(fault.begin_us)

    def update(self, time_us: int) -> None:
        """Move the bias of a drift to ``time_us``."""
        fault = self._fault
        since_s = max(0, time_us - fault.begin_us) * 1e-6
        bias = np.add(fault.bias, np.multiply(fault.drift_s, since_s)) * self._scale
        self._bias[:] = bias[: len(self._bias)]

    @property
    def rate(self) -> FloatArray:
        """Change of the bias per second."""
        rate: FloatArray = np.multiply(self._fault.drift_s, self._scale)
        return rate

    def pass_on(self, time_us: int, out: T) -> T | None:
        """Return the output that is sent at ``time_us`` for the measurement ``out``, or None. ``out`` is kept."""
        fault = self._fault
        if fault.late_us:
            self._past.append((time_us, out))
            while len(self._past) > 1 and self._past[1][0] <= time_us - fault.late_us:
                self._past.popleft()
            out = self._past[0][1]
        if fault.is_off or (fault.loss > 0.0 and self._is_lost()):
            return None
        return out

    def _is_lost(self) -> bool:
        assert self._losses is not None
        return self._losses.next() < self._fault.loss
