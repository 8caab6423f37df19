"""Simulated time of a world: ticks, exchanges of messages after outer ticks, and what is to be called then."""

from __future__ import annotations

import math
from collections.abc import Callable

from flightstack.testing.client import Network
from flightstack.testing.engine import Engine

_ROUNDING = 1e-6
"""Share of a period that is no further period."""


class Clock:
    """Advances the engine, and lets the network exchange messages when some may be due."""

    def __init__(self, engine: Engine, network: Network, after_outer: Callable[[], None]) -> None:
        """Call ``after_outer`` before watches and timers, after each outer tick that may have had an event."""
        self._engine, self._network, self._after_outer = engine, network, after_outer
        self._watches: list[Callable[[], None]] = []
        self._timers: list[tuple[float, Callable[[], None]]] = []

    def watch(self, callback: Callable[[], None]) -> None:
        """Call ``callback`` after every outer tick."""
        self._watches.append(callback)

    def after(self, seconds: float, callback: Callable[[], None]) -> None:
        """Call ``callback`` once, ``seconds`` from now."""
        self._timers.append((self._engine.time_s + seconds, callback))

    def run(self, ticks: int) -> None:
        """Run inner ticks, and exchange messages when some are due, at the end of an outer period."""
        until_s = -math.inf  # messages may wait that were sent since the last exchange
        while ticks > 0:
            ticks -= self._run_period(ticks, until_s)
            until_s = self._idle_until_s() if ticks > 0 else until_s

    def run_on(self, most_s: float) -> None:
        """Run one period, and on until messages are due or something happens, for ``most_s`` at most.

        The time is a number of whole periods, at least one.
        """
        rates = self._engine.stack.rates
        periods = max(1, math.ceil(most_s * rates.outer_hz - _ROUNDING))
        self._run_period(periods * rates.divisor, self._idle_until_s())

    def _run_period(self, most: int, until_s: float) -> int:
        """Run up to the end of a period, and on until ``until_s`` if nothing happens; ``most`` inner ticks at most."""
        left, engine = most, self._engine
        while left > 0:
            count, is_outer = engine.run(left, until_s)
            left -= count
            if is_outer:
                engine.pass_requests()
                self._network.exchange(engine.stack.ground, engine.time_s)
                self._call_due()
            engine.advance()
            if is_outer:
                break
        return most - left

    def _idle_until_s(self) -> float:
        """Return the time from which messages are due, or a watch or a timer; −inf if it may be now."""
        engine = self._engine
        if self._watches or not engine.was_ready:
            return -math.inf
        now_s = engine.time_s
        until_s = now_s + self._network.idle_s(engine.stack.ground, now_s)
        return min(until_s, *(at_s for at_s, _ in self._timers)) if self._timers else until_s

    def _call_due(self) -> None:
        self._engine.note_readiness()
        self._after_outer()
        for watch in self._watches:
            watch()
        if self._timers:
            now_s = self._engine.time_s + 1e-9
            due = [call for at_s, call in self._timers if at_s <= now_s]
            self._timers = [timer for timer in self._timers if timer[0] > now_s]
            for call in due:
                call()
