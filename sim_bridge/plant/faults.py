"""Faults of rotors, state and battery, at given simulated times: their text, and which are active when.

    rotor:2:off@12.5          rotor 2 gets no power from 12.5 s on
    rotor:2:weak=0.7@10-20    it gives 0.7 of its thrust and torque between 10 s and 20 s
    rotor:1:stuck=150@8       it turns at 150 rad/s, whatever is commanded, as long as the vehicle is armed
    state:freeze@10-12        the same state is sent again and again, with new times
    state:nan@5-5.1           all numbers of the state are sent as NaN
    state:drop@5-6            no state is sent; not in lockstep, where nothing would happen ever after
    battery:level=0.1@20      at 20 s the battery has a tenth of its charge left

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
    """What a fault does."""

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
    """One fault. ``rotor`` counts from 0 and is −1 where no rotor is meant; ``end_us`` None is never."""

    kind: Kind
    rotor: int = -1
    value: float = 0.0  # share of the thrust or of the charge, or speed in rad/s
    begin_us: int = 0
    end_us: int | None = None

    def is_active(self, time_us: int) -> bool:
        """Whether it acts at a time."""
        return self.begin_us <= time_us and (self.end_us is None or time_us < self.end_us)


class _Values(NamedTuple):
    kind: Kind
    low: float | None  # None: takes no value
    high: float | None


_WORDS = {
    ("rotor", "off"): _Values(Kind.ROTOR_OFF, None, None),
    ("rotor", "weak"): _Values(Kind.ROTOR_WEAK, 0.0, 1.0),
    ("rotor", "stuck"): _Values(Kind.ROTOR_STUCK, 0.0, 1e5),
    ("state", "freeze"): _Values(Kind.STATE_FREEZE, None, None),
    ("state", "nan"): _Values(Kind.STATE_NAN, None, None),
    ("state", "drop"): _Values(Kind.STATE_DROP, None, None),
    ("battery", "level"): _Values(Kind.BATTERY_LEVEL, 0.0, 1.0),
}


def parse_fault(text: str, rotor_count: int) -> Fault:
    """Read a fault; raise UsageProblemError with one sentence."""
    shown = text if len(text) <= _LONGEST_QUOTE else f"{text[:_LONGEST_QUOTE]}…"

    def problem(sentence: str) -> UsageProblemError:
        return UsageProblemError(f"--fault {shown}: {sentence}")

    def number(word: str, name: str, low: float, high: float) -> float:
        try:
            value = float(word) if "_" not in word else math.nan  # Python reads 1_000, nobody else does
        except ValueError:
            raise problem(f"{name} {word[:_LONGEST_QUOTE]!r} is not a number") from None
        if not low <= value <= high:
            raise problem(f"{name} must be {low:g} to {high:g}")
        return value

    match = _SPEC.fullmatch(text)
    assert match is not None  # the pattern takes any text
    unit, *rest = match["what"].split(":")
    rotor = -1
    if unit == "rotor" and len(rest) == 2:
        rotor = _rotor(rest.pop(0), rotor_count)
        if rotor < 0:
            raise problem(f"the vehicle has rotors 1 to {rotor_count}")
    word, has_value, value_text = rest[0].partition("=") if len(rest) == 1 else ("", "", "")
    values = _WORDS.get((unit, word))
    if values is None or (unit == "rotor") != (rotor >= 0):
        raise problem(_FORMS)
    value = 0.0
    if (values.low is None) == bool(has_value):
        raise problem(f"{unit} {word} takes " + ("no value" if has_value else f"a value: {word}=NUMBER"))
    if values.low is not None and values.high is not None:
        value = number(value_text, word, values.low, values.high)
    begin_s = 0.0 if match["begin"] is None else number(match["begin"], "the begin", 0.0, LONGEST_S)
    if match["end"] is None:
        return Fault(values.kind, rotor, value, round(begin_s * 1e6))
    if values.kind is Kind.BATTERY_LEVEL:
        raise problem("a charge is set at one moment: give no end")
    end_s = number(match["end"], "the end", 0.0, LONGEST_S)
    if not end_s > begin_s:
        raise problem(f"it ends at {end_s:g} s, not after its begin at {begin_s:g} s")
    return Fault(values.kind, rotor, value, round(begin_s * 1e6), round(end_s * 1e6))


def _rotor(word: str, count: int) -> int:
    number = int(word) if re.fullmatch(r"[0-9]{1,3}", word) else 0
    return number - 1 if 1 <= number <= count else -1


class Schedule:
    """Faults and the times at which something begins or ends, in the order in which they were added."""

    def __init__(self) -> None:
        self.faults: list[Fault] = []

    def active(self, time_us: int) -> list[Fault]:
        """Return the faults that act at a time."""
        return [fault for fault in self.faults if fault.is_active(time_us)]

    def take_due_levels(self, time_us: int) -> list[Fault]:
        """Take out and return the settings of the battery's charge whose time has come."""
        due = [f for f in self.faults if f.kind is Kind.BATTERY_LEVEL and f.begin_us <= time_us]
        self.faults = [fault for fault in self.faults if fault not in due]
        return due

    def forget_past(self, time_us: int) -> None:
        """Drop the faults that are over."""
        self.faults = [fault for fault in self.faults if fault.end_us is None or time_us < fault.end_us]

    def next_change_us(self, time_us: int) -> int | None:
        """Return the first time after ``time_us`` at which a fault begins or ends; None if there is none."""
        times = [fault.begin_us for fault in self.faults]
        times += [fault.end_us for fault in self.faults if fault.end_us is not None]
        return min((time for time in times if time > time_us), default=None)
