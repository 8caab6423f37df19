"""Charts of several flights on top of each other: a colour for each flight, dotted its setpoints. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import zip_longest
from typing import TypeAlias

import numpy as np

from flightstack.plan import Plan
from gcs_cli.charts.figure import AnyFigure, Axis, Figure, Panel, SpaceFigure, SpacePath, nth_colour
from gcs_cli.charts.figure import Series as Curve
from gcs_cli.report.flight_charts import SETPOINT, mode_bands, shown_span, time_figures
from gcs_cli.report.flight_data import Flight
from gcs_cli.report.path_charts import flown_path, map_curves, plan_paths

NamedFlight: TypeAlias = tuple[str, Flight, Plan]


def overlaid_figures(flights: Sequence[NamedFlight]) -> Iterator[AnyFigure]:
    """Yield the charts of a flight report with all flights in each; those without a sample are left out."""
    yield _space(flights)
    yield _map(flights)
    of_each = [
        (name, _arming_s(flight), time_figures(flight, rotors_apart=True)) for name, flight, _ in flights
    ]
    spans = [np.subtract(shown_span(flight), _arming_s(flight)) for _, flight, _ in flights]
    x = Axis("time since arming", "s", float(np.min(spans)), float(np.max(spans)))
    for index, figure in enumerate(of_each[0][2]):
        merged = _overlaid(
            figure, x, [(name, arming_s, figures[index]) for name, arming_s, figures in of_each]
        )
        if not merged.empty:
            yield merged


def _arming_s(flight: Flight) -> float:
    """Return when the vehicle armed first, since the start of the log; 0 if it never did."""
    bands = mode_bands(flight)
    return bands[0].start if bands else 0.0


def _overlaid(first: Figure, x: Axis, of_each: Sequence[tuple[str, float, Figure]]) -> Figure:
    panels = []
    for each in zip_longest(*(figure.panels for _, _, figure in of_each)):
        curves = [
            _renamed(curve, name, arming_s, nth_colour(index))
            for index, ((name, arming_s, _), panel) in enumerate(zip(of_each, each, strict=True))
            if panel is not None
            for curve in panel.series
        ]
        like = next(panel for panel in each if panel is not None)
        panels.append(Panel(like.y, curves, x))
    longest = max((figure.caption for _, _, figure in of_each), key=len)
    return replace(first, panels=panels, caption=f"{longest} Time counts from arming.")


def _renamed(curve: Curve, name: str, arming_s: float, colour: str) -> Curve:
    is_setpoint = curve.name == SETPOINT
    return replace(
        curve,
        name=f"{name}: setpoint" if is_setpoint else name,
        group=name,
        x=curve.x - arming_s,
        colour=colour,
        dash="dot" if is_setpoint else "solid",
        width=1.2 if is_setpoint else 1.5,
        in_legend=not is_setpoint,
    )


def _shared_plan(flights: Sequence[NamedFlight]) -> bool:
    """True if all flew the same plan, or none is known: it is drawn once then."""
    plans = [(plan.items, plan.fence, plan.rally) for _, _, plan in flights]
    return all(plan == plans[0] for plan in plans)


def _space(flights: Sequence[NamedFlight]) -> SpaceFigure:
    paths = [
        SpacePath(name, flown_path(flight, shown_span(flight)), nth_colour(index))
        for index, (name, flight, _) in enumerate(flights)
    ]
    shared = _shared_plan(flights)
    for index, (name, flight, plan) in enumerate(flights[:1] if shared else flights):
        for path in plan_paths(flight, plan) if plan.items else ():
            if shared:
                paths.append(replace(path, colour="soft"))
            elif path.dash == "dash":
                paths.append(replace(path, colour=nth_colour(index), name=f"{name}: planned"))
    caption = "The flown paths, each from the origin of its own local frame. Drag to turn, scroll to zoom."
    return SpaceFigure(
        "path-in-space", "Paths in space", [path for path in paths if len(path.ned_m)], caption
    )


def _map(flights: Sequence[NamedFlight]) -> Figure:
    curves: list[Curve] = []
    shared = _shared_plan(flights)
    for index, (name, flight, plan) in enumerate(flights):
        for curve in map_curves(flight, plan, shown_span(flight)):
            if curve.name == "flown":
                curves.append(replace(curve, name=name, colour=nth_colour(index), width=1.5))
            elif shared and plan.items and not index:
                curves.append(replace(curve, colour="soft"))
            elif not shared and plan.items and curve.dash == "dash":
                curves.append(replace(curve, name=f"{name}: planned", colour=nth_colour(index), width=1.0))
    caption = (
        "The flown paths and their plans from above, north up, each from the origin of its own local frame."
    )
    panel = Panel(Axis("north", "m"), curves, Axis("east", "m"), equal=True)
    return Figure("path-from-above", "Paths from above", [panel], caption, height=500)
