"""Parsing of ``--loops``."""

from __future__ import annotations

from typing import NamedTuple

from flightstack.core.errors import ConfigError

PYTHON, C, HOST, EMULATED, SERIAL = "python", "c", "host", "emulated", "serial"
DEFAULT_BAUD = 115_200
SLOWEST_BAUD = 1_200
"""Minimum: at lower rates, gaps between bytes exceed the target's frame timeout."""
FASTEST_BAUD = 20_000_000
SHORT = "short"
"""Ending of a target: send and report only what a flight needs, for a slow line."""
_KNOWN = f"{PYTHON}, {C}, {HOST}, {EMULATED} and {SERIAL}:DEVICE[:BAUD]"
_ENDINGS = (SHORT,)


class LoopsChoice(NamedTuple):
    """Kind of loops; ``device`` and ``baud`` of a serial port."""

    kind: str
    device: str = ""
    baud: int = DEFAULT_BAUD
    ending: str = ""
    """``SHORT`` or nothing."""

    @property
    def is_target(self) -> bool:
        """True for loops behind a link: on a board, emulated, or in another process."""
        return self.kind in (HOST, EMULATED, SERIAL)


def parse_loops(text: str, flag: str = "--loops") -> LoopsChoice:
    """Read ``python``, ``c``, or a target, which may end in ``,short``; raise ConfigError.

    A target is ``host``, ``emulated`` or ``serial:DEVICE[:BAUD]``.
    """
    target, comma, ending = text.rpartition(",")
    if not comma or ending not in _ENDINGS:
        target, ending = text, ""
    kind, _, rest = target.partition(":")
    if kind in (HOST, EMULATED) and target == kind:
        return LoopsChoice(kind, ending=ending)
    if kind in (PYTHON, C) and target == text == kind:
        return LoopsChoice(kind)
    if kind != SERIAL:
        raise ConfigError(flag, text, f"is not one of {_KNOWN}")
    device, colon, number = rest.rpartition(":")
    if not colon or not number.isdecimal():  # a device name may contain colons
        device, number = rest, str(DEFAULT_BAUD)
    if not device:
        raise ConfigError(flag, text, "has no device: use for example serial:/dev/ttyACM0")
    baud = int(number[:12])
    if baud < SLOWEST_BAUD:
        raise ConfigError(flag, text, f"has a baud rate below the minimum of {SLOWEST_BAUD}")
    if baud > FASTEST_BAUD:
        raise ConfigError(flag, text, f"has a baud rate above the maximum of {FASTEST_BAUD}")
    return LoopsChoice(SERIAL, device, baud, ending)
