"""Statistics of a campaign's rows: pass probability, distributions, sensitivities, worst cases. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.stats import binomtest, rankdata, spearmanr

from gcs_cli.campaign.rows import Row

CONFIDENCE = 0.95
_FEWEST = 4
"""Flights from which a rank correlation is given."""


class Probability(NamedTuple):
    """The share of flights that pass, and the ends of its confidence interval."""

    passed: int
    flights: int
    low: float
    high: float

    @property
    def share(self) -> float:
        """The estimate: passed of all."""
        return self.passed / self.flights

    def __str__(self) -> str:
        low, high = 100.0 * self.low, 100.0 * self.high
        return f"{100.0 * self.share:.1f} % ({low:.1f} to {high:.1f} %)"


class Sensitivity(NamedTuple):
    """Rank correlation of an input with a result, from −1 to 1, and its p-value."""

    name: str
    correlation: float
    p_value: float


def pass_probability(passed: int, flights: int) -> Probability:
    """Return the pass probability of ``flights``, at least one, with Clopper and Pearson's interval.

    It is exact: it covers the true probability with CONFIDENCE or more, also near 0 and 1.

    >>> str(pass_probability(100, 100))
    '100.0 % (96.4 to 100.0 %)'
    """
    interval = binomtest(passed, flights).proportion_ci(CONFIDENCE, "exact")
    return Probability(passed, flights, float(interval.low), float(interval.high))


def numeric_inputs(rows: Sequence[Row]) -> list[str]:
    """Return the names of the inputs that are numbers."""
    first = rows[0]["inputs"] if rows else {}
    return [
        name
        for name, value in first.items()
        if isinstance(value, float | int) and not isinstance(value, bool)
    ]


def sensitivities(rows: Sequence[Row]) -> list[Sensitivity]:
    """Return Spearman's rank correlation of each numeric input with the robustness, the largest first."""
    found = []
    result = np.array([row["robustness"] for row in rows], float)
    for name in numeric_inputs(rows):
        values = np.array([row["inputs"][name] for row in rows], float)
        if len(rows) >= _FEWEST and np.ptp(rankdata(values)) and np.ptp(rankdata(result)):
            correlation = spearmanr(values, result)
            found.append(Sensitivity(name, float(correlation.statistic), float(correlation.pvalue)))
    return sorted(found, key=lambda each: -abs(each.correlation))


def worst(rows: Sequence[Row], count: int) -> list[Row]:
    """Return the flights with the least robustness, the worst first."""
    return sorted(rows, key=lambda row: (row["robustness"], row["flight"]))[:count]


def quantiles(values: Sequence[float | None]) -> tuple[float, ...] | None:
    """Return least, 5 %, median, 95 % and largest of the numbers; None without any."""
    finite = [value for value in values if value is not None and math.isfinite(value)]
    return tuple(float(q) for q in np.quantile(finite, (0.0, 0.05, 0.5, 0.95, 1.0))) if finite else None
