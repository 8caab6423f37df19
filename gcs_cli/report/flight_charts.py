"""The charts of a flight over time. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from flightstack.core.contract import FloatArray
from flightstack.core.enums import NAVIGATION_STATE
from gcs_cli.charts.decimate import BUCKETS, is_decimated
from gcs_cli.charts.figure import Axis, Band, Figure, Level, Panel, Shape, nth_colour
from gcs_cli.charts.figure import Series as Curve
from gcs_cli.report.estimate_error import SIGMAS, sigma_curve
from gcs_cli.report.flight_data import Flight, LoopTiming, Series
from gcs_cli.report.flight_figures import attitude_error, attitude_errors_rad

SETPOINT, ACTUAL = "setpoint", "actual"
"""Names of curves."""
_MODE_NAMES = {number: mode.name.lower() for mode, number in NAVIGATION_STATE.items()}
_ANGLES = ("roll", "pitch", "yaw")
_FEW = 60
"""Up to so many samples are drawn as dots too."""


def mode_bands(flight: Flight) -> list[Band]:
    """Return the stretches of time armed in one mode."""
    ends = [status.time_s for status in flight.statuses[1:]] + [flight.duration_s]
    bands: list[Band] = []
    for status, end_s in zip(flight.statuses, ends, strict=False):
        name = _MODE_NAMES.get(status.nav_state, f"mode {status.nav_state}")
        if not status.armed:
            continue
        if bands and bands[-1].label == name and bands[-1].end == status.time_s:
            bands[-1] = replace(bands[-1], end=end_s)
        else:
            bands.append(Band(status.time_s, end_s, name))
    return bands


def shown_span(flight: Flight) -> tuple[float, float]:
    """Return the time from just before arming to just after disarming; all of it if never armed."""
    bands = mode_bands(flight)
    if not bands:
        return 0.0, flight.duration_s
    margin_s = 0.02 * (bands[-1].end - bands[0].start) + 0.2
    return max(0.0, bands[0].start - margin_s), min(flight.duration_s, bands[-1].end + margin_s)


def time_figures(flight: Flight, rotors_apart: bool = False) -> list[Figure]:
    """Return what the vehicle did over time, from arming to disarming.

    ``rotors_apart``: a panel for each rotor, in place of one for all.
    """
    span = shown_span(flight)
    figures = [
        _position(flight, span),
        _velocity(flight, span),
        _position_error(flight),
        _attitude(flight, span),
        _attitude_error(flight),
        _rotors(flight, span, rotors_apart),
        _battery(_within(flight.battery, span)),
    ]
    return [_noted(figure) for figure in figures]


def in_modes(figure: Figure, flight: Flight) -> Figure:
    """Return a figure with the flight modes as bands, from arming to disarming."""
    low, high = shown_span(flight)
    x, bands = Axis("time", "s", low, high), mode_bands(flight)
    return replace(figure, panels=[replace(panel, x=x, bands=bands) for panel in figure.panels])


def _noted(figure: Figure) -> Figure:
    """Return a figure whose caption says if samples are left out."""
    count = max((len(curve.x) for panel in figure.panels for curve in panel.series), default=0)
    if not is_decimated(count):
        return figure
    note = f"Of {count} samples the smallest and the largest of each of {BUCKETS} stretches are drawn."
    return replace(figure, caption=f"{figure.caption} {note}")


def _within(series: Series, span: tuple[float, float]) -> Series:
    first, last = np.searchsorted(series.time_s, span[0]), np.searchsorted(series.time_s, span[1], "right")
    return Series(series.time_s[first:last], series.values[first:last])


def _curve(
    name: str,
    time_s: FloatArray,
    values: FloatArray,
    colour: str = "s1",
    width: float = 1.5,
    in_legend: bool = True,
) -> list[Curve]:
    """Return a curve, or none if no value is known."""
    if not np.isfinite(values).any():
        return []
    marker: Shape = "circle" if len(time_s) <= _FEW else ""
    return [Curve(name, time_s, values, colour, width=width, marker=marker, in_legend=in_legend)]


def _alone(time_s: FloatArray, values: FloatArray) -> list[Curve]:
    """Return the only curve of a panel, which the axis names."""
    return _curve(ACTUAL, time_s, values, in_legend=False)


def _pair(
    axis: Axis, setpoint: tuple[FloatArray, FloatArray], actual: tuple[FloatArray, FloatArray]
) -> Panel:
    return Panel(axis, [*_curve(SETPOINT, *setpoint, "s2", 3.0), *_curve(ACTUAL, *actual, "s1")])


def _position(flight: Flight, span: tuple[float, float]) -> Figure:
    setpoint, position = _within(flight.position_setpoint, span), _within(flight.position, span)
    down = np.where(flight.standing(setpoint.time_s), np.nan, setpoint.values[:, 2])
    wanted = (setpoint.values[:, 0], setpoint.values[:, 1], -down)
    got = (position.values[:, 0], position.values[:, 1], -position.values[:, 2])
    panels = [
        _pair(Axis(name, "m"), (setpoint.time_s, wanted[index]), (position.time_s, got[index]))
        for index, name in enumerate(("north", "east", "altitude"))
    ]
    caption = "Position and its setpoint in metres north, east and up from the origin of the local frame."
    true = _within(flight.true_position, span)
    if len(true.time_s):
        panels = [_with_truth(panel, index, flight, true) for index, panel in enumerate(panels)]
        caption += " Dashed: the truth. Dotted: three standard deviations that the estimator states."
    return Figure("position", "Position", panels, caption, linked=True, height=140)


def _with_truth(panel: Panel, axis: int, flight: Flight, true: Series) -> Panel:
    """Return a panel of the position with the truth, and the band of the estimate."""
    sign = -1.0 if axis == 2 else 1.0
    curves = [*panel.series, Curve("truth", true.time_s, sign * true.values[:, axis], "s5", "dash")]
    time_s, sigma = flight.deviations
    if len(time_s):
        middle = sign * np.interp(time_s, flight.position.time_s, flight.position.values[:, axis])
        band = SIGMAS * sigma[:, 6 + axis]
        curves += [sigma_curve(time_s, middle + band), sigma_curve(time_s, middle - band)]
    return replace(panel, series=curves)


def _velocity(flight: Flight, span: tuple[float, float]) -> Figure:
    setpoint, velocity = _within(flight.velocity_setpoint, span), _within(flight.velocity, span)
    flying = flight.flying(setpoint.time_s)
    panels = [
        _pair(
            Axis(name, "m/s"),
            (setpoint.time_s, np.where(flying, sign * setpoint.values[:, index], np.nan)),
            (velocity.time_s, sign * velocity.values[:, index]),
        )
        for index, (name, sign) in enumerate((("north", 1.0), ("east", 1.0), ("climb", -1.0)))
    ]
    caption = (
        "Velocity and the velocity that guidance feeds forward, in metres per second north, east and up."
    )
    return Figure("velocity", "Velocity", panels, caption, linked=True, height=120)


def _position_error(flight: Flight) -> Figure:
    time_s, error = flight.position_error()
    panels = [
        Panel(Axis(name, "m"), _alone(time_s, sign * error[:, index]))
        for index, (name, sign) in enumerate((("north", 1.0), ("east", 1.0), ("up", -1.0)))
    ]
    time_s, distance = flight.tracking_error()
    rms_m = float(np.sqrt(np.mean(np.square(distance)))) if len(distance) else None
    levels = [] if rms_m is None else [Level(f"rms {rms_m:.3f} m", rms_m)]
    distances = _alone(time_s, distance[:, 0])
    panels.append(Panel(Axis("distance", "m", low=0.0), distances, levels=levels))
    caption = "Setpoint minus position on each axis, and the distance between them, while flying."
    return Figure("position-error", "Tracking error", panels, caption, linked=True, height=110)


def _attitude(flight: Flight, span: tuple[float, float]) -> Figure:
    setpoint, actual = _within(flight.attitude_target, span), _within(flight.attitude, span)
    panels = []
    for axis, name in enumerate(_ANGLES):
        wanted, got = setpoint.values[:, axis], actual.values[:, axis]
        if name == "yaw":
            wanted, got = _same_turn(_unwrapped(wanted), _unwrapped(got))
        panels.append(
            _pair(Axis(name, "°"), (setpoint.time_s, np.degrees(wanted)), (actual.time_s, np.degrees(got)))
        )
    caption = "Roll, pitch and yaw beside the attitude that the outer loop asks for."
    return Figure("attitude", "Attitude", panels, caption, linked=True, height=130)


def _unwrapped(angle_rad: FloatArray) -> FloatArray:
    result, finite = angle_rad.copy(), np.isfinite(angle_rad)
    result[finite] = np.unwrap(angle_rad[finite])
    return result


def _same_turn(target_rad: FloatArray, actual_rad: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Bring both to the same number of turns at their middle."""
    target, actual = (angle[np.isfinite(angle)] for angle in (target_rad, actual_rad))
    if not len(target) or not len(actual):
        return target_rad, actual_rad
    turns = round((_middle(actual) - _middle(target)) / (2.0 * math.pi))
    return target_rad + 2.0 * math.pi * turns, actual_rad


