"""The figures of a flight: ``summary.json``."""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flightstack.atomic_file import write_text_atomically
from flightstack.contract import FloatArray
from flightstack.geodesy import LocalFrame
from flightstack.plan import NAV_COMMANDS, MissionItem, Plan
from gcs_cli.flight_data import Flight

_DIGITS = 6


@dataclass(frozen=True)
class RunInfo:
    """What the log of the flight does not know: how it was started and how it ended.

    ``outcome`` is "completed" or the reason why not. ``wall_time_s`` runs from the start of the mission to
    the end of the flight. What is None is taken from the log where it is there.
    """

    outcome: str
    plan: str
    wall_time_s: float | None = None
    vehicle: str | None = None
    controller: str | None = None
    gains: str | None = None
    plant: str | None = None
    loops: str | None = None
    seed: int | None = None
    wind: str | None = None
    gust: float | None = None
    torque_gust: float | None = None
    force: str | None = None
    torque: str | None = None
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
    """Return the content of ``summary.json``: only what JSON can hold; null for what is not known.

    For a run that left no readable log, pass ``Flight()``. Tracking errors are distances [m] between position
    and setpoint while flying; the root mean square is over samples, which are evenly spaced in time.
    """
    error_m = flight.tracking_error().values[:, 0]
    factor = flight.duration_s / run.wall_time_s if run.wall_time_s else None
    settings = {
        key: value if (value := getattr(run, key)) is not None else flight.info.get(key)
        for key in ("vehicle", "controller", "gains", "plant", "loops", "seed", "inner_hz", "outer_hz")
    }
    return {
        "outcome": run.outcome,
        "plan": run.plan,
        **{key: _finite(value) for key, value in settings.items()},
        **_conditions(run),
        "sim_time_s": _rounded(flight.duration_s),
        "wall_time_s": _rounded(run.wall_time_s),
        "real_time_factor": _rounded(factor),
        "waypoints": waypoint_rows(flight, plan),
        "rms_tracking_error_m": _rounded(math.sqrt(np.mean(error_m**2))) if len(error_m) else None,
        "max_tracking_error_m": _rounded(float(error_m.max())) if len(error_m) else None,
        "overruns": run.overruns if run.overruns is not None else flight.overruns,
        "log_sha256": file_sha256(run.log_path) if run.log_path and run.log_path.exists() else None,
    }


def _conditions(run: RunInfo) -> dict[str, Any]:
    """What the simulator was asked to do to the vehicle, in the units of the flags; null where nothing was."""
    return {
        "wind_m_s": _numbers(run.wind),
        "gust_m_s": run.gust,
        "torque_gust_n_m": run.torque_gust,
        "force_n": _numbers(run.force),
        "torque_n_m": _numbers(run.torque),
        "battery_start_percent": run.battery_start,
        "battery_capacity_mah": run.battery_capacity,
        "battery_drain": run.battery_drain,
        "faults": list(run.faults),
        "ideal_rotors": run.ideal_rotors,
        "params": run.params,
        "param": list(run.param),
    }


def _numbers(text: str | None) -> list[float] | None:
    return None if text is None else [float(part) for part in text.split(",")]


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
    """
    reached: dict[int, float] = {}
    for progress in flight.mission:
        reached.setdefault(progress.reached, progress.time_s)
    return [
        {
            "seq": seq,
            "reached": seq in reached,
            "time_s": _rounded(reached.get(seq)),
            "miss_distance_m": _miss_distance_m(flight, seq, item),
        }
        for seq, item in enumerate(plan.items)
        if item.command in NAV_COMMANDS
    ]


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
            inside = (time_s >= progress.time_s) & (time_s <= end_s) & flight.flying(time_s)
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
