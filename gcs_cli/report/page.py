"""The flight report: one HTML file that needs nothing else."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from flightstack.core.atomic_file import write_text_atomically
from flightstack.core.enums import Severity
from flightstack.plan import Plan, command_name
from gcs_cli.charts.figure import AnyFigure
from gcs_cli.charts.pages import render_page, shown
from gcs_cli.report.conditions import conditions, flown
from gcs_cli.report.estimate_error import estimate_error_figures
from gcs_cli.report.flight_charts import in_modes, shown_span, time_figures, timing_figures
from gcs_cli.report.flight_data import Flight, LoopTiming
from gcs_cli.report.path_charts import map_figure, space_figure
from gcs_cli.report.summary import max_overshoot_m
from gcs_cli.report.telemetry import read_loop_timing

TEMPLATES = Path(__file__).parent / "templates"
_COMPLETED = "completed"
_LEVELS = [severity.name.lower() for severity in Severity]


def write_report(path: Path, flight: Flight, plan: Plan, summary: dict[str, Any], tlog: Path) -> None:
    """Write ``report.html``, whole or not at all; raise OSError when that fails.

    ``summary`` is what ``summarise`` returns. Loop timing comes from the file ``tlog``, else from the log.
    """
    write_text_atomically(path, render_report(flight, plan, summary, read_loop_timing(tlog, flight.start_s)))


def render_report(
    flight: Flight, plan: Plan, summary: dict[str, Any], timing: Sequence[LoopTiming], name: str = ""
) -> str:
    """Return the report as HTML; ``timing`` is that of the telemetry, ``name`` the title of a flight without plan."""
    return render_page(
        TEMPLATES,
        "report.html",
        title=Path(summary["plan"]).stem if summary["plan"] else name,
        outcome=(summary["outcome"] or "").replace("_", " "),
        is_good=summary["outcome"] == _COMPLETED,
        lines=[" · ".join(line) for line in ([summary["outcome_text"]], flown(summary), conditions(summary))],
        tiles=tiles(summary),
        figures=list(_figures(flight, plan, timing)),
        waypoints=[{**row, "command": _command(plan, row["seq"])} for row in summary["waypoints"]],
        texts=[
            (
                text,
                _LEVELS[text.level] if 0 <= text.level < len(_LEVELS) else text.level,
                text.level <= Severity.WARNING,
            )
            for text in flight.texts
        ],
        facts=_facts(flight, summary),
        log_sha256=summary["log_sha256"],
    )


def _figures(flight: Flight, plan: Plan, timing: Sequence[LoopTiming]) -> Iterator[AnyFigure]:
    span = shown_span(flight)
    yield space_figure(flight, plan, span)
    yield map_figure(flight, plan, span)
    for figure in time_figures(flight):
        yield in_modes(figure, flight)
    for figure in estimate_error_figures(flight):
        yield in_modes(figure, flight)
    yield from timing_figures(timing or flight.loop_timing)


def tiles(summary: dict[str, Any]) -> list[tuple[str, str]]:
    """Return names and values of the figures that matter most."""
    rows = summary["waypoints"]
    return [
        ("items reached", f"{sum(row['reached'] for row in rows)} of {len(rows)}"),
        ("time in flight", shown(summary["flight_time_s"], ".1f", " s")),
        ("tracking error, rms", shown(summary["rms_tracking_error_m"], ".3f", " m")),
        ("tracking error, largest", shown(summary["max_tracking_error_m"], ".3f", " m")),
        ("overshoot, largest", shown(max_overshoot_m(summary), ".3f", " m")),
        ("attitude error, rms", shown(summary["rms_attitude_error_deg"], ".2f", "°")),
        ("attitude error, largest", shown(summary["max_attitude_error_deg"], ".1f", "°")),
        ("times real time", shown(summary["real_time_factor"], ".3g", "×")),
        *_estimate_tiles(summary["estimate_error"]),
    ]


def _estimate_tiles(errors: dict[str, float] | None) -> list[tuple[str, str]]:
    if errors is None:
        return []
    return [
        ("estimate, tilt error, rms", shown(errors["rms_tilt_deg"], ".2f", "°")),
        ("estimate, yaw error, rms", shown(errors["rms_yaw_deg"], ".2f", "°")),
        ("estimate, velocity error, rms", shown(errors["rms_velocity_m_s"], ".2f", " m/s")),
        ("estimate, position error, rms", shown(errors["rms_horizontal_m"], ".2f", " m")),
        ("estimate, height error, rms", shown(errors["rms_height_m"], ".2f", " m")),
    ]


def _command(plan: Plan, seq: int) -> str:
    return command_name(plan.items[seq].command).removeprefix("NAV_").replace("_", " ").lower()


def _facts(flight: Flight, summary: dict[str, Any]) -> list[tuple[str, str]]:
    return [
        *(
            (name, shown(summary[name]))
            for name in ("plan", "vehicle", "controller", "gains", "plant", "loops", "state", "seed")
        ),
        ("inner loop", shown(summary["inner_hz"], "g", " Hz")),
        ("outer loop", shown(summary["outer_hz"], "g", " Hz")),
        ("rms torque asked for, x, y, z", _effort(summary)),
        ("rms change of rotor commands", shown(summary["rms_rotor_command_rate_rad_s2"], ".0f", " rad/s²")),
        ("simulated time", shown(summary["sim_time_s"], ".2f", " s")),
        ("wall time", shown(summary["wall_time_s"], ".2f", " s")),
        ("flight stack", shown(flight.info.get("ver_sw"))),
        ("home", _home(flight)),
    ]


def _effort(summary: dict[str, Any]) -> str:
    torque = summary["rms_torque_n_m"]
    return shown(None if torque is None else ", ".join(f"{value:.4f}" for value in torque), "", " N m")


def _home(flight: Flight) -> str:
    if flight.home is None:
        return shown(None)
    home = flight.home
    return f"{home.latitude_deg:.5f}°, {home.longitude_deg:.5f}°, {home.altitude_m:.0f} m"
