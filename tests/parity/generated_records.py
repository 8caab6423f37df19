"""Records of NumPy with numbers, records and arrays of records: material for the generator."""

from __future__ import annotations

from typing import Annotated, NamedTuple, TypeAlias

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Record, RecordArray

SENSORS = 3


class Switches(NamedTuple):
    """Integers."""

    is_on: int
    times: int


class Reading(NamedTuple):
    """Floats: a record, not a row."""

    value: float
    mean: float
    count: float


class Motion(NamedTuple):
    """Numbers beside an array."""

    change: Annotated[FloatArray, 2]
    total: float
    count: int


class Log(NamedTuple):
    """All of them."""

    time_s: float
    switches: Annotated[Record, Switches]
    east: Annotated[Record, Motion]
    north: Annotated[Record, Motion]
    readings: Annotated[RecordArray, Reading, SENSORS]
    steps: int


class Sensors(NamedTuple):
    """A NamedTuple with an array of records."""

    readings: Annotated[RecordArray, Reading, SENSORS]
    weights: Annotated[FloatArray, SENSORS]


LogRecord: TypeAlias = Annotated[Record, Log]
MotionRecord: TypeAlias = Annotated[Record, Motion]
ReadingRecord: TypeAlias = Annotated[Record, Reading]


@compiled
def _add(motion: MotionRecord, change: float) -> float:
    motion["change"][0], motion["change"][1] = change, motion["change"][0]
    motion["total"] += change
    motion["count"] += 1
    total: float = motion["total"]
    return total


@compiled
def _take(reading: ReadingRecord, value: float) -> None:
    reading["value"], reading["count"] = value, reading["count"] + 1.0
    reading["mean"] += 0.5 * (value - reading["mean"])


@compiled
def write_log(log: LogRecord, time_s: float, value: float) -> float:
    switches, elapsed_s = log["switches"], time_s - log["time_s"]
    log["time_s"] = time_s
    if switches["is_on"] == 0:
        switches["is_on"], switches["times"] = 1, switches["times"] + 1
    elif elapsed_s < 0.0:
        log["switches"]["is_on"] = 0
        return float(switches["times"])
    total = _add(log["east"], elapsed_s * value)
    _add(log["north"], -total)
    for number in range(SENSORS):
        reading = log["readings"][number]
        reading["value"] += value
        if reading["count"] > 1.0:
            reading["count"] *= 0.5
    _take(log["readings"][1], value)
    log["steps"] += log["north"]["count"]
    return total + log["readings"][2]["value"]


@compiled
def weigh(sensors: Sensors, value: float) -> float:
    total, readings = 0.0, sensors.readings
    for number in range(SENSORS):
        reading = readings[number]
        total += sensors.weights[number] * reading["mean"]
        _take(sensors.readings[number], value)
    readings[0]["value"] = total
    return total


RECORDS = {"record": write_log, "array of records": weigh}
