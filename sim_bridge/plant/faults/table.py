"""The table of faults and disturbances: for each one its two notations, its values and its effect.

Parser, error sentences, command help and docs/reference/faults.md follow this table. A new fault is a row here and an
effect: of the plant in ``effects.py``, of the state that is sent in ``sent_state.py``.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from types import MappingProxyType
from typing import NamedTuple

from flightstack.core.contract import Vector3
from flightstack.core.errors import plain


class Kind(Enum):
    """Effect of a fault."""

    ROTOR_OFF = "rotor off"
    ROTOR_WEAK = "rotor weak"
    ROTOR_STUCK = "rotor stuck"
    ROTOR_DELAYED = "rotor delayed"
    PAYLOAD = "payload"
    PAYLOAD_CUT = "payload cut"
    CENTRE = "centre of gravity"
    WIND_STEP = "wind step"
    WIND_GUST = "wind gust"
    WIND_SHEAR = "wind shear"
    GROUND_EFFECT = "ground effect"
    GROUND_EFFECT_OFF = "ground effect off"
    BATTERY_LEVEL = "battery level"
    BATTERY_SAG = "battery sag"
    BATTERY_CELL = "battery cell"
    STATE_FREEZE = "state freeze"
    STATE_NAN = "state nan"
    STATE_DROP = "state drop"
    STATE_LATE = "state late"
    SENSOR_OFF = "sensor off"
    SENSOR_FREEZE = "sensor freeze"
    SENSOR_BIAS = "sensor bias"
    SENSOR_DRIFT = "sensor drift"
    SENSOR_NOISE = "sensor noise"
    SENSOR_LATE = "sensor late"
    SENSOR_LOSS = "sensor loss"
    GNSS_JAM = "gnss jam"
    MAG_TURN = "mag turn"
    VIBRATION = "vibration"
    CLOCK_STALL = "clock stall"
    CLOCK_JUMP = "clock jump"
    CLEAR = "clear"


STATE_KINDS = frozenset({Kind.STATE_FREEZE, Kind.STATE_NAN, Kind.STATE_DROP, Kind.STATE_LATE})


class Need(Enum):
    """Condition for a fault to act, in the words of the reference page."""

    BATTERY = "a battery"
    CELLS = "two cells or more"
    DRAG = "drag, not `paper`"
    MEAN_WIND = "a mean wind"
    MASS = "not `paper`"
    PAYLOAD = "a payload"
    GROUND = "ground, not `paper`"
    SENSOR = "the sensor"


class Fault(NamedTuple):
    """One fault. ``rotor`` counts from 0, −1 for none; ``end_us`` None is never; ``sensor`` is a name as "gyro2"."""

    kind: Kind
    rotor: int = -1
    value: float = 0.0
    begin_us: int = 0
    end_us: int | None = None
    vector: Vector3 = Vector3(0.0, 0.0, 0.0)
    sensor: str = ""

    def is_active(self, time_us: int) -> bool:
        """Return True if the fault is active at ``time_us``."""
        return self.begin_us <= time_us and (self.end_us is None or time_us < self.end_us)


class Range(NamedTuple):
    """Allowed values of a placeholder, or of each component of a vector."""

    low: float
    high: float
    unit: str = ""

    def __str__(self) -> str:
        return f"{plain(self.low)} to {plain(self.high)}" + (f" {self.unit}" if self.unit else "")


NO_END = "it acts at one time: give no end"
"""Reason to refuse an event with an end."""

ROTOR_NUMBER = "N"
"""Placeholder of the number of a rotor, from 1."""

SENSOR_NAME = "SENSOR"
"""Placeholder of a sensor, a name of ``SENSORS``; with a number from 1 for one of several inertial sensors."""

SENSOR_VALUE = "VALUE"
"""Placeholder of a value in the unit of a sensor: one number for each of its components, separated by commas."""


class SensorUnit(NamedTuple):
    """Unit of the faults of a sensor."""

    unit: str
    components: int
    most: float
    """Largest value of a fault."""


SENSORS: Mapping[str, SensorUnit] = MappingProxyType(
    {
        "imu": SensorUnit("", 0, 0.0),
        "gyro": SensorUnit("°/s", 3, 2000.0),
        "accel": SensorUnit("m/s²", 3, 200.0),
        "mag": SensorUnit("gauss", 3, 10.0),
        "baro": SensorUnit("hPa", 1, 1000.0),
        "gnss": SensorUnit("m", 3, 1e6),
        "range": SensorUnit("m", 1, 1e4),
        "flow": SensorUnit("rad/s", 2, 100.0),
    }
)
"""Sensors that can fail; ``imu`` is gyro and accelerometer together, without values."""

_NO_VALUES: Mapping[str, Range] = MappingProxyType({})


class Row(NamedTuple):
    """One fault of the table. Words in capitals are placeholders: a rotor number, or a key of ``ranges``."""

    kind: Kind
    compact: str
    words: str
    effect: str
    ranges: Mapping[str, Range] = _NO_VALUES
    needs: tuple[Need, ...] = ()
    is_event: bool = False  # acts once, at its begin
    ends: frozenset[Kind] = frozenset()  # active faults that this event ends

    @property
    def part(self) -> str:
        """Kind of part that fails: the first word of the compact notation."""
        return self.compact.partition(":")[0]

    def is_placeholder(self, word: str) -> bool:
        """Return True if a word of a notation stands for a value."""
        return word in (ROTOR_NUMBER, SENSOR_NAME, SENSOR_VALUE) or word in self.ranges


_SHARE = Range(0.0, 1.0)
_POINT = Range(-2.0, 2.0, "m")

TABLE: tuple[Row, ...] = (
    Row(
        Kind.ROTOR_OFF, "rotor:N:off", "rotor N dead",
        "The rotor has no power and runs down with its lag.",
    ),
    Row(
        Kind.ROTOR_WEAK, "rotor:N:weak=SHARE", "rotor N efficiency SHARE",
        "It has this share of its thrust and torque.", {"SHARE": _SHARE},
    ),
    Row(
        Kind.ROTOR_STUCK, "rotor:N:stuck=RAD_S", "rotor N stuck RAD_S",
        "It turns at this speed whatever is commanded, while armed.", {"RAD_S": Range(0.0, 1e5, "rad/s")},
    ),
    Row(
        Kind.ROTOR_DELAYED, "rotor:N:delayed=SECONDS", "rotor N delayed SECONDS",
        "Its commands act later by this dead time, rounded up to integration steps. Until the first one acts, the "
        "last command before the fault holds. Disarming acts at once.", {"SECONDS": Range(1e-4, 2.0, "s")},
    ),
    Row(
        Kind.PAYLOAD, "payload:add=KG:at=X,Y,Z", "payload KG at X,Y,Z",
        "A point mass is attached, in body axes FRD from the origin of the vehicle file. Mass, inertia and centre of "
        "gravity change.", {"KG": Range(1e-3, 100.0, "kg"), "X,Y,Z": _POINT}, (Need.MASS,),
    ),
    Row(
        Kind.PAYLOAD_CUT, "payload:cut", "payload cut", "The payload is gone.",
        needs=(Need.PAYLOAD,), is_event=True, ends=frozenset({Kind.PAYLOAD}),
    ),
    Row(
        Kind.CENTRE, "centre:at=X,Y,Z", "centre of gravity X,Y,Z",
        "The centre of gravity of the vehicle without payload is at this point, FRD; the inertia about it is "
        "unchanged.", {"X,Y,Z": Range(-0.5, 0.5, "m")}, (Need.MASS,),
    ),
    Row(
        Kind.WIND_STEP, "wind:step=N,E,D", "wind step N,E,D",
        "This wind adds to the mean wind.", {"N,E,D": Range(-200.0, 200.0, "m/s")}, (Need.DRAG,),
    ),
    Row(
        Kind.WIND_GUST, "wind:gust=M_S", "gust M_S",
        "The gusts have this standard deviation instead of that of `--gust`; the present gust scales with it.",
        {"M_S": Range(0.0, 100.0, "m/s")}, (Need.DRAG,),
    ),
    Row(
        Kind.WIND_SHEAR, "wind:shear=EXPONENT", "wind shear EXPONENT",
        "The mean wind changes with the height h above the ground as (h / 10 m) to this power.",
        {"EXPONENT": _SHARE}, (Need.DRAG, Need.MEAN_WIND),
    ),
    Row(
        Kind.GROUND_EFFECT, "ground:effect=on", "ground effect on",
        "The thrust grows near the ground (Cheeseman and Bennett).", needs=(Need.GROUND,),
    ),
    Row(
        Kind.GROUND_EFFECT_OFF, "ground:effect=off", "ground effect off", "The ground effect ends.",
        is_event=True, ends=frozenset({Kind.GROUND_EFFECT}),
    ),
    Row(
        Kind.BATTERY_LEVEL, "battery:level=SHARE", "battery level SHARE",
        "The charge is set to this share of the capacity.", {"SHARE": _SHARE}, (Need.BATTERY,), is_event=True,
    ),
    Row(
        Kind.BATTERY_SAG, "battery:sag=OHM", "battery sag OHM",
        "The internal resistance of the pack is larger by this.", {"OHM": Range(0.0, 100.0, "ohm")}, (Need.BATTERY,),
    ),
    Row(
        Kind.BATTERY_CELL, "battery:cell", "battery cell dead",
        "One cell has no voltage: the open-circuit voltage of the pack falls by one cell.",
        needs=(Need.BATTERY, Need.CELLS),
    ),
    Row(
        Kind.SENSOR_OFF, "sensor:SENSOR:off", "sensor SENSOR off", "The sensor sends no measurements.",
        needs=(Need.SENSOR,),
    ),
    Row(
        Kind.SENSOR_FREEZE, "sensor:SENSOR:freeze", "sensor SENSOR frozen",
        "It sends its last measurement again and again.", needs=(Need.SENSOR,),
    ),
    Row(
        Kind.SENSOR_BIAS, "sensor:SENSOR:bias=VALUE", "sensor SENSOR bias VALUE",
        "Its measurements are off by this; a GNSS position jumps.", needs=(Need.SENSOR,),
    ),
    Row(
        Kind.SENSOR_DRIFT, "sensor:SENSOR:drift=VALUE", "sensor SENSOR drift VALUE",
        "Its measurements move away by this per second; a GNSS position is spoofed slowly, with its velocity.",
        needs=(Need.SENSOR,),
    ),
    Row(
        Kind.SENSOR_NOISE, "sensor:SENSOR:noise=SPREAD", "sensor SENSOR noise SPREAD",
        "White noise of this standard deviation, in the unit of the sensor, adds to each measurement.",
        {"SPREAD": Range(0.0, 1e6)}, (Need.SENSOR,),
    ),
    Row(
        Kind.SENSOR_LATE, "sensor:SENSOR:late=SECONDS", "sensor SENSOR late SECONDS",
        "Its measurements arrive later by this time, rounded up to an exchange. They begin with a gap.",
        {"SECONDS": Range(1e-4, 10.0, "s")}, (Need.SENSOR,),
    ),
    Row(
        Kind.SENSOR_LOSS, "sensor:SENSOR:loss=SHARE", "sensor SENSOR loss SHARE",
        "This share of its measurements, at random, is lost.", {"SHARE": _SHARE}, (Need.SENSOR,),
    ),
    Row(
        Kind.GNSS_JAM, "sensor:gnss:jam=SHARE", "sensor gnss jammed SHARE",
        "The receiver loses this share of its satellites; noise and stated accuracy grow as 1 / (1 − SHARE), and with "
        "fewer than four satellites there is no fix.", {"SHARE": _SHARE}, (Need.SENSOR,),
    ),
    Row(
        Kind.MAG_TURN, "sensor:mag:turn=DEGREES", "sensor mag turned DEGREES",
        "The magnetometer is turned about the vertical axis of the body by this.",
        {"DEGREES": Range(-360.0, 360.0, "°")}, (Need.SENSOR,),
    ),
    Row(
        Kind.VIBRATION, "sensor:imu:vibration=FACTOR", "sensor imu vibration FACTOR",
        "The rotors shake the inertial sensors by this factor.", {"FACTOR": Range(0.0, 1000.0)}, (Need.SENSOR,),
    ),
    Row(Kind.STATE_FREEZE, "state:freeze", "state frozen", "The same state is sent, with new times."),
    Row(Kind.STATE_NAN, "state:nan", "state nan", "All numbers of the state are NaN."),
    Row(
        Kind.STATE_DROP, "state:drop", "state dropped",
        "No state is sent; refused in lockstep, where both sides would wait for each other.",
    ),
    Row(
        Kind.STATE_LATE, "state:late=SECONDS", "state late SECONDS",
        "The state sent is older by this time, with a new time stamp. The state at the begin is repeated until it is "
        "that old.", {"SECONDS": Range(1e-4, 10.0, "s")},
    ),
    Row(
        Kind.CLOCK_STALL, "clock:stall", "clock stalled",
        "All states have the same time stamp while the plant moves on. The clock resumes from that time.",
    ),
    Row(
        Kind.CLOCK_JUMP, "clock:jump=SECONDS", "clock jump SECONDS",
        "The time stamps jump by this time, backwards not below zero.", {"SECONDS": Range(-1e5, 1e5, "s")},
        is_event=True,
    ),
    Row(
        Kind.CLEAR, "clear", "clear", "All faults that have begun end.",
        is_event=True, ends=frozenset(Kind),
    ),
)  # fmt: skip
"""All faults, by part."""

ROWS: Mapping[Kind, Row] = MappingProxyType({row.kind: row for row in TABLE})
