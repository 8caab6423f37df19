"""The flight log in memory: every topic as arrays with units."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from flightstack.core.contract import FloatArray
from gcs_cli.logs.ulog_parser import parse_ulog
from gcs_cli.report.analysis import flight_in
from gcs_cli.report.flight_data import Flight as FlightData

Array: TypeAlias = np.ndarray[Any, np.dtype[Any]]

_UNITS = {
    "x": "m", "y": "m", "z": "m", "alt": "m", "ref_alt": "m", "position": "m",
    "vx": "m/s", "vy": "m/s", "vz": "m/s", "velocity": "m/s", "acceleration": "m/s²",
    "heading": "rad", "yaw": "rad", "yawspeed": "rad/s", "xyz": "rad/s",
    "lat": "°", "lon": "°", "ref_lat": "°", "ref_lon": "°",
}  # fmt: skip
"""Units of fields with PX4's names; the other names end in their unit."""
_ENDINGS = {
    "_rad_s2": "rad/s²", "_rad_s": "rad/s", "_m_s": "m/s", "_n_m": "N m", "_n": "N", "_us": "µs", "_hz": "Hz",
    "_v": "V", "_a": "A", "_mah": "mAh", "_m": "m", "_rad": "rad", "_s": "s",
}  # fmt: skip
_SOURCE = "the flight log"
"""Name of the log in errors."""
_ELEMENT = re.compile(r"(?P<name>\w+)\[(?P<index>\d+)\]")


class Topic(Mapping[str, Array]):
    """One topic: fields by name, each of shape (n,) or (n, k) for an array of k elements."""

    def __init__(self, name: str, time_s: FloatArray, fields: Mapping[str, Array]) -> None:
        self.name = name
        self.time_s = time_s
        """Simulated time of each message [s], shape (n,)."""
        self._fields = fields

    @property
    def units(self) -> dict[str, str]:
        """The unit of each field that has one."""
        return {name: unit for name in self._fields if (unit := unit_of(name))}

    def __getitem__(self, name: str) -> Array:
        if name not in self._fields:
            raise KeyError(f"topic {self.name} has no field {name}; it has {', '.join(self._fields)}")
        return self._fields[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._fields)

    def __len__(self) -> int:
        return len(self._fields)


def unit_of(field: str) -> str:
    """Return the unit of a field; empty for a count, a flag or a quaternion.

    >>> unit_of("vx"), unit_of("torque_n_m"), unit_of("q")
    ('m/s', 'N m', '')
    """
    if field in _UNITS:
        return _UNITS[field]
    return next((unit for ending, unit in _ENDINGS.items() if field.endswith(ending)), "")


class LoggedText(NamedTuple):
    """A status text of the log."""

    time_s: float
    severity: int
    """MAV_SEVERITY: 0 emergency to 7 debug."""
    text: str


class Log(Mapping[str, Topic]):
    """Topics by name; docs/reference/log-topics.md lists them."""

    def __init__(self, content: bytes, boot_s: float = 0.0) -> None:
        """Read the bytes of a ULog file, empty for a vehicle that was never armed; raise ConfigError.

        ``boot_s`` is the simulated time from which the file counts: a vehicle counts from its boot.
        """
        self._boot_s = boot_s
        self.content = content
        """The bytes of the file."""
        self._data: dict[str, Mapping[str, Array]] = {}
        self._topics: dict[str, Topic] = {}
        self.parameters: dict[str, float] = {}
        """Parameters at the start of the flight."""
        self.texts: tuple[LoggedText, ...] = ()
        """Status texts, oldest first."""
        if content:
            self._read(content)

    def _read(self, content: bytes) -> None:
        self._parsed = parse_ulog(content, _SOURCE)
        log = self._parsed.log
        self._data = {item.name: item.data for item in log.data_list}
        self.parameters = dict(log.initial_parameters)
        self.texts = tuple(
            LoggedText(self._boot_s + item.timestamp * 1e-6, item.log_level - ord("0"), item.message)
            for item in log.logged_messages
        )

    @cached_property
    def flight(self) -> FlightData:
        """The flight as ``gcs`` reads it from its log; empty without one."""
        if not self.content:
            return FlightData()
        data = flight_in(self._parsed, _SOURCE)
        return replace(data, start_s=self._boot_s + data.start_s)

    def __getitem__(self, name: str) -> Topic:
        if name not in self._data:
            raise KeyError(f"the log has no topic {name}; it has {', '.join(self._data)}")
        if name not in self._topics:
            self._topics[name] = _topic(name, self._data[name], self._boot_s)
        return self._topics[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._data)

    def __len__(self) -> int:
        return len(self._data)


def _topic(name: str, data: Mapping[str, Array], boot_s: float) -> Topic:
    """Join the elements of arrays: pyulog has a field for each."""
    fields: dict[str, Any] = {}
    for key, values in data.items():
        element = _ELEMENT.fullmatch(key)
        if element is not None:
            fields.setdefault(element["name"], []).append(values)
        elif key != "timestamp":
            fields[key] = values
    joined = {
        key: np.column_stack(value) if isinstance(value, list) else value for key, value in fields.items()
    }
    time_s: FloatArray = boot_s + data["timestamp"].astype(np.float64) * 1e-6
    return Topic(name, time_s, joined)
