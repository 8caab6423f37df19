"""The small figures of a flight on the page of a run, path from above and height over time, and its metrics. Pure."""

from __future__ import annotations

import math
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
METRICS = (
    "duration_s", "max_error_m", "rms_error_m", "landing_error_m", "max_altitude_m", "max_speed_m_s", "max_tilt_deg",
    "battery_percent",
)  # fmt: skip
"""Names of the metrics; ``battery_percent`` is the smallest charge, tilt the larger of roll and pitch."""


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


def metrics_of(flight: Flight) -> dict[str, float]:
    """Return the value of each of ``METRICS``; NaN for those that the flight does not have."""
    if not len(flight.data.position.time_s):
        return dict.fromkeys(METRICS, math.nan)
    values = flight.signals.values
    found = (
        flight.duration_s,
        flight.max_error_m,
        flight.rms_error_m,
        flight.landing_error_m,
        values["altitude_m"].max(),
        values["speed_m_s"].max(),
        max(np.abs(values["roll_deg"]).max(), np.abs(values["pitch_deg"]).max()),
        values["battery_percent"].min(),
    )
    return {name: float(value) for name, value in zip(METRICS, found, strict=True)}


def _thin(curve: Series) -> Series:
    if curve.texts or curve.hints or curve.filled:
        return curve
    kept = spaced(len(curve.x), _MAP_POINTS)
    return replace(curve, x=curve.x[kept], y=curve.y[kept])


def _heights(flight: Flight) -> Iterator[Series]:
    low, high = shown_span(flight.data)
    for name, series, colour in (
        ("setpoint", flight.data.position_setpoint, "s3"),
        ("flown", flight.data.actual_position, "s1"),
    ):
        up = -series.values[:, 2]
        shown = np.isfinite(up) & (series.time_s >= low) & (series.time_s <= high)
        x, y = decimated(series.time_s[shown], up[shown], _BUCKETS)
        dash = "dot" if name == "setpoint" else "solid"
        yield Series(name, x, y, colour, dash)  # type: ignore[arg-type]  # a literal


def _events(flight: Flight) -> Iterator[Series]:
    """Yield marks on the flown height where the scenario changed something; their names show at the cursor."""
    time_s, position = flight.data.actual_position
    at_s = np.array([event.time_s - flight.data.start_s for event in flight.caused])
    if len(at_s):
        at = np.clip(np.searchsorted(time_s, at_s), 0, len(time_s) - 1)
        hints = [f"{event.name} at t = {event.time_s:.2f} s" for event in flight.caused]
        yield Series("event", at_s, -position[at, 2], "s4", "none", marker="diamond", hints=hints)
