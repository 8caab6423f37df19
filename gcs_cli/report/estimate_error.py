"""The estimate of a vehicle on its sensors against the true state: errors, their charts, the true path. Pure."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from flightstack.core.contract import FloatArray
from flightstack.core.geometry_bulk import quaternions_from_euler
from gcs_cli.charts.figure import Axis, Figure, Panel
from gcs_cli.charts.figure import Series as Curve
from gcs_cli.report.flight_data import Flight

TRUE_PATH = "true path"
SIGMAS = 3.0
_AXES = ("north", "east", "down")
_COLOURS = ("s1", "s2", "s3")


class EstimateErrors(NamedTuple):
    """Estimate minus truth at the times of the truth; empty for a flight on the true state."""

    time_s: FloatArray
    tilt_deg: FloatArray
    """Angle between the estimated and the true vertical."""
    yaw_deg: FloatArray
    velocity_m_s: FloatArray
    """North, east, down, shape (n, 3)."""
    position_m: FloatArray


def estimate_errors(flight: Flight) -> EstimateErrors:
    """Return the errors of the estimate."""
    time_s, truth = flight.true_position
    if not len(time_s) or not len(flight.attitude.time_s) or not len(flight.position.time_s):
        return EstimateErrors(*[np.zeros(0)] * 3, *[np.zeros((0, 3))] * 2)
    newest = np.maximum(np.searchsorted(flight.attitude.time_s, time_s, side="right") - 1, 0)
    estimated, true = flight.attitude.values[newest], flight.true_attitude.values
    yaw = estimated[:, 2] - true[:, 2]
    return EstimateErrors(
        time_s,
        np.degrees(_tilt_rad(estimated, true)),
        np.degrees((yaw + math.pi) % (2.0 * math.pi) - math.pi),
        _at(time_s, flight.velocity) - flight.true_velocity.values,
        _at(time_s, flight.position) - truth,
    )


def _at(time_s: FloatArray, of: tuple[FloatArray, FloatArray]) -> FloatArray:
    return np.column_stack([np.interp(time_s, of[0], column) for column in of[1].T])


def _tilt_rad(estimated: FloatArray, true: FloatArray) -> FloatArray:
    """Return the angle between the vertical axes of two attitudes."""
    a, b = (_down_axis(quaternions_from_euler(euler)) for euler in (estimated, true))
    angle: FloatArray = 2.0 * np.arcsin(np.minimum(0.5 * np.linalg.norm(a - b, axis=1), 1.0))
    return angle


def _down_axis(q: FloatArray) -> FloatArray:
    w, x, y, z = q.T
    return np.column_stack((2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)))


def estimate_figures(flight: Flight) -> dict[str, float] | None:
    """Return root mean squares and largest errors in flight; None without a true state in the log."""
    errors = estimate_errors(flight)
    flying = flight.flying(errors.time_s)
    if not flying.any():
        return None
    parts = {
        "tilt_deg": errors.tilt_deg,
        "yaw_deg": errors.yaw_deg,
        "velocity_m_s": np.linalg.norm(errors.velocity_m_s, axis=1),
        "horizontal_m": np.linalg.norm(errors.position_m[:, :2], axis=1),
        "height_m": errors.position_m[:, 2],
    }
    found: dict[str, float] = {}
    for name, values in parts.items():
        sizes = np.abs(values[flying])
        found[f"rms_{name}"] = float(np.sqrt(np.mean(sizes**2)))
        found[f"max_{name}"] = float(sizes.max())
    return {name: round(value, 6) for name, value in found.items()}


def true_path(flight: Flight, span: tuple[float, float]) -> FloatArray:
    """Return the true positions of a stretch of time, NED [m], shape (n, 3)."""
    time_s, position = flight.true_position
    return position[(time_s >= span[0]) & (time_s <= span[1])]


def estimate_error_figures(flight: Flight) -> list[Figure]:
    """Return the errors over time with three standard deviations; none without a true state."""
    errors = estimate_errors(flight)
    if not len(errors.time_s):
        return []
    sigma_s, sigma = flight.deviations
    bands: dict[str, Any] = {
        "tilt": np.degrees(np.hypot(sigma[:, 0], sigma[:, 1])),
        "yaw": np.degrees(sigma[:, 2]),
        "velocity": np.max(sigma[:, 3:6], axis=1, initial=0.0),
        "position": np.max(sigma[:, 6:9], axis=1, initial=0.0),
    }
    rows: list[tuple[str, str, list[tuple[str, FloatArray]]]] = [
        ("tilt", "°", [("tilt", errors.tilt_deg)]),
        ("yaw", "°", [("yaw", errors.yaw_deg)]),
        ("velocity", "m/s", list(zip(_AXES, errors.velocity_m_s.T, strict=True))),
        ("position", "m", list(zip(_AXES, errors.position_m.T, strict=True))),
    ]
    panels = []
    for name, unit, curves in rows:
        series = [
            Curve(label, errors.time_s, values, colour, in_legend=len(curves) > 1, group=label)
            for (label, values), colour in zip(curves, _COLOURS, strict=False)
        ]
        signs = (1.0,) if name == "tilt" else (1.0, -1.0)
        series += [sigma_curve(sigma_s, sign * SIGMAS * bands[name]) for sign in signs if len(sigma_s)]
        panels.append(Panel(Axis(name, unit), series))
    caption = "Estimate minus truth. Dotted: three standard deviations of the most uncertain axis, by the estimator."
    return [Figure("estimate-error", "Error of the estimate", panels, caption, linked=True, height=140)]


def sigma_curve(time_s: FloatArray, values: FloatArray) -> Curve:
    """Return one side of a band of three standard deviations."""
    return Curve("3σ", time_s, values, "s8", "dot", width=1.0, group="3σ")
