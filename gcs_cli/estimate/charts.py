"""Charts of an estimate: states, differences, biases, innovations. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from flightstack.core.contract import FloatArray
from flightstack.core.geometry_bulk import euler_from_quaternions
from flightstack.estimation.error_state import ACCEL_BIAS, ATTITUDE, GYRO_BIAS, POSITION, VELOCITY
from flightstack.estimation.kalman import (
    BARO,
    GNSS_POSITION,
    GNSS_VELOCITY,
    MAG,
)
from gcs_cli.charts.figure import Axis, Figure, Panel, Series, nth_colour
from gcs_cli.estimate.run import Estimate
from gcs_cli.estimate.track import Differences, Track

_POINTS = 3000
_ANGLES, _AXES, _BODY = ("roll", "pitch", "yaw"), ("north", "east", "down"), ("x", "y", "z")
_NOMINAL = {"gyro bias": 10, "accelerometer bias": 13, "body's magnetic field": 19}


def figures(
    estimate: Estimate, others: Mapping[str, Track], against: Mapping[str, Differences]
) -> Iterator[Figure]:
    """Yield the charts; ``others`` and ``against`` are by the name of the other estimate."""
    start_s = float(estimate.track.attitude_s[0])
    tracks = {"estimate": estimate.track, **others}
    yield _attitude(tracks, start_s)
    yield _motion(tracks, start_s, "velocity", "m/s")
    yield _motion(tracks, start_s, "position", "m")
    for name, difference in against.items():
        yield _difference(name, difference, estimate, start_s)
    yield _biases(estimate, start_s)
    yield from _innovations(estimate, start_s)


def _thinned(values: FloatArray) -> FloatArray:
    return values[:: max(1, len(values) // _POINTS)]


def _curve(name: str, number: int, times: FloatArray, values: FloatArray, dash: str = "solid") -> Series:
    return Series(
        name,
        _thinned(times),
        _thinned(values),
        nth_colour(number),
        "dot" if dash == "dot" else "solid",
        group=name,
    )


def _attitude(tracks: Mapping[str, Track], start_s: float) -> Figure:
    panels = []
    for axis, angle in enumerate(_ANGLES):
        curves = [
            _curve(
                name,
                number,
                track.attitude_s - start_s,
                np.degrees(euler_from_quaternions(track.attitude)[:, axis]),
            )
            for number, (name, track) in enumerate(tracks.items())
        ]
        panels.append(Panel(Axis(angle, "°"), curves))
    return Figure("attitude", "Attitude", panels, "Roll, pitch and yaw in degrees.", linked=True)


def _motion(tracks: Mapping[str, Track], start_s: float, quantity: str, unit: str) -> Figure:
    panels = []
    for axis, name in enumerate(_AXES):
        curves = []
        for number, (label, track) in enumerate(tracks.items()):
            values = track.velocity_m_s if quantity == "velocity" else track.position_m
            curves.append(_curve(label, number, track.motion_s - start_s, values[:, axis]))
        panels.append(Panel(Axis(name, unit), curves))
    caption = f"{quantity.capitalize()} in the local frame of each estimate."
    return Figure(quantity, quantity.capitalize(), panels, caption, linked=True)


def _difference(name: str, d: Differences, estimate: Estimate, start_s: float) -> Figure:
    """Return the difference to another estimate, with three standard deviations of the filter."""
    bands = _bands(estimate, start_s)
    angle_s, motion_s = d.attitude_s - start_s, d.motion_s - start_s
    rows = [
        ("tilt", "°", angle_s, [("tilt", d.tilt_deg)], bands["tilt"]),
        ("yaw", "°", angle_s, [("yaw", d.yaw_deg)], bands["yaw"]),
        ("velocity", "m/s", motion_s, list(zip(_AXES, d.velocity_m_s.T, strict=True)), bands["velocity"]),
        ("position", "m", motion_s, list(zip(_AXES, d.position_m.T, strict=True)), bands["position"]),
    ]
    panels = [
        Panel(
            Axis(quantity, unit),
            [
                *(_curve(label, number, times, values) for number, (label, values) in enumerate(curves)),
                *band,
            ],
        )
        for quantity, unit, times, curves, band in rows
    ]
    caption = (
        "Estimate minus the other; dotted: three standard deviations of the filter, horizontal for motion."
    )
    slug = name.replace(" ", "-")
    return Figure(f"difference-{slug}", f"Difference to {name}", panels, caption, linked=True)


def _bands(estimate: Estimate, start_s: float) -> dict[str, list[Series]]:
    times, sigma = estimate.state_s - start_s, estimate.deviations
    sizes = {
        "tilt": np.degrees(np.hypot(sigma[:, ATTITUDE], sigma[:, ATTITUDE + 1])),
        "yaw": np.degrees(sigma[:, ATTITUDE + 2]),
        "velocity": np.hypot(sigma[:, VELOCITY], sigma[:, VELOCITY + 1]) / np.sqrt(2.0),
        "position": np.hypot(sigma[:, POSITION], sigma[:, POSITION + 1]) / np.sqrt(2.0),
    }
    return {
        name: [
            _curve("3σ", 7, times, sign * 3.0 * size, "dot")
            for sign in ((1.0,) if name == "tilt" else (1.0, -1.0))
        ]
        for name, size in sizes.items()
    }


def _biases(estimate: Estimate, start_s: float) -> Figure:
    units = {"gyro bias": "rad/s", "accelerometer bias": "m/s²", "body's magnetic field": "gauss"}
    errors = {"gyro bias": GYRO_BIAS, "accelerometer bias": ACCEL_BIAS}
    panels = []
    for name, at in _NOMINAL.items():
        curves = [
            _curve(axis, number, estimate.state_s - start_s, estimate.nominal[:, at + number])
            for number, axis in enumerate(_BODY)
        ]
        if name in errors:
            size = 3.0 * estimate.deviations[:, errors[name]]
            curves.append(_curve("3σ of x", 7, estimate.state_s - start_s, size, "dot"))
        panels.append(Panel(Axis(name, units[name]), curves))
    return Figure("biases", "Biases", panels, "Estimated errors of the sensors, body axes.", linked=True)


def _innovations(estimate: Estimate, start_s: float) -> Iterator[Figure]:
    sensors = (
        ("GNSS velocity", "m/s", GNSS_VELOCITY, _AXES),
        ("GNSS position", "m", GNSS_POSITION, _AXES),
        ("magnetometer", "gauss", MAG, _BODY),
        ("barometer", "m", BARO, ("height",)),
    )
    times = estimate.state_s - start_s
    for name, unit, row, axes in sensors:
        panels = []
        for number, axis in enumerate(axes):
            values = estimate.observations[:, row + number]
            size = 3.0 * np.sqrt(values["variance"])
            curves = [
                _curve("innovation", 0, times, values["innovation"]),
                _curve("3σ", 7, times, size, "dot"),
                _curve("3σ", 7, times, -size, "dot"),
            ]
            panels.append(Panel(Axis(axis, unit), curves if np.any(size > 0.0) else []))
        caption = "Measurement minus prediction, and three standard deviations that the filter expects."
        slug = name.lower().replace(" ", "-")
        yield Figure(f"innovations-{slug}", f"Innovations: {name}", panels, caption, linked=True)
