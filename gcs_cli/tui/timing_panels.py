"""Loop timing in the terminal view: a panel, or one line without room for it. Pure."""

from __future__ import annotations

from rich.console import Group
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from gcs_cli.tui.panels import UNKNOWN, bar, framed, number
from gcs_cli.vehicle.view_types import LoopTiming


def timing_panel(timing: LoopTiming | None, width: int) -> Panel:
    """Loop rates, execution time over the period, lateness and overruns."""
    if timing is None:
        return framed("Loops", Text("no timing yet", style="bright_black"))
    grid = Table.grid(padding=(0, 1))
    grid.add_column(style="bright_black")
    for _ in range(3):
        grid.add_column(justify="right", no_wrap=True, min_width=6)
    grid.add_row("µs", *(Text(name, style="bright_black") for name in ("mean", "p99", "max")))
    period_us = 1e6 / timing.inner_hz if timing.inner_hz else None
    for name, figures in _times(timing):
        grid.add_row(name, *(Text(number(v, 0), style=_time_style(v, period_us)) for v in figures))
    mean = timing.execution_mean_us
    share = None if mean is None or period_us is None else mean / period_us
    load = Text("load ", style="bright_black", no_wrap=True)
    load.append_text(bar(share, max(4, width - 15), "green"))
    load.append(f" {UNKNOWN if share is None else f'{share:.1%}':>5}", style="bold")
    return framed("Loops", Group(_rates(timing), grid, load, _counts(timing)))


def timing_line(timing: LoopTiming | None) -> Panel:
    """The same on one line; in real time it shows lateness instead of the clock."""
    if timing is None:
        return framed("Loops", Text("no timing yet", style="bright_black"))
    period_us = 1e6 / timing.inner_hz if timing.inner_hz else None
    line = _rates(timing, with_clock=timing.lockstep)
    for name, figures in _times(timing):
        line.append(f"  {name} ", style="bright_black")
        for index, value in enumerate(figures):
            line.append(("/" if index else "") + number(value, 0), style=_time_style(value, period_us))
    line.append(" µs  ", style="bright_black")
    line.append_text(_counts(timing, with_ticks=timing.lockstep))
    return framed("Loops", line)


def _times(timing: LoopTiming) -> list[tuple[str, tuple[float | None, ...]]]:
    run = (timing.execution_mean_us, timing.execution_p99_us, timing.execution_max_us)
    late = (timing.lateness_mean_us, timing.lateness_p99_us, timing.lateness_max_us)
    return [("run", run)] if timing.lockstep else [("run", run), ("late", late)]


def _rates(timing: LoopTiming, with_clock: bool = True) -> Text:
    text = Text(no_wrap=True, overflow="ellipsis")
    text.append(f"{number(timing.inner_hz, 0)}/{number(timing.outer_hz, 0)} Hz", style="bold")
    if not with_clock:
        return text
    text.append(" lockstep" if timing.lockstep else " real time")
    if timing.real_time_factor is not None:
        text.append(f" ×{timing.real_time_factor:.1f}", style="bold")
    return text


def _counts(timing: LoopTiming, with_ticks: bool = True) -> Text:
    text = Text("overruns ", style="bright_black", no_wrap=True, overflow="ellipsis")
    text.append(f"{timing.overruns}", style="bold yellow" if timing.overruns else "bold")
    if not timing.lockstep:
        text.append(" missed ")
        text.append(f"{timing.missed}", style="bold red" if timing.missed else "bold")
    if with_ticks:
        text.append(f" of {timing.ticks}")
    return text


def _time_style(value_us: float | None, period_us: float | None) -> str:
    if value_us is None or period_us is None or value_us < 0.5 * period_us:
        return "bold"
    return "bold yellow" if value_us < period_us else "bold red"
