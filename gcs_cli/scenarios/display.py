"""Progress of a run of scenarios: a live region on a terminal, else a line for each flight."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Protocol

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.spinner import Spinner
from rich.table import Table
from rich.text import Text

from gcs_cli.fly.fly_display import before_echo, draws_bars
from gcs_cli.scenarios.result import Result, Row, summary_text
from gcs_cli.scenarios.selection import Case

_MOST_SHOWN = 12
"""Flights under way that the live region lists."""
_WALL_COLUMNS = 8
_VERDICTS = {True: ("PASS", "green"), False: ("FAIL", "bold red")}


class Display(Protocol):
    """Shows flights as they begin and end."""

    def start(self, case: Case) -> None:
        """A flight begins."""

    def finish(self, case: Case, result: Result) -> None:
        """A flight is over; called in the order of the cases."""

    def end(self, case: Case) -> None:
        """A flight is over; called at once."""

    def note(self, line: str) -> None:
        """Show a line."""

    def tick(self) -> None:
        """Redraw what changes with time."""

    def close(self) -> None:
        """Restore the terminal."""


def make_display(console: Console, cases: Sequence[Case]) -> Display:
    """Return the display for the output of ``console``."""
    return LiveDisplay(console, cases) if draws_bars(console) else LineDisplay(console, cases)


class _Lines:
    """One line for each flight, in columns."""

    def __init__(self, cases: Sequence[Case]) -> None:
        self._label = max((len(case.label) for case in cases), default=0)
        self._seed = max((len(str(case.seed)) for case in cases), default=0)

    def of(self, case: Case, result: Result, width: int | None = None) -> Text:
        """Return the line of a flight, cut off at ``width``."""
        word, style = _VERDICTS[result.passed]
        line = Text(no_wrap=True, overflow="ellipsis")
        line.append(word, style)
        line.append(f"  {case.label:{self._label}}  seed {case.seed:<{self._seed}}  ")
        summary = summary_text(result)
        room = None if width is None else max(10, width - line.cell_len - _WALL_COLUMNS)
        if room is not None and len(summary) > room:
            summary = summary[: room - 1] + "…"
        line.append(summary if room is None else f"{summary:{room}}", "" if result.passed else "red")
        line.append(f"  {result.wall_s:.1f} s", "bright_black")
        return line


class LineDisplay:
    """A line for each flight that is over."""

    def __init__(self, console: Console, cases: Sequence[Case]) -> None:
        self._console = console
        self._lines = _Lines(cases)

    def start(self, case: Case) -> None:
        """Show nothing."""

    def finish(self, case: Case, result: Result) -> None:
        """Print the line of the flight."""
        self._console.print(self._lines.of(case, result), soft_wrap=True)

    def end(self, case: Case) -> None:
        """Show nothing."""

    def note(self, line: str) -> None:
        """Print the line."""
        self._console.print(line, markup=False, soft_wrap=True)

    def tick(self) -> None:
        """Show nothing."""

    def close(self) -> None:
        """Do nothing."""


class LiveDisplay:
    """The lines of the flights that are over, and below them a bar and the flights under way."""

    def __init__(self, console: Console, cases: Sequence[Case]) -> None:
        self._lines = _Lines(cases)
        self._total = len(cases)
        self._over = self._failed = 0
        self._flying: dict[str, tuple[Case, float, Spinner]] = {}
        self._began_s = time.monotonic()
        self._live = Live(console=console, auto_refresh=False, transient=True)
        self._live.start()
        self.tick()

    def start(self, case: Case) -> None:
        """Add the flight to those under way."""
        self._flying[case.name] = (case, time.monotonic(), Spinner("dots"))
        self.tick()

    def end(self, case: Case) -> None:
        """Remove the flight from those under way."""
        self._flying.pop(case.name, None)
        self._over += 1
        self.tick()

    def finish(self, case: Case, result: Result) -> None:
        """Print the line of the flight above the live region."""
        self._failed += not result.passed
        self._live.console.print(self._lines.of(case, result, self._live.console.width))

    def note(self, line: str) -> None:
        """Print the line above the live region."""
        self._live.console.print(Text(line, style="yellow"), soft_wrap=True)

    def tick(self) -> None:
        """Redraw the live region."""
        now_s = time.monotonic()
        rows: list[RenderableType] = [self._bar(now_s)]
        for case, began_s, spinner in list(self._flying.values())[:_MOST_SHOWN]:
            words = f"{case.label} seed {case.seed}  {now_s - began_s:.1f} s"
            row = Table.grid(padding=(0, 1))
            row.add_row(spinner.render(now_s), Text(words, no_wrap=True, overflow="ellipsis"))
            rows.append(row)
        self._live.update(before_echo(Group(*rows), self._live.console), refresh=True)

    def _bar(self, now_s: float) -> RenderableType:
        grid = Table.grid(padding=(0, 1), expand=True)
        grid.add_column(no_wrap=True)
        grid.add_column(ratio=1)
        grid.add_column(no_wrap=True)
        failed = f"{self._failed} failed  " if self._failed else ""
        grid.add_row(
            Text(f"{self._over} of {self._total} flights", "bold"),
            ProgressBar(self._total, self._over, complete_style="red" if self._failed else "green"),
            Text.assemble((failed, "bold red"), f"{now_s - self._began_s:.1f} s"),
        )
        return grid

    def close(self) -> None:
        """Remove the live region."""
        self._live.stop()


def print_failures(console: Console, rows: Sequence[Row]) -> None:
    """Print each flight that failed: its expectations, the values around, and the command that repeats it."""
    for row in (row for row in rows if not row.result.passed):
        _print(console, Text(f"\n{row.case.label}, seed {row.case.seed}", "bold red"))
        _print_outcome(console, row.result)
        for check in row.result.failures:
            first, *others = str(check).splitlines()
            _print(console, Text(f"  {first}"))
            for line in others:
                _print(console, Text(f"    {line}", "bold" if line.startswith(">") else "bright_black"))
        _print_events(console, row.result)
        if row.kept is not None:
            _print(console, Text(f"  log and report: {row.kept}"))
        _print(console, Text(f"  repeat: {row.case.command}"))


def _print_outcome(console: Console, result: Result) -> None:
    """Print the outcome, unless a failure has it."""
    is_told = any(result.outcome_text in check.found for check in result.failures)
    if result.outcome_text and not is_told:
        _print(console, Text(f"  {result.outcome}: {result.outcome_text}", "bright_black"))


def _print_events(console: Console, result: Result) -> None:
    """Print the events around the first violation, or the last ones."""
    if not result.nearest:
        return
    at_s = result.violated_s
    _print(console, Text("  last events:" if at_s is None else f"  events around t = {at_s:.2f} s:"))
    for time_s, text in result.nearest:
        _print(console, Text(f"  {time_s:7.2f} s  {text}", "bright_black"))


def print_summary(console: Console, rows: Sequence[Row], jobs: int, wall_s: float) -> None:
    """Print how many flights passed."""
    failed = sum(not row.result.passed for row in rows)
    parts = [(f"{len(rows) - failed} passed", "green" if not failed else "")]
    if failed:
        parts.insert(0, (f"{failed} failed", "bold red"))
    words = Text(", ").join(Text(*part) for part in parts)
    words.append(f" in {wall_s:.1f} s on {jobs} {'process' if jobs == 1 else 'processes'}")
    _print(console, Text("\n") + words if failed else words)


def _print(console: Console, text: Text) -> None:
    console.print(text, soft_wrap=True)
