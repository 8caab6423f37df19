"""A run of scenarios: fly, show, keep what failed, write the reports; once, or after each change of a file."""

from __future__ import annotations

import contextlib
import json
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from rich.console import Console

from flightstack.core.atomic_file import write_bytes_atomically, write_text_atomically
from flightstack.core.errors import ConfigError
from flightstack.testing.scenario import forget_controllers
from gcs_cli.errors import DONE, FAILED, INTERRUPTED, CliError
from gcs_cli.run_directory import LOG_NAME, REPORT_NAME, RUNS, fresh_directory
from gcs_cli.scenarios.display import Display, make_display, print_failures, print_summary
from gcs_cli.scenarios.junit import junit_xml
from gcs_cli.scenarios.options import TestOptions
from gcs_cli.scenarios.page import render_results
from gcs_cli.scenarios.pool import Finished, Notice, Pool, Started
from gcs_cli.scenarios.result import Result, Row, Wanted, as_json, not_flown
from gcs_cli.scenarios.selection import Case, find_scenarios, select
from gcs_cli.scenarios.watch import Stamps

_POLL_S = 0.5


@dataclass(frozen=True)
class Run:
    """The flown cases and their results."""

    rows: tuple[Row, ...]
    total: int
    wall_s: float
    interrupted: bool
    jobs: int
    """Flights at once."""

    @property
    def exit_code(self) -> int:
        """0 if all passed."""
        return DONE if all(row.result.passed for row in self.rows) else FAILED


