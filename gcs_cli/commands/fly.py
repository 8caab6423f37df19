"""``gcs fly``: simulator, flight stack and ground station in one command, from plan to report."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gcs_cli.errors import USAGE, CliError
from gcs_cli.settings import JsonOption, settings_of

if TYPE_CHECKING:
    from rich.console import Console


def fly(
    context: typer.Context,
    plan: Annotated[Path, typer.Argument(help="A .plan or .waypoints file.", show_default=False)],
    controller: Annotated[str, typer.Option(help="pid, backstepping, or the name of one of yours.")] = "pid",
    gains: Annotated[
        str, typer.Option(help="tuned, paper, paper_rate_fed, backstepping_poles, or a TOML file.")
    ] = "tuned",
    plant: Annotated[str, typer.Option(help="rigid, multibody or paper.")] = "rigid",
    speed: Annotated[str, typer.Option(metavar="max|N", help="N times real time.")] = "max",
    inner_hz: Annotated[float, typer.Option(help="Rate of the inner loop.")] = 500.0,
    outer_hz: Annotated[
        float | None,
        typer.Option(help="Rate of the outer loop; divides the inner one.  [default: about 100]"),
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the gusts.")] = 1,
    wind: Annotated[str | None, typer.Option(metavar="N,E[,D]", help="Steady wind, m/s.")] = None,
    gust: Annotated[float | None, typer.Option(help="Standard deviation of the gusts, m/s.")] = None,
    torque_gust: Annotated[
        float | None, typer.Option(help="Standard deviation of a gusty torque about roll and pitch, N m.")
    ] = None,
    battery_start: Annotated[
        float | None, typer.Option(metavar="PERCENT", help="Charge at the start.  [default: 100]")
    ] = None,
    battery_capacity: Annotated[
        float | None, typer.Option(metavar="MAH", help="Capacity.  [default: the vehicle's]")
    ] = None,
    battery_drain: Annotated[
        float | None, typer.Option(metavar="FACTOR", help="Let the charge fall so many times as fast.")
    ] = None,
    fault: Annotated[
        list[str] | None,
        typer.Option(metavar="SPEC", help="As of sim-bridge, for example rotor:2:off@12.5; may be repeated."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Directory of the results.  [default: runs/<stamp>-<plan>]"),
    ] = None,
    vehicle: Annotated[str, typer.Option(help="paper_quad, x_quad, or a TOML file.")] = "paper_quad",
    instance: Annotated[int, typer.Option(help="Shifts all ports, to fly beside another one.")] = 0,
    ideal_rotors: Annotated[
        bool, typer.Option("--ideal-rotors", help="Rotors without limits, lag and spin-up torque.")
    ] = False,
    params: Annotated[Path | None, typer.Option(help="Parameter file to fly with.  [default: none]")] = None,
    loops: Annotated[
        str,
        typer.Option(
            metavar="LOOPS", help="python, c, or those of a target: host, emulated, serial:DEVICE[:BAUD]."
        ),
    ] = "python",
    open_report: Annotated[bool, typer.Option("--open", help="Open the report afterwards.")] = False,
    as_json: JsonOption = False,
    timeout: Annotated[float | None, typer.Option(help="Wait for the vehicle, s.  [default: 180]")] = None,
    limit: Annotated[
        float | None,
        typer.Option(
            help="Longest flight, s of simulated time.  [default: 60 s more than three times the plan's]"
        ),
    ] = None,
) -> None:
    """Fly a mission in simulation and write log, summary and report."""
    from gcs_cli.fly_display import FlyConsole, make_display  # noqa: PLC0415
    from gcs_cli.fly_options import FlyOptions, checked_plan  # noqa: PLC0415
    from gcs_cli.fly_run import fly as fly_plan  # noqa: PLC0415
    from gcs_cli.fly_run import write_results  # noqa: PLC0415
    from gcs_cli.run_directory import REPORT_NAME  # noqa: PLC0415

    settings = settings_of(context).merged(None, timeout)
    if settings.connect is not None:
        raise CliError("fly starts a vehicle of its own: leave --connect out, or see --instance", USAGE)
    options = FlyOptions(
        plan, controller, gains, plant, speed, inner_hz, outer_hz, seed, wind, gust, torque_gust, vehicle,
        instance, ideal_rotors, 180.0 if settings.timeout_s is None else settings.timeout_s, limit,
        battery_start, battery_capacity, battery_drain, tuple(fault or ()), params, loops,
    )  # fmt: skip
    items = checked_plan(options)
    console = FlyConsole(stderr=as_json, highlight=False)
    display = make_display(console)
    try:
        flown = fly_plan(options, items, out, display)
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
    rows = summary["waypoints"]
    misses = [row["miss_distance_m"] for row in rows if row["reached"] and row["miss_distance_m"] is not None]
    reached = f"{sum(row['reached'] for row in rows)} of {len(rows)} items reached"
    if misses:
        reached += f", largest miss {max(misses):.3f} m"
    files = " ".join(sorted(path.name for path in folder.iterdir() if path.suffix != ".log"))
    lines = (
        ("outcome", str(summary["outcome"])),
        ("time", _time(summary)),
        ("mission", reached),
        ("tracking", _tracking(summary)),
        ("overruns", _shown(summary["overruns"])),
        ("files", f"{folder}/  {files}"),
    )
    for name, value in lines:
        console.print(f"[bright_black]{name:<9}[/]", end="")
        console.print(value, markup=False, soft_wrap=True)


def _time(summary: dict[str, Any]) -> str:
    words = f"{_shown(summary['sim_time_s'], '.1f')} s simulated"
    if summary["wall_time_s"] is None:
        return words
    words += f" in {summary['wall_time_s']:.2f} s"
    factor = summary["real_time_factor"]
    return words if factor is None else f"{words}, {factor:.3g} times real time"


def _tracking(summary: dict[str, Any]) -> str:
    rms, largest = summary["rms_tracking_error_m"], summary["max_tracking_error_m"]
    return f"rms error {_shown(rms, '.3f')} m, largest {_shown(largest, '.3f')} m"


def _shown(value: float | None, spec: str = "") -> str:
    return "—" if value is None else format(value, spec)
