"""The flown path against the plan: in space and from above. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from flightstack.core.contract import FloatArray
from flightstack.plan import Plan
from gcs_cli.charts.decimate import spaced
from gcs_cli.charts.figure import Axis, Figure, Panel, Playback, Series, SpaceFigure, SpacePath
from gcs_cli.report.estimate_error import TRUE_PATH, true_path
from gcs_cli.report.flight_data import Flight
from gcs_cli.report.places import (
    Area,
    Marker,
    fence,
    merged,
    plan_markers,
    rally_markers,
    route_ned_m,
)

_MAP_POINTS = 3000
_CEILING_PARAMETER = "GF_MAX_VER_DIST"
_CIRCLE = np.linspace(0.0, 2.0 * math.pi, 49)


def space_figure(flight: Flight, plan: Plan, span: tuple[float, float]) -> SpaceFigure:
    """Return the flight in space, with the poses of the time slider."""
    flown, playback = flown_path(flight, span), _playback(flight, span)
    paths = [
        SpacePath(_flown_name(flight), flown),
        SpacePath(TRUE_PATH, true_path(flight, span), "s5", "dash"),
        SpacePath("setpoint", _setpoints(flight, span), "s3", "dot", 2.0),
        *plan_paths(flight, plan),
        _places("rally points", rally_markers(flight, plan), "s4"),
        *_walls(list(fence(flight, plan)), flight, flown),
    ]
    caption = (
        "Drag to turn, scroll to zoom; the slider moves the vehicle, drawn larger than it is, along its path."
    )
    if plan.fence:
        caption += (
            " The geofence reaches from the ground to its ceiling, or to the highest point of the flight."
        )
    return SpaceFigure(
        "path-in-space", "Path in space", [path for path in paths if len(path.ned_m)], caption, playback
    )


def plan_paths(flight: Flight, plan: Plan) -> list[SpacePath]:
    """Return the route of a plan, and its items with their numbers."""
    return [
        SpacePath("planned, items numbered", route_ned_m(flight, plan), "s2", "dash"),
        _places("items", merged(plan_markers(flight, plan), 3), "s2"),
    ]


def _flown_name(flight: Flight) -> str:
    return "estimated path" if len(flight.true_position.time_s) else "flown"


def flown_path(flight: Flight, span: tuple[float, float]) -> FloatArray:
    """Return the positions of a stretch of time, NED [m], shape (n, 3)."""
    time_s, position = flight.position
    return position[(time_s >= span[0]) & (time_s <= span[1])]


def _setpoints(flight: Flight, span: tuple[float, float]) -> FloatArray:
    """Setpoints of position while flying: landed, they sink into the ground."""
    time_s, setpoint = flight.position_setpoint
    return setpoint[flight.flying(time_s) & (time_s >= span[0]) & (time_s <= span[1])]


def _playback(flight: Flight, span: tuple[float, float]) -> Playback | None:
    time_s, position = flight.position
    good = (time_s >= span[0]) & (time_s <= span[1]) & np.isfinite(position).all(axis=1)
    if not good.any() or not len(flight.attitude.time_s):
        return None
    time_s, position = time_s[good], position[good]
    latest = np.searchsorted(flight.attitude.time_s, time_s, side="right") - 1
    euler = np.nan_to_num(flight.attitude.values[np.maximum(latest, 0)], posinf=0.0, neginf=0.0)
    return Playback(time_s, position, euler)


def _places(name: str, markers: Sequence[Marker], colour: str) -> SpacePath:
    places = np.array([marker.ned_m for marker in markers]).reshape(-1, 3)
    return SpacePath(
        name, places, colour, "none", marker="circle", texts=[marker.label for marker in markers]
    )


def _walls(areas: Sequence[Area], flight: Flight, flown: FloatArray) -> Iterator[SpacePath]:
    """Yield the outlines of the geofence on the ground and at its top, joined by uprights."""
    finite = flown[np.isfinite(flown).all(axis=1)]
    ceiling_m = float(flight.parameters.get(_CEILING_PARAMETER, 0.0))
    top_m = ceiling_m or float(-finite[:, 2].min() if len(finite) else 0.0)
    gap = np.full((1, 3), np.nan)
    for is_inclusion, name, colour in (
        (True, "geofence, stay inside", "s6"),
        (False, "geofence, stay outside", "bad"),
    ):
        parts: list[FloatArray] = []
        for outline in (area.outline_m for area in areas if area.is_inclusion is is_inclusion):
            ground, top = (np.column_stack((outline, np.full(len(outline), down))) for down in (0.0, -top_m))
            parts += [ground, gap, top, gap]
            for index in range(0, len(outline) - 1, max(1, len(outline) // 12)):
                parts += [ground[index : index + 1], top[index : index + 1], gap]
        if parts:
            yield SpacePath(name, np.concatenate(parts), colour, width=2.0)


def map_figure(flight: Flight, plan: Plan, span: tuple[float, float]) -> Figure:
    """Return the path from above; north is up, east is right."""
    caption = (
        "The flown path and the plan from above, north up; shaded circles are where items count as reached."
    )
    if plan.fence:
        caption += " Outlined: the geofence."
    panel = Panel(Axis("north", "m"), map_curves(flight, plan, span), Axis("east", "m"), equal=True)
    return Figure("path-from-above", "Path from above", [panel], caption, height=500)


def map_curves(flight: Flight, plan: Plan, span: tuple[float, float]) -> list[Series]:
    """Return the plan, and the path flown in a stretch of time; x is east and y is north."""
    flown = flown_path(flight, span)
    flown, true = flown[spaced(len(flown), _MAP_POINTS)], true_path(flight, span)
    true = true[spaced(len(true), _MAP_POINTS)]
    route, markers = route_ned_m(flight, plan), plan_markers(flight, plan)
    series = [
        *_outlines(list(fence(flight, plan))),
        *_acceptance(markers),
        Series("planned, items numbered", route[:, 1], route[:, 0], "s2", "dash"),
        Series(_flown_name(flight), flown[:, 1], flown[:, 0], "s1", width=2.0),
        Series(TRUE_PATH, true[:, 1], true[:, 0], "s5", "dash"),
        *_labelled("items", merged(markers, 2), "s2"),
        *_labelled("rally points", rally_markers(flight, plan), "s4"),
    ]
    return [each for each in series if len(each.x)]


def _outlines(areas: Sequence[Area]) -> Iterator[Series]:
    names = {True: ("geofence, stay inside", "s6"), False: ("geofence, stay outside", "bad")}
    for area in areas:
        name, colour = names[area.is_inclusion]
        yield Series(name, area.outline_m[:, 1], area.outline_m[:, 0], colour, filled=not area.is_inclusion)


def _acceptance(markers: Sequence[Marker]) -> Iterator[Series]:
    for marker in (marker for marker in markers if marker.radius_m > 0.0):
        x, y = (
            centre + marker.radius_m * turn(_CIRCLE)
            for centre, turn in ((marker.ned_m[1], np.cos), (marker.ned_m[0], np.sin))
        )
        yield Series("accepted within", x, y, "s2", width=1.0, filled=True, in_legend=False)


def _labelled(name: str, markers: Sequence[Marker], colour: str) -> Iterator[Series]:
    if markers:
        north, east, _ = np.array([marker.ned_m for marker in markers]).T
        labels = [marker.label for marker in markers]
        hints = [_hint(name, marker) for marker in markers]
        yield Series(
            name, east, north, colour, "none", marker="circle", texts=labels, hints=hints, in_legend=False
        )


def _hint(name: str, marker: Marker) -> str:
    within = f": accepted within {marker.radius_m:g} m" if marker.radius_m else ""
    return f"{'rally point' if name == 'rally points' else 'item'} {marker.label}{within}"
