"""``gcs pil``: run a comparison or an examination of a target, and print its result."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rich.console import Console

from flightstack.core.atomic_file import write_bytes_atomically
from flightstack.firmware.law_parity import law_parity
from flightstack.firmware.law_tree import controller_named, generated_names, is_built_in, write_tree
from flightstack.params.config import ESTIMATED
from flightstack.process.clock import nearest_outer_hz
from gcs_cli.errors import FAILED, USAGE, CliError
from gcs_cli.fly.fly_display import FlyConsole
from gcs_cli.fly.fly_flags import FlyOptions
from gcs_cli.fly.fly_options import checked_plan
from gcs_cli.output import Output, show_page
from gcs_cli.pil import doctor, replay_run
from gcs_cli.pil.excitation import excitation
from gcs_cli.pil.junit import pil_junit
from gcs_cli.pil.limits_file import read_limits
from gcs_cli.pil.pil_flags import VerdictOptions
from gcs_cli.pil.result import PASSED, Outcome
from gcs_cli.pil.run import HTML_NAME, make_pil_directory, run, write_outcome
from gcs_cli.pil.targets import checked_target, port_or_target
from gcs_cli.pil.vectors import SUFFIXES, Vectors, vectors_of, write_vectors
from gcs_cli.pil.verdict import LimitSet
from gcs_cli.settings import check_output_file
from gcs_cli.tui.widgets.transfer_bar import step_bar


def run_flights(options: FlyOptions, verdict: VerdictOptions, target: str) -> None:
    """Fly the mission as MIL, SIL and PIL and print the comparison; raise CliError, ConfigError."""
    checked_target(target)
    items, limits, began_s = checked_plan(options), _checked(verdict), time.monotonic()
    console = FlyConsole(stderr=verdict.as_json, highlight=False)
    of_flight = limits.sensed if options.state == ESTIMATED else limits.flight
    finished = run(options, items, target, verdict.out, console, verdict.overwrite, of_flight)
    _finish(finished.outcome, finished.folder, console, verdict, "pil.fly", began_s)
    if finished.problem is not None:
        raise finished.problem
    _check_verdict(finished.outcome, verdict.fail_over)


def run_replay(log: Path, verdict: VerdictOptions, target: str, vehicle: str | None) -> None:
    """Replay a flight log on a target and print the comparison; raise CliError, ConfigError."""
    choice, limits, began_s = checked_target(target, more=("c",)), _checked(verdict), time.monotonic()
    prepared = replay_run.prepared(log, vehicle)
    folder = make_pil_directory(log.stem, verdict.out, verdict.overwrite)
    console = FlyConsole(stderr=verdict.as_json, highlight=False)
    outcome = replay_run.replay(log, choice, target, prepared, folder, console, limits)
    write_outcome(folder, outcome)
    _finish(outcome, folder, console, verdict, "pil.replay", began_s)
    _check_verdict(outcome, verdict.fail_over)


def run_vectors(
    file: Path,
    log: Path | None,
    loops: tuple[str, str, str, float, float | None],
    overwrite: bool,
    as_json: bool,
) -> None:
    """Write test vectors of a log, or of the excitation of ``loops``; raise CliError, ConfigError.

    ``loops``: vehicle, controller, gains, rates of inner and outer loop.
    """
    if file.suffix.lower() not in SUFFIXES:
        raise CliError(
            f"{file}: give the file a name that ends in {', '.join(SUFFIXES[:-1])} or {SUFFIXES[-1]}", USAGE
        )
    if file.exists() and not overwrite:
        raise CliError(f"{file}: exists; give --overwrite to replace it", USAGE)
    if log is None:
        vehicle, controller, gains, inner_hz, outer_hz = loops
        rates = inner_hz, outer_hz or nearest_outer_hz(inner_hz)
        setup, info, parameters = replay_run.configured(vehicle, controller, gains, *rates)
        vectors = Vectors(excitation(setup), None, info, parameters)
    else:
        vectors = vectors_of(*replay_run.read_flight(log))
    write_vectors(file, vectors)
    steps = len(vectors.record.time_us)
    what = "excitation, inputs only" if log is None else f"inputs and outputs of {log.name}"
    Output(as_json).say("vectors", f"{file}: {steps} steps, {what}", file=str(file), steps=steps)


def _checked(verdict: VerdictOptions) -> LimitSet:
    """Return the limits; raise CliError or ConfigError for a file of ``verdict`` that cannot be used."""
    check_output_file("--junit", verdict.junit, (".xml",))
    return read_limits(verdict.limits)


def run_generate(name: str, out: Path | None, as_json: bool) -> None:
    """Write the firmware with a controller's law and name its files; raise CliError, ConfigError."""
    controller = controller_named(name)
    if is_built_in(controller):
        raise CliError(f"--controller {name}: the firmware has it already", USAGE)
    folder = out or Path("build") / f"firmware-{name}"
    try:
        write_tree(controller, folder)
    except OSError as error:
        raise CliError(f"{folder}: cannot be written: {error.strerror}") from None
    names, parity = sorted(generated_names(controller)), law_parity(controller)
    if as_json:
        result = {"controller": name, "directory": str(folder), "files": names}
        steps = {"steps_compared": parity.compared, "steps_differing": parity.differing}
        print(json.dumps({**result, **steps}), flush=True)
    else:
        console = FlyConsole(highlight=False)
        lines = [f"firmware with {name}: {folder}/", *(f"  core/{file}" for file in names)]
        figures = f"{parity.compared} random steps, {parity.differing} of them with other bits"
        nothing = "nothing to compare: the law is written in C"
        lines.append(f"C in double against Python: {figures if parity.compared else nothing}")
        for line in lines:
            console.print(line, markup=False, highlight=False, soft_wrap=True)
    if parity.differing:
        raise CliError(
            f"--controller {name}: its C and its Python differ in {parity.differing} of {parity.compared} steps",
            FAILED,
        )


