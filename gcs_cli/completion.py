"""Values that the shell completes without a vehicle and without the libraries of the commands."""

from __future__ import annotations

import re
from importlib.util import find_spec
from pathlib import Path

_DEFINITION = re.compile(rb"^MAVLINK_MSG_ID_(\w+) = ", re.MULTILINE)
_LAYOUT = re.compile(rb'Layout\(\s*\d+,\s*"(\w+)"')
_PLACEHOLDERS = {b"BAD_DATA", b"UNKNOWN"}
"""pymavlink's names for bytes that are no known message."""


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
    wanted = incomplete.upper().encode()
    return sorted(name.decode() for name in names - _PLACEHOLDERS if name.startswith(wanted))
