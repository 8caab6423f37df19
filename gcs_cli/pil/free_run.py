"""``gcs pil free-run``: fly a mission with the loops run by the target's own timer, and show its timing."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from flightstack.firmware.choice import EMULATED, FREE
from flightstack.firmware.pil.record import LINK_FILE
from gcs_cli.errors import USAGE, CliError
from gcs_cli.fly.fly_display import FlyConsole
from gcs_cli.fly.fly_flags import FlyOptions, RunOptions
from gcs_cli.fly.fly_options import checked_plan
from gcs_cli.pil.run import fly_stage, make_pil_directory
from gcs_cli.pil.targets import check_there, checked_target
from gcs_cli.pil.verdict import PIL


def run_free(options: FlyOptions, chosen: RunOptions, target: str, out: Path | None) -> None:
    """Fly the mission in real time and print the target's timing; raise CliError, ConfigError."""
    choice = checked_target(target)
    if choice.kind == EMULATED:
        raise CliError(f"--target: {target} has no time of its own: use host or serial:DEVICE[:BAUD]", USAGE)
    options = dataclasses.replace(options, loops=f"{target},{FREE}", speed="1")
    plan = checked_plan(options)
    check_there(choice, options.controller)
    folder = make_pil_directory(options.plan_path.stem, out, chosen.overwrite)
    console = FlyConsole(stderr=chosen.as_json, highlight=False)
    console.print(f"[bold]{PIL}[/]  loops {options.loops}, in real time", highlight=False)
    flown, problem = fly_stage(PIL, options, plan, folder, console, chosen.overwrite)
    figures = _figures(folder / PIL.lower() / LINK_FILE)
    if chosen.as_json:
        result = {"outcome": flown.outcome, "free_running": figures, "directory": str(folder)}
        print(json.dumps(result), flush=True)
    else:
        for line in (flown.outcome, *timing_lines(figures or {}), f"files  {folder}/"):
            console.print(line, markup=False, highlight=False, soft_wrap=True)
    if problem is not None:
        raise problem


def _figures(path: Path) -> dict[str, Any] | None:
    """Return the timing in the record of the link; None if the target failed before its start."""
    try:
        figures: dict[str, Any] | None = json.loads(path.read_text(encoding="utf-8"))["free_running"]
    except (OSError, ValueError, KeyError):
        return None
    return figures


def timing_lines(figures: Mapping[str, Any]) -> list[str]:
    """Return the figures of ``FreeRunning.figures`` as lines of a table."""
    if not figures.get("ticks"):
        return ["no timing: the target ran for less than a second"]
    rows = (
        (
            "ticks",
            f"{figures['ticks']}, of which {figures['missed']} were left out and {figures['overruns']} overran",
        ),
        ("jitter", _span(figures, "late") + f" behind the deadlines, period {figures['period_us']} µs"),
        (
            "states",
            f"{figures['states']} received, {figures['skipped']} replaced, {figures['held']} ticks without one",
        ),
        ("age", _span(figures, "state_age") + " from the arrival of a state to its tick"),
        ("delay", _span(figures, "end_to_end") + " from a state's departure to the arrival of its command"),
        ("timeouts", f"{figures['timeouts']}"),
    )
    return [f"{name:<9}{words}" for name, words in rows]


def _span(figures: Mapping[str, Any], name: str) -> str:
    mean, most = figures[f"{name}_mean_us"] or 0.0, figures[f"{name}_max_us"] or 0.0
    return f"mean {mean:.0f} µs, max {most:.0f} µs"
