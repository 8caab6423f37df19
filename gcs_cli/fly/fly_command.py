"""``gcs fly``: fly, write the results and print a summary."""

from __future__ import annotations

import json
import webbrowser
from pathlib import Path
from typing import Any

from rich.console import Console

from gcs_cli.errors import CliError
from gcs_cli.fly.fly_display import FlyConsole, make_display
from gcs_cli.fly.fly_flags import FlyOptions, RunOptions
from gcs_cli.fly.fly_options import checked_plan
from gcs_cli.fly.fly_run import fly, write_results
from gcs_cli.report.conditions import conditions
from gcs_cli.report.flight_outcome import Code
from gcs_cli.report.summary import max_overshoot_m
from gcs_cli.run_directory import REPORT_NAME


def run_fly(options: FlyOptions, run: RunOptions, out: Path | None) -> None:
    """Fly the mission, write the results to ``out`` and print a summary; raise CliError, ConfigError."""
    items = checked_plan(options)
    console = FlyConsole(stderr=run.as_json, highlight=False)
    display = make_display(console)
    try:
        flown = fly(options, items, out, display, run.overwrite)
    finally:
        display.close()
    summary, outcome = write_results(options, items, flown)
    if run.as_json:
        print(json.dumps({**summary, "directory": str(flown.folder)}), flush=True)
    else:
        print_summary(console, summary, flown.folder)
    report = flown.folder / REPORT_NAME
    if run.open_report and report.exists():
        webbrowser.open(report.resolve().as_uri())
    if not outcome.completed:
        raise CliError(f"{outcome.reason} (see {flown.folder})", outcome.exit_code)


def print_summary(console: Console, summary: dict[str, Any], folder: Path) -> None:
    """Print the main figures of a flight; the reason of a failure is left to the error of the command."""
    outcome = summary["outcome"]
    files = " ".join(sorted(path.name for path in folder.iterdir() if path.suffix != ".log"))
    errors = summary["estimate_error"]
    lines = (
        ("outcome", f"{outcome}: {summary['outcome_text']}" if outcome == Code.COMPLETED else outcome),
        ("flown in", ", ".join(conditions(summary))),
        ("time", _time(summary)),
        ("mission", _mission(summary)),
        ("tracking", _tracking(summary)),
        ("effort", _effort(summary)),
        *(() if errors is None else (("estimate", _estimate(errors)),)),
        ("files", f"{folder}/  {files}"),
    )
    for name, value in lines:
        console.print(f"[bright_black]{name:<9}[/]", end="")
        console.print(value, markup=False, soft_wrap=True)


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
