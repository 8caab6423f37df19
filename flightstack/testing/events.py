"""Names of the events of a flight, to which properties and the events of a scenario refer."""

from __future__ import annotations

import re
from typing import NamedTuple

from flightstack.commander.failsafe import RULE_OF, Failsafe
from flightstack.commander.failsafe_step import VERB
from flightstack.core.enums import Mode
from flightstack.core.errors import ConfigError
from flightstack.testing.faults import LINK_FAULTS


class EventForm(NamedTuple):
    """The form of an event's name."""

    form: str
    """As in the reference; the part in capitals varies."""
    pattern: str
    meaning: str
    is_live: bool
    """True if the event is known in flight, for ``after``; otherwise only from the log."""


_CHANGES, _MODES, _FAILSAFES = (
    "|".join(names) for names in (LINK_FAULTS, Mode.__members__, Failsafe.__members__)
)

EVENTS = (
    EventForm("takeoff", "takeoff", "the vehicle leaves the ground", False),
    EventForm("landing", "landing", "the land detector reports landed", False),
    EventForm("item_N", r"item_\d+", "mission item N is reached", False),
    EventForm("mode_MODE", f"mode_({_MODES})", "the flight mode becomes MODE", False),
    EventForm("failsafe", "failsafe", "the first failsafe begins to act", False),
    EventForm("failsafe_NAME", f"failsafe_({_FAILSAFES})", "failsafe NAME becomes active", True),
    EventForm("fault", "fault", "a fault of the simulator begins", True),
    EventForm("link_CHANGE", f"link_({_CHANGES})", "a link changes", True),
    EventForm("link_CHANGE_end", f"link_({_CHANGES})_end", "a change of a link with `for_s` ends", True),
    EventForm("power_cycle", "power_cycle", "the vehicle was switched off and on", True),
)


_TEXT_OF_EVENT = {
    "takeoff": "takeoff detected",
    "landing": "landing detected",
    **{f"failsafe_{failsafe.name}": rule.begins.lower() for failsafe, rule in RULE_OF.items()},
    **{f"mode_{action.name}": verb for action, verb in VERB.items() if action.name in Mode.__members__},
}
"""Words of the status text that describes an event, in small letters."""


def check_event(name: str, *, is_live: bool = False) -> None:
    """Raise ConfigError for a name that no event has; with ``is_live``, none that is known in flight."""
    allowed = [event for event in EVENTS if event.is_live or not is_live]
    if not any(re.fullmatch(event.pattern, name) for event in allowed):
        forms = ", ".join(event.form for event in allowed)
        raise ConfigError(
            "event", "", f"{name} is no event{' that is known in flight' if is_live else ''}: {forms}"
        )


def describes(text: str, event: str) -> bool:
    """Return True if a status text says that an event happened."""
    said = text.lower()
    if event == "failsafe":  # the first that acts, whichever it is
        return any(rule.begins.lower() in said for rule in RULE_OF.values())
    if event.startswith("item_"):
        return said == f"mission item {event.removeprefix('item_')} reached"
    return event in _TEXT_OF_EVENT and _TEXT_OF_EVENT[event] in said
