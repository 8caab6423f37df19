"""Random inputs of the core in C, without anything compiled, so that they also feed it under sanitizers."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from tests.firmware.core_support import OUTER_DUE, RESET, SET_TARGET


class Samples:
    """Random inputs, each representable in float32, so that every precision gets the same."""

    def __init__(self, count: int, seed: int) -> None:
        self.count = count
        self.random = np.random.default_rng(seed)

    def narrow(self, values: Any) -> np.ndarray:
        """Round to float32."""
        return np.ascontiguousarray(np.asarray(values).astype(np.float32).astype(np.float64))

    def normal(self, width: int, deviation: float) -> np.ndarray:
        """Normal numbers, a tenth of them ten times as large, a tenth a hundredth."""
        size = self.random.choice([0.01, 1.0, 10.0], (self.count, 1), p=[0.1, 0.8, 0.1])
        values = self.random.normal(0.0, deviation, (self.count, width)) * size
        return self.narrow(values if width > 1 else values[:, 0])

    def uniform(self, *ranges: tuple[float, float]) -> np.ndarray:
        """Numbers between bounds, one column for each pair."""
        columns = [self.random.uniform(low, high, self.count) for low, high in ranges]
        return self.narrow(np.stack(columns, axis=1) if len(columns) > 1 else columns[0])

    def choice(self, width: int, values: list[float]) -> np.ndarray:
        picked = self.random.choice(values, (self.count, width))
        return self.narrow(picked if width > 1 else picked[:, 0])

    def attitudes(self) -> np.ndarray:
        """Unit quaternions: half of them anywhere, half within some 30 degrees of level."""
        near = self.random.normal(0.0, 0.15, (self.count, 4)) + np.array([1.0, 0.0, 0.0, 0.0])
        q = np.where(
            self.random.random((self.count, 1)) < 0.5, self.random.normal(size=(self.count, 4)), near
        )
        return self.narrow(q / np.linalg.norm(q, axis=1, keepdims=True))

    def near(self, attitudes: np.ndarray, deviation: float) -> np.ndarray:
        """Unit quaternions a small turn away, of either sign."""
        q = attitudes + self.random.normal(0.0, deviation, attitudes.shape)
        sign = self.random.choice([-1.0, 1.0], (self.count, 1))
        return self.narrow(sign * q / np.linalg.norm(q, axis=1, keepdims=True))


class Sequence(NamedTuple):
    """Inputs of consecutive ticks."""

    states: np.ndarray
    setpoints: np.ndarray
    targets: np.ndarray
    flags: np.ndarray


def sequence(count: int, seed: int, thrust_n: float, unsound: float = 0.02) -> Sequence:
    """Return ticks of a vehicle that is shaken about, with resets, targets, and now and then a number that is none.

    The outer loop runs in every fifth tick; ``unsound`` is the share of ticks with a NaN or an infinity somewhere.
    """
    s = Samples(count, seed)
    level = np.tile([1.0, 0.0, 0.0, 0.0], (count, 1))
    states = np.hstack([s.normal(3, 1.0), s.normal(3, 1.0), s.near(level, 0.05), s.normal(3, 0.3)])
    setpoints = np.hstack([s.normal(3, 1.0), s.normal(3, 1.0), s.normal(3, 1.0), s.normal(2, 1.0)])
    targets = np.hstack([s.near(level, 0.05), s.narrow(np.abs(s.normal(1, thrust_n)))[:, None]])
    flags = np.where(np.arange(count) % 5 == 0, OUTER_DUE, 0)
    flags |= np.where(s.random.random(count) < 0.02, SET_TARGET, 0)
    flags |= np.where(s.random.random(count) < 0.005, RESET, 0)
    flags[0] |= RESET
    for array in (states, setpoints, targets):
        spoiled = np.flatnonzero(s.random.random(count) < unsound)
        places = s.random.integers(0, array.shape[1], spoiled.size)
        array[spoiled, places] = s.random.choice([np.nan, np.inf, -np.inf], spoiled.size)
    return Sequence(states, setpoints, targets, flags.astype(np.uint16))
