"""The order in which tests are tried on a mutant: first those that found others nearby in the least time."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from flightstack.core.contract import FloatArray
from tests.mutation.mutants import Mutant

WEIGHT = 2.0
"""Tries that the wider surroundings count for in the narrower ones."""


class Counts:
    """Tries and finds of each test in one function, file, or part."""

    def __init__(self, tests: int) -> None:
        self.tries, self.finds = np.zeros(tests), np.zeros(tests)

    def share(self, wider: FloatArray) -> FloatArray:
        """Return the share of mutants that each test finds, mixed with that of the wider surroundings."""
        return np.asarray((self.finds + WEIGHT * wider) / (self.tries + WEIGHT))


class Order:
    """Learns which tests find the mutants of a function, and what they cost."""

    def __init__(self, costs_s: Sequence[float]) -> None:
        self._costs_s = np.maximum(costs_s, 1e-3)
        self._counts: defaultdict[tuple[str, ...], Counts] = defaultdict(lambda: Counts(len(costs_s)))

    def ranked(self, mutant: Mutant) -> list[int]:
        """Return the indices of all tests, the one that finds most for its CPU time first."""
        share = np.full(self._costs_s.size, 0.5)
        for place in _places(mutant):
            share = self._counts[place].share(share)
        return [int(index) for index in np.argsort(-share / self._costs_s, kind="stable")]

    def learn(self, mutant: Mutant, spent_s: FloatArray, found_by: int) -> None:
        """Count the tests that have run, with their CPU time (NaN: has not run, or not to its end)."""
        has_run = ~np.isnan(spent_s)
        self._costs_s[has_run] += 0.2 * (spent_s[has_run] - self._costs_s[has_run])
        if found_by >= 0:
            has_run[found_by] = True
        for place in _places(mutant):
            self._counts[place].tries += has_run
            if found_by >= 0:
                self._counts[place].finds[found_by] += 1.0


def _places(mutant: Mutant) -> list[tuple[str, ...]]:
    """Return part, file and function, from wide to narrow."""
    return [(), (mutant.file,), (mutant.file, mutant.function)]
