"""Search the inputs for the least margin, and for the smallest variation that fails. Pure: ``fly`` is given.

A point has a share from 0 to 1 of the distribution of each input, so that all inputs count alike.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from scipy.optimize import differential_evolution
from scipy.stats import qmc

from flightstack.core.contract import FloatArray

_GLOBAL_PART = 0.6
"""Largest part of the flights for the least margin; the others are for the boundary."""
_FEWEST_MEMBERS, _GENERATIONS = 6, 8
_FEWEST_GLOBAL = 2 * _FEWEST_MEMBERS
HALVINGS = 6
"""Most flights on each ray: its boundary is known to 1/64 of it."""
_NEAREST = 3
"""Failing points of the global search to which rays lead."""


class Flown(NamedTuple):
    """A point that was flown."""

    point: FloatArray
    """Shape (inputs,)."""
    robustness: float
    passed: bool
    number: int
    """Number of its flight."""


class Ray(NamedTuple):
    """A direction from the nominal point with the boundary on it: ``passes`` and ``fails`` are next to each other."""

    passes: Flown
    fails: Flown


Fly: TypeAlias = Callable[[Sequence[FloatArray]], Sequence[Flown]]
"""Flies points, in parallel if possible, and returns them in their order."""


class Search(NamedTuple):
    """What a search found."""

    nominal: Flown
    flown: Sequence[Flown]
    """All flights in their order."""
    rays: Sequence[Ray]

    @property
    def worst(self) -> Flown:
        """The flight with the least margin."""
        return min(self.flown, key=lambda each: (each.robustness, each.number))

    @property
    def smallest(self) -> Flown | None:
        """The failing flight nearest to the nominal point; None if all passed."""
        failed = [each for each in self.flown if not each.passed]
        return min(failed, key=lambda each: (self.size(each), each.number), default=None)

    def size(self, flown: Flown) -> float:
        """Return the distance from the nominal point; 1 is the whole range of one input."""
        return float(math.dist(flown.point, self.nominal.point))

    def alone(self, index: int) -> list[Ray]:
        """Return the rays on which only the input ``index`` varies."""
        others = np.arange(len(self.nominal.point)) != index
        return [
            ray for ray in self.rays if np.array_equal(ray.fails.point[others], self.nominal.point[others])
        ]


def fewest_flights(nominal: FloatArray) -> int:
    """Return the least number of flights of a search from ``nominal``, shape (inputs,)."""
    return 1 + len(box_ends(nominal)) + _FEWEST_GLOBAL


def search(fly: Fly, nominal: FloatArray, flights: int, seed: int) -> Search:
    """Search with at most ``flights`` flights, at least ``fewest_flights``.

    The same ``seed`` and margins search the same points. Flights that do not suffice for another round on all rays are
    left.
    """
    flown: list[Flown] = []

    def fly_all(points: Sequence[FloatArray]) -> Sequence[Flown]:
        found = fly(points)
        flown.extend(found)
        return found

    (start,) = fly_all([nominal])
    if not start.passed:
        return Search(start, flown, ())
    ends = [end for end in fly_all(box_ends(nominal)) if not end.passed]
    nearest, before = min(_NEAREST, len(nominal)), len(flown)
    for_least = min(round(_GLOBAL_PART * flights), flights - before - HALVINGS * (len(ends) + nearest))
    _find_least(fly_all, nominal, max(_FEWEST_GLOBAL, for_least), seed)
    failed = sorted(
        (each for each in flown[before:] if not each.passed), key=lambda each: math.dist(each.point, nominal)
    )
    rays = [Ray(start, end) for end in (*ends, *failed[:nearest])]
    rounds = min(HALVINGS, (flights - len(flown)) // max(1, len(rays)))
    return Search(start, flown, _boundary(fly_all, rays, rounds))


def box_ends(nominal: FloatArray) -> list[FloatArray]:
    """Return the ends of the rays along each input, and for two inputs also the corners; shape (inputs,) each.

    Each place is there once, the nominal one not at all: it may be at an end of a range.
    """
    ends = []
    for index, end in itertools.product(range(len(nominal)), (0.0, 1.0)):
        ends.append(nominal.copy())
        ends[-1][index] = end
    if len(nominal) == 2:
        ends += [np.array(corner) for corner in itertools.product((0.0, 1.0), repeat=2)]
    places = {tuple(end): end for end in ends}
    return [end for place, end in places.items() if place != tuple(nominal)]


def _find_least(fly: Fly, nominal: FloatArray, flights: int, seed: int) -> None:
    """Minimise the robustness with at most ``flights`` by differential evolution; ``fly`` records what is flown."""
    members = max(_FEWEST_MEMBERS, flights // _GENERATIONS)
    random = np.random.default_rng(seed)
    first = qmc.LatinHypercube(d=len(nominal), seed=random).random(members)

    def robustness(points: FloatArray) -> FloatArray:
        return np.array([each.robustness for each in fly(list(points.T))])

    settings: dict[str, Any] = {"vectorized": True, "updating": "deferred", "polish": False, "tol": 0.0}
    differential_evolution(
        robustness,
        [(0.0, 1.0)] * len(nominal),
        init=first,
        maxiter=flights // members - 1,
        seed=random,
        **settings,
    )


def _boundary(fly: Fly, rays: Sequence[Ray], rounds: int) -> list[Ray]:
    """Halve each ray ``rounds`` times between a flight that passes and one that fails, all rays in parallel."""
    found = list(rays)
    for _ in range(rounds if found else 0):
        middles = fly([0.5 * (ray.passes.point + ray.fails.point) for ray in found])
        found = [
            ray._replace(passes=middle) if middle.passed else ray._replace(fails=middle)
            for ray, middle in zip(found, middles, strict=True)
        ]
    return found
