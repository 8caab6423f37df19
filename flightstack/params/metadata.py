"""Parameter metadata for ground stations: the file of MAVLink's component metadata of type PARAMETER.

Format: https://mavlink.io/en/services/component_metadata.html, parameter.schema.json, version 3.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from functools import lru_cache
from typing import Any

from flightstack.params.spec import ParamSpec

VERSION = 3
INTEGER, REAL = "Int32", "Float"


def parameter_metadata(specs: Iterable[ParamSpec]) -> dict[str, Any]:
    """Return the content of the file, sorted by name."""
    entries = [_entry(spec) for spec in sorted(specs, key=lambda spec: spec.name)]
    return {"version": VERSION, "parameters": entries}


def parameters_json(specs: Iterable[ParamSpec]) -> str:
    """Return the text of the file; it depends on the declarations alone."""
    return _json(tuple(specs))


@lru_cache(maxsize=16)
def _json(specs: tuple[ParamSpec, ...]) -> str:
    """Return the text of ``parameters_json``, made once for all flights of a campaign."""
    return json.dumps(parameter_metadata(specs), separators=(",", ":"), allow_nan=False)


def _entry(spec: ParamSpec) -> dict[str, Any]:
    entry: dict[str, Any] = {
        "name": spec.name,
        "type": INTEGER if spec.is_integer else REAL,
        "default": spec.number(spec.default),
        "min": spec.number(spec.low),
        "max": spec.number(spec.high),
        "units": spec.unit,
        "shortDesc": spec.help,
        "longDesc": long_description(spec),
        "decimalPlaces": 0 if spec.is_integer else spec.decimals,
        "group": spec.group,
        "category": "Standard",
    }
    if spec.choices:
        entry["values"] = [{"value": value, "description": meaning} for value, meaning in spec.choices]
    if spec.reboot_required:
        entry["rebootRequired"] = True
    return entry


def long_description(spec: ParamSpec) -> str:
    """Return the help text and when a change takes effect."""
    when = (
        "Takes effect at the next start."
        if spec.reboot_required
        else "Takes effect immediately, also in flight."
    )
    return f"{spec.help}. {when}"