class FailureFiles:
    """Writes log and report of each failed flight to a folder, which it makes with the first."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder

    def write(self, case: Case, result: Result) -> str | None:
        """Write the files of a flight; return its folder, or None without files. Raise CliError, OSError."""
        if not result.log:
            return None
        if self._folder is None:
            self._folder = fresh_directory(RUNS, "test")
        folder = self._folder / case.name
        folder.mkdir(parents=True, exist_ok=True)
        write_bytes_atomically(folder / LOG_NAME, result.log, survives_power_loss=False)
        write_text_atomically(folder / REPORT_NAME, result.report)
        return str(folder)


def run_once(pool: Pool, options: TestOptions, console: Console) -> int:
    """Fly all scenarios once and report; return the exit code. Raise ConfigError, CliError."""
    run = _fly(pool, _cases(options), options, console)
    _write(run, options)
    if options.as_json:
        print(json.dumps(as_json(run.rows, run.wall_s, run.interrupted), allow_nan=False), flush=True)
    else:
        _print(run, options, console)
    _check_complete(run)
    return run.exit_code


def run_watching(pool: Pool, options: TestOptions, console: Console) -> int:
    """Fly all scenarios, and those whose files change until Ctrl-C; return the exit code of the newest results."""
    stamps, rows = Stamps(), dict[tuple[Path, int], Row]()
    code = DONE
    with contextlib.suppress(KeyboardInterrupt):
        cases = _cases(options)
        while True:
            changed = stamps.changed(cases)
            stamps.poll(find_scenarios(_paths(options)))
            run = _fly(pool, changed, options, console)
            rows |= {row.case.key: row for row in run.rows}
            newest = [replace(rows[case.key], case=case) for case in cases if case.key in rows]
            whole = replace(run, rows=tuple(newest), total=len(newest))
            code = whole.exit_code
            _write(whole, options)
            _print(run, options, console)
            _check_complete(run)
            pool.renew()
            console.print(f"watching {stamps.count} files; Ctrl-C ends", style="bright_black")
            cases = _changed_cases(stamps, options, console)
    return code


def _paths(options: TestOptions) -> list[Path]:
    return options.paths or [Path()]


def _cases(options: TestOptions) -> list[Case]:
    files = find_scenarios(_paths(options))
    return select(files, options.expression, options.seed, options.repeat)


def _changed_cases(stamps: Stamps, options: TestOptions, console: Console) -> list[Case]:
    """Wait for a change, and read the scenarios; print why that fails, and wait for the next change."""
    shown = ""
    while True:
        time.sleep(_POLL_S)
        try:
            if stamps.poll(find_scenarios(_paths(options))):
                forget_controllers()
                return _cases(options)
        except (ConfigError, CliError) as error:
            if str(error) != shown:
                shown = str(error)
                console.print(f"gcs: {error}", style="red", markup=False, soft_wrap=True)


def _fly(pool: Pool, cases: Sequence[Case], options: TestOptions, console: Console) -> Run:
    began_s = time.monotonic()
    wanted = Wanted(figures=options.report is not None, files=True)
    display = make_display(console, cases)
    collected = _Collected(cases, display, FailureFiles(options.keep))
    interrupted = False
    try:
        with contextlib.closing(pool.fly(cases, wanted, stops_at_failure=options.exitfirst)) as messages:
            for message in messages:
                if isinstance(message, Started):
                    display.start(cases[message.case])
                elif isinstance(message, Finished):
                    collected.add(message)
                elif isinstance(message, Notice):
                    collected.note(message.line)
                else:
                    display.tick()
    except KeyboardInterrupt:
        interrupted = True
    finally:
        collected.show_rest()
        display.close()
    rows = collected.rows(options.exitfirst)
    wall_s = time.monotonic() - began_s
    return Run(rows, len(cases), wall_s, interrupted, min(pool.jobs, len(cases)))


class _Collected:
    """The results so far; they are shown in the order of the cases."""

    def __init__(self, cases: Sequence[Case], display: Display, files: FailureFiles) -> None:
        self._cases, self._display, self._files = cases, display, files
        self._rows: dict[int, Row] = {}
        self._shown = 0
        self._has_noted = False

    def add(self, message: Finished) -> None:
        """Add a result, and write its files if it failed."""
        case = self._cases[message.case]
        result = message.result or not_flown(message.reason)
        kept = None
        try:
            kept = self._files.write(case, result)
        except (OSError, CliError) as error:
            self._display.note(f"gcs: the log of {case.name} is not kept: {error}")
        self._rows[message.case] = Row(case, replace(result, log=b"", report=""), kept)
        self._display.end(case)
        while self._shown in self._rows:
            self._show(self._shown)
            self._shown += 1

    def note(self, line: str) -> None:
        """Show the first line about compilation: each worker has the same."""
        if not self._has_noted:
            self._has_noted = True
            self._display.note(line)

    def show_rest(self) -> None:
        """Show the results behind one that is missing, after an interruption."""
        for index in sorted(self._rows):
            if index >= self._shown:
                self._show(index)

    def _show(self, index: int) -> None:
        self._display.finish(self._rows[index].case, self._rows[index].result)

    def rows(self, stops_at_failure: bool) -> tuple[Row, ...]:
        """Return the results in the order of the cases, with ``stops_at_failure`` up to the first failure."""
        ordered = [self._rows[index] for index in sorted(self._rows)]
        failed = [index for index, row in enumerate(ordered) if not row.result.passed]
        return tuple(ordered[: failed[0] + 1] if stops_at_failure and failed else ordered)


def _write(run: Run, options: TestOptions) -> None:
    """Write page and JUnit file; raise OSError."""
    if options.junit is not None:
        write_bytes_atomically(options.junit, junit_xml(run.rows, run.wall_s))
    if options.report is not None:
        write_text_atomically(options.report, render_results(run.rows, run.wall_s, run.interrupted))


def _print(run: Run, options: TestOptions, console: Console) -> None:
    print_failures(console, run.rows)
    print_summary(console, run.rows, run.jobs, run.wall_s)
    if options.report is not None:
        console.print(f"report: {options.report}", markup=False, highlight=False, soft_wrap=True)


def _check_complete(run: Run) -> None:
    if run.interrupted:
        raise CliError(f"interrupted: {len(run.rows)} of {run.total} flights were flown", INTERRUPTED)
