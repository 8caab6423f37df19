"""State and events of the flight, which the parts of the autopilot share."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

from flightstack.commander.transitions import Status
from flightstack.core.contract import FloatArray, Vector3
from flightstack.core.enums import Severity
from flightstack.core.geodesy import GeoPoint
from flightstack.flight_log.recorder import FlightRecorder
from flightstack.guidance.mission import MissionProgress
from flightstack.params.behaviour import Behaviour

DISARMED = Status()
NO_PROGRESS = MissionProgress(0, -1, False, False)


@dataclass(slots=True)
class FlightState:
    """The newest values of the flight, as PX4's modules share them by uORB topics.

    One part of the autopilot writes a field, every part may read it. The arrays are written in place.
    """

    behaviour: Behaviour
    """Parameters of guidance and commander."""
    state: FloatArray
    """Newest state, shape (13,): position and velocity [m, m/s NED], quaternion, body rates [rad/s]."""
    rotor_speed: FloatArray
    """Newest measured rotor speeds [rad/s], shape (8,)."""
    setpoint: FloatArray
    """Setpoint of the outer loop, shape (11,)."""
    attitude_target: FloatArray
    """Attitude and thrust that the outer loop commands, shape (5,)."""
    row: FloatArray
    """Newest row of the inner loop, shape (48,)."""
    has_state: bool = False
    """True once position and attitude are known: from the simulator's first state, or the estimator's origin."""
    time_us: int = 0
    """Vehicle time of the newest tick."""
    status: Status = DISARMED
    """Mode and arming."""
    landed: bool = True
    """Result of the land detector."""
    flying: bool = False
    """True while the loops control the vehicle."""
    loops_reset: bool = False
    """True if the loops were reset since the last tick."""
    rests: bool = False
    """True while the vehicle rests on the ground without control, before the land detector reports landed."""
    attitude_is_given: bool = False
    """True while guidance commands attitude and thrust instead of the outer loop."""
    throttle: float = 0.0
    """Throttle stick of the newest manual control, −1 to 1."""
    progress: MissionProgress = NO_PROGRESS
    mission_count: int = 0
    mission_complete: bool = False
    armed_us: int = 0
    """Vehicle time of arming, takeoff and landing of the present flight; 0 before the event."""
    takeoff_us: int = 0
    landing_us: int = 0


class Text(NamedTuple):
    """A text for the operator, sent as STATUSTEXT."""

    time_us: int
    severity: int
    text: str


class ItemReached(NamedTuple):
    """A mission item was reached."""

    seq: int


Event: TypeAlias = Text | ItemReached
KEPT_TEXTS = 100
"""Texts kept for clients that connect later."""


class Journal:
    """Queues events until telemetry takes them, and records them."""

    def __init__(self, now: FlightState, recorder: FlightRecorder) -> None:
        self._now = now
        self._recorder = recorder
        self._events: list[Event] = []
        self.texts: deque[Text] = deque(maxlen=KEPT_TEXTS)
        """The newest texts, oldest first."""
        self.failsafe_acts = False
        """True from the action of a failsafe to its end, or until a user overrides it."""

    @property
    def has_events(self) -> bool:
        """True if ``take_events`` has events to return."""
        return bool(self._events)

    def take_events(self) -> list[Event]:
        """Return the events since the last call, oldest first."""
        if not self._events:  # the usual case
            return self._events
        events, self._events = self._events, []
        return events

    def say(self, severity: int, text: str) -> None:
        """Send a text to the operator and record it."""
        self.texts.append(Text(self._now.time_us, severity, text))
        self._events.append(self.texts[-1])
        self._recorder.text(self._now.time_us, severity, text)

    def item_reached(self, seq: int, progress: MissionProgress, count: int) -> None:
        """Announce and record that mission item ``seq`` of ``count`` was reached."""
        self._events.append(ItemReached(seq))
        self.mission(progress._replace(reached=seq), count)
        self.say(Severity.INFO, f"Mission item {seq} reached")

    def mission(self, progress: MissionProgress, count: int) -> None:
        """Record progress of the mission."""
        self._recorder.mission(self._now.time_us, progress, count)

    def status(self, status: Status) -> None:
        """Record a change of mode, arming, or failsafe."""
        self._recorder.status(self._now.time_us, status, self.failsafe_acts)
        self.failsafe_acts = self.failsafe_acts and status.armed

    def landed(self, landed: bool) -> None:
        """Record and announce a change of the land detector."""
        self._recorder.landed(self._now.time_us, landed)
        self.say(Severity.INFO, "Landing detected" if landed else "Takeoff detected")

    def origin(self, origin: GeoPoint) -> None:
        """Record the origin of the local frame."""
        self._recorder.set_origin(origin)

    def home(self, home: GeoPoint, position_ned_m: Vector3) -> None:
        """Record a change of home."""
        self._recorder.home(self._now.time_us, home, position_ned_m)
