"""User takeover: decide if a mode request may override a failsafe.

A user overrides a failsafe by selecting a mode, as in PX4. Companion computers, however, repeat requests for OFFBOARD
or for their next position regardless of the vehicle's mode; a repeated request overrides nothing. No I/O, no clock.
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
    conflicts_with,
)
from flightstack.commander.failsafe_step import VERB, Memory
from flightstack.params.behaviour import Behaviour

REPETITION_S = 10.0
"""A request sooner after the last one for the same mode is a repetition; companions repeat every 0.5 to 5 s."""


def conflicting_failsafes(memory: Memory, phase: Phase, behaviour: Behaviour) -> tuple[Failsafe, ...]:
    """Return the failsafes whose action conflicts with a flight in ``phase``, in order of priority."""
    entries = memory.entries
    found = [
        f for f, entry in entries.items() if not entry.overridden and conflicts_with(f, phase, behaviour)
    ]
    return tuple(sorted(found, key=lambda failsafe: -PRIORITY[failsafe]))


class UserTakeover:
    """Records the modes that failsafes ended and the requests for them; accepts or denies mode requests."""

    def __init__(self) -> None:
        self._ended_by: dict[Phase, Failsafe] = {}
        self._requested_us: dict[Phase, int] = {}

    def begin_flight(self) -> None:
        """Reset at the start of a flight."""
        self._ended_by.clear()
        self._requested_us.clear()

    def record(self, phase: Phase, cause: Failsafe) -> None:
        """Record that a failsafe has ended a phase of flight."""
        self._ended_by[phase] = cause

    def clear(self) -> None:
        """Allow all modes again after a user's selection was carried out."""
        self._ended_by.clear()

    def refusal(self, memory: Memory, phase: Phase, time_us: int, behaviour: Behaviour) -> str | None:
        """Return the reason that a user may not fly in ``phase`` now, or None. Call once per request.

        A failsafe without ``allows_takeover`` denies every request. A mode that a failsafe ended is available again
        after COM_FAIL_ACT_T, unless the request repeats one of the last ``REPETITION_S``. This rule outlasts the
        failsafe, because a return brings the vehicle back inside the fence. After a link failsafe, the mode is
        available as soon as the link is back.
        """
        requested_us = self._requested_us.get(phase)
        self._requested_us[phase] = time_us
        conflicting = conflicting_failsafes(memory, phase, behaviour)
        for failsafe in conflicting:
            if not RULE_OF[failsafe].allows_takeover:
                return f"{_condition_text(failsafe)}: {VERB[action_of(failsafe, behaviour)]}"
        cause = self._ended_by.get(phase)
        if cause is None or (cause in LINK_FAILSAFES and cause not in memory.entries):
            return None
        since_us = max((memory.entries[failsafe].since_us for failsafe in conflicting), default=-math.inf)
        left_s = behaviour.failsafe_delay_s - (time_us - since_us) * 1e-6
        is_repetition = requested_us is not None and time_us - requested_us < REPETITION_S * 1e6
        if left_s <= 0.0 and not is_repetition:
            return None
        wait_s = math.ceil(max(left_s, REPETITION_S))
        return f"{_condition_text(cause)}: select another mode first, or ask again in {wait_s} s"


def _condition_text(failsafe: Failsafe) -> str:
    begins = RULE_OF[failsafe].begins
    return f"{begins[0].lower()}{begins[1:]}"
