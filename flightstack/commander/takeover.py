"""Who may have a mode back that a failsafe took away: a person who decides so, no program that repeats itself.

A user overrides a failsafe by selecting a mode, as with PX4. Companions, however, ask for OFFBOARD or for their next
place again and again, whatever the vehicle does; such a request decides nothing. No I/O, no clock.
"""

from __future__ import annotations

import math

from flightstack.commander.failsafe import (
    LINK_FAILSAFES,
    PRIORITY,
    RULE_OF,
    Failsafe,
    Phase,
    action_of,
    opposes,
)
from flightstack.commander.failsafe_step import VERB, Memory
from flightstack.params.behaviour import Behaviour

REPETITION_S = 10.0
"""A request sooner after the last one for the same mode is its repetition; companions ask every 0.5 to 5 s."""


def opponents(memory: Memory, phase: Phase, behaviour: Behaviour) -> tuple[Failsafe, ...]:
    """Return the failsafes whose action a flight in ``phase`` would undo, in order of priority."""
    entries = memory.entries
    found = [f for f, entry in entries.items() if not entry.overridden and opposes(f, phase, behaviour)]
    return tuple(sorted(found, key=lambda failsafe: -PRIORITY[failsafe]))


class Takeovers:
    """Remembers which modes failsafes ended, and who asked for them; judges what a user selects."""

    def __init__(self) -> None:
        self._taken: dict[Phase, Failsafe] = {}
        self._asked_us: dict[Phase, int] = {}

    def begin_flight(self) -> None:
        """Begin a flight."""
        self._taken.clear()
        self._asked_us.clear()

    def record(self, phase: Phase, cause: Failsafe) -> None:
        """Remember that a failsafe has ended a phase of flight."""
        self._taken[phase] = cause

    def clear(self) -> None:
        """A user's choice was carried out: from now on all modes are there to be chosen again."""
        self._taken.clear()

    def refusal(self, memory: Memory, phase: Phase, time_us: int, behaviour: Behaviour) -> str | None:
        """Return why a user may not fly in ``phase`` now, or None; call it once for each request.

        A failsafe that nobody may override stays. The mode that a failsafe took away is given back when the time to
        react (COM_FAIL_ACT_T) is over, to who has not asked for it for ``REPETITION_S``; also after the failsafe's
        end, as a vehicle that returns comes back inside its fence. A link that is back gives its mode back at once.
        """
        asked_us = self._asked_us.get(phase)
        self._asked_us[phase] = time_us
        against = opponents(memory, phase, behaviour)
        for failsafe in against:
            rule = RULE_OF[failsafe]
            if not rule.user_may:
                return f"{_said(failsafe)}: {VERB[action_of(failsafe, behaviour)]}"
        cause = self._taken.get(phase)
        if cause is None or (cause in LINK_FAILSAFES and cause not in memory.entries):
            return None
        since_us = max((memory.entries[failsafe].since_us for failsafe in against), default=-math.inf)
        left_s = behaviour.failsafe_delay_s - (time_us - since_us) * 1e-6
        repeats = asked_us is not None and time_us - asked_us < REPETITION_S * 1e6
        if left_s <= 0.0 and not repeats:
            return None
        wait_s = math.ceil(max(left_s, REPETITION_S))
        return f"{_said(cause)}: select another mode first, or ask again in {wait_s} s"


def _said(failsafe: Failsafe) -> str:
    begins = RULE_OF[failsafe].begins
    return f"{begins[0].lower()}{begins[1:]}"
