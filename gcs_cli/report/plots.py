"""The plots of a flight report, as HTML sections."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from html import escape
from typing import Any

import numpy as np

from flightstack.core.contract import FloatArray
from flightstack.core.enums import NAVIGATION_STATE
from flightstack.plan import Plan
from gcs_cli.report.chart import Band, Level, Line, time_chart
from gcs_cli.report.flight_data import Flight, LoopTiming, Series
from gcs_cli.report.map import path_chart

_MODE_NAMES = {number: mode.name.lower() for mode, number in NAVIGATION_STATE.items()}
_ACTUAL, _TARGET = "s1", "s2 target"


def plots(
    flight: Flight, plan: Plan, timings: Sequence[LoopTiming], rms_error_m: float | None
) -> Iterator[str]:
    """Yield the sections in reading order."""
    span, bands = _span(flight), mode_bands(flight)
    planned = [("flown", "s1", False), ("planned, items numbered", "s2", True)]
    yield section("Path from above", path_chart(flight, plan), planned)
    yield _altitude(flight, span, bands)
    yield _attitude(flight, span, bands)
    yield _rotors(flight, span, bands)
    yield _tracking(flight, span, bands, rms_error_m)
    yield from _timing(timings)


def section(title: str, body: str, legend: Sequence[tuple[str, str, bool]] = (), note: str = "") -> str:
    """Return a card; the legend's entries are label, style and whether the line is dashed."""
    entries = "".join(
        f'<span class="{style}"><i class="{"dashed" if dashed else ""}"></i>{escape(label)}</span>'
        for label, style, dashed in legend
    )
    head = f'<div class="head"><h2>{escape(title)}</h2><div class="legend">{entries}</div></div>'
    foot = f'<p class="note">{escape(note)}</p>' if note else ""
    return f"<section>{head}{body}{foot}</section>"


def mode_bands(flight: Flight) -> list[Band]:
    """Return the stretches of time armed in one mode."""
    ends = [status.time_s for status in flight.statuses[1:]] + [flight.duration_s]
    bands: list[Band] = []
    for status, end_s in zip(flight.statuses, ends, strict=False):
        name = _MODE_NAMES.get(status.nav_state, f"mode {status.nav_state}")
        if not status.armed:
            continue
        if bands and bands[-1].label == name and bands[-1].end == status.time_s:
            bands[-1] = bands[-1]._replace(end=end_s)
        else:
            bands.append(Band(status.time_s, end_s, name))
    return bands


def _span(flight: Flight) -> tuple[float, float]:
    """Return the time from just before arming to just after disarming; all of it if never armed."""
    bands = mode_bands(flight)
    if not bands:
        return 0.0, flight.duration_s
    margin_s = 0.02 * (bands[-1].end - bands[0].start) + 0.2
    return max(0.0, bands[0].start - margin_s), min(flight.duration_s, bands[-1].end + margin_s)


def _within(series: Series, span: tuple[float, float]) -> Series:
    first, last = np.searchsorted(series.time_s, span[0]), np.searchsorted(series.time_s, span[1], "right")
    return Series(series.time_s[first:last], series.values[first:last])


def _altitude(flight: Flight, span: tuple[float, float], bands: list[Band]) -> str:
    setpoint, position = _within(flight.position_setpoint, span), _within(flight.position, span)
    wanted = np.where(flight.standing(setpoint.time_s), np.nan, -setpoint.values[:, 2])
    lines = [
        Line("setpoint", setpoint.time_s, wanted, _TARGET),
        Line("altitude", position.time_s, -position.values[:, 2], _ACTUAL),
    ]
    return section(
        "Altitude", time_chart("Altitude", "above home [m]", lines, span, bands=bands), _legend(lines)
    )


