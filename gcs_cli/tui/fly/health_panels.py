"""Health in the terminal view: failsafes, GNSS, estimator, wind, sensors and the link. Pure."""

from __future__ import annotations

import math

from rich.text import Text

from flightstack.core.enums import Severity
from gcs_cli.tui.fly.panels import row_of
from gcs_cli.tui.palette import Palette
from gcs_cli.vehicle.field_units import UNKNOWN, number
from gcs_cli.vehicle.view_types import VehicleView

_DOUBTFUL_RATIO = 0.5
_COMPASS = ("N", "NE", "E", "SE", "S", "SW", "W", "NW")


def health_panel(view: VehicleView, _now_s: float, width: int, height: int, colours: Palette) -> list[Text]:
    """Active failsafes and bad sensors first, then GNSS, estimator and wind."""
    lines = [
        _failsafe(view, colours),
        _gnss(view, width, colours),
        _estimator(view, width, colours),
        _wind(view, colours),
    ]
    lines.insert(1 if view.unhealthy else len(lines), _sensors(view, colours))
    return lines[:height]


def link_panel(view: VehicleView, now_s: float, _width: int, height: int, colours: Palette) -> list[Text]:
    """Rate, loss, round trip and silence of the link."""
    link, plain = view.link, colours.text
    total = link.received + link.lost
    loss = UNKNOWN if not total else f"{link.lost / total:.2%}, {link.lost} of {total}"
    trip = None if view.link.round_trip_s is None else 1e3 * view.link.round_trip_s
    silent = view.silent_s(now_s)
    rows = [
        row_of("rate", f"{number(link.rate_hz, 0)} msg/s", f"bold {plain}", colours),
        row_of("lost", loss, colours.warning if link.lost else plain, colours),
        row_of("round trip", number(trip, 1, " ms"), plain, colours),
        row_of("heartbeat", f"{number(silent, 0)} s ago", plain, colours),
    ]
    return rows[:height]


def _failsafe(view: VehicleView, colours: Palette) -> Text:
    if view.fence_breached and not view.in_failsafe:
        return row_of("failsafe", "outside the fence", f"bold {colours.warning}", colours)
    if not view.in_failsafe:
        return row_of("failsafe", "none active", colours.good, colours)
    reasons = [entry.text for entry in view.texts if entry.severity <= Severity.WARNING]
    state = (
        "flight terminated"
        if view.terminated_for_good
        else "rotors switched off"
        if view.terminated
        else reasons[-1].removeprefix("Failsafe: ")
        if reasons
        else "active"
    )
    return row_of("failsafe", state, f"bold {colours.bad}", colours)


def _gnss(view: VehicleView, width: int, colours: Palette) -> Text:
    gnss = view.gnss
    if gnss is None:
        return row_of("gnss", UNKNOWN, colours.text, colours)
    parts = [gnss.fix_name]
    if gnss.satellites is not None:
        parts.append(f"{gnss.satellites} sats")
    if gnss.hdop is not None and width >= 36:
        parts.append(f"HDOP {gnss.hdop:.1f}")
    elif gnss.horizontal_accuracy_m is not None and width >= 36:
        parts.append(f"±{gnss.horizontal_accuracy_m:.1f} m")
    return row_of("gnss", "  ".join(parts), colours.good if gnss.has_position else colours.bad, colours)


def _estimator(view: VehicleView, width: int, colours: Palette) -> Text:
    estimator = view.estimator
    if estimator is None:
        return row_of("estimator", UNKNOWN, colours.text, colours)
    known = (
        ("attitude", estimator.has_attitude),
        ("velocity", estimator.has_velocity),
        ("position", estimator.has_position),
        ("altitude", estimator.has_altitude),
    )
    missing = [name for name, is_known in known if not is_known]
    ratio = estimator.worst_ratio
    parts = ["no " + ", ".join(missing) if missing else "good" if estimator.healthy else "rejects"]
    if ratio is not None:
        parts.append(f"ratio {ratio:.2f}")
    if estimator.horizontal_m is not None and width >= 36:
        parts.append(f"±{estimator.horizontal_m:.1f} m")
    doubtful = ratio is not None and ratio >= _DOUBTFUL_RATIO
    style = colours.bad if not estimator.healthy else colours.warning if doubtful else colours.good
    return row_of("estimator", "  ".join(parts), style, colours)


def _wind(view: VehicleView, colours: Palette) -> Text:
    wind = view.wind_ned_m_s
    if wind is None:
        return row_of("wind", UNKNOWN, colours.text, colours)
    source_deg = math.degrees(math.atan2(-wind.y, -wind.x)) % 360
    name = _COMPASS[round(source_deg / 45) % 8]
    speed = math.hypot(wind.x, wind.y)
    return row_of("wind", f"{speed:.1f} m/s from {name} {source_deg:03.0f}°", colours.text, colours)


def _sensors(view: VehicleView, colours: Palette) -> Text:
    if view.healthy is None:
        return row_of("sensors", UNKNOWN, colours.text, colours)
    if not view.unhealthy:
        return row_of("sensors", "healthy", colours.good, colours)
    return row_of("sensors", "bad: " + ", ".join(view.unhealthy), f"bold {colours.bad}", colours)
