"""Which loops fly: the word behind ``--loops``, read and checked."""

from __future__ import annotations

from typing import NamedTuple

from flightstack.core.errors import ConfigError

PYTHON, C, HOST, EMULATED, SERIAL = "python", "c", "host", "emulated", "serial"
DEFAULT_BAUD = 115_200
SLOWEST_BAUD = 1_200
"""Slower, the octets of a frame come so far apart that a target takes the pauses for its end."""
_KNOWN = f"{PYTHON}, {C}, {HOST}, {EMULATED} and {SERIAL}:DEVICE[:BAUD]"


class LoopsChoice(NamedTuple):
    """Where the loops run. ``device`` and ``baud`` are those of a serial port."""

    kind: str
    device: str = ""
    baud: int = DEFAULT_BAUD

    @property
    def is_target(self) -> bool:
        """Whether they run behind a link: on a board, emulated, or in a process of their own."""
        return self.kind in (HOST, EMULATED, SERIAL)


def parse_loops(text: str, flag: str = "--loops") -> LoopsChoice:
    """Read ``python``, ``c``, ``host``, ``emulated`` or ``serial:DEVICE[:BAUD]``; or ConfigError of ``flag``."""
    kind, _, rest = text.partition(":")
    if kind in (PYTHON, C, HOST, EMULATED) and not rest and not text.endswith(":"):
        return LoopsChoice(kind)
    if kind != SERIAL:
        raise ConfigError(flag, text, f"is none of {_KNOWN}")
    device, colon, ending = rest.rpartition(":")
    if not colon or not ending.isdecimal():  # a device's name may hold colons
        device, ending = rest, str(DEFAULT_BAUD)
    if not device:
        raise ConfigError(flag, text, "names no device: serial:/dev/ttyACM0 for instance")
    baud = int(ending[:12])
    if baud < SLOWEST_BAUD:
        raise ConfigError(flag, text, f"has a baud rate too slow for a target: {SLOWEST_BAUD} at least")
    if baud > 20_000_000:
        raise ConfigError(flag, text, "has a baud rate that no port has: 20000000 at most")
    return LoopsChoice(SERIAL, device, baud)