def _middle(values: FloatArray) -> float:
    """Return the median, of an even number the upper one; that of NumPy imports ``numpy.ma``, 20 ms after a flight."""
    middle = len(values) // 2
    return float(np.partition(values, middle)[middle])


def _attitude_error(flight: Flight) -> Figure:
    time_s, errors = attitude_errors_rad(flight)
    panels = [
        Panel(Axis(name, "°"), _alone(time_s, np.degrees(errors[:, axis])))
        for axis, name in enumerate(_ANGLES)
    ]
    time_s, angle = attitude_error(flight)
    panels.append(Panel(Axis("angle", "°", low=0.0), _alone(time_s, np.degrees(angle[:, 0]))))
    caption = (
        "Setpoint minus attitude on each axis, and the angle of the rotation between them, while flying."
    )
    return Figure("attitude-error", "Attitude error", panels, caption, linked=True, height=110)


def _rotors(flight: Flight, span: tuple[float, float], apart: bool) -> Figure:
    speed = _within(flight.rotor_speed, span)
    curves = [
        _curve(f"rotor {index + 1}", speed.time_s, column, nth_colour(index), 1.0)
        for index, column in enumerate(speed.values.T)
    ]
    levels = list(_rotor_limits(flight))
    if apart:
        panels = [Panel(Axis(f"rotor {index + 1}", "rad/s"), each) for index, each in enumerate(curves)]
    else:
        panels = [Panel(Axis("speed", "rad/s"), [curve for each in curves for curve in each], levels=levels)]
    caption = "Speed of each rotor, with the limits of the vehicle."
    if any(curves) and not levels:
        caption = "Speed of each rotor. The rotors have no limits."
    return Figure("rotor-speeds", "Rotor speeds", panels, caption, linked=True, height=110 if apart else 230)


