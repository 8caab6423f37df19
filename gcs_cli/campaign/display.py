"""Progress of a campaign: a live table on a terminal, else a line for each tenth and each failure."""

from __future__ import annotations

import time
from collections.abc import Collection
from typing import Protocol

from rich.console import Console, Group
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from gcs_cli.campaign.rows import Row
from gcs_cli.campaign.statistics import pass_probability, worst
from gcs_cli.fly.fly_display import before_echo, draws_bars
from gcs_cli.tables import new_table

_WORST = 5
"""Flights with the least margin that the live table lists."""


class Display(Protocol):
    """Shows flights as they begin and end."""

    def begin(self, number: int) -> None:
        """A flight begins."""

    def add(self, row: Row) -> None:
        """A flight is over."""

    def lose(self, number: int, reason: str) -> None:
        """A flight ends without a row."""

    def note(self, line: str) -> None:
        """Show a line."""

    def tick(self) -> None:
        """Redraw what changes with time."""

    def close(self) -> None:
        """Restore the terminal."""


def make_display(console: Console, total: int, before: Collection[Row]) -> Display:
    """Return the display of a campaign of ``total`` flights, of which those of ``before`` are over."""
    kind = LiveDisplay if draws_bars(console) else LineDisplay
    return kind(console, total, before)


def inputs_text(row: Row) -> str:
    """Return the inputs of a flight in one line."""
    return ", ".join(
        f"{name} {value:.4g}" if isinstance(value, float) else f"{name} {value}"
        for name, value in row["inputs"].items()
    )


class LineDisplay:
    """A line for each tenth of the flights, and for each that fails."""

    def __init__(self, console: Console, total: int, before: Collection[Row]) -> None:
        self._console = console
        self._over = len(before)
        self._total = max(total, self._over)
        self._failed = sum(not row["passed"] for row in before)
        if before:
            self.note(f"{self._over} of {self._total} flights are over already")

    def begin(self, number: int) -> None:
        """Show nothing."""

    def add(self, row: Row) -> None:
        """Print a failure, and a line at each tenth."""
        self._over += 1
        self._total = max(self._total, self._over)  # a search has about as many
        if not row["passed"]:
            self._failed += 1
            self.note(f"FAIL  flight {row['flight']}: {row['failed'][0]}; {inputs_text(row)}")
        tenths = 10 * self._over // self._total
        if tenths != 10 * (self._over - 1) // self._total:
            self.note(f"{self._over} of {self._total} flights, {self._failed} failed")

    def lose(self, number: int, reason: str) -> None:
        """Print the reason."""
        self.note(f"LOST  flight {number}: {reason}")

    def note(self, line: str) -> None:
        """Print the line."""
        self._console.print(line, markup=False, soft_wrap=True)

    def tick(self) -> None:
        """Show nothing."""

    def close(self) -> None:
        """Do nothing."""


class LiveDisplay:
    """A bar, the pass probability so far, and the flights with the least margins."""

    def __init__(self, console: Console, total: int, before: Collection[Row]) -> None:
        self._over = len(before)
        self._total = max(total, self._over)
        self._failed = sum(not row["passed"] for row in before)
        self._worst = worst(list(before), _WORST)
        self._flying: list[int] = []
        self._began_s, self._flown = time.monotonic(), 0
        self._live = Live(console=console, auto_refresh=False, transient=True)
        self._live.start()
        self.tick()

    def begin(self, number: int) -> None:
        """Add the flight to those under way."""
        self._flying.append(number)
        self.tick()

    def add(self, row: Row) -> None:
        """Count the flight."""
        self._flying.remove(row["flight"])
        self._over, self._flown = self._over + 1, self._flown + 1
        self._total = max(self._total, self._over)
        self._failed += not row["passed"]
        self._worst = worst([*self._worst, row], _WORST)
        self.tick()

    def lose(self, number: int, reason: str) -> None:
        """Remove the flight from those under way, and print the reason above the live table."""
        self._flying.remove(number)
        self.note(f"LOST  flight {number}: {reason}")

    def note(self, line: str) -> None:
        """Print the line above the live table."""
        self._live.console.print(Text(line, style="yellow"), soft_wrap=True)

    def tick(self) -> None:
        """Redraw the live table."""
        shown = Group(self._bar(), self._facts(), self._table())
        self._live.update(before_echo(shown, self._live.console), refresh=True)

    def close(self) -> None:
        """Remove the live table."""
        self._live.stop()

    def _bar(self) -> Table:
        grid = Table.grid(padding=(0, 1), expand=True)
        grid.add_column(no_wrap=True)
        grid.add_column(ratio=1)
        grid.add_column(no_wrap=True)
        passed_s = time.monotonic() - self._began_s
        left = ""
        if self._flown:
            left = f"  {(self._total - self._over) * passed_s / self._flown:.0f} s left"
        grid.add_row(
            Text(f"{self._over} of {self._total} flights", "bold"),
            ProgressBar(self._total, self._over, complete_style="red" if self._failed else "green"),
            Text(f"{passed_s:.0f} s{left}"),
        )
        return grid

    def _facts(self) -> Text:
        flying = ", ".join(map(str, self._flying)) or "none"
        words = f"in flight: {flying}"
        if self._over:
            passes = pass_probability(self._over - self._failed, self._over)
            words = f"{self._failed} failed, pass probability {passes}; {words}"
        return Text(words, no_wrap=True, overflow="ellipsis")

    def _table(self) -> Table:
        table = new_table()
        table.expand = True
        table.add_column("flight", no_wrap=True)
        table.add_column("margin", no_wrap=True)
        table.add_column("closest expectation", no_wrap=True, overflow="ellipsis", max_width=32)
        table.add_column("inputs", no_wrap=True, overflow="ellipsis", ratio=1)  # the others stay whole
        for row in self._worst:
            style = "" if row["passed"] else "red"
            margin = f"{100.0 * row['robustness']:.1f} %"
            table.add_row(str(row["flight"]), margin, row["closest"] or "", inputs_text(row), style=style)
        return table
