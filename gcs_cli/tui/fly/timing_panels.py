"""Loop timing in the terminal view: rates, execution time, lateness and overruns. Pure."""

from __future__ import annotations

from rich.text import Text

from gcs_cli.tui.fly.panels import bar
from gcs_cli.tui.palette import Palette
from gcs_cli.vehicle.field_units import UNKNOWN, number
from gcs_cli.vehicle.view_types import LoopTiming, VehicleView


def timing_panel(view: VehicleView, _now_s: float, width: int, height: int, colours: Palette) -> list[Text]:
    """Draw the timing of the loops; on three lines without room for a table."""
    timing = view.timing
    if timing is None:
        return [Text("not sent by this vehicle", colours.muted)]
    period_us = 1e6 / timing.inner_hz if timing.inner_hz else None
    lines = [_rates(timing, colours)]
    if height >= 4 + len(_times(timing)):
        lines.append(Text(f"{'µs':<5}{'mean':>8}{'p99':>8}{'max':>8}", colours.muted))
        for name, figures in _times(timing):
            line = Text(f"{name:<5}", colours.muted, no_wrap=True)
            for value in figures:
                line.append(f"{number(value, 0):>8}", _time_style(value, period_us, colours))
            lines.append(line)
        lines.append(_load(timing, period_us, width, colours))
    else:
        line = Text("", no_wrap=True, overflow="crop")
        for name, figures in _times(timing):
            line.append(f"{name} ", colours.muted)
            for index, value in enumerate(figures):
                line.append(("/" if index else "") + number(value, 0), _time_style(value, period_us, colours))
            line.append(" ")
        lines.append(line.append("µs", colours.muted))
    lines.append(_counts(timing, colours))
    return lines[:height]


def _times(timing: LoopTiming) -> list[tuple[str, tuple[float | None, ...]]]:
    run = (timing.execution_mean_us, timing.execution_p99_us, timing.execution_max_us)
    late = (timing.lateness_mean_us, timing.lateness_p99_us, timing.lateness_max_us)
    return [("run", run)] if timing.lockstep else [("run", run), ("late", late)]


def _load(timing: LoopTiming, period_us: float | None, width: int, colours: Palette) -> Text:
    mean = timing.execution_mean_us
    share = None if mean is None or period_us is None else mean / period_us
    load = Text("load ", colours.muted, no_wrap=True)
    load.append_text(bar(share, max(4, width - 13), colours.good, colours.muted))
    return load.append(f" {UNKNOWN if share is None else f'{share:.1%}':>6}", f"bold {colours.text}")


def _rates(timing: LoopTiming, colours: Palette) -> Text:
    text = Text(no_wrap=True, overflow="crop")
    text.append(f"{number(timing.inner_hz, 0)}/{number(timing.outer_hz, 0)} Hz", f"bold {colours.text}")
    text.append(" lockstep" if timing.lockstep else " real time", colours.muted)
    if timing.real_time_factor is not None:
        text.append(f" ×{timing.real_time_factor:.1f}", f"bold {colours.text}")
    return text


def _counts(timing: LoopTiming, colours: Palette) -> Text:
    text = Text(no_wrap=True, overflow="crop")
    if timing.lockstep:
        return text.append("ticks ", colours.muted).append(f"{timing.ticks}", f"bold {colours.text}")
    text.append("overruns ", colours.muted)
    text.append(f"{timing.overruns}", f"bold {colours.warning if timing.overruns else colours.text}")
    text.append(" missed ", colours.muted)
    text.append(f"{timing.missed}", f"bold {colours.bad if timing.missed else colours.text}")
    return text.append(f" of {timing.ticks}", colours.muted)


def _time_style(value_us: float | None, period_us: float | None, colours: Palette) -> str:
    if value_us is None or period_us is None or value_us < 0.5 * period_us:
        return f"bold {colours.text}"
    return f"bold {colours.warning if value_us < period_us else colours.bad}"
