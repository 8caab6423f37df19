"""The small figures of a flight on the page of a run: the path from above, and the height over time. Pure."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from flightstack.testing import Flight
from gcs_cli.charts.decimate import decimated, spaced
from gcs_cli.charts.figure import Axis, Figure, Panel, Series
from gcs_cli.report.flight_charts import in_modes, shown_span
from gcs_cli.report.path_charts import map_curves

_MAP_POINTS, _BUCKETS = 400, 150
_HEIGHT_PX = 260
_DOWN = 2


def figures_of(flight: Flight) -> tuple[Figure, ...]:
    """Return map and height with few samples, so that a page may hold many flights."""
    data = flight.data
    if not len(data.position.time_s):
        return ()
    curves = [_thin(curve) for curve in map_curves(data, flight.plan, shown_span(data))]
    above = Panel(Axis("north", "m"), curves, Axis("east", "m"), equal=True)
    height = Panel(Axis("height", "m"), [*_heights(flight), *_events(flight)])
    return (
        Figure("map", "Path from above", [above], height=_HEIGHT_PX),
        in_modes(Figure("height", "Height", [height], height=_HEIGHT_PX), data),
    )


def _thin(curve: Series) -> Series:
    if curve.texts or curve.hints or curve.filled:
        return curve
    kept = spaced(len(curve.x), _MAP_POINTS)
    return replace(curve, x=curve.x[kept], y=curve.y[kept])


def _heights(flight: Flight) -> Iterator[Series]:
    low, high = shown_span(flight.data)
    for name, series, colour in (
        ("setpoint", flight.data.position_setpoint, "s3"),
        ("flown", flight.data.position, "s1"),
    ):
        up = -series.values[:, _DOWN]
        shown = np.isfinite(up) & (series.time_s >= low) & (series.time_s <= high)
        x, y = decimated(series.time_s[shown], up[shown], _BUCKETS)
        dash = "dot" if name == "setpoint" else "solid"
        yield Series(name, x, y, colour, dash)  # type: ignore[arg-type]  # a literal


def _events(flight: Flight) -> Iterator[Series]:
    """Yield marks on the flown height where the scenario changed something; their names show at the cursor."""
    time_s, position = flight.data.position
    at_s = np.array([event.time_s - flight.data.start_s for event in flight.caused])
    if len(at_s):
        at = np.clip(np.searchsorted(time_s, at_s), 0, len(time_s) - 1)
        hints = [f"{event.name} at t = {event.time_s:.2f} s" for event in flight.caused]
        yield Series("event", at_s, -position[at, _DOWN], "s4", "none", marker="diamond", hints=hints)
