"""The distributions of a campaign's inputs, as functions of a share from 0 to 1. Pure."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

from scipy.special import ndtr, ndtri

Value: TypeAlias = float | str | bool
"""A value of an input: a number, or one of the texts or flags of a choice."""
_LEAST = 2.0**-53
"""Smallest share: a normal distribution has no value at 0 and 1."""
KINDS = ("uniform", "normal", "log_uniform", "choice")


@dataclass(frozen=True)
class Distribution:
    """One entry of ``[vary]``."""

    kind: str
    """One of ``KINDS``."""
    of: tuple[Value, ...]
    """Ends of uniform and log_uniform; mean and standard deviation of normal; the values of a choice."""
    low: float = -math.inf
    high: float = math.inf
    """Ends at which a normal distribution is cut off."""
    steps: int | None = None
    """Number of values in a grid."""
    nominal: float | None = None
    """The value without variation, from which ``--seek worst`` counts; None: that of the scenario."""

    @property
    def is_choice(self) -> bool:
        """True if the values have no order."""
        return self.kind == "choice"

    def at(self, share: float) -> Value:
        """Return the value below which ``share`` of the distribution lies.

        >>> Distribution("uniform", (2.0, 4.0)).at(0.25), Distribution("choice", ("pid", "lqr")).at(0.7)
        (2.5, 'lqr')
        """
        if self.kind == "choice":
            return self.of[min(int(share * len(self.of)), len(self.of) - 1)]
        first, second = float(self.of[0]), float(self.of[1])
        if self.kind == "uniform":
            return first + share * (second - first)
        if self.kind == "log_uniform":
            return float(min(max(first * (second / first) ** share, first), second))
        below, above = self._ends()
        cut = min(max(below + share * (above - below), _LEAST), 1.0 - _LEAST)
        return min(max(first + second * float(ndtri(cut)), self.low), self.high)

    @property
    def ends(self) -> tuple[float, float]:
        """The least and the largest value of a range."""
        if self.kind == "normal":
            return self.low, self.high
        return float(self.of[0]), float(self.of[1])

    def share_of(self, value: float) -> float:
        """Return the share at which ``at`` gives ``value``, 0 or 1 beyond the ends."""
        first, second = float(self.of[0]), float(self.of[1])
        if self.kind == "uniform":
            share = (value - first) / (second - first)
        elif self.kind == "log_uniform":
            share = math.log(max(value, first) / first) / math.log(second / first)
        else:
            below, above = self._ends()
            share = (float(ndtr((value - first) / second)) - below) / (above - below)
        return float(min(max(share, 0.0), 1.0))

    def _ends(self) -> tuple[float, float]:
        """Return the shares of an uncut normal distribution below ``low`` and ``high``."""
        mean, deviation = float(self.of[0]), float(self.of[1])
        return float(ndtr((self.low - mean) / deviation)), float(ndtr((self.high - mean) / deviation))

    def levels(self) -> tuple[Value, ...]:
        """Return the values of a grid: both ends of a range, the middles of equal shares of a normal distribution."""
        if self.kind == "choice":
            return self.of
        steps = self.steps or 1
        if self.kind == "normal":
            return tuple(self.at((index + 0.5) / steps) for index in range(steps))
        return tuple(self.at(index / max(steps - 1, 1)) for index in range(steps))


def read_distribution(values: Mapping[str, Any]) -> Distribution:
    """Return the distribution of an entry; raise ValueError, whose text is the problem."""
    kinds = [name for name in values if name in KINDS]
    if len(kinds) != 1:
        raise ValueError(f"needs one distribution of {', '.join(KINDS)}")
    kind = kinds[0]
    allowed = {"steps", "nominal", *(("low", "high") if kind == "normal" else ())}
    for name in values:
        if name != kind and (kind == "choice" or name not in allowed):
            raise ValueError(f"{name} is not a known key of {kind}")
    of = values[kind]
    if kind == "choice":
        return Distribution(kind, _choices(of))
    first, second = _numbers(kind, of, 2)
    if kind == "normal" and not second > 0.0:
        raise ValueError(f"normal = [{first:g}, {second:g}]: the standard deviation must be above 0")
    if kind != "normal" and not first < second:
        raise ValueError(f"{kind} = [{first:g}, {second:g}]: the first number must be below the second")
    if kind == "log_uniform" and not first > 0.0:
        raise ValueError(f"log_uniform = [{first:g}, {second:g}]: both numbers must be above 0")
    low, high = (
        _numbers(name, [values[name]], 1)[0] if name in values else default
        for name, default in (("low", -math.inf), ("high", math.inf))
    )
    if not low < high:
        raise ValueError(f"low must be below high, and {low:g} is not below {high:g}")
    if kind == "normal" and not ndtr((high - first) / second) > ndtr((low - first) / second):
        raise ValueError(f"no number of normal = [{first:g}, {second:g}] lies between {low:g} and {high:g}")
    steps = values.get("steps")
    if steps is not None and (
        isinstance(steps, bool) or not isinstance(steps, int) or not 2 <= steps <= 10_000
    ):
        raise ValueError(f"steps: {steps!r} is not a whole number from 2 to 10000")
    nominal = _numbers("nominal", [values["nominal"]], 1)[0] if "nominal" in values else None
    return Distribution(kind, (first, second), low, high, steps, nominal)


def _choices(of: Any) -> tuple[Value, ...]:
    if not isinstance(of, list) or not of or not all(isinstance(value, int | float | str) for value in of):
        raise ValueError("choice must be a list of numbers, texts or flags")
    if len({type(value) if isinstance(value, bool | str) else float for value in of}) > 1:
        raise ValueError("choice must be numbers only, texts only or flags only")
    if len(set(of)) < len(of):
        raise ValueError("choice has a value twice")
    return tuple(of)


def _numbers(name: str, of: Any, count: int) -> Sequence[float]:
    is_list = isinstance(of, list) and len(of) == count
    if not is_list or not all(
        isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
        for value in of
    ):
        raise ValueError(
            f"{name} must be {'a list of 2 finite numbers' if count == 2 else 'a finite number'}"
        )
    return [float(value) for value in of]
