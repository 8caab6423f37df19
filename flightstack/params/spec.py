"""What a parameter is: its declaration, and the values it takes."""

from __future__ import annotations

import math
from typing import NamedTuple

from flightstack.core.float32 import LARGEST_FLOAT32, shortest

LARGEST_NAME = 16
"""Characters in the name of a parameter: MAVLink's param_id."""

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
"""Group of a parameter by the first part of its name, where the declaration names none. PX4's where it has one."""


class ParamSpec(NamedTuple):
    """Declaration of one parameter.

    Every declaration of the project is one of these, whichever table it stands in, so that one walk over them makes the
    reference page, the metadata file, and a C table with the columns name, default, low, high, is_integer.
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
    """The only values of an enumeration, each with its meaning; empty for any number of the range."""
    reboot_required: bool = False

    def number(self, value: float) -> float:
        """Return ``value`` with the type of the parameter: an ``int`` if it is an integer."""
        return int(value) if self.is_integer else float(value)

    def accepted(self, value: float) -> float | str:
        """Return what the parameter becomes when it is set to ``value``, or the sentence why it is refused.

        MAVLink carries float32, so that is a parameter's precision wherever the value comes from: it becomes the
        shortest decimal number that float32 tells apart from its neighbours. 0.35 typed, 0.35 sent as
        0.34999999403953552 and 0.35 read from a file are one value, and the flight is the same. The default keeps its
        own precision, and an end of the range is not missed by the rounding.
        """
        if abs(value) > LARGEST_FLOAT32:  # infinities as well, and integers that no float can hold
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
            return f"{value:g} is outside {self.low:g} to {self.high:g} {self.unit}".rstrip()
        if self.is_integer and value != int(value):
            return f"{value:g} is not a whole number"
        if self.choices and int(value) not in dict(self.choices):
            return f"{value:g} is not one of {', '.join(str(choice) for choice, _ in self.choices)}"
        return None


def group_of(name: str) -> str:
    """Return the group of a parameter by its name, for declarations that name none."""
    return GROUPS.get(name.partition("_")[0], "Miscellaneous")
