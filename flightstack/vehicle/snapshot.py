"""What the autopilot shows of itself: to telemetry, to the log, to the operator."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

from flightstack.commander.transitions import Status
from flightstack.core.contract import FloatArray, Vector3
from flightstack.core.geodesy import GeoPoint
from flightstack.guidance.navigator import MissionProgress

EMERGENCY, ALERT, CRITICAL, ERROR, WARNING, NOTICE, INFO = range(7)
"""MAV_SEVERITY of texts."""

DISARMED = Status()
NO_PROGRESS = MissionProgress(0, -1, False, False)


class Recorder(Protocol):
    """Where the autopilot writes what happens; ``logging.recorder`` makes a flight log of it."""

    def inner_row(self, time_us: int) -> FloatArray:
        """Return the row, shape (48,), that the inner loop fills in this tick."""

    def outer(
        self,
        time_us: int,
        state: FloatArray,
        setpoint: FloatArray,
        attitude_target: FloatArray,
        loop_flags: int,
    ) -> None:
        """Record one outer tick; ``loop_flags`` say what the loops began it with, 0 while they rest."""

    def status(self, time_us: int, status: Status, failsafe: bool = False) -> None:
        """Record mode and arming, and whether a failsafe acts, when one of them has changed."""

    def landed(self, time_us: int, landed: bool) -> None:
        """Record a change of the land detector."""

    def mission(self, time_us: int, progress: MissionProgress, count: int) -> None:
        """Record progress of the mission."""

    def home(self, time_us: int, home: GeoPoint, position_ned_m: Vector3) -> None:
        """Record where home is now."""

    def text(self, time_us: int, severity: int, text: str) -> None:
        """Record a text."""


class Text(NamedTuple):
    """A text for the operator."""

    severity: int
    text: str


@dataclass
class Snapshot:
    """What telemetry reads: the arrays are live, the rest is copied once per change."""

    state: FloatArray
    setpoint: FloatArray
    attitude_target: FloatArray
    row: FloatArray
    time_us: int = 0
    status: Status = DISARMED
    landed: bool = True
    progress: MissionProgress = NO_PROGRESS
    mission_count: int = 0
    mission_complete: bool = False
    armed_us: int = 0
    """When the present flight was armed, took off and landed; 0 for what has not been since arming."""
    takeoff_us: int = 0
    landing_us: int = 0
    reached: list[int] = field(default_factory=list)
    """Mission items reached that telemetry has yet to announce."""
    texts: list[Text] = field(default_factory=list)
