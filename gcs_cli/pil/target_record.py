"""What a flight on a target left beside its log: who the target is, what each step cost, how the link did."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flightstack.contract import FloatArray
from flightstack.firmware.pil_record import COST_UNITS, LINK_FILE, STEPS_FILE
from flightstack.params.errors import ConfigError


class TargetRecord(NamedTuple):
    """See ``flightstack.firmware.pil_record``."""

    identity: Mapping[str, Any]
    link: Mapping[str, Any]
    """Counters of the link, and the round trips' figures."""
    status: Mapping[str, Any]
    """The target's own counters; empty if it did not tell them."""
    costs: FloatArray
    """Outer loop, inner loop, mixer and whole step of each step, (steps, 4), in ``identity``'s cost unit."""
    ending: str | None = None
    """Why the target was given up; None: it was not."""

    @property
    def steps(self) -> int:
        """Steps that the target has answered."""
        return len(self.costs)

    @property
    def unit(self) -> str:
        """Unit of the costs; empty for a target that counts nothing."""
        unit = str(self.identity["cost_unit"])
        return "" if unit == COST_UNITS[0] else unit


def read_record(folder: Path) -> TargetRecord:
    """Read both files; raise ConfigError when one is missing or damaged."""
    path = folder / LINK_FILE
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        path = folder / STEPS_FILE
        with np.load(path) as file:
            costs = file["steps"]["cost"].astype(np.float64)
        return record_of(content, costs)
    except OSError as error:
        raise ConfigError(path, "", f"cannot be read: {error.strerror}") from error
    except (ValueError, KeyError, TypeError, AttributeError, IndexError, zipfile.BadZipFile) as error:
        raise ConfigError(path, "", f"is not the record of a target: {error}") from error


def record_of(content: Mapping[str, Any], costs: FloatArray) -> TargetRecord:
    """Return the record from the content of its first file, and the costs of the steps."""
    trips = content["round_trip_s"] or {}
    link = dict(content["link"])
    link["lost"] = max(0, link["resent"] - link["late"])  # in either direction: nothing came of that sending
    for name, seconds in trips.items():
        link[f"round_trip_{name}_us"] = round(seconds * 1e6, 1)
    return TargetRecord(content["identity"], link, content["status"] or {}, costs, content["ending"])
