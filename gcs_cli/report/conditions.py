"""Vehicle and conditions of a flight as text, from ``summary.json``; unknown values are omitted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from flightstack.params.config import FLOWN_ON


def flown(summary: Mapping[str, Any]) -> list[str]:
    """Return vehicle, controller with its gains, loops, rates and plant."""
    controller, gains = summary.get("controller"), summary.get("gains")
    inner_hz, outer_hz = summary.get("inner_hz"), summary.get("outer_hz")
    parts = [
        _named("vehicle", summary.get("vehicle")),
        _named("controller", controller if gains is None else f"{controller or '–'}, gains {gains}"),
        _named("loops in", summary.get("loops")),
        ""
        if inner_hz is None
        else f"{inner_hz:g} Hz"
        if outer_hz is None
        else f"{inner_hz:g} and {outer_hz:g} Hz",
        _named("plant", summary.get("plant")),
    ]
    return [part for part in parts if part]


def conditions(summary: Mapping[str, Any]) -> list[str]:
    """Return what the simulator did to the vehicle: wind, gusts, battery, faults and seed; and the state it flew on."""
    parts = [
        _vector("wind", summary.get("wind_m_s"), "m/s", ("north", "east", "down")),
        _amount("gusts", summary.get("gust_m_s"), " m/s"),
        _drag(summary),
        _amount("gusty torque", summary.get("torque_gust_n_m"), " N m"),
        _vector("force", summary.get("force_n"), "N", ("north", "east", "down")),
        _vector("torque", summary.get("torque_n_m"), "N m", ("roll", "pitch", "yaw")),
        _amount("slope of", summary.get("slope_deg"), "°"),
        _vector("boat at", summary.get("boat_m_s"), "m/s", ("north", "east")),
        _amount("battery from", summary.get("battery_start_percent"), " %"),
        _amount("battery of", summary.get("battery_capacity_mah"), " mAh"),
        _amount("battery drained", summary.get("battery_drain"), " times as fast"),
        *_faults(summary),
    ]
    if summary.get("ideal_rotors"):
        parts.append("rotors without lag and limits")
    parts.append(_named("parameters of", summary.get("params")))
    parts += summary.get("param") or ()
    told = [part for part in parts if part]
    if (
        summary.get("seed") is not None
    ):  # else the simulator is unknown, as in a report that is made of a log alone
        told = [*(told or ["no wind, no faults"]), f"seed {summary['seed']}"]
    state = summary.get("state")
    return [*told, *([FLOWN_ON[state]] if state in FLOWN_ON else [])]


def _drag(summary: Mapping[str, Any]) -> str:
    """Return the drag through which the wind acted; nothing of a flight in calm air."""
    blows = any(summary.get("wind_m_s") or ()) or summary.get("gust_m_s")
    drag = summary.get("drag_n_s_m")
    return f"drag {', '.join(f'{value:g}' for value in drag)} N s/m" if blows and drag else ""


def _faults(summary: Mapping[str, Any]) -> list[str]:
    late = summary.get("faults_not_begun") or ()
    return [
        f"fault {fault}" + (" (did not act: the flight ended before)" if fault in late else "")
        for fault in summary.get("faults") or ()
    ]


def _named(name: str, value: object) -> str:
    return "" if value is None else f"{name} {value}"


def _amount(name: str, value: float | None, unit: str) -> str:
    return "" if value is None else f"{name} {value:g}{unit}"


def _vector(name: str, values: Sequence[float] | None, unit: str, axes: Sequence[str]) -> str:
    if values is None:
        return ""
    parts = (f"{value:g} {unit} {axis}".replace("-", "−") for value, axis in zip(values, axes, strict=False))
    return f"{name} {', '.join(parts)}"
