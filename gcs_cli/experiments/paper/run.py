"""``gcs paper``: fly the experiments, do the analysis, run the loops on the target, and write what came out.

Each part is written when it ends, whole or not at all: who interrupts the command keeps the parts that were done, and
``left_out`` names the others.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rich.console import Console

from flightstack.core.atomic_file import write_text_atomically
from flightstack.core.errors import INSTALL_MULTIBODY
from gcs_cli.errors import FAILED, CliError
from gcs_cli.experiments.paper import linear, pil_section, report_pictures
from gcs_cli.experiments.paper.cases import MULTIBODY, all_cases
from gcs_cli.experiments.paper.checks import check
from gcs_cli.experiments.paper.claims import claims
from gcs_cli.experiments.paper.endings import CRASHED
from gcs_cli.experiments.paper.experiments import Flown, default_jobs, run_cases
from gcs_cli.experiments.paper.report import render
from gcs_cli.experiments.paper.report_pictures import Picture
from gcs_cli.experiments.paper.results import results_of, text_of
from gcs_cli.experiments.paper.types import Case
from gcs_cli.report.run_directory import results_directory
from gcs_cli.tui.transfer_bar import step_bar

JSON_NAME, HTML_NAME = "results.json", "report.html"
NO_MUJOCO = f"the multibody plant needs MuJoCo: {INSTALL_MULTIBODY}"
NOT_WANTED = "left out on request"
NOT_REACHED = "not done: the command was ended before"


class PaperOptions(NamedTuple):
    """What the command was asked for."""

    out: Path
    pil: bool = True
    multibody: bool = True
    target: str = pil_section.EMULATED
    jobs: int | None = None
    """Processes that fly at once; None: one for each processor."""


def run(options: PaperOptions, console: Console, cases: Sequence[Case] | None = None) -> dict[str, Any]:
    """Do it all and return the results; ``cases`` in place of the whole matrix. Raise CliError, ConfigError."""
    left_out = {} if options.pil else {"pil": NOT_WANTED}
    if not options.multibody:
        left_out[MULTIBODY] = NOT_WANTED
    elif importlib.util.find_spec("mujoco") is None:
        left_out[MULTIBODY] = NO_MUJOCO
    chosen = all_cases(MULTIBODY not in left_out) if cases is None else cases
    check(chosen, options.target if options.pil else None)
    with results_directory(options.out):
        return _run(options, console, chosen, left_out)


def _run(
    options: PaperOptions, console: Console, chosen: Sequence[Case], left_out: dict[str, str]
) -> dict[str, Any]:
    flown = _fly(chosen, options.jobs or default_jobs(), console)
    parts = {part: work for part, work in _parts(options).items() if part not in left_out}
    results = results_of(flown, {**left_out, **dict.fromkeys(parts, NOT_REACHED)})
    _write(options.out, results, flown)
    pil_section.clear(options.out)  # of a run before
    for part, (words, work) in parts.items():
        with console.status(words) as status:
            results[part] = found = work(status.update)
            if part == "linear":  # one of the claims is judged by it
                results["comparisons"]["claims"] = claims(flown.entries, found)
        del results["left_out"][part]
        why = found.get("why_left_out") if isinstance(found, dict) else None
        if why is not None:
            results["left_out"][part] = why
        _write(options.out, results, flown)
        console.print(f"{words}: {'done' if why is None else 'left out'}", markup=False, highlight=False)
    if MULTIBODY not in left_out:
        with console.status("pictures"):
            pictures = report_pictures.take(flown.recordings)
        _write(options.out, results, flown, pictures)
        console.print("pictures: done", markup=False, highlight=False)
    return results


def _parts(options: PaperOptions) -> dict[str, tuple[str, Callable[[Callable[[str], None]], Any]]]:
    """What follows the flights: a part's name in the results, what is said of it, and its work, which may tell more."""
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
    told = f"experiments: {len(flown.entries)} flown, {crashed} crashed, {len(ended) - crashed} lost control"
    console.print(told, markup=False, highlight=False)
    return flown


def _write(folder: Path, results: dict[str, Any], flown: Flown, pictures: Sequence[Picture] = ()) -> None:
    """Write results.json and report.html, each whole or not at all; raise CliError."""
    html = render(results, flown.recordings, pictures)
    try:
        write_text_atomically(folder / JSON_NAME, text_of(results))
        write_text_atomically(folder / HTML_NAME, html)
    except OSError as error:
        raise CliError(f"{folder}: the results cannot be written: {error.strerror}", FAILED) from None
