"""Streaming ULog writer.

The loops write float64 rows into ``Trace`` arrays, which are converted and written in blocks, so that the file of a
killed process is readable up to the last block. The log contains no wall clock times: the same flight gives the same
bytes.
"""

from __future__ import annotations

import contextlib
import struct
from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

import numpy as np

from flightstack.core.contract import FloatArray, LoopRow
from flightstack.core.geodesy import GeoPoint
from flightstack.flight_log import ulog
from flightstack.flight_log.row_block import RowBlock, content_size
from flightstack.flight_log.row_kernel import TimeArray
from flightstack.flight_log.topics import (
    EVENT_TOPICS,
    OUTER,
    OUTER_GROUP,
    OUTER_TOPICS,
    Group,
    Topic,
    inner_topics,
)
from flightstack.mavlink.fields import COUNTERS, STRUCT_CODES, fitted
from flightstack.params.vehicle import Vehicle, system_type

DEFAULT_CAPACITY = 512
"""Rows: a second of the inner loop at 500 Hz. What is in them is lost if the process is killed."""


class LogFile(Protocol):
    """Unbuffered binary file, such as ``open(path, "wb", buffering=0)``."""

    def write(self, data: bytes | memoryview, /) -> int | None:
        """Write bytes; return the number written."""

    def truncate(self, size: int, /) -> int:
        """Shorten the file; raise OSError."""

    def close(self) -> None:
        """Close the file."""


class Trace:
    """Buffered rows: ``rows[:n]``, shape (capacity, columns), and ``times_us[:n]``."""

    __slots__ = ("_flush", "capacity", "n", "rows", "times_us")

    def __init__(self, capacity: int, columns: int, flush: Callable[[], None]) -> None:
        self.capacity = capacity
        self.rows: FloatArray = np.zeros((capacity, columns))
        self.times_us: TimeArray = np.zeros(capacity, np.uint64)
        self.n = 0
        self._flush = flush

    def append(self, time_us: int) -> FloatArray:
        """Return the next row, to be filled before the next call; flush a full trace first."""
        if self.n == self.capacity:
            self._flush()
        index = self.n
        self.times_us[index] = time_us
        self.n = index + 1
        row: FloatArray = self.rows[index]
        return row


class _EventTopic:
    """Encoder of an event topic."""

    def __init__(self, topic: Topic, message_id: int, known: Mapping[str, float]) -> None:
        """``known`` replaces the default values of fields."""
        self._header = ulog.DATA_HEADER.pack(content_size(topic), ulog.DATA_TYPE, message_id)
        self._codes = "Q" + "".join(STRUCT_CODES[field.type] for field in topic.fields)
        self._wraps = [
            True,
            *(f.type == "uint64_t" or f.name in COUNTERS for f in topic.fields),
        ]  # uint64_t fields are times
        self._pack = struct.Struct("<" + self._codes).pack
        self._defaults: dict[str, float] = {
            field.name: field.default if field.type in ("float", "double") else int(field.default)
            for field in topic.fields
        }
        self._defaults |= known

    def encode(self, time_us: int, fields: Mapping[str, float]) -> bytes:
        """Return the message; times and counters wrap, other integers saturate."""
        values = {**self._defaults, **fields}
        if len(values) != len(self._defaults):
            raise TypeError(f"not a field of the topic: {sorted(set(fields) - set(self._defaults))}")
        numbers = (time_us, *values.values())
        try:
            return self._header + self._pack(*numbers)
        except (struct.error, OverflowError):
            return self._header + self._pack(*map(fitted, numbers, self._codes, self._wraps))


