"""``gcs pil``: run a comparison or an examination of a target, and print its result."""

from __future__ import annotations

import json
import webbrowser
from pathlib import Path
from typing import Any

from rich.console import Console

from flightstack.firmware.law_parity import VECTORS, differing_steps
from flightstack.firmware.law_tree import controller_named, generated_names, is_built_in, write_tree
from gcs_cli.errors import FAILED, USAGE, CliError
from gcs_cli.fly.fly_display import FlyConsole
from gcs_cli.fly.fly_flags import FlyOptions, ResultOptions, RunOptions
from gcs_cli.fly.fly_options import checked_plan
from gcs_cli.pil import doctor, replay_run
from gcs_cli.pil.result import PASSED, Outcome
from gcs_cli.pil.run import HTML_NAME, make_pil_directory, run, write_outcome
from gcs_cli.pil.targets import checked_target, port_or_target
from gcs_cli.tui.widgets.transfer_bar import step_bar


def run_flights(
    options: FlyOptions, chosen: RunOptions, target: str, out: Path | None, fail_over: bool
) -> None:
    """Fly the mission as MIL, SIL and PIL and print the comparison; raise CliError, ConfigError."""
    checked_target(target)
    items = checked_plan(options)
    console = FlyConsole(stderr=chosen.as_json, highlight=False)
    finished = run(options, items, target, out, console, chosen.overwrite)
    _show(finished.outcome, finished.folder, console, chosen)
    if finished.problem is not None:
        raise finished.problem
    _check_verdict(finished.outcome, fail_over)


def run_replay(
    log: Path, chosen: ResultOptions, target: str, vehicle: str | None, out: Path | None, fail_over: bool
) -> None:
    """Replay a flight log on a target and print the comparison; raise CliError, ConfigError."""
    choice = checked_target(target, more=("c",))
    prepared = replay_run.prepared(log, vehicle)
    folder = make_pil_directory(log.stem, out, chosen.overwrite)
    console = FlyConsole(stderr=chosen.as_json, highlight=False)
    outcome = replay_run.replay(log, choice, target, prepared, folder, console)
    write_outcome(folder, outcome)
    _show(outcome, folder, console, chosen)
    _check_verdict(outcome, fail_over)


def run_generate(name: str, out: Path | None, as_json: bool) -> None:
    """Write the firmware with a controller's law and name its files; raise CliError, ConfigError."""
    controller = controller_named(name)
    if is_built_in(controller):
        raise CliError(f"--controller {name}: the firmware has it already", USAGE)
    folder = out or Path("build") / f"firmware-{name}"
    try:
        write_tree(controller, folder)
    except OSError as error:
        raise CliError(f"{folder}: cannot be written: {error.strerror}", USAGE) from None
    names, differing = sorted(generated_names(controller)), differing_steps(controller)
    if as_json:
        result = {"controller": name, "directory": str(folder), "files": names, "steps_compared": VECTORS}
        print(json.dumps({**result, "steps_differing": differing}), flush=True)
    else:
        console = FlyConsole(highlight=False)
        lines = [f"firmware with {name}: {folder}/", *(f"  core/{file}" for file in names)]
        lines.append(
            f"C in double against Python: {VECTORS} random steps, {differing} of them with other bits"
        )
        for line in lines:
            console.print(line, markup=False, highlight=False, soft_wrap=True)
    if differing:
        raise CliError(
            f"--controller {name}: its C and its Python differ in {differing} of {VECTORS} steps", FAILED
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


def _show(outcome: Outcome, folder: Path, console: Console, chosen: ResultOptions) -> None:
    if chosen.as_json:
        print(json.dumps({**outcome.result, "directory": str(folder)}), flush=True)
    else:
        print_outcome(console, outcome.result, folder)
    if chosen.open_report:
        webbrowser.open((folder / HTML_NAME).resolve().as_uri())


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
    style = "green" if result["verdict"] == PASSED else "red"
    console.print(f"[bright_black]verdict  [/][{style}]{result['verdict']}[/]", highlight=False)
    console.print("[bright_black]files    [/]", end="")
    console.print(f"{folder}/  pil.html pil.json", markup=False, highlight=False, soft_wrap=True)


def _cells(check: dict[str, Any]) -> tuple[str, str, str, str]:
    unit = f" {check['unit']}" if check["unit"] else ""
    measured = "not a number" if check["measured"] is None else f"{check['measured']:.4g}{unit}"
    return check["name"], measured, f"{check['limit']:g}{unit}", check["about"]