def _attitude(flight: Flight, span: tuple[float, float], bands: list[Band]) -> str:
    target, actual = _within(flight.attitude_target, span), _within(flight.attitude, span)
    charts, lines = [], []
    for axis, name in enumerate(("roll", "pitch", "yaw")):
        wanted, got = target.values[:, axis], actual.values[:, axis]
        if name == "yaw":
            wanted, got = _same_turn(_unwrapped(wanted), _unwrapped(got))
        lines = [
            Line("target", target.time_s, np.degrees(wanted), _TARGET),
            Line("actual", actual.time_s, np.degrees(got), _ACTUAL),
        ]
        time_label = "time [s]" if name == "yaw" else ""
        charts.append(
            time_chart(name, f"{name} [°]", lines, span, bands=bands, x_label=time_label, height=175)
        )
    return section("Attitude", "".join(charts), _legend(lines))


def _unwrapped(angle_rad: FloatArray) -> FloatArray:
    result, finite = angle_rad.copy(), np.isfinite(angle_rad)
    result[finite] = np.unwrap(angle_rad[finite])
    return result


def _same_turn(target_rad: FloatArray, actual_rad: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Bring both to the same number of turns at their middle."""
    target, actual = (angle[np.isfinite(angle)] for angle in (target_rad, actual_rad))
    if not len(target) or not len(actual):
        return target_rad, actual_rad
    turns = round((float(np.median(actual)) - float(np.median(target))) / (2.0 * math.pi))
    return target_rad + 2.0 * math.pi * turns, actual_rad


def _rotors(flight: Flight, span: tuple[float, float], bands: list[Band]) -> str:
    speed = _within(flight.rotor_speed, span)
    lines = [
        Line(f"rotor {index + 1}", speed.time_s, column, f"s{index % 8 + 1} thin")
        for index, column in enumerate(speed.values.T)
    ]
    limits: list[tuple[str, Any]] = [
        ("lowest", flight.info.get("rotor_min_speed_rad_s")),
        ("highest", flight.info.get("rotor_max_speed_rad_s")),
    ]
    levels = [
        Level(f"{name} {value:.0f}", value)
        for name, value in limits
        if isinstance(value, float) and math.isfinite(value)
    ]
    chart = time_chart("Rotor speeds", "[rad/s]", lines, span, bands=bands, levels=levels, height=270)
    note = "The rotors have no limits." if lines and not levels else ""
    return section("Rotor speeds", chart, _legend(lines), note)


def _tracking(flight: Flight, span: tuple[float, float], bands: list[Band], rms_error_m: float | None) -> str:
    time_s, error = flight.tracking_error()
    lines = [Line("distance between position and setpoint", time_s, error[:, 0], _ACTUAL)]
    levels = [Level(f"rms {rms_error_m:.3f} m", rms_error_m)] if rms_error_m is not None else []
    chart = time_chart("Tracking error", "[m]", lines, span, bands=bands, levels=levels, zero_based=True)
    return section("Tracking error while flying", chart, _legend(lines))


def _timing(timings: Sequence[LoopTiming]) -> Iterator[str]:
    if not timings:
        body = '<p class="none">No loop timing was received during this flight.</p>'
        yield section("Loop timing", body)
        return
    note = "Each point covers one second of wall time."
    if not timings[-1].real_time:
        note += " In lockstep the loops run as fast as the machine goes; they have no deadline to miss."
    yield _timing_chart("Loop timing: execution of a tick", timings, "execution", note)
    if timings[-1].real_time:
        yield _timing_chart("Loop timing: lateness of a tick", timings, "lateness", "")


def _timing_chart(title: str, timings: Sequence[LoopTiming], what: str, note: str) -> str:
    time_s = np.array([timing.time_s for timing in timings])
    lines = [
        Line(name, time_s, np.array([getattr(timing, f"{what}_{key}_us") for timing in timings]), style)
        for name, key, style in (("largest", "max", "s2"), ("99 %", "p99", "s3"), ("mean", "mean", "s1"))
    ]
    period_us = timings[-1].period_us
    levels = [Level(f"period {period_us:.0f} µs", period_us)] if math.isfinite(period_us) else []
    span = (0.0, float(time_s.max()) * 1.02)
    return section(
        title, time_chart(title, "[µs]", lines, span, levels=levels, log=True), _legend(lines), note
    )


def _legend(lines: Sequence[Line]) -> list[tuple[str, str, bool]]:
    return [(line.label, line.style, False) for line in lines]