def _rotor_limits(flight: Flight) -> Iterator[Level]:
    for name, key in (("lowest", "rotor_min_speed_rad_s"), ("highest", "rotor_max_speed_rad_s")):
        value = flight.info.get(key)
        if isinstance(value, float) and math.isfinite(value):
            yield Level(f"{name} {value:.0f}", value)


def _battery(battery: Series) -> Figure:
    panels = [
        Panel(Axis(name, unit), _alone(battery.time_s, factor * battery.values[:, index]))
        for index, (name, unit, factor) in enumerate((("remaining", "%", 100.0), ("voltage", "V", 1.0)))
    ]
    caption = "Charge and voltage of the battery."
    if not len(battery.time_s):
        caption = "The log has no battery."
    return Figure("battery", "Battery", panels, caption, linked=True, height=120)


def timing_figures(timings: Sequence[LoopTiming]) -> Iterator[Figure]:
    """Yield execution time, and lateness in real time, of the loops."""
    real_time = bool(timings) and timings[-1].real_time
    caption = "Time that a tick of the loops took; each point covers the newest 4096 ticks."
    if not timings:
        caption = "No loop timing was received during this flight."
    elif not real_time:
        caption += " In lockstep the loops run as fast as the machine goes; they have no deadline to miss."
    yield _timing("Loop timing: execution of a tick", timings, "execution", caption)
    if real_time:
        caption = "How late ticks began; each point covers the newest 4096 ticks."
        yield _timing("Loop timing: lateness of a tick", timings, "lateness", caption)


def _timing(title: str, timings: Sequence[LoopTiming], what: str, caption: str) -> Figure:
    time_s = np.array([timing.time_s for timing in timings])
    curves = [
        curve
        for name, key, colour in (("largest", "max", "s2"), ("99 %", "p99", "s3"), ("mean", "mean", "s1"))
        for curve in _curve(
            name, time_s, np.array([getattr(timing, f"{what}_{key}_us") for timing in timings]), colour
        )
    ]
    period_us = timings[-1].period_us if timings else math.nan
    levels = [Level(f"period {period_us:.0f} µs", period_us)] if math.isfinite(period_us) else []
    panel = Panel(Axis(what, "µs", log=True), curves, levels=levels)
    return Figure(f"loop-timing-{what}", title, [panel], caption, height=210)
