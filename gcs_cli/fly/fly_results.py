"""The results of a flight: summary, report, and the figures that are printed. Needed after the flight only."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

from rich.console import Console

from flightstack.core.errors import ConfigError
from flightstack.params.vehicle import NO_DRAG_PLANT
from flightstack.plan import Plan
from gcs_cli.charts.pages import load_templates
from gcs_cli.errors import CliError
from gcs_cli.fly.flight import Flown
from gcs_cli.fly.fly_flags import FlyOptions
from gcs_cli.fly.fly_options import flown_vehicle, outer_rate_hz
from gcs_cli.report.analysis import read_flight
from gcs_cli.report.conditions import conditions
from gcs_cli.report.flight_data import Flight as FlightData
from gcs_cli.report.flight_outcome import Code, Outcome, with_log
from gcs_cli.report.page import TEMPLATES, write_report
from gcs_cli.report.summary import RunInfo, max_overshoot_m, summarise, write_summary
from gcs_cli.run_directory import LOG_NAME, REPORT_NAME, RESULTS, SUMMARY_NAME, TLOG_NAME


def prepare() -> None:
    """Load what the report needs besides the modules."""
    load_templates(TEMPLATES)


def _drag_of(options: FlyOptions) -> tuple[float, float, float]:
    return (0.0, 0.0, 0.0) if options.plant == NO_DRAG_PLANT else flown_vehicle(options).linear_drag_n_s_m


class Results(NamedTuple):
    """Results of a flight."""

    summary: dict[str, Any]
    outcome: Outcome
    """Outcome after reading the log."""
    failure: CliError | None
    """The error of results that could not be written."""


def write_results(options: FlyOptions, plan: Plan, flown: Flown) -> Results:
    """Write summary and report; return them even if they cannot be written."""
    log, outcome = flown.folder / LOG_NAME, flown.outcome
    try:
        data = read_flight(log)
    except (ConfigError, OSError) as error:
        data = FlightData()
        if outcome.completed:
            outcome = Outcome(Code.NO_LOG, f"the mission was flown, but its log cannot be read: {error}")
    else:
        outcome = with_log(outcome, data, plan.items)
    summary, failure = summarise(data, plan, _run_info(options, flown, outcome)), None
    try:
        write_summary(flown.folder / SUMMARY_NAME, summary)
        write_report(flown.folder / REPORT_NAME, data, plan, summary, flown.folder / TLOG_NAME)
    except OSError as error:
        failure = CliError(f"{flown.folder}: the results cannot be written: {error.strerror}")
    return Results(summary, outcome, failure)


def _run_info(options: FlyOptions, flown: Flown, outcome: Outcome) -> RunInfo:
    return RunInfo(
        outcome=outcome.code.value,
        outcome_text=outcome.reason,
        plan=str(options.plan_path),
        wall_time_s=flown.wall_time_s,
        vehicle=options.vehicle,
        controller=options.controller,
        gains=options.gains,
        plant=options.plant,
        loops=options.loops,
        state=options.state,
        seed=options.seed,
        wind=options.wind,
        gust=options.gust,
        drag_n_s_m=_drag_of(options),
        torque_gust=options.torque_gust,
        force=options.force,
        torque=options.torque,
        slope=options.slope,
        boat=options.boat,
        battery_start=options.battery_start,
        battery_capacity=options.battery_capacity,
        battery_drain=options.battery_drain,
        faults=tuple(options.faults or ()),
        ideal_rotors=options.ideal_rotors,
        params=None if options.params is None else str(options.params),
        param=tuple(options.param or ()),
        inner_hz=options.inner_hz,
        outer_hz=outer_rate_hz(options),
        overruns=flown.overruns,
        log_path=flown.folder / LOG_NAME,
    )


def print_summary(console: Console, summary: dict[str, Any], folder: Path) -> None:
    """Print the main figures of a flight; the reason of a failure is left to the error of the command."""
    outcome = summary["outcome"]
    errors = summary["estimate_error"]
    lines = (
        ("outcome", f"{outcome}: {summary['outcome_text']}" if outcome == Code.COMPLETED else outcome),
        ("flown in", ", ".join(conditions(summary))),
        ("time", _time(summary)),
        ("mission", _mission(summary)),
        *(() if summary["rms_tracking_error_m"] is None else (("tracking", _tracking(summary)),)),
        *(() if summary["rms_torque_n_m"] is None else (("effort", _effort(summary)),)),
        *(() if errors is None else (("estimate", _estimate(errors)),)),
        ("files", f"{folder}/  {flight_files(folder)}"),
    )
    for name, value in lines:
        console.print(f"[bright_black]{name:<9}[/]", end="")
        console.print(value, markup=False, soft_wrap=True)


def flight_files(folder: Path) -> str:
    """Return the names of a flight's files in a directory that may hold others."""
    return " ".join(
        sorted(name for name in RESULTS if not name.endswith(".log") and (folder / name).exists())
    )


def _mission(summary: dict[str, Any]) -> str:
    rows = summary["waypoints"]
    misses = [row["miss_distance_m"] for row in rows if row["reached"] and row["miss_distance_m"] is not None]
    words = f"{sum(row['reached'] for row in rows)} of {len(rows)} items reached"
    if misses:
        words += f", largest miss {max(misses):.3f} m"
    overshoot_m = max_overshoot_m(summary)
    return words if overshoot_m is None else f"{words}, largest overshoot {overshoot_m:.3f} m"


def _time(summary: dict[str, Any]) -> str:
    words = f"{_shown(summary['sim_time_s'], '.1f')} s simulated"
    if summary["wall_time_s"] is None:
        return words
    words += f" in {summary['wall_time_s']:.2f} s"
    factor = summary["real_time_factor"]
    return words if factor is None else f"{words}, {factor:.3g} times real time"


def _tracking(summary: dict[str, Any]) -> str:
    rms, largest = summary["rms_tracking_error_m"], summary["max_tracking_error_m"]
    words = f"rms error {_shown(rms, '.3f')} m, largest {_shown(largest, '.3f')} m"
    rms, largest = summary["rms_attitude_error_deg"], summary["max_attitude_error_deg"]
    return f"{words}; attitude rms {_shown(rms, '.2f')}°, largest {_shown(largest, '.1f')}°"


def _estimate(errors: dict[str, float]) -> str:
    return (
        f"rms error of tilt {errors['rms_tilt_deg']:.2f}°, yaw {errors['rms_yaw_deg']:.2f}°, "
        f"velocity {errors['rms_velocity_m_s']:.2f} m/s, position {errors['rms_horizontal_m']:.2f} m, "
        f"height {errors['rms_height_m']:.2f} m"
    )


def _effort(summary: dict[str, Any]) -> str:
    torque = summary["rms_torque_n_m"]
    about = "—" if torque is None else " ".join(f"{value:.4f}" for value in torque)
    rate = _shown(summary["rms_rotor_command_rate_rad_s2"], ".0f")
    return f"rms torque {about} N m, rms change of rotor commands {rate} rad/s²"


def _shown(value: float | None, spec: str = "") -> str:
    return "—" if value is None else format(value, spec)
