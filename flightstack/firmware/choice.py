"""Which loops fly: the word behind ``--loops``, read and checked."""

from __future__ import annotations

from typing import NamedTuple

from flightstack.params.errors import ConfigError

PYTHON, C, HOST, EMULATED, SERIAL = "python", "c", "host", "emulated", "serial"
DEFAULT_BAUD = 115_200
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


def parse_loops(text: str) -> LoopsChoice:
    """Read ``python``, ``c``, ``host``, ``emulated`` or ``serial:DEVICE[:BAUD]``; raise ConfigError."""
    kind, _, rest = text.partition(":")
    if kind in (PYTHON, C, HOST, EMULATED) and not rest and not text.endswith(":"):
        return LoopsChoice(kind)
    if kind != SERIAL:
        raise ConfigError("--loops", text, f"is none of {_KNOWN}")
    device, colon, ending = rest.rpartition(":")
    if not colon or not ending.isdecimal():  # a device's name may hold colons
        device, ending = rest, str(DEFAULT_BAUD)
    if not device:
        raise ConfigError("--loops", text, "names no device: serial:/dev/ttyACM0 for instance")
    baud = int(ending[:12])
    if not 300 <= baud <= 20_000_000:
        raise ConfigError("--loops", text, "has a baud rate that no port has: 300 to 20000000")
    return LoopsChoice(SERIAL, device, baud)
