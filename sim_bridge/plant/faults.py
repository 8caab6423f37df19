"""Faults of rotors, state and battery at given simulated times: syntax and schedule.

    rotor:2:off@12.5          rotor 2 has no power from 12.5 s on
    rotor:2:weak=0.7@10-20    it has 0.7 of its thrust and torque from 10 s to 20 s
    rotor:1:stuck=150@8       it turns at 150 rad/s whatever the command, while armed
    state:freeze@10-12        the same state is repeated with new timestamps
    state:nan@5-5.1           all numbers of the state are sent as NaN
    state:drop@5-6            no state is sent; impossible in lockstep
    battery:level=0.1@20      at 20 s the charge of the battery is set to 10 %

Without ``@`` a fault begins at once. A fault begins and ends at the first exchange at or after its time.
"""

from __future__ import annotations

import math
import re
from enum import Enum
from typing import NamedTuple

from sim_bridge.errors import UsageProblemError

LONGEST_S = 1e6
_SPEC = re.compile(r"(?P<what>[^@]*)(@(?P<begin>[^-]*)(-(?P<end>.*))?)?", re.DOTALL)
_FORMS = (
    "expected rotor:N:off, rotor:N:weak=SHARE, rotor:N:stuck=RAD_S, state:freeze, state:nan, state:drop or "
    "battery:level=SHARE, each with @BEGIN or @BEGIN-END in seconds"
)
_LONGEST_QUOTE = 60


class Kind(Enum):
    """Effect of a fault."""

    ROTOR_OFF = "rotor off"
    ROTOR_WEAK = "rotor weak"
    ROTOR_STUCK = "rotor stuck"
    STATE_FREEZE = "state freeze"
    STATE_NAN = "state nan"
    STATE_DROP = "state drop"
    BATTERY_LEVEL = "battery level"


ROTOR_KINDS = frozenset({Kind.ROTOR_OFF, Kind.ROTOR_WEAK, Kind.ROTOR_STUCK})
STATE_KINDS = frozenset({Kind.STATE_FREEZE, Kind.STATE_NAN, Kind.STATE_DROP})


class Fault(NamedTuple):
    """One fault. ``rotor`` counts from 0, −1 for none; ``end_us`` None is never."""

    kind: Kind
    rotor: int = -1
    value: float = 0.0  # share of the thrust or of the charge, or speed in rad/s
    begin_us: int = 0
    end_us: int | None = None

    def is_active(self, time_us: int) -> bool:
        """Return True if the fault is active at ``time_us``."""
        return self.begin_us <= time_us and (self.end_us is None or time_us < self.end_us)


class _Syntax(NamedTuple):
    kind: Kind
    low: float | None  # None: takes no value
    high: float | None


_SYNTAX = {
    ("rotor", "off"): _Syntax(Kind.ROTOR_OFF, None, None),
    ("rotor", "weak"): _Syntax(Kind.ROTOR_WEAK, 0.0, 1.0),
    ("rotor", "stuck"): _Syntax(Kind.ROTOR_STUCK, 0.0, 1e5),
    ("state", "freeze"): _Syntax(Kind.STATE_FREEZE, None, None),
    ("state", "nan"): _Syntax(Kind.STATE_NAN, None, None),
    ("state", "drop"): _Syntax(Kind.STATE_DROP, None, None),
    ("battery", "level"): _Syntax(Kind.BATTERY_LEVEL, 0.0, 1.0),
}


def parse_fault(text: str, rotor_count: int) -> Fault:
    """Parse a fault; raise UsageProblemError with one sentence."""
    match = _SPEC.fullmatch(text)
    assert match is not None  # the pattern matches any text
    try:
        fault = _parse_effect(match["what"], rotor_count)
        return _with_times(fault, match["begin"], match["end"])
    except ValueError as error:
        shown = text if len(text) <= _LONGEST_QUOTE else f"{text[:_LONGEST_QUOTE]}…"
        raise UsageProblemError(f"--fault {shown}: {error}") from None


def _parse_effect(what: str, rotor_count: int) -> Fault:
    """Parse kind, rotor and value of a fault; raise ValueError."""
    unit, *rest = what.split(":")
    rotor = -1
    if unit == "rotor" and len(rest) == 2:
        rotor = _parse_rotor(rest.pop(0), rotor_count)
    word, has_value, text = rest[0].partition("=") if len(rest) == 1 else ("", "", "")
    syntax = _SYNTAX.get((unit, word))
    if syntax is None or (unit == "rotor") != (rotor >= 0):
        raise ValueError(_FORMS)
    if (syntax.low is None) == bool(has_value):
        raise ValueError(f"{unit} {word} takes " + ("no value" if has_value else f"a value: {word}=NUMBER"))
    if syntax.low is None or syntax.high is None:
        return Fault(syntax.kind, rotor)
    return Fault(syntax.kind, rotor, _parse_number(text, word, syntax.low, syntax.high))


def _with_times(fault: Fault, begin: str | None, end: str | None) -> Fault:
    """Return the fault with its begin and end [s]; raise ValueError."""
    begin_s = 0.0 if begin is None else _parse_number(begin, "the begin", 0.0, LONGEST_S)
    fault = fault._replace(begin_us=round(begin_s * 1e6))
    if end is None:
        return fault
    if fault.kind is Kind.BATTERY_LEVEL:
        raise ValueError("the charge is set at one time: give no end")
    end_s = _parse_number(end, "the end", 0.0, LONGEST_S)
    if not end_s > begin_s:
        raise ValueError(f"its end, {end_s:g} s, is not after its begin, {begin_s:g} s")
    return fault._replace(end_us=round(end_s * 1e6))


def _parse_number(text: str, name: str, low: float, high: float) -> float:
    try:
        value = float(text) if "_" not in text else math.nan  # float() accepts 1_000
    except ValueError:
        raise ValueError(f"{name} {text[:_LONGEST_QUOTE]!r} is not a number") from None
    if not low <= value <= high:
        raise ValueError(f"{name} must be {low:g} to {high:g}")
    return value


def _parse_rotor(text: str, count: int) -> int:
    number = int(text) if re.fullmatch(r"[0-9]{1,3}", text) else 0
    if not 1 <= number <= count:
        raise ValueError(f"the vehicle has rotors 1 to {count}")
    return number - 1


class Schedule:
    """Scheduled faults, in the order in which they were added."""

    def __init__(self) -> None:
        self.faults: list[Fault] = []

    def active(self, time_us: int) -> list[Fault]:
        """Return the faults that are active at ``time_us``."""
        return [fault for fault in self.faults if fault.is_active(time_us)]

    def take_due_levels(self, time_us: int) -> list[Fault]:
        """Remove and return the settings of the battery charge that are due."""
        due = [f for f in self.faults if f.kind is Kind.BATTERY_LEVEL and f.begin_us <= time_us]
        self.faults = [fault for fault in self.faults if fault not in due]
        return due

    def remove_past(self, time_us: int) -> None:
        """Remove the faults that have ended."""
        self.faults = [fault for fault in self.faults if fault.end_us is None or time_us < fault.end_us]

    def next_change_us(self, time_us: int) -> int | None:
        """Return the next begin or end of a fault after ``time_us``, or None."""
        times = [fault.begin_us for fault in self.faults]
        times += [fault.end_us for fault in self.faults if fault.end_us is not None]
        return min((time for time in times if time > time_us), default=None)
