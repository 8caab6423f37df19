"""Faults of the sensors: which parts of which sensors they affect, and how.

Bias, noise and a frozen output act in the record of a sensor; drop-out, loss and delay on its output, in ``Channel``.
A measurement that is late by less than a period is sent between two measurements, at the first exchange at or after
its time.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple, TypeVar

import numpy as np

from flightstack.core.contract import FloatArray, RecordArray, Vector3
from flightstack.core.periods import NEVER_US
from sim_bridge.plant.faults.table import Fault, Kind
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


def without(fault: Fault, sensor: str, imu_count: int) -> list[Fault]:
    """Return the remainder of a fault when it ends on ``sensor``: the fault, or one for each other sensor, or none."""
    channels, ended = channels_of(fault.sensor, imu_count), channels_of(sensor, imu_count)
    if not set(channels).intersection(ended):
        return [fault]
    return [
        fault._replace(sensor=f"{name}{index + 1}") for name, index in channels if (name, index) not in ended
    ]


class Channel:
    """One sensor, or one part of the inertial sensor: its faults, and the way of its measurements to the link."""

    def __init__(
        self,
        key: tuple[str, int],
        seed: int,
        records: RecordArray,
        part: int | None = None,
        *,
        scale: float = 1.0,
    ) -> None:
        """``key``: name and number of the sensor; ``part``: of a record with several channels.

        ``scale`` is from the unit of faults to that of the record.
        """
        name, number = key
        index = number if part is not None else 0
        of_part = slice(None) if part is None else slice(3 * part, 3 * part + 3)
        self._bias: FloatArray = records["fault_bias"][index, of_part]
        at = index if part is None else (index, part)
        self._flat = (records["fault_noise"], records["is_frozen"], at)
        self._scale = scale
        self._fault = HEALTHY
        self._passes_at_once = True  # without a fault
        self._waiting: deque[tuple[int, Any]] = deque()
        self.next_due_us = NEVER_US
        """Time of the next message that waits."""
        self._losses = UniformStream(seed, name, number)

    @property
    def is_direct(self) -> bool:
        """True if each measurement is sent at once, and none waits."""
        return self._passes_at_once and not self._waiting

    def set(self, fault: ChannelFault, time_us: int) -> None:
        """Begin, change or end the fault at ``time_us``."""
        self._fault = fault
        self._passes_at_once = fault == HEALTHY
        noise, frozen, at = self._flat
        noise[at], frozen[at] = fault.noise * self._scale, fault.is_frozen
        self.update(time_us)

    def update(self, time_us: int) -> None:
        """Move the bias of a drift to ``time_us``; call before the measurement of this time."""
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
        """Take the measurement ``out``, which is kept, and return the one that is sent at ``time_us``, or None."""
        fault = self._fault
        if fault.loss == 0.0 or self._losses.next() >= fault.loss:
            due_us = time_us + fault.late_us
            self._waiting.append((due_us, out))
            self.next_due_us = min(self.next_due_us, due_us)
        sent: T | None = self.due(time_us)
        return sent

    def due(self, time_us: int) -> Any:
        """Return the newest measurement that is due, once, or None; older ones are dropped."""
        if time_us < self.next_due_us:
            return None
        waiting, out = self._waiting, None
        newest = max(i for i, (due_us, _) in enumerate(waiting) if due_us <= time_us)
        for _ in range(newest + 1):
            out = waiting.popleft()[1]
        self.next_due_us = min((due_us for due_us, _ in waiting), default=NEVER_US)
        return None if self._fault.is_off else out
