"""Declaration of a parameter and validation of its values."""

from __future__ import annotations

import math
from typing import NamedTuple

from flightstack.core.errors import plain
from flightstack.core.float32 import LARGEST_FLOAT32, shortest

LARGEST_NAME = 16
"""Maximum length of a parameter name: MAVLink's param_id."""

GROUPS = {
    "MIS": "Mission",
    "MPC": "Multicopter Position Control",
    "NAV": "Navigator",
    "RTL": "Return Mode",
    "COM": "Commander",
    "GF": "Geofence",
    "BAT": "Battery",
    "FD": "Failure Detector",
    "MAV": "MAVLink",
    "FS": "System",
}
"""Default group of a parameter by the prefix of its name; PX4's group where it has one."""


class ParamSpec(NamedTuple):
    """Declaration of one parameter.

    All parameters are declared this way: the reference page, the metadata file and the C table are generated from it.
    """

    name: str
    default: float
    low: float
    high: float
    unit: str
    help: str
    is_integer: bool = False
    group: str = ""
    decimals: int = 3
    choices: tuple[tuple[int, str], ...] = ()
    """Values of an enumeration, each with its meaning; empty for a range."""
    reboot_required: bool = False
    at_least: str = ""
    """Parameter that this one must not be below."""

    def number(self, value: float) -> float:
        """Return ``value`` as ``int`` for an integer parameter, else as ``float``."""
        return int(value) if self.is_integer else float(value)

    def accepted(self, value: float) -> float | str:
        """Return the value stored when the parameter is set to ``value``, or the reason for a refusal.

        Values have MAVLink's float32 precision whatever their source: the shortest decimal number with the same float32
        is stored. 0.35 typed, 0.35 received as 0.34999999403953552 and 0.35 read from a file are the same value. The
        default and the ends of the range keep their own precision.
        """
        if abs(value) > LARGEST_FLOAT32:  # also infinities, and integers beyond the range of float
            value = math.copysign(math.inf, 1.0 if value > 0 else -1.0)
        refused = self._beyond(value)
        if refused is not None:
            return refused
        if self.is_integer:
            return int(value)
        short = shortest(value)
        for exact in (self.default, self.low, self.high):
            if short == shortest(exact):
                return float(exact)
        return short

    def _beyond(self, value: float) -> str | None:
        inside = math.isfinite(value) and (
            self.low <= value <= self.high or shortest(value) in (shortest(self.low), shortest(self.high))
        )
        if not inside:
            return f"{plain(value)} is outside {plain(self.low)} to {plain(self.high)} {self.unit}".rstrip()
        if self.is_integer and value != int(value):
            return f"{value:g} is not a whole number"
        if self.choices and int(value) not in dict(self.choices):
            return f"{plain(value)} is not one of {', '.join(str(choice) for choice, _ in self.choices)}"
        return None


def group_of(name: str) -> str:
    """Return the default group of a parameter by its name."""
    return GROUPS.get(name.partition("_")[0], "Miscellaneous")
