"""All problems that a vehicle has with a plan: the one check of ``flightstack.plan``, by item. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from flightstack.core.geodesy import GeoPoint
from flightstack.plan import (
    DEFAULT_LIMITS,
    Limits,
    MissionItem,
    Plan,
    Rejection,
    mission_rejections,
)
from flightstack.plan.check import leg_rejections

LIMIT_PARAMETERS = ("MIS_DIST_1WP", "MIS_DIST_WPS", "GF_MAX_VER_DIST", "GF_MAX_HOR_DIST")


class Problem(NamedTuple):
    """A reason for which the vehicle refuses a part of the plan."""

    part: str
    seq: int | None
    """Number of the item; None for the part as a whole."""
    reason: str
    """One sentence that names the item."""


def limits_of(parameters: Mapping[str, float]) -> Limits:
    """Return the limits of a vehicle with these parameters; those that it lacks have their defaults."""
    first, next_, vertical, horizontal = (parameters.get(name) for name in LIMIT_PARAMETERS)
    default = DEFAULT_LIMITS
    return default._replace(
        max_first_distance_m=default.max_first_distance_m if first is None else first,
        max_distance_m=default.max_distance_m if next_ is None else next_,
        max_altitude_m=vertical or default.max_altitude_m,
        max_home_distance_m=default.max_home_distance_m if horizontal is None else horizontal,
    )


def plan_problems(
    plan: Plan,
    home: GeoPoint,
    limits: Limits = DEFAULT_LIMITS,
    fence: Sequence[MissionItem] | None = None,
    *,
    is_foreign: bool = False,
) -> Iterator[Problem]:
    """Yield the problems of geofence, mission and rally points, in this order.

    ``fence``: the vehicle's geofence, which holds for a plan without one. ``is_foreign``: the vehicle flies commands
    that the flight stack does not, so that only the geofence is checked.
    """
    areas = plan.fence or tuple(fence or ())
    shape = None
    if areas or plan.rally:
        from flightstack.plan.fence import check_fence, fence_shape
        from flightstack.plan.rally import check_rally

        shape = fence_shape(areas, home)
    if plan.fence:
        yield from _problems("geofence", [check_fence(plan.fence, home)])
    if plan.items and is_foreign:
        yield from _problems("mission", leg_rejections(plan.items, home, shape))
    elif plan.items:
        yield from _problems("mission", mission_rejections(plan.items, home, limits, shape))
    if plan.rally:
        yield from _problems("list of rally points", [check_rally(plan.rally, home, limits, shape)])


def _problems(part: str, rejections: Iterator[Rejection] | list[Rejection | None]) -> Iterator[Problem]:
    for rejection in rejections:
        if rejection is not None:
            yield Problem(part, rejection.seq, rejection.reason)
