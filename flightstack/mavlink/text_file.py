"""File of past status texts, which a vehicle offers over MAVLink FTP: MAVLink repeats no STATUSTEXT.

One text a line: vehicle time [s], MAV_SEVERITY and text, with tabs between them. ArduPilot has its text files of the
system in the same folder.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

from flightstack.mavlink.fields import clean

PATH = "@SYS/messages.txt"
_LEAST_SEVERE = 7


class PastText(NamedTuple):
    """A status text that was sent before."""

    time_s: float
    severity: int
    text: str


def pack_texts(texts: Iterable[PastText]) -> bytes:
    """Return the content of the file, the oldest text first."""
    return "".join(f"{entry.time_s:.3f}\t{entry.severity}\t{clean(entry.text)}\n" for entry in texts).encode()


def read_texts(content: bytes) -> tuple[PastText, ...]:
    """Return the texts of a file; lines that are not valid are skipped."""
    found = []
    for line in content.decode(errors="replace").split("\n"):
        time, _, rest = line.partition("\t")
        severity, _, text = rest.partition("\t")
        try:
            entry = PastText(float(time), int(severity), clean(text))
        except ValueError:
            continue
        if math.isfinite(entry.time_s) and 0 <= entry.severity <= _LEAST_SEVERE:
            found.append(entry)
    return tuple(found)