def run_doctor(
    port: str | None, target: str | None, bauds: list[int] | None, exchanges: int, as_json: bool
) -> None:
    """Measure the link to a serial port or a target and print the findings; raise CliError."""
    choice = port_or_target(port, target)
    rates = bauds or (doctor.BAUDS if target is None else [choice.baud])
    console = FlyConsole(stderr=as_json, highlight=False)
    with step_bar("exchanges", console) as bar:
        found = doctor.examine(choice, rates, exchanges, bar.show)
    result = doctor.findings(choice, found)
    if as_json:
        print(json.dumps(result), flush=True)
    else:
        doctor.print_findings(console, result)
    doctor.check_findings(result)


def _finish(
    outcome: Outcome, folder: Path, console: Console, verdict: VerdictOptions, command: str, began_s: float
) -> None:
    """Print the outcome, and write the file of ``--junit``; raise CliError."""
    if verdict.as_json:
        print(json.dumps({**outcome.result, "directory": str(folder)}), flush=True)
    else:
        print_outcome(console, outcome.result, folder)
    if verdict.junit is not None:
        try:
            content = pil_junit(outcome.result, command, time.monotonic() - began_s)
            write_bytes_atomically(verdict.junit, content)
        except OSError as error:
            raise CliError(f"--junit {verdict.junit}: cannot be written: {error.strerror}") from None
    if verdict.open_report:
        show_page(folder / HTML_NAME)


def _check_verdict(outcome: Outcome, fail_over: bool) -> None:
    """Raise CliError if the verdict is not good and ``fail_over`` is set."""
    if fail_over and not outcome.passed:
        failed = [check["name"] for check in outcome.result["checks"] if not check["passed"]]
        raise CliError(f"the verdict is not good: {', '.join(failed)}", FAILED)


def print_outcome(console: Console, result: dict[str, Any], folder: Path) -> None:
    """Print the checks, the cost of a step, the verdict and the files."""
    rows = [("check", "measured", "limit", ""), *map(_cells, result["checks"])]
    widths = [max(len(row[column]) for row in rows) for column in range(3)]
    for row, passed in zip(rows, (None, *(check["passed"] for check in result["checks"])), strict=True):
        name, measured, limit, about = row
        line = f"{name:<{widths[0]}}  {measured:>{widths[1]}}  {limit:>{widths[2]}}  {about}".rstrip()
        style = "bright_black" if passed is None else "" if passed else "red"
        console.print(line, style=style, markup=False, highlight=False, soft_wrap=True)
    for stage, figures in ((result["profile"] or {}).get("stages") or {}).items():
        unit = result["profile"]["unit"]
        words = f"mean {figures['mean']:.1f}, p99 {figures['p99']:.0f}, max {figures['max']:.0f} {unit}"
        console.print(f"[bright_black]{stage:<9}[/]{words}", highlight=False)
    for line in code_lines(result):
        console.print(line, markup=False, highlight=False, soft_wrap=True)
    style = "green" if result["verdict"] == PASSED else "red"
    console.print(f"[bright_black]verdict  [/][{style}]{result['verdict']}[/]", highlight=False)
    console.print("[bright_black]files    [/]", end="")
    console.print(f"{folder}/  pil.html pil.json", markup=False, highlight=False, soft_wrap=True)


def code_lines(result: dict[str, Any]) -> Iterator[str]:
    """Yield a line for each of CPU load, coverage and stack that is known."""
    load, coverage, usage = result["load"], result["coverage"], result["stack_usage"]
    if load is not None:
        percent = f"mean {load['mean_percent']:.3g} %, max {load['max_percent']:.3g} %"
        yield f"load     {percent} of {load['period_us']:g} µs at {load['clock_hz'] / 1e6:g} MHz"
    if coverage is not None and coverage["lines"]:
        yield f"coverage {coverage['percent']:.1f} % of {coverage['lines']} lines of core"
    if usage is not None:
        yield f"stack    {usage['total']} bytes on the deepest path, {usage['compiler']}"


def _cells(check: dict[str, Any]) -> tuple[str, str, str, str]:
    unit = f" {check['unit']}" if check["unit"] else ""
    measured = "not a number" if check["measured"] is None else f"{check['measured']:.4g}{unit}"
    return check["name"], measured, f"{check['limit']:g}{unit}", check["about"]
