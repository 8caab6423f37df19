"""Timing of small calls, and what the rest of the machine did meanwhile."""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple


class Figure(NamedTuple):
    """Median and range of one quantity over the rounds."""

    median: float
    least: float
    greatest: float
    rounds: int

    def text(self, digits: int = 3) -> str:
        """Return "median (least–greatest)" with so many significant digits."""
        return f"{short(self.median, digits)} ({short(self.least, digits)}–{short(self.greatest, digits)})"


def short(value: float, digits: int = 3) -> str:
    """Return ``value`` with so many significant digits, without an exponent."""
    return f"{value:#.{digits}g}".rstrip(".") if abs(value) < 10**digits else f"{value:.0f}"


def figure(values: Iterable[float]) -> Figure:
    """Summarise the values of the rounds."""
    known = sorted(values)
    return Figure(statistics.median(known), known[0], known[-1], len(known))


def call_us(function: Callable[[], object], seconds: float) -> float:
    """Return the mean time of a call [µs] over about ``seconds``."""
    count, spent_ns = 1, 0
    while spent_ns < seconds * 1e9:
        count *= 2
        began_ns = time.perf_counter_ns()
        for _ in range(count):
            function()
        spent_ns = time.perf_counter_ns() - began_ns
    return spent_ns / count / 1e3


_EMPTY_CALL_S = 0.02


def interleaved_us(
    functions: dict[str, Callable[[], object]], rounds: int, seconds: float
) -> dict[str, Figure]:
    """Time each function in every round, without the cost of the timing loop itself [µs]."""
    values: dict[str, list[float]] = {name: [] for name in functions}
    for _ in range(rounds):
        empty_us = call_us(lambda: None, _EMPTY_CALL_S)
        for name, function in functions.items():
            values[name].append(max(0.0, call_us(function, seconds) - empty_us))
    return {name: figure(measured) for name, measured in values.items()}


class OtherLoad:
    """Share of the machine that others used while we measured: the reader's warning."""

    def __init__(self) -> None:
        self._busy_s, self._idle_s = _machine_s()
        self._own_s = _own_s()

    def share(self) -> float:
        """Return the share, 0 to 1, since the beginning; 0 where the system does not tell."""
        busy_s, idle_s = _machine_s()
        all_s = busy_s + idle_s - self._busy_s - self._idle_s
        if all_s <= 0.0:
            return 0.0
        return max(0.0, busy_s - self._busy_s - (_own_s() - self._own_s)) / all_s


def _machine_s() -> tuple[float, float]:
    """Return busy and idle time of all processors together."""
    try:
        words = Path("/proc/stat").read_text(encoding="ascii").split("\n", 1)[0].split()
    except OSError:
        return 0.0, 0.0
    ticks = [int(word) / os.sysconf("SC_CLK_TCK") for word in words[1:9]]
    idle_s = ticks[3] + ticks[4]
    return sum(ticks) - idle_s, idle_s


def _own_s() -> float:
    t = os.times()
    return t.user + t.system + t.children_user + t.children_system
