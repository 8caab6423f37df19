"""Faults and disturbances at given simulated times: parser of both notations, and schedule.

    rotor:2:weak=0.7@10-20    rotor 2 has 0.7 of its thrust and torque from 10 s to 20 s
    rotor 2 dead @12.5        the same table in words, as in scenario files

Without ``@`` a fault begins at once. A fault begins and ends at the first exchange at or after its time.
``table.py`` has all forms.
"""

from __future__ import annotations

import math
import re
from typing import NamedTuple

from flightstack.core.contract import Vector3
from sim_bridge.errors import UsageProblemError
from sim_bridge.plant.faults.table import (
    NO_END,
    ROTOR_NUMBER,
    ROWS,
    SENSOR_NAME,
    SENSOR_VALUE,
    SENSORS,
    TABLE,
    Fault,
    Kind,
    Range,
    Row,
    SensorUnit,
)

__all__ = ["Fault", "Kind", "Schedule", "parse_fault"]

LONGEST_S = 1e6
_SPEC = re.compile(r"(?P<what>[^@]*)(@(?P<begin>-?[^-]*)(-(?P<end>.*))?)?", re.DOTALL)
_LONGEST_QUOTE = 60


def parse_fault(text: str, rotor_count: int, label: str = "fault") -> Fault:
    """Parse a fault in either notation; raise UsageProblemError with one sentence, which begins with ``label``."""
    match = _SPEC.fullmatch(text)
    assert match is not None  # the pattern matches any text
    try:
        fault = _parse_effect(match["what"].strip(), rotor_count)
        return _with_times(fault, match["begin"], match["end"])
    except ValueError as error:
        raise UsageProblemError(f"{label} {shortened(text)}: {error}") from None


def shortened(text: str) -> str:
    """Return the begin of a long text."""
    return text if len(text) <= _LONGEST_QUOTE else f"{text[:_LONGEST_QUOTE]}…"


class _Form(NamedTuple):
    """One notation of a row as words and separators."""

    row: Row
    words: list[str]

    def agreement(self, given: list[str]) -> int:
        """Return the number of leading words that agree."""
        pairs = zip(self.words, given, strict=False)
        return next(
            (n for n, (own, word) in enumerate(pairs) if own != word and not self.row.is_placeholder(own)),
            min(len(self.words), len(given)),
        )


def _words(text: str) -> list[str]:
    """Split either notation; the separators of the compact one are words."""
    spaced = re.sub(r"\s*,\s*", ",", text)
    return re.split(r"([:=])", spaced) if ":" in spaced else spaced.split()


_COMPACT = tuple(_Form(row, _words(row.compact)) for row in TABLE)
_IN_WORDS = tuple(_Form(row, _words(row.words)) for row in TABLE)


def _parse_effect(what: str, rotor_count: int) -> Fault:
    """Parse kind, rotor and values of a fault; raise ValueError."""
    given = _words(what)
    forms = _COMPACT if ":" in what else _IN_WORDS
    matches = [form for form in forms if form.agreement(given) == len(given) == len(form.words)]
    if not matches:
        raise ValueError(_expected(forms, given))
    # a word of the notation is stronger than a placeholder: "payload cut" has no mass
    row, words = max(matches, key=lambda form: sum(map(str.__eq__, form.words, given)))
    fault = Fault(row.kind)
    for name, word in zip(words, given, strict=True):
        if name == ROTOR_NUMBER:
            fault = fault._replace(rotor=_parse_rotor(word, rotor_count))
        elif name == SENSOR_NAME or (word in SENSORS and words[0] == "sensor"):
            fault = fault._replace(sensor=_parse_sensor(word))
        elif name == SENSOR_VALUE:
            fault = fault._replace(vector=_parse_sensor_value(word, fault.sensor))
        elif name in row.ranges and "," in name:
            fault = fault._replace(vector=_parse_vector(word, name, row.ranges[name]))
        elif name in row.ranges:
            span = row.ranges[name]
            if row.kind is Kind.SENSOR_NOISE:
                unit, _, most = _sensor_unit(fault.sensor)
                span = Range(0.0, most, unit)
            fault = fault._replace(value=_parse_number(word, name, span))
    return fault


def _expected(forms: tuple[_Form, ...], given: list[str]) -> str:
    """Return the forms that agree best with the given words, with their values."""
    best = max(form.agreement(given) for form in forms)
    if best == 0:
        return f"the part is not one of {', '.join(dict.fromkeys(form.words[0] for form in forms))}"
    rows = [form.row for form in forms if form.agreement(given) == best]
    notations = [row.compact if forms is _COMPACT else row.words for row in rows]
    told = [notation + _allowed(row) for notation, row in zip(notations, rows, strict=True)]
    return "expected " + (f"{', '.join(told[:-1])} or {told[-1]}" if len(told) > 1 else told[0])


