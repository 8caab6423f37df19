"""Flights side by side: conditions and figures as a table, and a page with their charts overlaid."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from flightstack.core.errors import ConfigError
from flightstack.plan import Plan, load_plan
from gcs_cli.charts.pages import UNKNOWN, render_page, shown
from gcs_cli.errors import USAGE, CliError
from gcs_cli.report.analysis import read_flight
from gcs_cli.report.compare_charts import overlaid_figures
from gcs_cli.report.flight_data import Flight
from gcs_cli.report.poses import Run
from gcs_cli.report.summary import RunInfo, max_overshoot_m, summarise
from gcs_cli.run_directory import LOG_NAME, SUMMARY_NAME

TEMPLATES = Path(__file__).parent / "templates"
Summary = Mapping[str, Any]
_LARGEST_PERCENT = 1000.0
"""Larger changes are shown as factors."""
_FILES = ("plan", "params")
_ALWAYS = ("plan", "vehicle", "controller", "gains", "seed")


class ComparedRun(NamedTuple):
    """A flight with the name that it has beside others."""

    name: str
    log: Path
    flight: Flight
    plan: Plan
    summary: Summary


class Row(NamedTuple):
    """One condition or figure of all runs, in their order."""

    key: str
    title: str
    values: list[Any]
    texts: list[str]
    changes: list[str]
    """Of each run, relative to the first one; empty where it has no meaning."""
    differs: bool


class _Figure(NamedTuple):
    key: str
    title: str
    spec: str
    unit: str
    value: Callable[[Summary], Any] | None = None
    """None: what the summary has under ``key``."""

    def of(self, summary: Summary) -> Any:
        return summary.get(self.key) if self.value is None else self.value(summary)


_CONDITIONS = (
    ("plan", "plan"),
    ("vehicle", "vehicle"),
    ("controller", "controller"),
    ("gains", "gains"),
    ("plant", "plant"),
    ("loops", "loops"),
    ("state", "state"),
    ("inner_hz", "inner loop [Hz]"),
    ("outer_hz", "outer loop [Hz]"),
    ("seed", "seed"),
    ("wind_m_s", "wind N, E, D [m/s]"),
    ("gust_m_s", "gusts [m/s]"),
    ("drag_n_s_m", "drag [N s/m]"),
    ("torque_gust_n_m", "gusty torque [N m]"),
    ("force_n", "force N, E, D [N]"),
    ("torque_n_m", "torque x, y, z [N m]"),
    ("slope_deg", "slope of the ground [°]"),
    ("boat_m_s", "velocity of the ground N, E [m/s]"),
    ("battery_start_percent", "battery at the start [%]"),
    ("battery_capacity_mah", "battery capacity [mAh]"),
    ("battery_drain", "battery drain, times"),
    ("faults", "faults"),
    ("ideal_rotors", "rotors without lag and limits"),
    ("params", "parameter file"),
    ("param", "parameters"),
)


def _reached(summary: Summary) -> str | None:
    rows = summary.get("waypoints")
    return f"{sum(bool(row['reached']) for row in rows)} of {len(rows)}" if rows else None


def _miss_m(summary: Summary) -> float | None:
    rows = summary.get("waypoints") or ()
    return max(
        (row["miss_distance_m"] for row in rows if row.get("miss_distance_m") is not None), default=None
    )


def _overshoot_m(summary: Summary) -> float | None:
    return max_overshoot_m(summary) if summary.get("waypoints") else None


def _torque(axis: int) -> Callable[[Summary], float | None]:
    return lambda summary: (summary.get("rms_torque_n_m") or (None,) * 3)[axis]


_FIGURES = (
    _Figure("outcome", "outcome", "", ""),
    _Figure("items_reached", "items reached", "", "", _reached),
    _Figure("flight_time_s", "time in flight", ".2f", "s"),
    _Figure("sim_time_s", "simulated time", ".2f", "s"),
    _Figure("rms_tracking_error_m", "tracking error, rms", ".4f", "m"),
    _Figure("max_tracking_error_m", "tracking error, largest", ".4f", "m"),
    _Figure("max_overshoot_m", "overshoot, largest", ".3f", "m", _overshoot_m),
    _Figure("max_miss_distance_m", "miss distance, largest", ".3f", "m", _miss_m),
    _Figure("rms_attitude_error_deg", "attitude error, rms", ".3f", "°"),
    _Figure("max_attitude_error_deg", "attitude error, largest", ".2f", "°"),
    _Figure("rms_torque_x_n_m", "torque about x, rms", ".4f", "N m", _torque(0)),
    _Figure("rms_torque_y_n_m", "torque about y, rms", ".4f", "N m", _torque(1)),
    _Figure("rms_torque_z_n_m", "torque about z, rms", ".4f", "N m", _torque(2)),
    _Figure("rms_rotor_command_rate_rad_s2", "rotor commands, rms", ".0f", "rad/s²"),
    _Figure("overruns", "overruns", "", ""),
)


def read_runs(found: Sequence[Run]) -> list[ComparedRun]:
    """Read runs; raise CliError (usage) or ConfigError."""
    runs = []
    for name, run in zip(_names([run.log for run in found]), found, strict=True):
        flight = read_flight(run.log)
        plan = _plan(run.summary)
        summary = run.summary or {
            **summarise(flight, Plan(()), RunInfo(outcome="", plan="")), "outcome": None, "plan": None,
        }  # fmt: skip
        _check_summary(summary, run.log)
        runs.append(ComparedRun(name, run.log, flight, plan, summary))
    return runs


def _check_summary(summary: Summary, log: Path) -> None:
    """Raise CliError (usage) if a figure of a summary has another type than ``summarise`` gives it."""
    for figure in _FIGURES:
        try:
            shown(figure.of(summary), figure.spec)
        except (KeyError, TypeError, ValueError, AttributeError, IndexError):
            path = log.with_name(SUMMARY_NAME)
            raise CliError(f"{path} is damaged: its figure {figure.key} cannot be read", USAGE) from None


def _names(logs: Sequence[Path]) -> list[str]:
    """Return short names: of the directory or the log; with a number where two are the same."""
    names = [log.resolve().parent.name if log.name == LOG_NAME else log.stem for log in logs]
    short = [name.encode("utf-8", "replace").decode() for name in names]  # a file's name may be any bytes
    return [
        name if short.count(name) == 1 else f"{name} ({short[: index + 1].count(name)})"
        for index, name in enumerate(short)
    ]


def _plan(summary: Summary) -> Plan:
    path = summary.get("plan")
    try:
        return load_plan(path) if isinstance(path, str) else Plan(())
    except (ConfigError, OSError):  # the plan's file is gone
        return Plan(())


def condition_rows(summaries: Sequence[Summary]) -> list[Row]:
    """Return the conditions of the runs; those that no run has are left out."""
    rows = []
    for key, title in _CONDITIONS:
        values = [summary.get(key) for summary in summaries]
        if key in _ALWAYS or any(value not in (None, [], False) for value in values):
            texts = _file_names(values) if key in _FILES else [_condition_text(value) for value in values]
            rows.append(Row(key, title, values, texts, [""] * len(values), len(set(texts)) > 1))
    return rows


def _file_names(paths: Sequence[Any]) -> list[str]:
    """Return the names of files; with their paths where different files have the same name."""
    names = [Path(path).name if isinstance(path, str) else UNKNOWN for path in paths]
    return names if len(set(names)) == len(set(paths)) else [_condition_text(path) for path in paths]


def _condition_text(value: Any) -> str:
    if value is None or value == []:
        return UNKNOWN
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:g}"
    return ", ".join(map(_condition_text, value)) if isinstance(value, list) else str(value)


def figure_rows(summaries: Sequence[Summary]) -> list[Row]:
    """Return the figures of the runs, each with its change relative to the first run."""
    rows = []
    for figure in _FIGURES:
        values = [figure.of(summary) for summary in summaries]
        if figure.key == "overruns" and values.count(None) == len(values):  # in lockstep
            continue
        texts = [shown(value, figure.spec) for value in values]
        changes = [_change(values[0], value) for value in values]
        title = f"{figure.title} [{figure.unit}]" if figure.unit else figure.title
        rows.append(Row(figure.key, title, values, texts, ["", *changes[1:]], len(set(texts)) > 1))
    return rows


def _change(first: Any, value: Any) -> str:
    numbers = [number for number in (first, value) if isinstance(number, float) and math.isfinite(number)]
    if len(numbers) < 2 or first in (0.0, value):
        return ""
    percent = 100.0 * (value / first - 1.0)
    return f"{percent:+.1f}%".replace("-", "−") if percent < _LARGEST_PERCENT else f"×{value / first:.3g}"


def comparison(runs: Sequence[ComparedRun], page: Path | None) -> dict[str, Any]:
    """Return what ``gcs compare --json`` prints; ``page`` is None if it is not written."""
    summaries = [run.summary for run in runs]
    return {
        "runs": [{"name": run.name, "log": str(run.log), "damaged": run.flight.damaged} for run in runs],
        "conditions": {
            row.key: {"values": row.values, "differs": row.differs} for row in condition_rows(summaries)
        },
        "figures": {row.key: row.values for row in figure_rows(summaries)},
        "page": None if page is None else str(page),
    }


def render_comparison(runs: Sequence[ComparedRun]) -> str:
    """Return the page."""
    summaries = [run.summary for run in runs]
    damaged = [run.name for run in runs if run.flight.damaged]
    return render_page(
        TEMPLATES,
        "compare.html",
        title=" – ".join(run.name for run in runs),
        lines=[
            f"{len(runs)} flights side by side; differing conditions are marked, and changes are relative to the first",
            f"damaged logs, read as far as possible: {', '.join(damaged)}" if damaged else "",
        ],
        names=[run.name for run in runs],
        conditions=condition_rows(summaries),
        rows=figure_rows(summaries),
        figures=list(overlaid_figures([(run.name, run.flight, run.plan) for run in runs])),
    )
