"""Parsing of ``--loops``."""

from __future__ import annotations

from typing import NamedTuple

from flightstack.core.errors import ConfigError

PYTHON, C, HOST, EMULATED, SERIAL = "python", "c", "host", "emulated", "serial"
DEFAULT_BAUD = 115_200
SLOWEST_BAUD = 1_200
"""Minimum: at lower rates, gaps between bytes exceed the target's frame timeout."""
_KNOWN = f"{PYTHON}, {C}, {HOST}, {EMULATED} and {SERIAL}:DEVICE[:BAUD]"


class LoopsChoice(NamedTuple):
    """Kind of loops; ``device`` and ``baud`` of a serial port."""

    kind: str
    device: str = ""
    baud: int = DEFAULT_BAUD

    @property
    def is_target(self) -> bool:
        """True for loops behind a link: on a board, emulated, or in another process."""
        return self.kind in (HOST, EMULATED, SERIAL)


def parse_loops(text: str, flag: str = "--loops") -> LoopsChoice:
    """Read ``python``, ``c``, ``host``, ``emulated`` or ``serial:DEVICE[:BAUD]``; raise ConfigError."""
    kind, _, rest = text.partition(":")
    if kind in (PYTHON, C, HOST, EMULATED) and not rest and not text.endswith(":"):
        return LoopsChoice(kind)
    if kind != SERIAL:
        raise ConfigError(flag, text, f"is not one of {_KNOWN}")
    device, colon, ending = rest.rpartition(":")
    if not colon or not ending.isdecimal():  # a device name may contain colons
        device, ending = rest, str(DEFAULT_BAUD)
    if not device:
        raise ConfigError(flag, text, "has no device: use for example serial:/dev/ttyACM0")
    baud = int(ending[:12])
    if baud < SLOWEST_BAUD:
        raise ConfigError(flag, text, f"has a baud rate below the minimum of {SLOWEST_BAUD}")
    if baud > 20_000_000:
        raise ConfigError(flag, text, "has a baud rate above the maximum of 20000000")
    return LoopsChoice(SERIAL, device, baud)
