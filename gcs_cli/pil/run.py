"""``gcs pil MISSION``: three flights of the same mission, each in its own directory, compared and checked."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any, NamedTuple

from rich.console import Console

from flightstack.core.atomic_file import write_text_atomically
from flightstack.core.errors import ConfigError
from flightstack.firmware.choice import PYTHON, C
from flightstack.plan import Plan
from gcs_cli.errors import USAGE, CliError
from gcs_cli.fly.flight import Flight
from gcs_cli.fly.fly_display import BarDisplay, Display, draws_bars
from gcs_cli.fly.fly_flags import FlyOptions
from gcs_cli.fly.fly_options import outer_rate_hz
from gcs_cli.fly.fly_results import write_results
from gcs_cli.fly.fly_run import fly
from gcs_cli.pil.code_facts import code_facts
from gcs_cli.pil.flight_samples import read_samples
from gcs_cli.pil.report import render_report
from gcs_cli.pil.result import COMPLETED, Flown, Outcome, closed_loop
from gcs_cli.pil.target_record import TargetRecord, read_record
from gcs_cli.pil.targets import FirmwareBuild, building, checked_target, has_same_bits, meaning
from gcs_cli.pil.verdict import DEFAULT_LIMITS, MIL, PIL, SIL, Limits
from gcs_cli.run_directory import LOG_NAME, RUNS, fresh_directory

JSON_NAME, HTML_NAME = "pil.json", "pil.html"


class NoticeDisplay:
    """Shows only the notices of a flight: for an output that cannot draw a bar."""

    def __init__(self, console: Console) -> None:
        self._console = console

    def update(self, flight: Flight) -> None:
        """Do nothing."""

    def note(self, line: str) -> None:
        """Print the line."""
        self._console.print(line, markup=False, highlight=False, soft_wrap=True)

    def close(self) -> None:
        """Do nothing."""


class Finished(NamedTuple):
    """Results of a run."""

    folder: Path
    outcome: Outcome
    problem: CliError | None
    """The error of a flight that was not completed, or None."""


def run(
    options: FlyOptions,
    plan: Plan,
    target: str,
    out: Path | None,
    console: Console,
    overwrite: bool = False,
    limits: Limits = DEFAULT_LIMITS.flight,
) -> Finished:
    """Fly the mission three times and write ``pil.json`` and ``pil.html``; raise CliError, ConfigError.

    A flight that fails ends the run; the flights until then are compared.
    """
    choice = checked_target(target)
    with building(choice, options.controller) as firmware:
        if firmware.tree is not None:
            words = f"C    of {options.controller}: {firmware.tree}"
            console.print(words, markup=False, highlight=False, soft_wrap=True)
        folder = make_pil_directory(options.plan_path.stem, out, overwrite)
        flights, problem = _fly_stages(options, plan, target, folder, console, overwrite, firmware)
    record = _record(folder) if PIL in flights else None
    facts = {
        "title": f"{options.plan_path.stem}: MIL, SIL and PIL",
        "about": _about(options, target),
        "meaning": meaning(choice),
        "conditions": _conditions(options, target),
        "inner_hz": options.inner_hz,
        **code_facts(record, options.controller),
    }
    outcome = closed_loop(flights, record, has_same_bits(choice), facts, limits)
    write_outcome(folder, outcome)
    return Finished(folder, outcome, problem)


def _fly_stages(
    options: FlyOptions,
    plan: Plan,
    target: str,
    folder: Path,
    console: Console,
    overwrite: bool,
    firmware: FirmwareBuild,
) -> tuple[dict[str, Flown], CliError | None]:
    """Fly MIL, SIL and PIL until one is not completed; return their results, and the error of that flight."""
    flights: dict[str, Flown] = {}
    for stage, loops in ((MIL, PYTHON), (SIL, C), (PIL, target)):
        console.print(f"[bold]{stage}[/]  loops {loops}", highlight=False)
        if loops != PYTHON:
            firmware.wait()
        flown = dataclasses.replace(options, loops=loops)
        flights[stage], problem = fly_stage(stage, flown, plan, folder, console, overwrite)
        console.print(f"     {_words(flights[stage])}", markup=False, highlight=False, soft_wrap=True)
        if problem is not None:
            return flights, problem
    return flights, None


def make_pil_directory(name: str, out: Path | None, overwrite: bool = False) -> Path:
    """Make and return the directory of a run; raise CliError if that fails, or if it has another run.

    With ``overwrite``, the other run's results are removed.
    """
    if out is None:
        return fresh_directory(RUNS, f"{name}-pil")
    if (out / JSON_NAME).exists() and not overwrite:
        raise CliError(
            f"--out {out}: {JSON_NAME} of another run is there; choose another one, or give --overwrite",
            USAGE,
        )
    try:
        for file in (JSON_NAME, HTML_NAME):
            (out / file).unlink(missing_ok=True)
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise CliError(f"{out}: the directory cannot be made: {error.strerror}", USAGE) from None
    return out


def fly_stage(
    stage: str, options: FlyOptions, plan: Plan, folder: Path, console: Console, overwrite: bool
) -> tuple[Flown, CliError | None]:
    """Fly a stage; return its results, and the error of a flight that was not completed."""
    display: Display = BarDisplay(console) if draws_bars(console) else NoticeDisplay(console)
    place = stage.lower()
    try:
        flown = fly(options, plan, folder / place, display, overwrite)
    finally:
        display.close()
    summary, outcome, failure = write_results(options, plan, flown)
    if failure is not None:
        raise failure
    try:
        samples = read_samples(folder / place / LOG_NAME)
    except ConfigError:  # a flight that never began has no log; its outcome has the reason
        samples = None
    facts = {name: summary[name] for name in ("sim_time_s", "wall_time_s", "log_sha256")}
    problem = None
    if not outcome.completed:
        problem = CliError(f"{stage}: {outcome.reason} (see {folder / place})", outcome.exit_code)
    return Flown(outcome.code.value, samples, {"directory": place, **facts}, outcome.reason), problem


def _words(flown: Flown) -> str:
    simulated_s, wall_s = flown.facts["sim_time_s"], flown.facts["wall_time_s"]
    if flown.outcome != COMPLETED or wall_s is None:
        return flown.outcome  # the error of the run has the reason
    return f"{flown.outcome}: {simulated_s:.1f} s simulated in {wall_s:.1f} s"


def _record(folder: Path) -> TargetRecord | None:
    try:
        return read_record(folder / PIL.lower())
    except ConfigError:  # the target failed before its identity was known
        return None


def _about(options: FlyOptions, target: str) -> str:
    return f"vehicle {options.vehicle} · controller {options.controller} ({options.gains}) · target {target}"


def _conditions(options: FlyOptions, target: str) -> dict[str, Any]:
    values = {
        "plan": str(options.plan_path),
        "target": target,
        "vehicle": options.vehicle,
        "controller": options.controller,
        "gains": options.gains,
        "state": options.state,
        "plant": options.plant,
        "inner loop": f"{options.inner_hz:g} Hz",
        "outer loop": f"{outer_rate_hz(options):g} Hz",
        "seed": options.seed,
        "wind": options.wind,
        "gusts": options.gust,
        "optional drag": "yes" if options.drag else None,
        "torque gusts": options.torque_gust,
        "force": options.force,
        "torque": options.torque,
        "battery": _battery(options),
        "faults": " ".join(options.faults or ()) or None,
        "ideal rotors": "yes" if options.ideal_rotors else None,
        "parameters": " ".join(map(str, filter(None, (options.params, *(options.param or ()))))) or None,
    }
    return {name: value for name, value in values.items() if value is not None}


def _battery(options: FlyOptions) -> str | None:
    parts = (
        (options.battery_start, "from {:g} %"),
        (options.battery_capacity, "{:g} mAh"),
        (options.battery_drain, "drained {:g} times as fast"),
    )
    return ", ".join(words.format(value) for value, words in parts if value is not None) or None


def write_outcome(folder: Path, outcome: Outcome) -> None:
    """Write ``pil.json`` and ``pil.html`` atomically; raise CliError."""
    text = json.dumps(outcome.result, indent=2, allow_nan=False, ensure_ascii=False) + "\n"
    html = render_report(outcome.result, outcome.charts, outcome.profiles, outcome.costs)
    try:
        write_text_atomically(folder / JSON_NAME, text)
        write_text_atomically(folder / HTML_NAME, html)
    except OSError as error:
        raise CliError(f"{folder}: the results cannot be written: {error.strerror}") from None
