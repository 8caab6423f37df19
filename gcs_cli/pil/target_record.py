"""The record of a flight on a target: its identity, the cost of each step, figures of the link."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from flightstack.core.contract import FloatArray
from flightstack.core.errors import ConfigError
from flightstack.firmware.pil.record import COST_UNITS, LINK_FILE, STEPS_FILE
from flightstack.firmware.pil.steps import BAD_INPUT, OVERRUN

StatusArray: TypeAlias = np.ndarray[Any, np.dtype[np.int64]]
NO_STATUSES: StatusArray = np.zeros(0, np.int64)
NO_COUNTERS = ("time_boot_ms", "stack_size", "stack_high_water", "state")
"""Fields of FS_PIL_STATUS that are not counters."""
SAFE, RESTARTED = "safe state", "restarted by its watchdog"
STATES = ("ready", "stepping", SAFE, RESTARTED, "free-running")
"""Names of FS_PIL_STATUS.state."""


class TargetRecord(NamedTuple):
    """See ``flightstack.firmware.pil.record``."""

    identity: Mapping[str, Any]
    link: Mapping[str, Any]
    """Counters of the link, and figures of the round trips."""
    at_start: Mapping[str, Any]
    """The target's FS_PIL_STATUS before the first step. Counters run since its start, over all flights."""
    status: Mapping[str, Any]
    """Its FS_PIL_STATUS after the last step; empty without an answer."""
    costs: FloatArray
    """Outer loop, inner loop, mixer and whole step of each step, (steps, 4), in ``identity``'s cost unit."""
    overruns: int
    """Steps reported to have taken longer than their period."""
    bad_inputs: int
    """Steps reported with stopped rotors."""
    ending: str | None = None
    """The reason of an early end, or None."""
    trace: Mapping[str, Any] | None = None
    """``image`` and ``executed`` addresses of an emulated target."""
    statuses: StatusArray = NO_STATUSES
    """FS_PIL_REPORT.status of each step."""

    @property
    def counted(self) -> dict[str, int]:
        """Differences of the target's own counters in this flight; empty without a status at the end."""
        return {
            name: (value - self.at_start[name]) & 0xFFFF_FFFF
            for name, value in self.status.items()
            if name not in NO_COUNTERS
        }

    @property
    def steps(self) -> int:
        """Number of answered steps."""
        return len(self.costs)

    @property
    def unit(self) -> str:
        """Unit of the costs; empty if the target measures none."""
        unit = str(self.identity["cost_unit"])
        return "" if unit == COST_UNITS[0] else unit


def state_words(state: int) -> str:
    """Return the name of FS_PIL_STATUS.state."""
    return STATES[state] if state < len(STATES) else f"state {state}"


def status_words(status: Mapping[str, Any]) -> str:
    """Return the state, the uptime and the counters of a target."""
    counted = [
        f"{name.replace('_', ' ')} {value}"
        for name, value in status.items()
        if name not in NO_COUNTERS and value
    ]
    state, up_s = state_words(status["state"]), status["time_boot_ms"] / 1e3
    return f"{state}, up for {up_s:.1f} s; {', '.join(counted) or 'nothing counted'}"


def read_record(folder: Path) -> TargetRecord:
    """Read both files; raise ConfigError if one is missing or damaged."""
    path = folder / LINK_FILE
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        path = folder / STEPS_FILE
        with np.load(path) as file:
            steps = file["steps"]
        return record_of(content, steps["cost"].astype(np.float64), steps["status"].astype(np.int64))
    except OSError as error:
        raise ConfigError(path, "", f"cannot be read: {error.strerror}") from error
    except (ValueError, KeyError, TypeError, AttributeError, IndexError, zipfile.BadZipFile) as error:
        raise ConfigError(path, "", f"is not the record of a target: {error}") from error


def record_of(content: Mapping[str, Any], costs: FloatArray, statuses: StatusArray) -> TargetRecord:
    """Return the record from the content of its first file, and the costs and FS_PIL_REPORT.status of the steps."""
    trips = content["round_trip_s"] or {}
    link = dict(content["link"])
    link["lost"] = max(0, link["resent"] - link["late"])  # in either direction
    for name, seconds in trips.items():
        link[f"round_trip_{name}_us"] = round(seconds * 1e6, 1)
    overruns, bad_inputs = (int(np.count_nonzero(statuses & bit)) for bit in (OVERRUN, BAD_INPUT))
    return TargetRecord(
        content["identity"],
        link,
        content["status_at_start"],
        content["status"] or {},
        costs,
        overruns,
        bad_inputs,
        content["ending"],
        content.get("trace"),
        statuses,
    )
