"""Streams of events for an estimator: a flight as it was, and with sensors lost, added and wrong."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence

import numpy as np

from flightstack.estimation.clock_origin import SPAN_S
from flightstack.estimation.estimator_params import EstimatorParams
from flightstack.estimation.rings import BARO_RING, GNSS_RING, MAG_RING, RANGE_RING
from flightstack.testing import World
from tests.support.filter_events import (
    EARTH,
    FIELD,
    HEALTH,
    IMU,
    NUMBERS,
    ORIGIN,
    PARAMS,
    TIMED,
    Event,
    recorded,
)

Events = Sequence[Event]


@functools.cache
def flown(plan: str = "hop") -> tuple[Event, ...]:
    """Return the events of a flight in wind with gusts."""
    with (
        recorded() as events,
        World(state="estimated", seed=3, vehicle="x_quad", wind=(4.0, -2.0), gust=1.0) as world,
    ):
        flight = world.fly(plan)
    assert flight.completed, flight.outcome
    lengths = {address: len(given) for address, given in events.items()}
    return tuple(events[max(lengths, key=lengths.__getitem__)])


def _with_params(events: Events, **values: float) -> list[Event]:
    """Return the events with other parameters."""
    names = EstimatorParams._fields
    made = []
    for kind, row in events:
        changed = row.copy()
        if kind == PARAMS:
            for name, value in values.items():
                changed[names.index(name)] = value
        made.append(Event(kind, changed))
    return made


def _time_of(event: Event) -> float:
    return float(event.row[0]) if event.kind in (IMU, GNSS_RING, MAG_RING, BARO_RING, RANGE_RING) else -1.0


def _without(events: Events, ring: int, start_s: float = 0.0, end_s: float = 1e9) -> list[Event]:
    return [e for e in events if e.kind != ring or not start_s <= _time_of(e) < end_s]


def _delayed(events: Events, delay_s: float) -> list[Event]:
    """Give the samples of all sensors but IMU and GNSS an older time in the second half of the flight."""
    middle_s = _time_of(events[len(events) // 2])
    made = []
    for kind, row in events:
        changed = row.copy()
        if kind in (MAG_RING, BARO_RING, RANGE_RING) and row[0] > middle_s:
            changed[0] -= delay_s
        made.append(Event(kind, changed))
    return made


def _with_range(events: Events) -> list[Event]:
    """Add a rangefinder above the place of take-off to the barometer's samples, lost for two seconds in the middle."""
    first = next(e.row[1] for e in events if e.kind == BARO_RING)
    middle_s = _time_of(events[len(events) // 2])
    made = []
    for event in events:
        made.append(event)
        is_lost = abs(_time_of(event) - middle_s) < 1.0
        if event.kind == BARO_RING and not is_lost:
            made.append(Event(RANGE_RING, np.array([event.row[0], max(event.row[1] - first, 0.0) + 0.1])))
    return made


def _moved_fixes(events: Events, shift_m: float, shift_m_s: float) -> list[Event]:
    """Move positions and velocities of GNSS in the second half of the flight."""
    middle_s = _time_of(events[len(events) // 2])
    made = []
    for kind, row in events:
        changed = row.copy()
        if kind == GNSS_RING and row[0] > middle_s:
            changed[1:4] += shift_m
            changed[4:7] += shift_m_s
        made.append(Event(kind, changed))
    return made


def _drifting_fixes(events: Events, east_m_s: float) -> list[Event]:
    """Move positions of GNSS to the east in the second half of the flight, at a speed that its velocities lack."""
    middle_s = _time_of(events[len(events) // 2])
    made = []
    for kind, row in events:
        changed = row.copy()
        if kind == GNSS_RING and row[0] > middle_s:
            changed[2] += east_m_s * (row[0] - middle_s)
        made.append(Event(kind, changed))
    return made


def _wrong_climb(events: Events, down_m_s: float) -> list[Event]:
    """Add a vertical speed to the velocities of GNSS after the climb."""
    made = []
    for kind, row in events:
        changed = row.copy()
        if kind == GNSS_RING and row[0] > _CLIMB_S:
            changed[6] += down_m_s
        made.append(Event(kind, changed))
    return made


def _stuck_barometer(events: Events) -> list[Event]:
    """Repeat an altitude of the barometer in the second half of the flight."""
    middle_s = _time_of(events[len(events) // 2])
    stuck_m = next(row[1] for kind, row in events if kind == BARO_RING and row[0] > middle_s)
    made = []
    for kind, row in events:
        changed = row.copy()
        if kind == BARO_RING and row[0] > middle_s:
            changed[1] = stuck_m
        made.append(Event(kind, changed))
    return made


def _wrong_barometer(
    events: Events, step_m: float, drift_m_s: float, begin_s: float | None = None
) -> list[Event]:
    """Add a step and a drift to the barometer's altitudes from ``begin_s`` on, or after the climb."""
    since_s = _CLIMB_S if begin_s is None else begin_s
    made = []
    for kind, row in events:
        changed = row.copy()
        if kind == BARO_RING and row[0] > since_s:
            changed[1] += step_m + drift_m_s * (row[0] - since_s)
        made.append(Event(kind, changed))
    return made


def _wrong_accelerometer(events: Events, down_m_s2: float) -> list[Event]:
    """Add an acceleration along the axis down after the climb."""
    made = []
    for kind, row in events:
        changed = row.copy()
        if kind == IMU and row[0] > _CLIMB_S:
            changed[7] += down_m_s2
        made.append(Event(kind, changed))
    return made


def _other_cutoffs(events: Events) -> list[Event]:
    """Change the cut-off of the rates' filter in flight, and switch it off."""
    params = next(row for kind, row in events if kind == PARAMS)
    made = list(events)
    for share, cutoff_hz in ((3, 0.0), (2, 30.0)):  # the later one first
        changed = params.copy()
        changed[EstimatorParams._fields.index("gyro_cutoff_hz")] = cutoff_hz
        made.insert(share * len(events) // 4, Event(PARAMS, changed))
    return made


def _turned_field(events: Events, turn_rad: float, strength: float = 1.0) -> list[Event]:
    """Turn the measured magnetic field; multiply it once it may have been aligned with."""
    sine, cosine = np.sin(turn_rad), np.cos(turn_rad)
    made = []
    for kind, row in events:
        changed = row.copy()
        if kind == MAG_RING:
            changed[1:3] = cosine * row[1] - sine * row[2], sine * row[1] + cosine * row[2]
            changed[1:4] *= strength if row[0] > _CLIMB_S else 1.0
        made.append(Event(kind, changed))
    return made


def _turned_track(events: Events) -> list[Event]:
    """Turn positions and velocities of GNSS by 90 degrees."""
    places = [0, 2, 1, 3, 5, 4, 6, 7, 8, 9]
    signs = np.array([1.0, -1.0, 1.0, 1.0, -1.0, 1.0, 1.0, 1.0, 1.0, 1.0])
    return [
        Event(kind, row[places] * signs) if kind == GNSS_RING else Event(kind, row) for kind, row in events
    ]


def _moving(events: Events) -> list[Event]:
    """Accelerate during the alignment, in a field of which only the declination is known."""
    made = [Event(EARTH, np.array([0.0, 0.0, 0.0, 0.1]))]
    for kind, row in events:
        changed = row.copy()
        if kind == IMU and row[0] < 1.0:
            changed[5] += 8.0
        if kind not in (EARTH, FIELD):
            made.append(Event(kind, changed))
    return made


def _in_eastern_field(events: Events) -> list[Event]:
    """Give a field of the Earth that points east."""
    given = Event(EARTH, np.array([0.0, 0.2, 0.4, np.pi / 2]))
    return [given, *(event for event in events if event.kind not in (EARTH, FIELD))]


def _new_earth_field(events: Events, turn_rad: float) -> list[Event]:
    """Turn the Earth's field that the filter knows, in flight."""
    earth = next(e.row for e in events if e.kind == EARTH).copy()
    sine, cosine = np.sin(turn_rad), np.cos(turn_rad)
    earth[:2] = earth[0] * cosine - earth[1] * sine, earth[0] * sine + earth[1] * cosine
    earth[3] += turn_rad
    at = 2 * len(events) // 3
    return [*events[:at], Event(EARTH, earth), Event(FIELD, np.zeros(1)), *events[at:]]


def _broken(events: Events) -> list[Event]:
    """Give samples that are not finite, out of order, without a duration, a gap, and a hit beyond the range."""
    middle_s = _time_of(events[len(events) // 2])
    made = []
    for number, event in enumerate(events):
        if event.kind == IMU and middle_s < _time_of(event) < middle_s + 0.2:
            continue
        row = event.row.copy()
        if event.kind == IMU and 0.5 <= _time_of(event) - middle_s < 0.504:
            row[2], row[6] = 60.0, 300.0
        made.append(Event(event.kind, row.copy()))
        if number % 50 == 0:
            row[-1] = np.nan
            made.append(Event(event.kind, row) if event.kind in (IMU, MAG_RING) else event)
        elif event.kind == GNSS_RING:
            made[-1] = Event(GNSS_RING, np.array([*row[:7], -1.0, np.inf, 0.3]))
        elif number % 50 == 1 and event.kind == IMU:
            row[0] -= 1.0
            made.append(Event(IMU, row))
        elif number % 50 == 2 and event.kind == IMU:
            row[0], row[1] = row[0] + 1e-4, 0.0
            made.append(Event(IMU, row))
    return made


def _tumbling(events: Events) -> list[Event]:
    """Roll by 1.5 rad in half a second of the flight."""
    middle_s = _time_of(events[len(events) // 2])
    made = []
    for kind, row in events:
        changed = row.copy()
        if kind == IMU and middle_s < row[0] < middle_s + 0.5:
            changed[2] += 3.0
        made.append(Event(kind, changed))
    return made


def _wrong_gyro(events: Events, begin_s: float, rate_rad_s: float) -> list[Event]:
    """Add a rate about x and z to those of the gyro from ``begin_s`` on."""
    made = []
    for kind, row in events:
        changed = row.copy()
        if kind == IMU and row[0] > begin_s:
            changed[2] += rate_rad_s
            changed[4] += rate_rad_s
        made.append(Event(kind, changed))
    return made


def _standing(events: Events, seconds: float) -> list[Event]:
    """Return the events of a rest, whose first second is followed by its second half again and again."""
    first = list(events[: next(i for i, e in enumerate(events) if _time_of(e) > 1.0)])
    made = list(first)
    for number in range(round(2.0 * seconds)):
        for kind, row in first:
            if _time_of(Event(kind, row)) > 0.5:
                changed = row.copy()
                changed[0] += 0.5 * (number + 1)
                made.append(Event(kind, changed))
    return made


def _on_boat(events: Events, north_m_s: float) -> list[Event]:
    """Add the motion of a boat to positions and velocities of GNSS."""
    made = []
    for kind, row in events:
        changed = row.copy()
        if kind == GNSS_RING:
            changed[1] += north_m_s * row[0]
            changed[4] += north_m_s
        made.append(Event(kind, changed))
    return made


def _checked(events: Events) -> list[Event]:
    """Ask for the health ten times a second, and at the end for functions at and beyond the ends of their range."""
    made = []
    for number, event in enumerate(events):
        made += [event, Event(HEALTH, np.zeros(1))] if number % 60 == 0 else [event]
    edges = (np.nan, -3e38, 3e38, -200.0, 200.0, -1e3, 1e3, 0.0, -1.0, 1.0, 1e-40, 5.0)
    return [*made, *(Event(NUMBERS, np.array([x, y])) for x in edges for y in (0.0, -1.0, 2.0))]


def later(events: Events, by_s: float) -> list[Event]:
    """Return the events of a flight that starts ``by_s`` later."""
    return [
        Event(kind, np.array([row[0] + by_s, *row[1:]]) if kind in TIMED else row) for kind, row in events
    ]


def _with_new_origin(events: Events) -> list[Event]:
    """Start a flight at the end of the clock's second span, and move its origin twice."""
    half, late, move = len(events) // 2, 3 * len(events) // 4, Event(ORIGIN, np.array([0.5 * SPAN_S]))
    first, second = later(events[:half], 2.0 * SPAN_S), later(events[half:late], 1.5 * SPAN_S)
    return [*first, move, *second, move, *later(events[late:], SPAN_S)]


_LONG = functools.partial(flown, "square")
_CLIMB_S, _LATE_S, _DOWN_S = 4.0, 18.0, 24.3
"""Times in the square after its take-off, before its descent, and within it."""
_DRAG = {"drag_is_fused": 1.0, "momentum_drag_1_s": 0.13, "ballistic_x_kg_m2": 20.0, "ballistic_y_kg_m2": 0.0}

NEW_ORIGIN = "origin of the clock moves"
STREAMS: dict[str, Callable[[], Events]] = {
    "as flown": lambda: _checked(flown()),
    "no magnetometer": lambda: _without(_LONG(), MAG_RING, end_s=_LATE_S),
    "no magnetometer, track turned": lambda: _new_earth_field(
        _turned_track(_without(_LONG(), MAG_RING)), 0.1
    ),
    "magnetometer turned": lambda: _new_earth_field(_turned_field(_LONG(), np.pi / 2), 0.2),
    "magnet near": lambda: _checked(_turned_field(flown(), 0.0, strength=50.0)),
    "magnetometer turned less": lambda: _turned_field(_LONG(), 1.0),
    "magnetometer turned, velocity refused": lambda: _with_params(
        _turned_field(_LONG(), 1.0), gnss_velocity_gate=0.3
    ),
    "magnetometer late": lambda: _without(flown(), MAG_RING, end_s=2.5),
    "no barometer": lambda: _without(flown(), BARO_RING),
    "no GNSS": lambda: _without(flown(), GNSS_RING),
    "GNSS lost": lambda: _with_params(
        _without(_without(_LONG(), GNSS_RING, _CLIMB_S, _LATE_S), GNSS_RING, _DOWN_S),
        hold_velocity_m_s=0.5,
        **_DRAG,
    ),
    "rangefinder": lambda: _with_range(flown()),
    "samples of an old time": lambda: _delayed(_with_range(flown()), 1.0),
    "tumbling": lambda: _tumbling(_with_range(flown())),
    "moving at the alignment": lambda: _moving(flown()),
    "field to the east": lambda: _in_eastern_field(flown()),
    "drag": lambda: _with_params(flown(), **_DRAG),
    "position wrong": lambda: _with_params(_moved_fixes(flown(), 50.0, 0.0), reset_s=1.0),
    "velocity wrong": lambda: _with_params(_moved_fixes(flown(), 0.0, 8.0), reset_s=1.0),
    "velocity slightly wrong": lambda: _moved_fixes(_LONG(), 0.0, 0.6),
    "velocity slightly wrong, the other way": lambda: _moved_fixes(_LONG(), 0.0, -0.6),
    "position drifts": lambda: _with_params(_drifting_fixes(_LONG(), 1.0), reset_s=1.0),
    "track turned, GNSS weak and never refused": lambda: _with_params(
        _turned_track(_LONG()),
        gnss_velocity_noise_m_s=20.0,
        gnss_position_noise_m=50.0,
        gnss_velocity_gate=100.0,
        gnss_position_gate=100.0,
    ),
    "vertical velocity wrong": lambda: _wrong_climb(_LONG(), 0.4),
    "vertical velocity wrong without a barometer": lambda: _with_params(
        _wrong_climb(_without(_LONG(), BARO_RING), 8.0), reset_s=1.0
    ),
    "vertical velocity wrong, then the barometer too": lambda: _wrong_climb(
        _wrong_barometer(_LONG(), 0.0, 2.0, 14.0), 1.0
    ),
    "accelerometer slightly wrong": lambda: _wrong_accelerometer(_LONG(), 0.4),
    "accelerometer wrong": lambda: _wrong_accelerometer(_LONG(), 0.8),
    "gyro steps": lambda: _wrong_gyro(_LONG(), _CLIMB_S, 0.02),
    "gyro steps at rest": lambda: _wrong_gyro(_wrong_gyro(_standing(flown(), 8.0), 1.0, 0.006), 5.0, 0.03),
    "boat": lambda: _on_boat(flown(), 0.5),
    "barometer stuck": lambda: _stuck_barometer(_LONG()),
    "barometer drifts": lambda: _wrong_barometer(_LONG(), 0.0, 1.0),
    "barometer jumps without GNSS": lambda: _with_params(
        _wrong_barometer(_without(_LONG(), GNSS_RING, _CLIMB_S - 0.5), 50.0, 0.0), reset_s=1.0
    ),
    "accelerometer wrong without a barometer": lambda: _wrong_accelerometer(
        _without(_LONG(), BARO_RING), 2.0
    ),
    "IMU lost, then the magnetometer": lambda: _without(
        _without(_LONG(), IMU, _CLIMB_S, _CLIMB_S + 2.5), MAG_RING, _CLIMB_S + 1.9, _LATE_S
    ),
    "other cut-offs of the rates": lambda: _other_cutoffs(flown()),
    "Earth's field changed": lambda: _new_earth_field(flown(), 0.2),
    "Earth's field far off": lambda: _new_earth_field(flown(), 1.0),
    "output at once": lambda: _with_params(flown(), output_s=0.0, delay_s=0.0, mag_corrects_tilt=1.0),
    "output slow": lambda: _with_params(_new_earth_field(flown(), 1e-4), output_s=0.5),
    "long delay": lambda: _with_params(flown(), delay_s=0.9),
    NEW_ORIGIN: lambda: _with_new_origin(_moved_fixes(_LONG(), 0.0, -0.6)),
    "broken samples": lambda: _broken(flown()),
}
"""A flight as it was given to the filter, and with its sensors changed."""
