"""A plan as one HTML page: from above, in space, its altitudes, and its items."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from flightstack.core.geodesy import GeoPoint
from flightstack.plan import Plan
from gcs_cli.charts.figure import AnyFigure, Axis, Figure, Panel, Series, SpaceFigure, SpacePath
from gcs_cli.charts.pages import render_page
from gcs_cli.plans.drawing import PlanPlaces, places_of
from gcs_cli.plans.itinerary import Itinerary
from gcs_cli.plans.names import any_command_name
from gcs_cli.plans.table import clock, parameters_text, totals

_TEMPLATES = Path(__file__).parent / "templates"


def plan_page(title: str, plan: Plan, flight: Itinerary, home: GeoPoint, problems: list[str]) -> str:
    """Return the page of a plan with its ``problems``."""
    places = places_of(plan, flight, home)
    figures = [_above(places), _space(flight), _profile(flight)]
    stops = {stop.seq: stop for stop in flight.stops}
    rows = []
    for seq, item in enumerate(plan.items):
        stop = stops.get(seq)
        place = item.position_deg
        texts = [
            any_command_name(item.command),
            "" if place is None else f"{place[0]:.7f}, {place[1]:.7f}",
            "" if stop is None else f"{stop.altitude_m:g} m",
            "" if stop is None or stop.leg_m < 0.05 else f"{stop.leg_m:.1f} m",
            "" if stop is None or stop.heading_deg is None else f"{stop.heading_deg:03.0f}°",
            "" if stop is None else clock(stop.time_s),
            parameters_text(item),
        ]
        rows.append((str(seq), texts))
    return render_page(
        _TEMPLATES,
        "plan.html",
        title=title,
        summary=totals(flight) if plan.items else "no mission",
        problems=problems,
        figures=[figure for figure in figures if not figure.empty],
        rows=rows,
    )


def _above(places: PlanPlaces) -> AnyFigure:
    series = []
    for outline in places.outlines:
        closed = np.concatenate((outline.points_m, outline.points_m[:1]))
        name, colour = (
            ("geofence, stay inside", "s6") if outline.is_inclusion else ("geofence, stay outside", "bad")
        )
        series.append(Series(name, closed[:, 1], closed[:, 0], colour, filled=not outline.is_inclusion))
    route = places.route_m
    series.append(Series("route", route[:, 1], route[:, 0], "s1", width=2.0))
    marks = (
        ("items", places.items, "s1"),
        ("rally points", places.rally, "s4"),
        ("home", (("H", (0.0, 0.0)),), "s2"),
    )
    for name, found, colour in marks:
        if found:
            north, east = np.array([place for _, place in found]).T
            labels = [label for label, _ in found]
            series.append(Series(name, east, north, colour, "none", marker="circle", texts=labels))
    panel = Panel(Axis("north", "m"), series, Axis("east", "m"), equal=True)
    return Figure("above", "From above", [panel], "The mission from above, north up.", height=520)


def _space(flight: Itinerary) -> AnyFigure:
    here, rows = (0.0, 0.0), [(0.0, 0.0, 0.0)]
    for stop in flight.stops:
        here = here if stop.place_ne_m is None else stop.place_ne_m
        rows.append((*here, -stop.altitude_m))
    return SpaceFigure("space", "In space", [SpacePath("route", np.array(rows), "s1", marker="circle")])


def _profile(flight: Itinerary) -> AnyFigure:
    distance = np.array([0.0, *(stop.distance_m for stop in flight.stops)])
    altitude = np.array([0.0, *(stop.altitude_m for stop in flight.stops)])
    hints = ["home", *(f"item {stop.seq}" for stop in flight.stops)]
    series = [Series("altitude", distance, altitude, "s1", marker="circle", hints=hints)]
    panel = Panel(Axis("altitude above home", "m"), series, Axis("distance", "m"))
    return Figure("profile", "Altitude", [panel], "Altitude above home along the route.", height=260)
