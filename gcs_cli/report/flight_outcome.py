"""Outcome of a flight: a code, a sentence and an exit code, from telemetry and flight log."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from typing import TYPE_CHECKING, NamedTuple

from flightstack.core.enums import NAVIGATION_STATE, Mode, Severity
from flightstack.plan import NAV_COMMANDS, Command, MissionItem
from gcs_cli.errors import DONE, FAILED
from gcs_cli.vehicle.view_types import VehicleView

if TYPE_CHECKING:
    from gcs_cli.report.flight_data import Flight

_ON_GROUND = 1  # MAV_LANDED_STATE
GROUND_ENDS = (Command.NAV_LAND, Command.NAV_RETURN_TO_LAUNCH)
_TERMINATED = NAVIGATION_STATE[Mode.TERMINATION]
_MOST_WARNINGS = 3
_ARMED = ("Armed", "Arming")
"""Beginnings of the text with which a vehicle says that it armed."""


class Code(StrEnum):
    """``outcome`` of summary.json; docs/reference/summary.md says what each means."""

    COMPLETED = "completed"
    FAILSAFE = "failsafe"
    LOST_CONTROL = "lost_control"
    INCOMPLETE = "incomplete"
    REFUSED = "refused"
    TIMEOUT = "timeout"
    NO_VEHICLE = "no_vehicle"
    VEHICLE_LOST = "vehicle_lost"
    STALLED = "stalled"
    PROCESS_ENDED = "process_ended"
    INTERRUPTED = "interrupted"
    NO_LOG = "no_log"


class Outcome(NamedTuple):
    """Code, sentence and exit code of a flight."""

    code: Code
    reason: str
    exit_code: int = FAILED

    @property
    def completed(self) -> bool:
        """True if the mission was flown to its end."""
        return self.code is Code.COMPLETED


COMPLETED = Outcome(Code.COMPLETED, "the mission was flown to its end", DONE)


def last_flown(items: Sequence[MissionItem]) -> int:
    """Return the number of the last item that is flown to."""
    return max((seq for seq, item in enumerate(items) if item.command in NAV_COMMANDS), default=0)


def ends_in_air(items: Sequence[MissionItem]) -> bool:
    """Tell whether a mission ends without a landing or a return."""
    return bool(items) and items[last_flown(items)].command not in GROUND_ENDS


def outcome_of(view: VehicleView, items: Sequence[MissionItem]) -> Outcome:
    """Return the outcome for a vehicle that has disarmed: complete if it flew its mission.

    Any message may have been lost, so that each of three signs is enough.
    """
    mission, last = view.mission, last_flown(items)
    reached_end = mission.reached is not None and mission.reached >= last
    landed_at_end = (
        mission.current is not None
        and mission.current >= last
        and not ends_in_air(items)
        and view.landed_state == _ON_GROUND
    )
    if mission.complete or reached_end or landed_at_end:
        return COMPLETED
    return Outcome(
        Code.INCOMPLETE,
        f"the vehicle disarmed{_item(view, items)}, before the mission was done{_warnings(view)}",
    )


def too_late(view: VehicleView, items: Sequence[MissionItem], limit_s: float) -> Outcome:
    """Return the outcome of a flight that was ended after ``limit_s`` of simulated time."""
    late = f"the mission was not done after {limit_s:g} s of simulated time (--limit)"
    return Outcome(Code.TIMEOUT, f"{late}{_item(view, items)}{_warnings(view)}")


def _item(view: VehicleView, items: Sequence[MissionItem]) -> str:
    text = view.mission._replace(total=len(items)).item_text
    return f" at {text}" if text else ""


def _warnings(view: VehicleView) -> str:
    """Return the first critical text, which is the cause, and the newest warnings, to end a sentence.

    Texts from before the last arming are about no flight, or about another one.
    """
    armings = [index for index, entry in enumerate(view.texts) if entry.text.startswith(_ARMED)]
    texts = view.texts[armings[-1] :] if armings else view.texts
    warnings = [entry for entry in texts if entry.severity <= Severity.WARNING]
    cause = next((entry for entry in warnings if entry.severity <= Severity.CRITICAL), None)
    shown = warnings[-_MOST_WARNINGS:]
    if cause is not None and cause not in shown:
        shown = [cause, *shown[1:]]
    return f": {'; '.join(entry.text for entry in shown)}" if shown else ""


def with_log(outcome: Outcome, flight: Flight, items: Sequence[MissionItem]) -> Outcome:
    """Return the outcome with what the log adds: cause of an early end, crash, items not reached, its own end.

    The codes that it changes are those of a vehicle that has disarmed.
    """
    if outcome.code not in (Code.COMPLETED, Code.INCOMPLETE):
        return outcome
    failed = outcome.reason.replace(COMPLETED.reason, "the vehicle crashed at the end of the mission")
    if any(status.nav_state == _TERMINATED for status in flight.statuses) or flight.disarmed_in_air:
        return Outcome(Code.LOST_CONTROL, failed)
    failsafe = any(status.failsafe for status in flight.statuses)
    cut = _cut(flight)
    if not outcome.completed:
        return _noted(outcome._replace(code=Code.FAILSAFE) if failsafe else outcome, cut)
    return _noted(
        outcome, cut or _unreached(flight, items), "a failsafe acted on the way" if failsafe else ""
    )


def _noted(outcome: Outcome, *notes: str) -> Outcome:
    return outcome._replace(reason="; ".join([outcome.reason, *(note for note in notes if note)]))


def _cut(flight: Flight) -> str:
    """Say that the log of a vehicle that has disarmed ends before that, as on a full disk; else return nothing."""
    if flight.statuses and not flight.statuses[-1].armed:
        return ""
    return f"the flight log ends early, at {flight.duration_s:.1f} s, and so do the figures"


def _unreached(flight: Flight, items: Sequence[MissionItem]) -> str:
    """Say which items of a completed mission were not reached, and why."""
    reached = {progress.reached for progress in flight.mission}
    flown = {progress.current for progress in flight.mission}
    missing = [seq for seq, item in enumerate(items) if item.command in NAV_COMMANDS and seq not in reached]
    if not missing or not flight.mission:
        return ""
    skipped = not flown.intersection(missing) and any(item.command == Command.DO_JUMP for item in items)
    what = f"item{'s' if len(missing) > 1 else ''} {', '.join(map(str, missing))}"
    return f"{what} skipped by DO_JUMP" if skipped else f"{what} not reached"