class FlightLog:
    """Writes one flight to ``file`` and owns it.

    A write error (disk full) does not end the flight: the first one is stored in ``error``, the file is truncated after
    the last complete message, and writing stops.
    """

    def __init__(self, file: LogFile, rotors: int, capacity: int = DEFAULT_CAPACITY) -> None:
        self._file = file
        self._inner_topics = inner_topics(rotors)
        self.inner = Trace(capacity, LoopRow.SIZE, self.flush)
        self.outer = Trace(capacity, OUTER.size, self.flush)
        self.sampled: dict[str, Trace] = {}
        """Traces of the groups of ``start``, by name."""
        self._sampled_blocks: list[tuple[Trace, RowBlock]] = []
        self.error: OSError | None = None
        self._size = 0  # bytes of complete messages
        self._closed = False
        first_outer_id = len(self._inner_topics)
        first_event_id = first_outer_id + len(OUTER_TOPICS)
        self._inner_block = RowBlock(self._inner_topics, 0)
        self._first_outer_id = first_outer_id
        self._outer_block: RowBlock | None = None
        known = {"vehicle_status": {"system_type": system_type(rotors)}}
        self._events = {
            topic.name: _EventTopic(topic, message_id, known.get(topic.name, {}))
            for message_id, topic in enumerate(EVENT_TOPICS, first_event_id)
        }

    def start(
        self,
        time_us: int,
        info: Mapping[str, str | int | float],
        parameters: Mapping[str, float],
        origin: GeoPoint,
        groups: Sequence[Group] = (),
        outer: Group = OUTER_GROUP,
    ) -> None:
        """Write header and definitions, with ``groups`` of further topics. Call first, once.

        ``origin`` is the origin of the local frame. ``outer`` has the topics of the outer loop.
        """
        reference = {
            "ref_lat": origin.latitude_deg, "ref_lon": origin.longitude_deg, "ref_alt": origin.altitude_m,
        }  # fmt: skip
        capacity = self.outer.capacity
        self.outer = Trace(capacity, outer.columns, self.flush)
        self._outer_block = RowBlock(outer.topics, self._first_outer_id, reference)
        topics = [*self._inner_topics, *outer.topics, *EVENT_TOPICS]
        for group in groups:
            trace = self.sampled[group.name] = Trace(capacity, group.columns, self.flush)
            self._sampled_blocks.append((trace, RowBlock(group.topics, len(topics), reference)))
            topics += group.topics
        self._write(ulog.file_header(time_us), ulog.HEADER_SIZE)
        parts = []
        for topic in topics:
            fields = [("uint64_t", 0, "timestamp"), *((f.type, f.length, f.name) for f in topic.fields)]
            parts.append(ulog.format_definition(topic.name, fields))
        parts.extend(ulog.information(key, value) for key, value in info.items())
        parts.extend(ulog.parameter(name, value) for name, value in parameters.items())
        parts.extend(ulog.subscription(message_id, topic.name) for message_id, topic in enumerate(topics))
        self._write(b"".join(parts))

    def flush(self) -> None:
        """Write and clear all buffered rows."""
        inner, outer = self.inner, self.outer
        if inner.n:
            self._write(self._inner_block.encode(inner.times_us[: inner.n], inner.rows[: inner.n]))
            inner.n = 0
        if outer.n:
            assert self._outer_block is not None, "start() comes first"
            self._write(self._outer_block.encode(outer.times_us[: outer.n], outer.rows[: outer.n]))
            outer.n = 0
        for trace, block in self._sampled_blocks:
            if trace.n:
                self._write(block.encode(trace.times_us[: trace.n], trace.rows[: trace.n]))
                trace.n = 0

    def event(self, topic: str, time_us: int, **fields: float) -> None:
        """Write a message of an event topic after the buffered rows; omitted fields have defaults."""
        self.flush()
        self._write(self._events[topic].encode(time_us, fields))

    def message(self, time_us: int, level: int, text: str) -> None:
        """Write a text with MAV_SEVERITY ``level``."""
        self.flush()
        self._write(ulog.logged_string(time_us, level, text))

    def binary_information(self, key: str, value: bytes) -> None:
        """Write bytes as a multi-information message after the buffered rows."""
        self.flush()
        self._write(ulog.binary_information(key, value))

    def parameter(self, name: str, value: float) -> None:
        """Write a changed parameter after the buffered rows."""
        self.flush()
        self._write(ulog.parameter(name, value))

    def close(self) -> None:
        """Flush and close the file; a second call does nothing."""
        if self._closed:
            return
        self.flush()
        self._closed = True
        try:
            self._file.close()
        except OSError as error:
            self.error = self.error or error

    def _write(self, data: bytes | memoryview, header_size: int = 0) -> None:
        """Write complete messages, preceded by ``header_size`` bytes of file header."""
        written = 0
        try:
            while self.error is None and written < len(data):
                now = self._file.write(data[written:])
                if not now:
                    raise OSError("the log file takes no more data")
                written += now
        except OSError as error:
            self.error = error
            with contextlib.suppress(OSError):  # not possible for a pipe
                self._file.truncate(self._size + ulog.whole_messages(data, written, header_size))
        self._size += written


def vehicle_fields(vehicle: Vehicle) -> dict[str, str | int | float]:
    """Return the info entries of a vehicle; ideal rotors have no speed limits."""
    info: dict[str, str | int | float] = {
        "vehicle": vehicle.name,
        "rotor_count": len(vehicle.rotors),
        "mass_kg": vehicle.mass_kg,
    }
    if not vehicle.ideal_rotors:
        info["rotor_min_speed_rad_s"] = min(rotor.min_speed_rad_s for rotor in vehicle.rotors)
        info["rotor_max_speed_rad_s"] = max(rotor.max_speed_rad_s for rotor in vehicle.rotors)
    return info
