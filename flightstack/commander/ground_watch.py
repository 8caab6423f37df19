"""When a vehicle that stands on the ground is disarmed. Pure."""

from __future__ import annotations

from flightstack.commander.transitions import Event
from flightstack.params.behaviour import Behaviour


class GroundWatch:
    """Counts the time since arming and since the last landing."""

    def __init__(self) -> None:
        self._armed_us = 0
        self._landed_us: int | None = None

    def armed(self, time_us: int) -> None:
        """Note the arming: a flight begins."""
        self._armed_us, self._landed_us = time_us, None

    def changed(self, time_us: int) -> None:
        """Note a takeoff or a landing."""
        self._landed_us = time_us

    def event(self, time_us: int, is_taking_off: bool, behaviour: Behaviour) -> Event | None:
        """Return the event that is due while the vehicle stands: disarming after a landing, or without a takeoff."""
        if self._landed_us is None:
            late = _waited(time_us, self._armed_us, behaviour.disarm_without_takeoff_s)
            return Event.NO_TAKEOFF if late else None
        late = _waited(time_us, self._landed_us, behaviour.disarm_after_landing_s)
        return Event.LANDED_LONG_ENOUGH if late and not is_taking_off else None


def _waited(time_us: int, since_us: int, wait_s: float) -> bool:
    return wait_s >= 0.0 and (time_us - since_us) * 1e-6 >= wait_s
