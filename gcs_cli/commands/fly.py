"""``gcs fly``: simulator, flight stack and ground station in one command, from plan to report."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gcs_cli.errors import USAGE, CliError
from gcs_cli.fly.fly_flags import FlyOptions, flies
from gcs_cli.settings import FlownInstanceOption, JsonOption, OverwriteOption, settings_of

if TYPE_CHECKING:
    from rich.console import Console


@flies()
def fly(
    context: typer.Context,
    options: FlyOptions,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Directory of the results.  [default: runs/<stamp>-<plan>]"),
    ] = None,
    overwrite: OverwriteOption = False,
    instance: FlownInstanceOption = None,
    open_report: Annotated[bool, typer.Option("--open", help="Open the report afterwards.")] = False,
    as_json: JsonOption = False,
    timeout: Annotated[float | None, typer.Option(help="Wait for the vehicle, s.  [default: 180]")] = None,
) -> None:
    """Fly a mission in simulation and write log, summary and report."""
    from gcs_cli.fly.fly_display import FlyConsole, make_display  # noqa: PLC0415
    from gcs_cli.fly.fly_options import checked_plan  # noqa: PLC0415
    from gcs_cli.fly.fly_run import fly as fly_plan  # noqa: PLC0415
    from gcs_cli.fly.fly_run import write_results  # noqa: PLC0415
    from gcs_cli.report.run_directory import REPORT_NAME  # noqa: PLC0415

    settings = settings_of(context).merged(None, timeout, instance)
    if settings.connect is not None:
        raise CliError("fly starts a vehicle of its own: leave --connect out, or see --instance", USAGE)
    timeout_s = FlyOptions.timeout_s if settings.timeout_s is None else settings.timeout_s
    options = replace(options, instance=settings.instance or 0, timeout_s=timeout_s)
    items = checked_plan(options)
    console = FlyConsole(stderr=as_json, highlight=False)
    display = make_display(console)
    try:
        flown = fly_plan(options, items, out, display, overwrite)
    finally:
        display.close()
    summary, outcome = write_results(options, items, flown)
    if as_json:
        print(json.dumps({**summary, "directory": str(flown.folder)}), flush=True)
    else:
        print_summary(console, summary, flown.folder)
    report = flown.folder / REPORT_NAME
    if open_report and report.exists():
        _open(report)
    if not outcome.completed:
        raise CliError(f"{outcome.reason} (see {flown.folder})", outcome.exit_code)


def _open(report: Path) -> None:
    import webbrowser  # noqa: PLC0415

    webbrowser.open(report.resolve().as_uri())


def print_summary(console: Console, summary: dict[str, Any], folder: Path) -> None:
    """Print the figures of a flight on a few lines."""
    from gcs_cli.report.conditions import conditions  # noqa: PLC0415

    files = " ".join(sorted(path.name for path in folder.iterdir() if path.suffix != ".log"))
    lines = (
        ("outcome", f"{summary['outcome']}: {summary['outcome_text']}"),
        ("flown in", ", ".join(conditions(summary))),
        ("time", _time(summary)),
        ("mission", _mission(summary)),
        ("tracking", _tracking(summary)),
        ("effort", _effort(summary)),
        ("files", f"{folder}/  {files}"),
    )
    for name, value in lines:
        console.print(f"[bright_black]{name:<9}[/]", end="")
        console.print(value, markup=False, soft_wrap=True)


def _mission(summary: dict[str, Any]) -> str:
    from gcs_cli.report.summary import max_overshoot_m  # noqa: PLC0415

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


def _effort(summary: dict[str, Any]) -> str:
    torque = summary["rms_torque_n_m"]
    about = "—" if torque is None else " ".join(f"{value:.4f}" for value in torque)
    rate = _shown(summary["rms_rotor_command_rate_rad_s2"], ".0f")
    return f"rms torque {about} N m, rms change of rotor commands {rate} rad/s²"


def _shown(value: float | None, spec: str = "") -> str:
    return "—" if value is None else format(value, spec)
