"""The figures of a flight: ``summary.json``."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flightstack.core.atomic_file import write_text_atomically
from flightstack.core.contract import FloatArray
from flightstack.core.geodesy import LocalFrame
from flightstack.params.config import ESTIMATED, TRUTH
from flightstack.plan import NAV_COMMANDS, Command, MissionItem, Plan
from gcs_cli.report.estimate_error import estimate_figures
from gcs_cli.report.flight_data import Flight
from gcs_cli.report.flight_figures import (
    attitude_error,
    overshoots_m,
    rms,
    rms_command_rate_rad_s2,
    rms_torque_n_m,
)
from gcs_cli.report.flight_outcome import GROUND_ENDS

_DIGITS = 6


@dataclass(frozen=True)
class RunInfo:
    """Facts that the flight log does not have: how the flight was started and how it ended.

    ``outcome`` is a code of ``flight_outcome``. ``wall_time_s`` runs from the start of the mission to the end of the
    flight. Fields that are None are read from the log if it has them.
    """

    outcome: str
    plan: str
    wall_time_s: float | None = None
    outcome_text: str = ""
    vehicle: str | None = None
    controller: str | None = None
    gains: str | None = None
    plant: str | None = None
    loops: str | None = None
    state: str | None = None
    seed: int | None = None
    wind: str | None = None
    gust: float | None = None
    drag_n_s_m: tuple[float, float, float] | None = None
    torque_gust: float | None = None
    force: str | None = None
    torque: str | None = None
    slope: float | None = None
    boat: str | None = None
    battery_start: float | None = None
    battery_capacity: float | None = None
    battery_drain: float | None = None
    faults: tuple[str, ...] = ()
    ideal_rotors: bool | None = None
    params: str | None = None
    param: tuple[str, ...] = ()
    inner_hz: float | None = None
    outer_hz: float | None = None
    overruns: int | None = None
    log_path: Path | None = None


def summarise(flight: Flight, plan: Plan, run: RunInfo) -> dict[str, Any]:
    """Return the content of ``summary.json``: values that JSON can hold; null if unknown.

    docs/reference/summary.md describes every key. For a run that left no readable log, pass ``Flight()``.
    """
    factor = flight.duration_s / run.wall_time_s if run.wall_time_s else None
    settings = {
        key: value if (value := getattr(run, key)) is not None else flight.info.get(key)
        for key in (
            "vehicle",
            "controller",
            "gains",
            "plant",
            "loops",
            "state",
            "seed",
            "inner_hz",
            "outer_hz",
        )
    }
    if settings["state"] is None and flight.info.get("sys_name") == "flightstack":
        settings["state"] = ESTIMATED if len(flight.true_position.time_s) else TRUTH
    return {
        "outcome": run.outcome,
        "outcome_text": run.outcome_text,
        "plan": run.plan,
        **{key: _finite(value) for key, value in settings.items()},
        **_conditions(run, flight),
        "sim_time_s": _rounded(flight.duration_s),
        "flight_time_s": _flight_time_s(flight),
        "wall_time_s": _rounded(run.wall_time_s),
        "real_time_factor": _rounded(factor),
        "waypoints": waypoint_rows(flight, plan),
        **_control(flight),
        "estimate_error": estimate_figures(flight),
        "overruns": run.overruns if run.overruns is not None else flight.overruns,
        "log_sha256": file_sha256(run.log_path) if run.log_path and run.log_path.exists() else None,
    }


def _control(flight: Flight) -> dict[str, Any]:
    """Tracking errors in flight, and the control effort."""
    error_m, angle_rad = flight.tracking_error().values[:, 0], attitude_error(flight).values[:, 0]
    angle_deg, torque = np.degrees(angle_rad), rms_torque_n_m(flight)
    return {
        "rms_tracking_error_m": _rounded(rms(error_m)),
        "max_tracking_error_m": _rounded(float(error_m.max())) if len(error_m) else None,
        "rms_attitude_error_deg": _rounded(rms(angle_deg)),
        "max_attitude_error_deg": _rounded(float(angle_deg.max())) if len(angle_deg) else None,
        "rms_torque_n_m": None if torque is None else [_rounded(value) for value in torque],
        "rms_rotor_command_rate_rad_s2": _rounded(rms_command_rate_rad_s2(flight)),
    }


def _flight_time_s(flight: Flight) -> float | None:
    """Time in the air, from takeoff to touchdown; None without a log of positions and of the arming state."""
    time_s = flight.position.time_s
    if len(time_s) < 2 or not flight.statuses:
        return None
    return _rounded(float(np.diff(time_s)[flight.flying(time_s)[:-1]].sum()))


def _conditions(run: RunInfo, flight: Flight) -> dict[str, Any]:
    """Disturbances requested of the simulator, in the units of the flags; null for none."""
    return {
        "wind_m_s": _numbers(run.wind),
        "gust_m_s": run.gust,
        "drag_n_s_m": None if run.drag_n_s_m is None else list(run.drag_n_s_m),
        "torque_gust_n_m": run.torque_gust,
        "force_n": _numbers(run.force),
        "torque_n_m": _numbers(run.torque),
        "slope_deg": run.slope,
        "boat_m_s": _numbers(run.boat),
        "battery_start_percent": run.battery_start,
        "battery_capacity_mah": run.battery_capacity,
        "battery_drain": run.battery_drain,
        "faults": list(run.faults),
        "faults_not_begun": [fault for fault in run.faults if _begin_s(fault) >= _end_s(flight)],
        "ideal_rotors": run.ideal_rotors,
        "params": run.params,
        "param": list(run.param),
    }


def _numbers(text: str | None) -> list[float] | None:
    return None if text is None else [float(part) for part in text.split(",")]


def _begin_s(fault: str) -> float:
    """Return the simulated time at which a fault begins, from its text: ``rotor:2:off@12.5-20``."""
    begin, _, _ = fault.partition("@")[2].partition("-")
    return float(begin) if begin else 0.0


def _end_s(flight: Flight) -> float:
    """Return the simulated time at the end of the log; infinite without one."""
    return flight.start_s + flight.duration_s if flight.statuses else math.inf


def write_summary(path: Path, summary: dict[str, Any]) -> None:
    """Write ``summary.json``, whole or not at all; raise OSError when that fails."""
    write_text_atomically(path, json.dumps(summary, indent=2, allow_nan=False, ensure_ascii=False) + "\n")


def file_sha256(path: Path) -> str:
    """Return the SHA-256 of a file in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def item_ned_m(item: MissionItem, flight: Flight) -> FloatArray | None:
    """Position NED [m] of an item in the flight's local frame, shape (3,); None for an item without one."""
    position_deg = item.position_deg
    if position_deg is None or flight.home is None or flight.origin is None or not math.isfinite(item.z):
        return None
    altitude_m = item.z + (flight.home.altitude_m if item.altitude_is_relative else 0.0)
    local = LocalFrame(flight.origin)
    return np.array(local.to_ned(flight.home._replace(
        latitude_deg=position_deg[0], longitude_deg=position_deg[1], altitude_m=altitude_m
    )))  # fmt: skip