def _allowed(row: Row) -> str:
    """Return the allowed values of a row in parentheses."""
    return f" ({'; '.join(f'{name} {span}' for name, span in row.ranges.items())})" if row.ranges else ""


def _with_times(fault: Fault, begin: str | None, end: str | None) -> Fault:
    """Return the fault with its begin and end [s]; raise ValueError."""
    span = Range(0.0, LONGEST_S, "s")
    if begin in ("", "-") or end == "":
        raise ValueError(f"a time is missing after {'-' if end == '' else '@'}")
    begin_s = 0.0 if begin is None else _parse_number(begin, "the begin", span)
    fault = fault._replace(begin_us=round(begin_s * 1e6))
    if end is None:
        return fault
    if ROWS[fault.kind].is_event:
        raise ValueError(NO_END)
    end_s = _parse_number(end, "the end", span)
    if not end_s > begin_s:
        raise ValueError(f"its end, {end_s:g} s, is not after its begin, {begin_s:g} s")
    return fault._replace(end_us=round(end_s * 1e6))


def _parse_number(text: str, name: str, allowed: Range) -> float:
    try:
        value = float(text) if "_" not in text else math.nan  # float() accepts 1_000
    except ValueError:
        raise ValueError(f"{name} {text[:_LONGEST_QUOTE]!r} is not a number") from None
    if not allowed.low <= value <= allowed.high:
        raise ValueError(f"{name} must be {allowed}")
    return value


def _parse_vector(text: str, name: str, allowed: Range) -> Vector3:
    parts = text.split(",")
    if len(parts) != 3:
        raise ValueError(f"{name} must be three numbers separated by commas, each {allowed}")
    x, y, z = (_parse_number(part, axis, allowed) for part, axis in zip(parts, name.split(","), strict=True))
    return Vector3(x, y, z)


def _parse_sensor(text: str) -> str:
    match = re.fullmatch(r"([a-z]+)([1-9]?)", text)
    if match is None or match[1] not in SENSORS or (match[2] and match[1] not in ("imu", "gyro", "accel")):
        names = ", ".join(SENSORS)
        raise ValueError(
            f"{text[:_LONGEST_QUOTE]!r} is not a sensor: {names}; imu2, gyro2, accel2 is the second one"
        )
    return text


def _sensor_unit(sensor: str) -> SensorUnit:
    """Return the unit of the faults of a sensor that have a value."""
    found = SENSORS[sensor.rstrip("0123456789")]
    if not found.components:
        raise ValueError(f"{sensor} is gyro and accelerometer: name one of them")
    return found


def _parse_sensor_value(text: str, sensor: str) -> Vector3:
    """Parse one number for each component of a sensor."""
    unit, count, most = _sensor_unit(sensor)
    parts = text.split(",")
    if len(parts) != count:
        numbers = "one number," if count == 1 else f"{count} numbers separated by commas, each"
        raise ValueError(f"VALUE of {sensor} must be {numbers} {Range(-most, most, unit)}")
    values = [_parse_number(part, SENSOR_VALUE, Range(-most, most, unit)) for part in parts]
    x, y, z = (*values, 0.0, 0.0)[:3]
    return Vector3(x, y, z)


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

    def take_due_events(self, time_us: int) -> list[Fault]:
        """Remove and return the events that are due, by their times, and remove the faults that they end."""
        due = [f for f in self.faults if ROWS[f.kind].is_event and f.begin_us <= time_us]
        due.sort(key=lambda event: event.begin_us)
        for event in due:
            self.faults.remove(event)
            ended = ROWS[event.kind].ends
            self.faults = [
                fault
                for fault in self.faults
                if fault.kind not in ended or ROWS[fault.kind].is_event or fault.begin_us > event.begin_us
            ]
        return due

    def remove_past(self, time_us: int) -> None:
        """Remove the faults that have ended."""
        self.faults = [fault for fault in self.faults if fault.end_us is None or time_us < fault.end_us]

    def next_change_us(self, time_us: int) -> int | None:
        """Return the next begin or end of a fault after ``time_us``, or None."""
        times = [fault.begin_us for fault in self.faults]
        times += [fault.end_us for fault in self.faults if fault.end_us is not None]
        return min((time for time in times if time > time_us), default=None)
