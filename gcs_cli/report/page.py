"""The flight report: one HTML file that needs nothing else."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape
from pathlib import Path
from typing import Any

from flightstack.core.atomic_file import write_text_atomically
from flightstack.plan import Plan, command_name
from gcs_cli.report.conditions import conditions, flown
from gcs_cli.report.flight_data import Flight, LoopTiming
from gcs_cli.report.plots import plots, section
from gcs_cli.report.summary import max_overshoot_m
from gcs_cli.report.timing import read_loop_timing

_STYLE_SHEET = Path(__file__).with_name("report.css")
_COMPLETED = "completed"
_UNKNOWN = "–"
_LEVELS = ("emergency", "alert", "critical", "error", "warning", "notice", "info", "debug")
_WARNING = 4


def write_report(path: Path, flight: Flight, plan: Plan, summary: dict[str, Any], tlog: Path) -> None:
    """Write ``report.html``, whole or not at all; raise OSError when that fails.

    ``summary`` is what ``summarise`` returns. Loop timing comes from the file ``tlog``, or else from the log.
    """
    timings = read_loop_timing(tlog) or flight.loop_timing
    write_text_atomically(path, render_report(flight, plan, summary, timings))


def render_report(flight: Flight, plan: Plan, summary: dict[str, Any], timings: Sequence[LoopTiming]) -> str:
    """Return the report as HTML."""
    title = Path(summary["plan"]).stem
    style = _STYLE_SHEET.read_text(encoding="utf-8")
    body = "".join(
        (
            _header(title, summary),
            _tiles(summary),
            *plots(flight, plan, timings, summary["rms_tracking_error_m"]),
            _waypoints(plan, summary),
            _texts(flight),
            _facts(flight, summary),
        )
    )
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}: flight report</title><style>{style}</style></head>"
        f"<body><main>{body}</main></body></html>\n"
    )


def _header(title: str, summary: dict[str, Any]) -> str:
    good = "good" if summary["outcome"] == _COMPLETED else "bad"
    lines = ([summary["outcome_text"]], flown(summary), conditions(summary))
    about = "".join(f'<div class="about">{escape(" · ".join(line))}</div>' for line in lines if any(line))
    return (
        f"<header><h1>{escape(title)}</h1>"
        f'<span class="outcome {good}">{escape(summary["outcome"].replace("_", " "))}</span>{about}</header>'
    )


def _tiles(summary: dict[str, Any]) -> str:
    rows = summary["waypoints"]
    reached = f"{sum(row['reached'] for row in rows)} of {len(rows)}"
    tiles = (
        ("items reached", reached),
        ("time in flight", _show(summary["flight_time_s"], ".1f", " s")),
        ("tracking error, rms", _show(summary["rms_tracking_error_m"], ".3f", " m")),
        ("tracking error, largest", _show(summary["max_tracking_error_m"], ".3f", " m")),
        ("overshoot, largest", _show(max_overshoot_m(summary), ".3f", " m")),
        ("attitude error, rms", _show(summary["rms_attitude_error_deg"], ".2f", "°")),
        ("attitude error, largest", _show(summary["max_attitude_error_deg"], ".1f", "°")),
        ("times real time", _show(summary["real_time_factor"], ".3g", "×")),
    )
    cells = "".join(f'<div class="tile"><b>{value}</b><span>{name}</span></div>' for name, value in tiles)
    return f'<div class="tiles">{cells}</div>'


def _waypoints(plan: Plan, summary: dict[str, Any]) -> str:
    def rows() -> Iterator[str]:
        for row in summary["waypoints"]:
            name = command_name(plan.items[row["seq"]].command).removeprefix("NAV_").replace("_", " ").lower()
            reached = '<td class="good">yes</td>' if row["reached"] else '<td class="bad">no</td>'
            yield (
                f'<tr><td class="n">{row["seq"]}</td><td>{escape(name)}</td>{reached}'
                f'<td class="n">{_show(row["time_s"], ".2f", " s")}</td>'
                f'<td class="n">{_show(row["miss_distance_m"], ".3f", " m")}</td>'
                f'<td class="n">{_show(row["overshoot_m"], ".3f", " m")}</td></tr>'
            )

    head = (
        '<tr><th class="n">item</th><th>command</th><th>reached</th><th class="n">at</th>'
        '<th class="n">closest approach</th><th class="n">overshoot</th></tr>'
    )
    return section("Plan", f"<table>{head}{''.join(rows())}</table>")


def _texts(flight: Flight) -> str:
    if not flight.texts:
        return section("Messages", '<p class="none">The vehicle sent no messages.</p>')
    rows = "".join(
        f'<tr class="{"bad" if text.level <= _WARNING else ""}"><td class="n">{text.time_s:.2f} s</td>'
        f"<td>{_LEVELS[text.level] if 0 <= text.level < len(_LEVELS) else text.level}</td>"
        f"<td>{escape(text.text)}</td></tr>"
        for text in flight.texts
    )
    return section(
        "Messages", f'<table><tr><th class="n">at</th><th>level</th><th>text</th></tr>{rows}</table>'
    )


def _facts(flight: Flight, summary: dict[str, Any]) -> str:
    facts = (
        ("plan", _show(summary["plan"])),
        ("vehicle", _show(summary["vehicle"])),
        ("controller", _show(summary["controller"])),
        ("gains", _show(summary["gains"])),
        ("plant", _show(summary["plant"])),
        ("loops", _show(summary["loops"])),
        ("seed", _show(summary["seed"])),
        ("inner loop", _show(summary["inner_hz"], "g", " Hz")),
        ("outer loop", _show(summary["outer_hz"], "g", " Hz")),
        ("rms torque asked for, x, y, z", _effort(summary)),
        ("rms change of rotor commands", _show(summary["rms_rotor_command_rate_rad_s2"], ".0f", " rad/s²")),
        ("simulated time", _show(summary["sim_time_s"], ".2f", " s")),
        ("wall time", _show(summary["wall_time_s"], ".2f", " s")),
        ("flight stack", _show(flight.info.get("ver_sw"))),
        ("home", _home(flight)),
    )
    cells = "".join(f"<div><dt>{name}</dt><dd>{value}</dd></div>" for name, value in facts)
    digest = f'<div class="wide"><dt>log sha-256</dt><dd>{_show(summary["log_sha256"])}</dd></div>'
    return section("Flight", f'<dl class="facts">{cells}{digest}</dl>')


def _effort(summary: dict[str, Any]) -> str:
    torque = summary["rms_torque_n_m"]
    return _UNKNOWN if torque is None else f"{', '.join(f'{value:.4f}' for value in torque)} N m"


def _home(flight: Flight) -> str:
    if flight.home is None:
        return _UNKNOWN
    home = flight.home
    return f"{home.latitude_deg:.5f}°, {home.longitude_deg:.5f}°, {home.altitude_m:.0f} m"


def _show(value: Any, spec: str = "", unit: str = "") -> str:
    return _UNKNOWN if value is None else escape(f"{value:{spec}}{unit}")
