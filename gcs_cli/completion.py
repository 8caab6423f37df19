"""Values that the shell completes without a vehicle and without the libraries of the commands."""

from __future__ import annotations

import re
from collections.abc import Iterable
from importlib.util import find_spec
from pathlib import Path

from gcs_cli.parameter_names_generated import NAMES

_DEFINITION = re.compile(rb"^MAVLINK_MSG_ID_(\w+) = ", re.MULTILINE)
_LAYOUT = re.compile(rb'Layout\(\s*\d+,\s*"(\w+)"')
_COPTER_MODE = re.compile(r"^COPTER_MODE_(\w+) = ", re.MULTILINE)
_PLACEHOLDERS = {b"BAD_DATA", b"UNKNOWN"}
"""pymavlink's names for bytes that are no known message."""


def parameter_names(incomplete: str) -> list[str]:
    """Return the flight stack's parameters, most of them PX4's, whose names begin with ``incomplete``."""
    return _beginning(NAMES, incomplete)


def mode_names(incomplete: str) -> list[str]:
    """Return the modes of PX4 and ArduCopter whose names begin with ``incomplete``."""
    from gcs_cli.autopilots.px4 import PX4

    names = {name for number, name in PX4.mode_names(0).items() if PX4.selectable(0, number)}
    spec = find_spec("pymavlink")
    if spec is not None and spec.origin is not None:
        text = (Path(spec.origin).parent / "dialects/v20/ardupilotmega.py").read_text(encoding="utf-8")
        names.update(name for name in _COPTER_MODE.findall(text) if name != "ENUM_END")
    return _beginning(map(str.lower, names), incomplete)


def message_names(incomplete: str) -> list[str]:
    """Return the MAVLink messages whose names begin with ``incomplete``.

    They are read from the text of the dialect, because its import takes longer than a user waits for a completion.
    """
    names: set[bytes] = set()
    for package, part, pattern in (
        ("pymavlink", "dialects/v20/common.py", _DEFINITION),
        ("flightstack", "mavlink/dialect_generated.py", _LAYOUT),
    ):
        spec = find_spec(package)
        if spec is not None and spec.origin is not None:
            text = (Path(spec.origin).parent / part).read_bytes()
            names |= set(pattern.findall(text))
    return _beginning((name.decode() for name in names - _PLACEHOLDERS), incomplete)


def _beginning(names: Iterable[str], incomplete: str) -> list[str]:
    """Return the names that begin with ``incomplete``, in its case: typer drops those of another case."""
    case = str.lower if incomplete.islower() else str.upper if incomplete.isupper() else str
    return sorted(case(name) for name in names if name.lower().startswith(incomplete.lower()))
