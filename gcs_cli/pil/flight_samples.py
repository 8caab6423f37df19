"""Inputs and outputs of the loops in a flight log: float32, to the last bit."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from flightstack.core.contract import LoopStatus
from flightstack.core.errors import ConfigError
from gcs_cli.logs.ulog_parser import DAMAGE, ParsedLog, parse_ulog
from gcs_cli.pil.signals import SIGNALS
from gcs_cli.pil.ulps import Float32Array

TimeArray: TypeAlias = np.ndarray[Any, np.dtype[np.int64]]
StatusArray: TypeAlias = np.ndarray[Any, np.dtype[np.uint16]]

_TOPICS = sorted({signal.topic for signal in SIGNALS} | {"trajectory_setpoint"})
GROUNDED = LoopStatus.IDLE | LoopStatus.INPUT_STALE
"""Status of ticks in which the loops did not run: on the ground, or with a frozen input."""
AIRBORNE_M = 0.05
"""Height above the start position from which a vehicle does not touch the ground."""


class Samples(NamedTuple):
    """``values`` (n, k) at ``time_us`` (n,), which rises."""

    time_us: TimeArray
    values: Float32Array


class FlightSamples(NamedTuple):
    """The loops in a log."""

    signals: Mapping[str, Samples]
    """Samples by the names of ``SIGNALS``, without those that the log lacks."""
    status: Samples
    """Status of the loops in each inner tick, (n, 1)."""
    topics: Mapping[str, Mapping[str, Any]]
    """The columns of the topics."""
    info: Mapping[str, Any]
    parameters: Mapping[str, float]
    """Parameters at the start."""
    changes: tuple[tuple[int, str, float], ...]
    """Time [µs], name and value of each later change, in order; effective after the samples of that time."""
    duration_s: float = 0.0
    damaged: bool = False
    """True if a part of the log could not be read."""

    @property
    def flown_us(self) -> TimeArray:
        """Times of the ticks in which the loops ran."""
        flags = self.status.values[:, 0].astype(np.int64)
        times: TimeArray = self.status.time_us[(flags & GROUNDED) == 0]
        return times

    @property
    def airborne_us(self) -> TimeArray:
        """Times of those ticks in which the vehicle was in the air too; empty if the log has no position."""
        position, flown_us = self.signals.get("position"), self.flown_us
        if position is None or not len(position.time_us):
            return flown_us[:0]
        down_m = position.values[:, 2]
        at = np.maximum(np.searchsorted(position.time_us, flown_us, side="right") - 1, 0)
        times: TimeArray = flown_us[down_m[at] < down_m[0] - AIRBORNE_M]
        return times


def read_samples(path: Path) -> FlightSamples:
    """Read a flight log; raise ConfigError if it is not readable, or has no loops."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ConfigError(path, "", f"cannot be read: {error.strerror}") from error
    try:
        return _samples(path, parse_ulog(content, path, _TOPICS))
    except DAMAGE as error:
        raise ConfigError(path, "", f"is not a readable flight log: {error}") from error


def _samples(path: Path, parsed: ParsedLog) -> FlightSamples:
    log = parsed.log
    topics = {item.name: item.data for item in log.data_list}
    if "status" not in topics.get("wrench", {}):
        raise ConfigError(path, "", "is not a log of flightstack: it holds no wrench of its loops")
    wrench = topics["wrench"]
    return FlightSamples(
        {
            signal.name: found
            for signal in SIGNALS
            if (found := _columns(topics.get(signal.topic, {}), signal.fields)) is not None
        },
        Samples(wrench["timestamp"].astype(np.int64), wrench["status"].astype(np.float32)[:, None]),
        topics,
        dict(log.msg_info_dict),
        dict(log.initial_parameters),
        tuple((int(at), str(name), float(value)) for at, name, value in log.changed_parameters),
        (log.last_timestamp - log.start_timestamp) * 1e-6,
        parsed.damaged,
    )


def _columns(data: Mapping[str, Any], fields: tuple[str, ...]) -> Samples | None:
    there = [data[name] for name in fields if name in data]
    if not there:
        return None
    return Samples(data["timestamp"].astype(np.int64), np.column_stack(there).astype(np.float32))
