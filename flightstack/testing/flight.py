"""One flown flight: its outcome, its figures, its log, and properties over all of it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from flightstack.core.contract import FloatArray
from flightstack.core.errors import ConfigError
from flightstack.core.geodesy import LocalFrame
from flightstack.plan import Command, Plan
from flightstack.testing import properties
from flightstack.testing.expression import SIGNALS
from flightstack.testing.flight_signals import MODES, FlightSignals
from flightstack.testing.log import Log, LoggedText
from flightstack.testing.properties import Margin, PropertyViolationError, Signals, parse_window
from flightstack.testing.setup import Setup
from gcs_cli.report.flight_data import Flight as FlightData
from gcs_cli.report.flight_figures import rms
from gcs_cli.report.flight_outcome import Outcome


class Event(NamedTuple):
    """Something that happened in a flight, such as ``link_cut``, ``takeoff``, ``item_2`` or ``mode_RETURN``."""

    time_s: float
    name: str


class ModeSpan(NamedTuple):
    """A time in one flight mode."""

    begin_s: float
    end_s: float
    mode: str


class Sample(NamedTuple):
    """The signals at one time; see ``flightstack.testing.expression.SIGNALS``."""

    time_s: float
    mode: str
    armed: bool
    landed: bool
    failsafe: bool
    item: int
    altitude_m: float
    north_m: float
    east_m: float
    speed_m_s: float
    climb_m_s: float
    roll_deg: float
    pitch_deg: float
    yaw_deg: float
    distance_to_home_m: float
    error_m: float
    battery_percent: float


@dataclass(frozen=True)
class Flight:
    """A flight from arming to disarming. Times are simulated seconds since the start of the world.

    >>> from flightstack.testing import World
    >>> with World(vehicle="x_quad") as world:
    ...     flight = world.fly("hop")
    >>> flight.outcome, flight.reached, flight.max_error_m < 1.5, flight.landing_error_m < 1.0
    ('completed', [0, 1], True, True)
    >>> flight.modes[0].mode, flight.texts[0], flight.texts_above(4)
    ('HOLD', 'Armed', [])

    The log, and the signals at one time:

    >>> flight.log["vehicle_local_position"].units["vx"], flight.log["vehicle_local_position"]["vx"].shape[0] > 100
    ('m/s', True)
    >>> flight.at(2.0).armed, flight.between(2.0, 3.0).values["armed"].tolist()[:2]
    (True, [True, True])

    Properties:

    >>> flight.always("altitude_m < 2").holds, flight.eventually("landed within 20 s of takeoff").holds
    (True, True)
    >>> flight.until("armed", "landed").holds, flight.within("altitude_m > 0.3", "landed", limit_s=20.0).holds
    (True, True)
    >>> from flightstack.testing import PropertyViolationError
    >>> try:
    ...     flight.always("climb_m_s < 0.3")
    ... except PropertyViolationError as error:
    ...     print(error.margin.prop, error.margin.holds)
    always climb_m_s < 0.3 False
    """

    log: Log
    """Every topic as arrays; ``log.content`` are the bytes of the ULog file."""
    result: Outcome | None = None
    plan: Plan = field(default_factory=lambda: Plan(()))
    setup: Setup = field(default_factory=Setup)
    caused: tuple[Event, ...] = ()
    """Faults and changes of links that the test caused."""

    def __repr__(self) -> str:
        """Return the outcome, which is what a failed assertion of pytest has room for."""
        said = (
            self.outcome
            if self.outcome_text in ("", self.outcome)
            else f"{self.outcome}: {self.outcome_text}"
        )
        return f"Flight({said or 'without an outcome'})"

    @property
    def data(self) -> FlightData:
        """The flight as ``gcs`` reads it from its log; empty if the vehicle was never armed."""
        return self.log.flight

    # ------------------------------------------------------------------ outcome

    @property
    def completed(self) -> bool:
        """True if the mission was flown to its end."""
        return self.result is not None and self.result.completed

    @property
    def outcome(self) -> str:
        """A code of docs/reference/summary.md: completed, failsafe, lost_control, incomplete, refused, timeout …"""
        return "" if self.result is None else self.result.code.value

    @property
    def outcome_text(self) -> str:
        """The outcome in one sentence."""
        return "" if self.result is None else self.result.reason

    @property
    def reached(self) -> list[int]:
        """Mission items in the order in which they were reached."""
        found: list[int] = []
        for progress in self.data.mission:
            if progress.reached >= 0 and (not found or found[-1] != progress.reached):
                found.append(progress.reached)
        return found

    # ------------------------------------------------------------------ figures

    @property
    def duration_s(self) -> float:
        """Simulated time from arming to disarming."""
        return self.data.duration_s

    @property
    def max_error_m(self) -> float:
        """Largest distance between true position and setpoint in flight; NaN without a flight."""
        return float(self._errors_m.max()) if len(self._errors_m) else math.nan

    @property
    def rms_error_m(self) -> float:
        """Root mean square of the distance between true position and setpoint in flight; NaN without a flight."""
        return rms(self._errors_m) or math.nan

    @cached_property
    def _errors_m(self) -> FloatArray:
        return self.data.actual_error().values

    @property
    def landing_error_m(self) -> float:
        """Horizontal distance between the touchdown and the intended place; NaN if it did not land at one.

        The intended place is that of the last landing item; home for a return.
        """
        data, target = self.data, self._landing_place()
        position = data.actual_position.values
        if target is None or not len(position) or not data.landed or not data.landed[-1][1]:
            return math.nan
        return float(np.hypot(*(position[-1, :2] - target)))

    def _landing_place(self) -> tuple[float, float] | None:
        data = self.data
        returned = any(MODES.get(status.nav_state) == "RETURN" for status in data.statuses)
        lands = [item for item in self.plan.items if item.command == Command.NAV_LAND]
        if lands and not returned and lands[-1].position_deg is not None and data.origin is not None:
            latitude_deg, longitude_deg = lands[-1].position_deg
            place = data.origin._replace(latitude_deg=latitude_deg, longitude_deg=longitude_deg)
            local = LocalFrame(data.origin).to_ned(place)
            return local.x, local.y
        return data.home_ne_m() if returned else None

    # ------------------------------------------------------------------ history

    @property
    def texts(self) -> list[str]:
        """Status texts of the flight, oldest first."""
        return [text.text for text in self.log.texts]

    def texts_above(self, severity: int) -> list[LoggedText]:
        """Return the texts more severe than a MAV_SEVERITY: smaller numbers are more severe."""
        return [text for text in self.log.texts if text.severity < severity]

    @cached_property
    def modes(self) -> tuple[ModeSpan, ...]:
        """The flight modes in order."""
        start_s = self.data.start_s
        changes = [(start_s + s.time_s, MODES.get(s.nav_state, str(s.nav_state))) for s in self.data.statuses]
        spans: list[ModeSpan] = []
        ends = [*(begin_s for begin_s, _ in changes), start_s + self.data.duration_s][1:]
        for (begin_s, mode), end_s in zip(changes, ends, strict=True):
            if spans and spans[-1].mode == mode:
                spans[-1] = spans[-1]._replace(end_s=end_s)
            else:
                spans.append(ModeSpan(begin_s, end_s, mode))
        return tuple(spans)

    @cached_property
    def events(self) -> tuple[Event, ...]:
        """Events in order: those that the test caused, modes, items reached, takeoff, landing, failsafes."""
        if not self.log:
            return self.caused
        data, start_s = self.data, self.data.start_s
        found = [*self.caused, *(Event(span.begin_s, f"mode_{span.mode}") for span in self.modes)]
        found += [
            Event(start_s + at_s, "landing" if landed else "takeoff")
            for index, (at_s, landed) in enumerate(data.landed)
            if index
        ]
        before = -1
        for progress in data.mission:
            if progress.reached not in (before, -1):
                found.append(Event(start_s + progress.time_s, f"item_{progress.reached}"))
            before = progress.reached
        failing = False
        for status in data.statuses:
            if status.failsafe and not failing:
                found.append(Event(start_s + status.time_s, "failsafe"))
            failing = status.failsafe
        return tuple(sorted(found, key=lambda event: event.time_s))

    @cached_property
    def signals(self) -> Signals:
        """All signals at the rate of the outer loop; raise ConfigError for a flight without samples."""
        if not len(self.data.position.time_s):
            raise ConfigError(
                "flight", "", f"has no samples: {self.outcome_text or 'the vehicle was not armed'}"
            )
        return signals_of(self)

    def at(self, time_s: float) -> Sample:
        """Return the signals at the newest sample at ``time_s`` or before it; raise IndexError before the first."""
        index = int(np.searchsorted(self.signals.time_s, time_s + 1e-9, side="right")) - 1
        if index < 0:
            raise IndexError(f"the flight begins at t = {self.signals.time_s[0]:.3f} s")
        return Sample(*(self.signals.values[name][index].item() for name in SIGNALS))

    def between(self, begin_s: float, end_s: float) -> Signals:
        """Return the signals from ``begin_s`` to ``end_s``."""
        inside = (self.signals.time_s >= begin_s) & (self.signals.time_s <= end_s)
        values = {name: array[inside] for name, array in self.signals.values.items()}
        return Signals(self.signals.time_s[inside], values, self.signals.events)

    # ------------------------------------------------------------------ properties

    def always(self, text: str) -> Margin:
        """Check that an expression holds at every sample, and return its margin; raise PropertyViolationError.

        ``text`` may end in ``after EVENT`` or ``within 20 s of EVENT``, as in ``"altitude_m < 12 after takeoff"``.
        """
        return _checked(properties.always(self.signals, *parse_window(text)))

    def eventually(self, text: str) -> Margin:
        """Check that an expression holds once, such as ``"mode == 'RETURN' within 20 s of link_cut"``."""
        return _checked(properties.eventually(self.signals, *parse_window(text)))

    def until(self, text: str, end: str) -> Margin:
        """Check that ``text`` holds at every sample until ``end`` holds, and that ``end`` holds once."""
        return _checked(properties.until(self.signals, text, end))

    def within(self, trigger: str, reaction: str, limit_s: float) -> Margin:
        """Check that whenever ``trigger`` holds, ``reaction`` holds at most ``limit_s`` later."""
        return _checked(properties.within(self.signals, trigger, reaction, limit_s))

    def __str__(self) -> str:
        return (
            f"{self.outcome or 'flight'}: {self.outcome_text or 'not over'}; {self.duration_s:.1f} s, reached "
            f"{self.reached}, largest error {self.max_error_m:.3f} m, seed {self.setup.seed}"
        )


def _checked(margin: Margin) -> Margin:
    if not margin.holds:
        raise PropertyViolationError(margin)
    return margin


def start_ned_m(flight: Flight) -> FloatArray:
    """Return where a vehicle started in its local frame, NED [m], shape (3,).

    The origin of a vehicle on its sensors is the first fix, as far off as GNSS was then; its height counts from
    the ground at the start.
    """
    origin = flight.data.local_origin
    if origin is None or not len(flight.data.true_position.time_s):
        return np.zeros(3)
    return np.array(LocalFrame(origin).to_ned(flight.setup.home)._replace(z=0.0))


def signals_of(flight: Flight) -> Signals:
    """Return the signals of a flight at the times of ``vehicle_local_position``: motion is the true one."""
    values = FlightSignals(flight.data, flight.log, start_ned_m(flight))
    times: dict[str, list[float]] = {}
    for event in flight.events:
        times.setdefault(event.name, []).append(event.time_s)
    return Signals(values["time_s"], values, times)
