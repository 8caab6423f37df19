"""A flight's log -> poses that can be drawn; the drawing is the simulator's (``sim-bridge render``)."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flightstack.core.contract import FloatArray
from flightstack.core.errors import ConfigError
from flightstack.core.geometry_bulk import quaternions_from_euler
from flightstack.flight_log.poses_file import Poses
from flightstack.params.vehicle import load_vehicle
from flightstack.plan import NAV_COMMANDS, load_plan
from gcs_cli.errors import USAGE, CliError
from gcs_cli.report.flight_data import Flight, Series
from gcs_cli.report.summary import item_ned_m
from gcs_cli.run_directory import LOG_NAME, SUMMARY_NAME

_FILM = "replay.mp4"


class Run(NamedTuple):
    """A flight that was flown: its log, and what the summary beside it says, nothing if there is none."""

    log: Path
    summary: dict[str, Any]

    @property
    def film(self) -> Path:
        """Default path of its film."""
        return self.log.with_name(_FILM if self.log.name == LOG_NAME else f"{self.log.stem}.mp4")


def find_run(path: Path) -> Run:
    """Return the flight in a directory or of a log; raise CliError (usage)."""
    if path.is_dir():
        logs = sorted(path.glob("*.ulg"))
        log = path / LOG_NAME
        if log not in logs:
            if len(logs) != 1:
                raise CliError(_no_single_log(path, logs), USAGE)
            log = logs[0]
    elif path.suffix == ".tlog" and path.exists():
        raise CliError(
            f"{path}: is a tlog; give a ULog (.ulg). `gcs log plot` and `gcs replay` read a tlog", USAGE
        )
    elif path.exists():
        log = path
    else:
        raise CliError(f"{path}: there is no such directory or log", USAGE)
    return Run(log, _summary(log))


def _no_single_log(folder: Path, logs: Sequence[Path]) -> str:
    if logs:
        return f"{folder}: this directory has {len(logs)} logs; name one, for example {logs[-1]}"
    flights = sorted(log.parent for log in folder.glob(f"*/{LOG_NAME}"))
    example = f", for example {flights[-1]}" if flights else ""
    return f"{folder}: there is no log in this directory; name the directory of a flight{example}, or a .ulg file"


def _summary(log: Path) -> dict[str, Any]:
    """Return what the summary beside a run's log says; that of another log says nothing about this one."""
    if log.name != LOG_NAME:
        return {}
    try:
        content = json.loads((log.parent / SUMMARY_NAME).read_text(encoding="utf-8"), parse_constant=_refuse)
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}


def _refuse(constant: str) -> float:
    """Refuse NaN and infinities, which JSON does not have; raise ValueError."""
    raise ValueError(f"{constant} is not a number of JSON")


def poses_of(flight: Flight, run: Run, vehicle: str | None) -> Poses:
    """Return the poses of a flight; ``vehicle`` overrides the one that the log names. Raise CliError (usage)."""
    if flight.damaged and not len(flight.position.time_s):
        raise CliError(f"{run.log}: the log is damaged before its first position; it cannot be drawn", USAGE)
    name = vehicle or _vehicle_name(flight, run)
    _check_vehicle(name, flight, run, given=vehicle is not None)
    time_s, position = flight.position
    if not len(time_s) or not len(flight.attitude.time_s):
        raise CliError(f"{run.log}: the log has no positions and attitudes; name the log of a flight", USAGE)
    euler = _latest(flight.attitude, time_s)
    good = np.isfinite(position).all(axis=1) & np.isfinite(euler).all(axis=1)
    good &= np.concatenate(([True], np.diff(np.maximum.accumulate(time_s)) > 0.0))
    if not good.any():
        raise CliError(f"{run.log}: the log has no positions and attitudes; name the log of a flight", USAGE)
    plan = run.summary.get("plan")
    numbers, places = _waypoints(flight, plan)
    title = [
        name if vehicle is None else Path(name).stem,
        *([Path(plan).name] if isinstance(plan, str) else []),
    ]
    return Poses(
        time_s[good],
        position[good],
        quaternions_from_euler(euler[good]),
        _latest(flight.rotor_speed, time_s)[good],
        _targets(flight, time_s)[good],
        places,
        name,
        " · ".join(Path(part).stem if part.endswith(".toml") else part for part in title),
        numbers,
    )


def _latest(series: Series, time_s: FloatArray) -> FloatArray:
    """Values of a series at given times, each the newest one then; NaN where the series has none."""
    if not len(series.time_s):
        return np.full((len(time_s), series.values.shape[1]), np.nan)
    index = np.searchsorted(series.time_s, time_s, side="right") - 1
    return series.values[np.maximum(index, 0)]


def _targets(flight: Flight, time_s: FloatArray) -> FloatArray:
    """Setpoints at given times; none on the ground, where they sink into it and mean nothing."""
    targets = _latest(flight.position_setpoint, time_s)
    if flight.statuses:
        targets[~flight.flying(time_s)] = np.nan
    return targets


def _vehicle_name(flight: Flight, run: Run) -> str:
    """Return the name or file of the vehicle that flew."""
    said = run.summary.get("vehicle") or flight.info.get("vehicle")
    if not isinstance(said, str) or not said:
        raise CliError(f"{run.log} does not say which vehicle flew: give --vehicle", USAGE)
    return said


def _check_vehicle(name: str, flight: Flight, run: Run, given: bool) -> None:
    try:
        rotors = len(load_vehicle(name).rotors)
    except ConfigError as error:
        if given:
            raise
        raise CliError(f"{error}: it flew in {run.log}; name its file with --vehicle", USAGE) from error
    flown = flight.rotor_speed.values.shape[1]
    if flown and rotors != flown:
        raise CliError(f"{name} has {rotors} rotors, the vehicle of {run.log} {flown}: see --vehicle", USAGE)


def _waypoints(flight: Flight, plan: object) -> tuple[FloatArray, FloatArray]:
    """Return the items of the flown plan that have a place: their numbers (m,) and their places NED [m] (m, 3)."""
    try:
        items = load_plan(plan).items if isinstance(plan, str) else ()
    except (ConfigError, OSError):  # the plan's file is gone
        items = ()
    found = [
        (seq, *place)
        for seq, item in enumerate(items)
        if item.command in NAV_COMMANDS
        and (place := item_ned_m(item, flight)) is not None
        and np.isfinite(place).all()
    ]
    table = np.array(found).reshape(-1, 4)
    return table[:, 0], table[:, 1:]
