"""The flights of a campaign, from its file alone: number, seed and inputs of each. Pure."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import qmc

from flightstack.core.errors import ConfigError
from gcs_cli.campaign.definition import (
    GRID,
    LATIN_HYPERCUBE,
    MONTE_CARLO,
    MOST_FLIGHTS,
    SOBOL,
    Campaign,
)
from gcs_cli.campaign.distributions import Value

_DEFAULT_FLIGHTS = {MONTE_CARLO: 100, LATIN_HYPERCUBE: 100, SOBOL: 128, GRID: 1}
_MOST_SOBOL_INPUTS = 21201
_LARGEST_SEED = 2**31 - 1


class PlannedFlight(NamedTuple):
    """One flight of a campaign."""

    number: int
    """Counted from 1."""
    seed: int
    inputs: Mapping[str, Value]


def plan_flights(campaign: Campaign) -> tuple[PlannedFlight, ...]:
    """Return the flights; raise ConfigError for a grid that is too large."""
    names = tuple(campaign.vary)
    rows = _grid(campaign) if campaign.plan.method == GRID else _samples(campaign)
    return tuple(
        PlannedFlight(number, flight_seed(campaign.plan.seed, number), dict(zip(names, row, strict=True)))
        for number, row in enumerate(rows, 1)
    )


def flight_seed(seed: int, number: int) -> int:
    """Return the seed of a flight: it depends on the campaign's seed and the flight's number alone."""
    return int(np.random.SeedSequence((seed, number)).generate_state(1)[0]) & _LARGEST_SEED


def _grid(campaign: Campaign) -> Iterator[tuple[Value, ...]]:
    levels = [distribution.levels() for distribution in campaign.vary.values()]
    each = campaign.plan.flights or _DEFAULT_FLIGHTS[GRID]
    count = each
    for values in levels:
        count *= len(values)
    if count > MOST_FLIGHTS:
        raise ConfigError(campaign.path, "vary", f"has {count} flights, at most {MOST_FLIGHTS} are allowed")
    return (row for row in itertools.product(*levels) for _ in range(each))


def _samples(campaign: Campaign) -> Iterator[tuple[Value, ...]]:
    plan, inputs = campaign.plan, len(campaign.vary)
    count = plan.flights or _DEFAULT_FLIGHTS[plan.method]
    random = np.random.default_rng(plan.seed)
    shares: Any
    if plan.method == LATIN_HYPERCUBE:
        shares = qmc.LatinHypercube(d=inputs, seed=random).random(count)
    elif plan.method == SOBOL:
        if inputs > _MOST_SOBOL_INPUTS:
            raise ConfigError(campaign.path, "vary", f"sobol has at most {_MOST_SOBOL_INPUTS} inputs")
        shares = qmc.Sobol(d=inputs, scramble=True, seed=random).random_base2(count.bit_length() - 1)
    else:
        shares = random.random((count, inputs))
    distributions = tuple(campaign.vary.values())
    return (
        tuple(each.at(float(share)) for each, share in zip(distributions, row, strict=True)) for row in shares
    )
