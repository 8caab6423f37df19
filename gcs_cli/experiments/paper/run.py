"""``gcs paper``: fly the experiments, analyse the loops, run them on the target, and write results and report.

Each part is written atomically when it ends: an interrupted command keeps the finished parts, and ``left_out`` names
the others.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rich.console import Console

from flightstack.core.atomic_file import write_text_atomically
from flightstack.core.errors import INSTALL_MULTIBODY
from flightstack.params.gains_file import open_gains
from flightstack.params.vehicle import load_vehicle
from gcs_cli.charts.print_figure import write_figure
from gcs_cli.errors import FAILED, USAGE, CliError
from gcs_cli.experiments.paper import linear, pil_section
from gcs_cli.experiments.paper.findings.claims import claims
from gcs_cli.experiments.paper.flights.cases import MULTIBODY, all_cases
from gcs_cli.experiments.paper.flights.endings import CRASHED
from gcs_cli.experiments.paper.flights.experiments import Flown, default_jobs, run_cases
from gcs_cli.experiments.paper.flights.trajectory import load_trajectory
from gcs_cli.experiments.paper.flights.types import Case
from gcs_cli.experiments.paper.report import pictures
from gcs_cli.experiments.paper.report.page import render, report_figures
from gcs_cli.experiments.paper.report.pictures import Picture
from gcs_cli.experiments.paper.results import results_of, text_of
from gcs_cli.run_directory import results_directory
from gcs_cli.tui.widgets.transfer_bar import step_bar

JSON_NAME, HTML_NAME, FIGURES_NAME = "results.json", "report.html", "figures"
PRINT_FORMATS = (".pdf", ".svg")
NO_MUJOCO = f"the multibody plant needs MuJoCo: {INSTALL_MULTIBODY}"
NOT_WANTED = "left out on request"
NOT_REACHED = "not done: the command was ended before"


class PaperOptions(NamedTuple):
    """Options of the command."""

    out: Path
    pil: bool = True
    multibody: bool = True
    target: str = pil_section.EMULATED
    jobs: int | None = None
    """Parallel processes; None: one for each processor."""


def run(options: PaperOptions, console: Console, cases: Sequence[Case] | None = None) -> dict[str, Any]:
    """Run all parts and return the results; ``cases`` replaces the whole matrix. Raise CliError, ConfigError."""
    left_out = {} if options.pil else {"pil": NOT_WANTED}
    if not options.multibody:
        left_out[MULTIBODY] = NOT_WANTED
    elif importlib.util.find_spec("mujoco") is None:
        left_out[MULTIBODY] = NO_MUJOCO
    chosen = all_cases(MULTIBODY not in left_out) if cases is None else cases
    check(chosen, options.target if options.pil else None)
    with results_directory(options.out):
        return _run(options, console, chosen, left_out)


def check(cases: Sequence[Case], target: str | None) -> None:
    """Read every file that the cases name and look for the target, None for none; raise CliError, ConfigError.

    An emulated target without its tools is no error: the results then name the reason.
    """
    for load, names in (
        (load_trajectory, {case.trajectory for case in cases}),
        (open_gains, {case.gains for case in cases}),
        (load_vehicle, {case.vehicle for case in cases}),
    ):
        for name in sorted(names):
            load(name)
    if target is not None and target != pil_section.EMULATED:
        why = pil_section.problem(target)
        if why is not None:
            raise CliError(why, USAGE)


def _run(
    options: PaperOptions, console: Console, chosen: Sequence[Case], left_out: dict[str, str]
) -> dict[str, Any]:
    flown = _fly(chosen, options.jobs or default_jobs(), console)
    parts = {part: work for part, work in _parts(options).items() if part not in left_out}
    results = results_of(flown, {**left_out, **dict.fromkeys(parts, NOT_REACHED)})
    _write(options.out, results, flown)
    pil_section.clear(options.out)  # of the previous run
    for part, (words, work) in parts.items():
        with console.status(words) as status:
            results[part] = found = work(status.update)
            if part == "linear":  # one of the claims needs it
                results["comparisons"]["claims"] = claims(flown.entries, found)
        del results["left_out"][part]
        why = found.get("why_left_out") if isinstance(found, dict) else None
        if why is not None:
            results["left_out"][part] = why
        _write(options.out, results, flown)
        console.print(f"{words}: {'done' if why is None else 'left out'}", markup=False, highlight=False)
    taken: list[Picture] = []
    if MULTIBODY not in left_out:
        with console.status("pictures"):
            taken = pictures.take(flown.recordings)
        console.print("pictures: done", markup=False, highlight=False)
    with console.status("figures"):
        _write(options.out, results, flown, taken, printed=True)
    console.print("figures: done", markup=False, highlight=False)
    return results


def _parts(options: PaperOptions) -> dict[str, tuple[str, Callable[[Callable[[str], None]], Any]]]:
    """Return the parts after the flights by their name in the results, each with its title and its work."""
    return {
        "linear": ("linear analysis", lambda tell: linear.results()),
        "onset": ("onset of instability", lambda tell: linear.onset()),
        "pil": ("processor in the loop", lambda tell: pil_section.run(options.out, options.target, tell)),
    }


def _fly(cases: Sequence[Case], jobs: int, console: Console) -> Flown:
    with step_bar("experiments", console) as bar:
        flown = run_cases(cases, jobs, bar.show)
    ended = [entry["ended"]["how"] for entry in flown.entries.values() if entry["ended"] is not None]
    crashed = ended.count(CRASHED)
    words = f"experiments: {len(flown.entries)} flown, {crashed} crashed, {len(ended) - crashed} lost control"
    console.print(words, markup=False, highlight=False)
    return flown


def _write(
    folder: Path,
    results: dict[str, Any],
    flown: Flown,
    taken: Sequence[Picture] = (),
    printed: bool = False,
) -> None:
    """Write results.json, report.html and, if ``printed``, the figures as PDF and SVG, atomically; raise CliError."""
    drawn = report_figures(results, flown.recordings)
    html = render(results, flown.recordings, drawn, taken)
    try:
        write_text_atomically(folder / JSON_NAME, text_of(results))
        write_text_atomically(folder / HTML_NAME, html)
        if printed:
            (folder / FIGURES_NAME).mkdir(exist_ok=True)
            for figure in drawn:
                for suffix in PRINT_FORMATS:
                    write_figure(folder / FIGURES_NAME / f"{figure.name}{suffix}", figure)
    except OSError as error:
        raise CliError(f"{folder}: the results cannot be written: {error.strerror}", FAILED) from None