def waypoint_rows(flight: Flight, plan: Plan) -> list[dict[str, Any]]:
    """Return a row for every navigation item of the plan, in order.

    ``time_s`` is when the item was first reached, since the start of the log. ``miss_distance_m`` is the
    smallest distance between the flown path and the item's position while it was the current one.
    ``overshoot_m``: see ``overshoots_m``; null where it has no meaning, as for a landing.
    """
    reached: dict[int, float] = {}
    for progress in flight.mission:
        reached.setdefault(progress.reached, progress.time_s)
    places = {
        seq: place for seq, item in enumerate(plan.items) if (place := _place(item, flight)) is not None
    }
    overshoots = overshoots_m(flight, places)
    return [
        {
            "seq": seq,
            "reached": seq in reached,
            "time_s": _rounded(reached.get(seq)),
            "miss_distance_m": _miss_distance_m(flight, seq, item),
            "overshoot_m": None if item.command in GROUND_ENDS else _rounded(overshoots.get(seq)),
        }
        for seq, item in enumerate(plan.items)
        if item.command in NAV_COMMANDS
    ]


def max_overshoot_m(summary: Mapping[str, Any]) -> float | None:
    """Return the largest overshoot of all items; None if none has one."""
    return max(
        (row["overshoot_m"] for row in summary["waypoints"] if row["overshoot_m"] is not None), default=None
    )


def _place(item: MissionItem, flight: Flight) -> FloatArray | None:
    """Position of an item that is flown to; that of a return is home, at the ground."""
    if item.command == Command.NAV_RETURN_TO_LAUNCH and flight.home_ne_m() is not None:
        return np.array([*(flight.home_ne_m() or ()), 0.0])
    return item_ned_m(item, flight) if item.command in NAV_COMMANDS else None


def _miss_distance_m(flight: Flight, seq: int, item: MissionItem) -> float | None:
    target = item_ned_m(item, flight)
    time_s, position = flight.position
    if target is None:
        return None
    ends = [progress.time_s for progress in flight.mission[1:]] + [math.inf]
    smallest = math.inf
    for progress, end_s in zip(flight.mission, ends, strict=False):
        if progress.current == seq:
            # the sample at the end belongs to both: the item was reached by then
            began = flight.flying(time_s) | flight.standing(time_s)
            inside = (time_s >= progress.time_s) & (time_s <= end_s) & began
            smallest = min(smallest, _distance_to_path_m(position[inside], target))
    return _rounded(smallest)


def _distance_to_path_m(path: FloatArray, point: FloatArray) -> float:
    """Smallest distance between a point and a line through samples, shape (n, 3); infinite for none."""
    path = path[np.isfinite(path).all(axis=1)]
    if len(path) == 0:
        return math.inf
    path = np.concatenate((path, path[-1:]))  # so that a single sample makes a line too
    start, step = path[:-1], np.diff(path, axis=0)
    length2 = np.maximum((step**2).sum(axis=1), 1e-30)
    along = np.clip(((point - start) * step).sum(axis=1) / length2, 0.0, 1.0)
    return float(np.linalg.norm(start + along[:, None] * step - point, axis=1).min())


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _rounded(value: float | None) -> float | None:
    return round(value, _DIGITS) if value is not None and math.isfinite(value) else None
