"""Display of ``gcs fly`` in flight: a bar on a terminal, else lines."""

from __future__ import annotations

import time
from typing import Any, Protocol

from rich.console import Console, RenderableType
from rich.constrain import Constrain
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.spinner import Spinner
from rich.table import Table
from rich.text import Text

from flightstack.core.enums import Severity
from flightstack.process.console import drop, lose
from gcs_cli.fly.flight import Flight, Phase
from gcs_cli.tui.fly.panels import clock_text
from gcs_cli.tui.watch_lines import text_line
from gcs_cli.vehicle.view_types import StatusText

_FRAME_S = 0.1
_ECHO = 5
"""Columns of ^C, twice, and of the cursor."""
_WITH_BAR, _WITH_PLACE = 60, 90  # columns of the terminal


class FlyConsole(Console):
    """A console that stops printing after a broken pipe or on a full disk, so that the flight continues.

    ``check_output`` reports a full disk at the program's end.
    """

    def __init__(self, **settings: Any) -> None:
        """Words between colons, as in the notation of faults, are no names of pictures."""
        super().__init__(emoji=False, **settings)

    def print(self, *objects: Any, **options: Any) -> None:
        """Print; stop printing after an error."""
        try:
            super().print(*objects, **options)
        except OSError as error:
            lose(self.file, error)
            self.quiet = True

    def on_broken_pipe(self) -> None:
        """Discard all further output."""
        self.quiet = True
        drop(self.file)


class Display(Protocol):
    """Shows the progress of a flight."""

    def update(self, flight: Flight) -> None:
        """Show the state of the flight."""

    def note(self, line: str) -> None:
        """Show a warning or a progress line of simulator or flight stack."""

    def close(self) -> None:
        """Restore the terminal."""


def make_display(console: Console) -> Display:
    """Return the display for the output of ``console``."""
    return BarDisplay(console) if draws_bars(console) else LineDisplay(console)


def draws_bars(console: Console) -> bool:
    """Return True if ``console`` writes to a terminal that can redraw a line."""
    return console.is_terminal and not console.is_dumb_terminal


def before_echo(shown: RenderableType, console: Console) -> Constrain:
    """Leave columns free on the right, where the terminal echoes ^C: in a new line, the live one would stay."""
    return Constrain(shown, max(1, console.width - _ECHO))


class _NewTexts:
    """Status texts not shown yet, without those that a shutdown in flight causes."""

    def __init__(self) -> None:
        self._seen = 0
        self._ended = False

    def of(self, flight: Flight) -> tuple[StatusText, ...]:
        """Return the new texts."""
        new = () if self._ended else flight.view.texts_since(self._seen)
        self._seen = flight.view.text_count
        self._ended = flight.outcome is not None
        return new


class BarDisplay:
    """One live line: phase, waypoint, position, real-time factor."""

    def __init__(self, console: Console) -> None:
        self._live = Live(console=console, auto_refresh=False, transient=True)
        self._live.start()
        self._spinner = Spinner("dots")
        self._due_s = 0.0
        self._texts = _NewTexts()

    def update(self, flight: Flight) -> None:
        """Redraw, at most ten times a second."""
        for entry in self._texts.of(flight):
            if entry.severity <= Severity.WARNING:
                self._live.console.print(Text(text_line(entry), style="yellow"))
        now_s = time.monotonic()
        if now_s >= self._due_s:
            self._due_s = now_s + _FRAME_S
            width = self._live.console.width
            self._live.update(
                before_echo(progress(flight, now_s, self._spinner, width - _ECHO), self._live.console),
                refresh=True,
            )

    def note(self, line: str) -> None:
        """Print the line above the live one."""
        self._live.console.print(Text(line, style="yellow"), soft_wrap=True)

    def close(self) -> None:
        """Remove the line."""
        self._live.stop()


class LineDisplay:
    """A line for each change of phase, mode or item, and for each status text."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._before = ""
        self._texts = _NewTexts()

    def update(self, flight: Flight) -> None:
        """Print changes."""
        for entry in self._texts.of(flight):
            self._print(text_line(entry))
        words = f"{phase_words(flight)}{item_words(flight)}"
        if words != self._before:
            self._before = words
            self._print("  ".join(part for part in (words, place_words(flight), speed_words(flight)) if part))

    def note(self, line: str) -> None:
        """Print the line."""
        self._print(line)

    def _print(self, text: str) -> None:
        self._console.print(text, markup=False, highlight=False, soft_wrap=True)

    def close(self) -> None:
        """Do nothing."""


def progress(flight: Flight, now_s: float, spinner: Spinner, width: int) -> RenderableType:
    """Return the live line; a narrow terminal shows only its first parts."""
    done, total = _share(flight)
    bar = ProgressBar(total=max(1, total), completed=done, complete_style="green")
    item = Text(item_words(flight).strip(), style="bold")
    parts: list[RenderableType] = [spinner.render(now_s), Text(phase_words(flight), style="bold cyan")]
    if width >= _WITH_BAR:
        parts.append(bar)
    parts.append(item)
    if width >= _WITH_PLACE:
        parts.append(Text(place_words(flight)))
    parts.append(Text(speed_words(flight), style="cyan"))
    grid = Table.grid(padding=(0, 1), expand=True)
    for part in parts:
        grid.add_column(no_wrap=True, ratio=1 if part is bar else None)
    grid.add_row(*parts)
    return grid


def _share(flight: Flight) -> tuple[float, float]:
    if flight.phase is Phase.UPLOAD:
        return flight.upload_progress
    mission = flight.view.mission
    total = mission.total or 0
    if flight.phase is not Phase.FLY:
        return (total, total) if flight.began_s is not None else (0, total)
    return (total if mission.complete else mission.current or 0), total


def phase_words(flight: Flight) -> str:
    """Return the mode in flight, else the phase."""
    if flight.is_over and flight.outcome is not None and not flight.outcome.completed:
        return "flight ended"
    return flight.view.mode or "flying" if flight.phase is Phase.FLY else flight.phase.value


def item_words(flight: Flight) -> str:
    """Return the current item."""
    mission = flight.view.mission
    if flight.phase is not Phase.FLY or mission.complete or not mission.item_text:
        return ""
    return f"  {mission.item_text}"


def place_words(flight: Flight) -> str:
    """Return the position of the vehicle."""
    position = flight.view.position_ned_m
    if flight.phase is not Phase.FLY or position is None:
        return ""
    north, east, up = (round(value, 1) + 0.0 for value in (position.x, position.y, -position.z))  # no -0.0
    return f"N {north:+6.1f} E {east:+6.1f} up {up:5.1f} m"


def speed_words(flight: Flight) -> str:
    """Return the vehicle's clock, as status texts have it, and the real-time factor."""
    if flight.phase is not Phase.FLY or flight.flown_s is None:
        return ""
    words = f"t {clock_text(flight.view.time_s)}"
    factor = flight.real_time_factor
    return words if factor is None else f"{words} ×{factor:5.1f}"
