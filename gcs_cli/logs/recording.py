"""A log as arrays: topics over time, texts, parameters. The same for ULog and tlog, for any vehicle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from flightstack.core.contract import FloatArray

AnyArray: TypeAlias = np.ndarray[Any, np.dtype[Any]]

ULOG, TLOG = "ULog", "tlog"
_YEAR_S = 365.2425 * 86400.0


@dataclass(frozen=True, eq=False)
class Topic:
    """The samples of one topic, or of one MAVLink message of one sender.

    ``time_us`` of shape (n,) is in the log's time. Each field has an array of shape (n,) of numbers or texts; the
    elements of an array field are fields ``name[0]``, ``name[1]``, ….
    """

    name: str
    """Unique in the log: ``vehicle_attitude``, ``sensor_accel_1`` for instance 1, ``HEARTBEAT_255_190`` for another
    sender than the vehicle."""
    time_us: AnyArray
    fields: Mapping[str, AnyArray]
    kind: str = ""
    """Topic or message without the instance."""

    @property
    def count(self) -> int:
        """Number of samples."""
        return len(self.time_us)

    @property
    def rate_hz(self) -> float | None:
        """Mean rate between the first and the last sample; None with fewer than two times."""
        if self.count < 2 or self.time_us[-1] <= self.time_us[0]:
            return None
        return (self.count - 1) / (float(self.time_us[-1] - self.time_us[0]) * 1e-6)

    def columns(self, names: list[str]) -> FloatArray | None:
        """Return the fields as columns of shape (n, k); None if one is missing."""
        if any(name not in self.fields for name in names):
            return None
        return np.column_stack([self.fields[name].astype(np.float64) for name in names])


class LogText(NamedTuple):
    """A status text; ``severity`` is its MAV_SEVERITY."""

    time_us: int
    severity: int
    text: str


class ParameterChange(NamedTuple):
    """A parameter set during the log."""

    time_us: int
    name: str
    value: float


class Dropout(NamedTuple):
    """A time in which the logger lost data."""

    time_us: int
    duration_s: float


@dataclass(frozen=True)
class Recording:
    """One log."""

    source: str
    form: str
    """``ULOG`` or ``TLOG``."""
    start_us: int
    """Start of the log; times of a ULog count from the start of the vehicle, those of a tlog from 1970. A topic may
    begin with a sample from before."""
    end_us: int
    epoch_us: int | None
    """Time of the log's zero, µs since 1970; None if unknown."""
    topics: tuple[Topic, ...]
    texts: tuple[LogText, ...] = ()
    info: Mapping[str, Any] = field(default_factory=dict)
    parameters: Mapping[str, int | float] = field(default_factory=dict)
    """At the start, or as the vehicle sent them; integers are ``int``."""
    changes: tuple[ParameterChange, ...] = ()
    dropouts: tuple[Dropout, ...] = ()
    damaged: bool = False
    """The log ends within a message, or holds unreadable bytes."""
    unknown: int = 0
    """Number of messages that are not in the dialect."""
    vehicle: tuple[int, int] = (1, 1)
    """System and component of the vehicle."""

    @property
    def duration_s(self) -> float:
        """From the first to the last sample."""
        return (self.end_us - self.start_us) * 1e-6

    @property
    def facts(self) -> dict[str, Any]:
        """``info`` without binary entries."""
        return {name: value for name, value in self.info.items() if not isinstance(value, bytes)}

    @property
    def year(self) -> float | None:
        """Date of the log as a year with a fraction; None if unknown."""
        seconds = None if self.epoch_us is None else (self.epoch_us + self.start_us) * 1e-6
        return None if seconds is None else 1970.0 + seconds / _YEAR_S

    def since_start_s(self, time_us: int) -> float:
        """Return a time of the log as seconds since its start."""
        return (time_us - self.start_us) * 1e-6

    def unix_ns(self, time_us: int | np.int64) -> int:
        """Return a time of the log as ns since 1970; the log starts in 1970 if its date is unknown."""
        return (int(time_us) + (self.epoch_us or 0)) * 1000

    def topic(self, name: str) -> Topic | None:
        """Return the topic of that name, or None."""
        return next((topic for topic in self.topics if topic.name == name), None)
