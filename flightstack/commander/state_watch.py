"""Whether the newest state is one to fly by: it may be too old, or frozen. No I/O, no clock."""

from __future__ import annotations

from flightstack.commander.conditions import StateSource

HOLD_AFTER_US = 50_000
"""Age of a state from which on the loops rest: fed with what does not change, they would go to their limits."""


class StateWatch:
    """Looks at the source of states once per outer tick."""

    def __init__(self, source: StateSource) -> None:
        self._source = source
        self.is_new = True
        """Whether the state has changed since the outer tick before."""
        self.holds_rotors = False
        """Whether the state must not be flown by: it is frozen or missing."""
        self.is_stale = False
        """Whether the newest state is too old, or frozen though its own speeds say that it must change."""

    def look(self, time_us: int, moves_in_air: bool, limit_s: float) -> None:
        """Find out whether the state is too old, or does not change although its own speeds say that it must.

        At rest on the ground, and in the calm at the end of a long hover, it may stay the same to the last bit.
        ``limit_s`` is the age from which on it is stale.
        """
        fresh = self._source.freshness(time_us)
        age_us, frozen_us = fresh.age_us, fresh.frozen_us
        if not (age_us or frozen_us):
            self.is_new, self.holds_rotors, self.is_stale = True, False, False
            return
        old_us = max(age_us, frozen_us) if moves_in_air else age_us
        limit_us = limit_s * 1e6
        self.is_new = False
        self.holds_rotors = old_us >= min(limit_us, HOLD_AFTER_US)
        self.is_stale = old_us >= limit_us
