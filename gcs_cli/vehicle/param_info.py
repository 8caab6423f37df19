"""What a vehicle says about its parameters: the file that QGroundControl reads (component metadata). Pure.

Schema: https://github.com/mavlink/mavlink/blob/master/component_metadata/parameter.schema.json
"""

from __future__ import annotations

import json
import lzma
import math
from typing import Any, NamedTuple

from flightstack.core.float32 import shortest
from flightstack.mavlink.fields import clean

METADATA_PATH = "etc/extras/parameters.json.xz"
"""Where PX4 and flightstack keep it; fetched over MAVLink FTP."""
MOST_OCTETS = 16_000_000
"""Of the file when it is unpacked. PX4's is 1.5 MB."""


class ParamInfo(NamedTuple):
    """About one parameter; None and empty where the vehicle says nothing."""

    default: float | None = None
    low: float | None = None
    high: float | None = None
    unit: str = ""
    help: str = ""
    choices: tuple[tuple[float, str], ...] = ()
    reboot_required: bool = False

    @property
    def range_text(self) -> str:
        """The range, or the values of an enumeration."""
        if self.choices:
            return " ".join(number_text(value) for value, _ in self.choices)
        if self.low is None and self.high is None:
            return ""
        return f"{_end_text(self.low)} to {_end_text(self.high)}"


UNKNOWN = ParamInfo()


def number_text(value: float) -> str:
    """Show a parameter's value as short as it can be told; equal texts are equal values on the wire."""
    return f"{shortest(value):.9g}"


def _end_text(value: float | None) -> str:
    return "…" if value is None else number_text(value)


def parse_metadata(packed: bytes) -> dict[str, ParamInfo]:
    """Read the packed file; return what is there by name, nothing when it is no such file."""
    try:
        text = lzma.LZMADecompressor(memlimit=128 * 2**20).decompress(packed, MOST_OCTETS)
        entries = json.loads(text)["parameters"]
    except (lzma.LZMAError, EOFError, ValueError, KeyError, TypeError, RecursionError):
        return {}
    if not isinstance(entries, list):
        return {}
    return {
        _text(entry["name"]): _info(entry)
        for entry in entries
        if isinstance(entry, dict) and isinstance(entry.get("name"), str)
    }


def _info(entry: dict[str, Any]) -> ParamInfo:
    values = entry.get("values")
    choices = []
    for choice in values if isinstance(values, list) else ():
        value = _number(choice.get("value")) if isinstance(choice, dict) else None
        if value is not None:
            choices.append((value, _text(choice.get("description"))))
    return ParamInfo(
        _number(entry.get("default")),
        _number(entry.get("min")),
        _number(entry.get("max")),
        _text(entry.get("units")),
        _text(entry.get("shortDesc")),
        tuple(choices),
        entry.get("rebootRequired") is True,
    )


def _number(value: Any) -> float | None:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def _text(value: Any) -> str:
    """Return ``value``, fit to be shown, if it is a text."""
    return clean(value) if isinstance(value, str) else ""
