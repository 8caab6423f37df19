"""A plan from above, for a terminal of any size: route, item numbers, geofence, rally points and home. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flightstack.core.contract import FloatArray
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.plan import Plan, Rejection
from flightstack.plan.fence_areas import fence_areas
from gcs_cli.charts.canvas import DASHED, DOTS_X, DOTS_Y, Canvas, circle_vertices
from gcs_cli.plans.itinerary import Itinerary

ROUTE, ITEM, HOME, RALLY, INSIDE, OUTSIDE = "cyan", "bold", "bold green", "magenta", "green", "red"
_MARGIN = 0.06
"""Share of the drawing around the plan."""
_SMALLEST_M = 2.0


class Outline(NamedTuple):
    """An area of the geofence: its open outline north and east of home [m], shape (n, 2)."""

    points_m: FloatArray
    is_inclusion: bool


class PlanPlaces(NamedTuple):
    """Shapes of the drawing, north and east of home [m]."""

    route_m: FloatArray
    """Home and the items in the order of their numbers, shape (n, 2)."""
    items: tuple[tuple[str, tuple[float, float]], ...]
    """Labels and places of the items; items at one place have one label."""
    rally: tuple[tuple[str, tuple[float, float]], ...]
    outlines: tuple[Outline, ...]


def places_of(plan: Plan, flight: Itinerary, home: GeoPoint) -> PlanPlaces:
    """Return the places of a plan whose mission has the itinerary ``flight``."""
    frame = LocalFrame(home)
    stops = [(stop.seq, stop.place_ne_m) for stop in flight.stops if stop.place_ne_m is not None]
    route = np.array([(0.0, 0.0), *(place for _, place in stops)]).reshape(-1, 2)
    labelled: dict[tuple[int, int], list[int]] = {}
    places: dict[tuple[int, int], tuple[float, float]] = {}
    for seq, place in stops:
        key = round(place[0] * 10.0), round(place[1] * 10.0)
        labelled.setdefault(key, []).append(seq)
        places.setdefault(key, place)
    items = tuple((_numbers(numbers), places[key]) for key, numbers in labelled.items())
    rally = []
    for seq, item in enumerate(plan.rally):
        if item.position_deg is not None:
            there = frame.to_ned(GeoPoint(*item.position_deg, home.altitude_m))
            rally.append((f"R{seq}", (there.x, there.y)))
    return PlanPlaces(route, items, tuple(rally), tuple(outlines(plan, frame)))


def outlines(plan: Plan, frame: LocalFrame) -> list[Outline]:
    """Return the outlines of a geofence; none of one that is not valid."""
    parsed = fence_areas(plan.fence)
    found: list[Outline] = []
    for area in () if isinstance(parsed, Rejection) else parsed.areas:
        there = [frame.to_ned(GeoPoint(*point, frame.origin.altitude_m)) for point in area.points_deg]
        points = np.array([(place.x, place.y) for place in there])
        if area.radius_m:
            north, east = circle_vertices(points[0, 0], points[0, 1], area.radius_m)
            points = np.column_stack((north, east))
        found.append(Outline(points, area.is_inclusion))
    return found


def draw(places: PlanPlaces, width: int, height: int) -> Canvas:
    """Return the drawing in ``width`` × ``height`` cells, north up, with a scale below."""
    canvas = Canvas(width, height)
    every = np.concatenate(
        [
            places.route_m,
            *(outline.points_m for outline in places.outlines),
            *(np.array([place]) for _, place in places.rally),
        ]
    )
    low, high = every.min(axis=0), every.max(axis=0)
    middle, extent = 0.5 * (low + high), np.maximum(high - low, _SMALLEST_M)
    dots_high = canvas.dots_high - DOTS_Y  # the last row holds the scale
    scale = (1.0 - 2.0 * _MARGIN) * min(canvas.dots_wide / extent[1], dots_high / extent[0])

    def dots(points_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        x = 0.5 * canvas.dots_wide + scale * (points_m[:, 1] - middle[1])
        y = 0.5 * dots_high - scale * (points_m[:, 0] - middle[0])
        return x, y

    for outline in places.outlines:
        canvas.polygon(*dots(outline.points_m), INSIDE if outline.is_inclusion else OUTSIDE, DASHED)
    canvas.line(*dots(places.route_m), ROUTE)
    marks = [("H", (0.0, 0.0), HOME), *((label, place, RALLY) for label, place in places.rally)]
    marks += [(label, place, ITEM) for label, place in places.items]
    for label, place, style in marks:
        x, y = (int(value[0]) for value in dots(np.array([place])))
        canvas.label_near(x // DOTS_X, y // DOTS_Y, label, style)
    _scale(canvas, scale)
    return canvas


def _scale(canvas: Canvas, dots_per_m: float) -> None:
    """Write a bar of a round length, and the direction of north."""
    length_m = 10.0 ** math.floor(math.log10(max(canvas.dots_wide, 1) / 4 / dots_per_m))
    length_m *= max(factor for factor in (1, 2, 5) if factor * length_m * dots_per_m <= canvas.dots_wide / 4)
    cells = max(1, round(length_m * dots_per_m / DOTS_X))
    canvas.label(0, canvas.height - 1, "├" + "─" * max(0, cells - 2) + f"┤ {length_m:g} m, north up", "dim")


def _numbers(numbers: Sequence[int]) -> str:
    """Return numbers as ``1,4-6``."""
    parts: list[list[int]] = []
    for number in numbers:
        if parts and number == parts[-1][-1] + 1:
            parts[-1].append(number)
        else:
            parts.append([number])
    return ",".join(str(part[0]) if len(part) == 1 else f"{part[0]}-{part[-1]}" for part in parts)
