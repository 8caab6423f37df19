"""How a flight ended, and how that is told from what the ground has heard."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from flightstack.plan import NAV_COMMANDS, Command, MissionItem
from gcs_cli.errors import DONE, FAILED
from gcs_cli.view_types import VehicleView

_ON_GROUND = 1  # MAV_LANDED_STATE
_WARNING = 4  # MAV_SEVERITY_WARNING
_GROUND_ENDS = (Command.NAV_LAND, Command.NAV_RETURN_TO_LAUNCH)


class Outcome(NamedTuple):
    """How the flight ended: "completed" or the reason why not, and the exit code."""

    reason: str
    exit_code: int

    @property
    def completed(self) -> bool:
        """Whether the mission was flown to its end."""
        return self.exit_code == DONE


COMPLETED = Outcome("completed", DONE)


def last_flown(items: Sequence[MissionItem]) -> int:
    """Return the number of the last item that is flown to."""
    return max((seq for seq, item in enumerate(items) if item.command in NAV_COMMANDS), default=0)


def ends_in_air(items: Sequence[MissionItem]) -> bool:
    """Tell whether a mission ends without a landing or a return."""
    return bool(items) and items[last_flown(items)].command not in _GROUND_ENDS


def judged(view: VehicleView, items: Sequence[MissionItem]) -> Outcome:
    """Judge a vehicle that has disarmed: did it fly its mission?

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
        f"the vehicle disarmed{_item(view, items)}, before the mission was done{_warning(view)}", FAILED
    )


def too_late(view: VehicleView, items: Sequence[MissionItem], limit_s: float) -> Outcome:
    """Return the outcome of a flight that was ended after ``limit_s`` of simulated time."""
    late = f"the mission was not done after {limit_s:g} s of simulated time (--limit)"
    return Outcome(f"{late}{_item(view, items)}{_warning(view)}", FAILED)


def _item(view: VehicleView, items: Sequence[MissionItem]) -> str:
    current = view.mission.current
    return "" if current is None else f" at item {current} of {len(items)}"


def _warning(view: VehicleView) -> str:
    """Return the newest warning of the vehicle, to stand at the end of a sentence."""
    warnings = [entry.text for entry in view.texts if entry.severity <= _WARNING]
    return f": {warnings[-1]}" if warnings else ""
