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
"""Part of the flights for the least margin; the others are for the boundary."""
_FEWEST_MEMBERS, _GENERATIONS = 8, 8
HALVINGS = 6
"""Flights on each ray: its boundary is known to 1/64 of it."""
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


def search(fly: Fly, nominal: FloatArray, flights: int, seed: int) -> Search:
    """Search with about ``flights`` flights; the same ``seed`` and margins search the same points."""
    flown: list[Flown] = []

    def fly_all(points: Sequence[FloatArray]) -> Sequence[Flown]:
        found = fly(points)
        flown.extend(found)
        return found

    (start,) = fly_all([nominal])
    if not start.passed:
        return Search(start, flown, ())
    _find_least(fly_all, nominal, round(_GLOBAL_PART * flights), seed)
    failed = sorted(
        (each for each in flown if not each.passed), key=lambda each: math.dist(each.point, nominal)
    )
    ends = fly_all(box_ends(nominal))
    rays = [Ray(start, end) for end in (*ends, *failed[: min(_NEAREST, len(nominal))]) if not end.passed]
    return Search(start, flown, _boundary(fly_all, rays))


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
    """Minimise the robustness by differential evolution; ``fly`` records what is flown."""
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
        maxiter=max(1, flights // members - 1),
        seed=random,
        **settings,
    )


def _boundary(fly: Fly, rays: Sequence[Ray]) -> list[Ray]:
    """Halve each ray between a flight that passes and one that fails, all rays in parallel."""
    found = list(rays)
    for _ in range(HALVINGS if found else 0):
        middles = fly([0.5 * (ray.passes.point + ray.fails.point) for ray in found])
        found = [
            ray._replace(passes=middle) if middle.passed else ray._replace(fails=middle)
            for ray, middle in zip(found, middles, strict=True)
        ]
    return found
