"""History of telemetry: the numeric fields of each message type over time, bounded, with message rates.

Written by the thread of the link, read by the screens.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from operator import attrgetter
from struct import Struct
from threading import Lock
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flightstack.mavlink.link import Message

ROWS_KEPT = 12_000
"""Samples kept of each message type: 4 min at 50 Hz, 20 min at 10 Hz."""
MOST_STREAMS = 500
"""Message types kept; further ones, of garbage or of many vehicles, are not recorded."""
_FIRST_ROWS = 256
_RATE_WINDOW_S = 3.0
_RATE_ROWS, _LEAST_RATE_ROWS = 3_000, 4
_LEAST_SILENCE_S, _SILENT_PERIODS = 1.0, 3.0
_TEXT_TYPES = ("char",)


class StreamKey(NamedTuple):
    """Source and type of a stream; ``instance`` is the value of the message's instance field, if it has one."""

    system_id: int
    component_id: int
    message_id: int
    instance: int | None


class Stream:
    """One message type from one source."""

    def __init__(self, key: StreamKey, message: Message) -> None:
        self.key = key
        self.name: str = message.get_type()
        """MAVLink name of the message, with the instance in brackets: ``ESC_STATUS[0]``."""
        if key.instance is not None:
            self.name += f"[{key.instance}]"
        self.last = message
        self.count = 0
        plain, self._lists, self.fields = _numeric_fields(message)
        self._plain: Callable[[Message], tuple[float, ...]] = _getter(plain)
        self._row = Struct(f"{1 + len(self.fields)}d")
        self._rows = np.empty((_FIRST_ROWS, 1 + len(self.fields)))

    def record(self, message: Message, now_s: float) -> None:
        """Append the values of ``message``, received at ``now_s``."""
        at = self.count % ROWS_KEPT
        if at >= len(self._rows):
            grown = np.empty((min(ROWS_KEPT, 2 * len(self._rows)), self._rows.shape[1]))
            grown[: len(self._rows)] = self._rows
            self._rows = grown
        row = self._plain(message)
        for name, size in self._lists:
            listed = getattr(message, name)
            row += tuple(listed) if len(listed) == size else (np.nan,) * size
        self._row.pack_into(self._rows.data, at * self._row.size, now_s, *row)
        self.last = message
        self.count += 1

    @property
    def last_s(self) -> float:
        """Time of the last message."""
        return float(self._rows[(self.count - 1) % ROWS_KEPT, 0])

    def column(self, index: int) -> NDArray[np.float64]:
        """Return a copy of the times (column 0) or of a field, oldest first."""
        if self.count <= ROWS_KEPT:
            return self._rows[: self.count, index].copy()
        at = self.count % ROWS_KEPT
        return np.concatenate((self._rows[at:, index], self._rows[:at, index]))

    def rate_hz(self, now_s: float) -> float:
        """Return the rate over the last seconds, of slow streams over the last periods; 0 if the stream stopped."""
        times_s = self.column(0)[-_RATE_ROWS:]
        first = min(int(np.searchsorted(times_s, now_s - _RATE_WINDOW_S)), len(times_s) - _LEAST_RATE_ROWS)
        recent = times_s[max(0, first) :]
        period_s = float(recent[-1] - recent[0]) / max(1, len(recent) - 1)
        is_stopped = now_s - recent[-1] > max(_LEAST_SILENCE_S, _SILENT_PERIODS * period_s)
        return 0.0 if is_stopped or period_s <= 0.0 else 1.0 / period_s


def _getter(names: Sequence[str]) -> Callable[[Message], tuple[Any, ...]]:
    """Return a function that reads the fields ``names`` of a message."""
    if len(names) > 1:
        return attrgetter(*names)
    return lambda message: tuple(getattr(message, name) for name in names)


def _numeric_fields(message: Message) -> tuple[list[str], list[tuple[str, int]], list[str]]:
    """Return the names of scalar fields, names and sizes of arrays, and the names of all columns."""
    plain: list[str] = []
    lists: list[tuple[str, int]] = []
    for name, kind in zip(message.fieldnames, message.fieldtypes, strict=True):
        value = getattr(message, name)
        if kind in _TEXT_TYPES or isinstance(value, str | bytes):
            continue
        if isinstance(value, list | tuple):
            lists.append((name, len(value)))
        else:
            plain.append(name)
    columns = [*plain, *(f"{name}[{index}]" for name, size in lists for index in range(size))]
    return plain, lists, columns


class Series(NamedTuple):
    """Values of one field; both arrays have the same length, oldest first."""

    times_s: NDArray[np.float64]
    values: NDArray[np.float64]


class History:
    """The streams of all vehicles on the link."""

    def __init__(self) -> None:
        self._streams: dict[tuple[int, int, int, int | None], Stream] = {}
        self._lock = Lock()

    def record(self, message: Message, now_s: float) -> None:
        """Record a message, received at ``now_s``."""
        instance_name = message.instance_field
        instance = None if instance_name is None else getattr(message, instance_name)
        key = (message.get_srcSystem(), message.get_srcComponent(), message.get_msgId(), instance)
        with self._lock:
            stream = self._streams.get(key)
            if stream is None or stream.last.__class__ is not message.__class__:
                stream = self._new_stream(StreamKey(*key), message)
            if stream is not None:
                stream.record(message, now_s)

    def _new_stream(self, key: StreamKey, message: Message) -> Stream | None:
        """Add a stream; return None if there are too many."""
        self._streams.pop(key, None)  # the class has changed
        # the dialect of an autopilot is known from its first heartbeat on: it was unknown, without an instance
        self._streams.pop(key._replace(instance=None), None)
        if len(self._streams) >= MOST_STREAMS:
            return None
        self._streams[key] = Stream(key, message)
        return self._streams[key]

    def streams(self, system_id: int | None = None) -> list[Stream]:
        """Return the streams of one vehicle, or of all, by name."""
        with self._lock:
            found = [s for s in self._streams.values() if system_id in (None, s.key.system_id)]
        return sorted(found, key=lambda stream: (stream.name, stream.key))

    def fields(self, system_id: int | None = None) -> Iterator[str]:
        """Yield the names of all numeric fields, as in ``ATTITUDE.roll`` or ``ESC_STATUS[0].rpm[2]``."""
        for stream in self.streams(system_id):
            for field in stream.fields:
                yield f"{stream.name}.{field}"

    def series(self, name: str, system_id: int | None = None) -> Series:
        """Return the kept values of a field; empty if it was never received."""
        message, _, field = name.partition(".")
        with self._lock:
            for stream in self._streams.values():
                is_wanted = stream.name == message and system_id in (None, stream.key.system_id)
                if is_wanted and field in stream.fields:
                    return Series(stream.column(0), stream.column(1 + stream.fields.index(field)))
        return Series(np.empty(0), np.empty(0))

    def rate_hz(self, stream: Stream, now_s: float) -> float:
        """Return the rate of a stream over the last seconds."""
        with self._lock:
            return stream.rate_hz(now_s)
