"""Values of the last minutes as small curves of block characters. Pure."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.text import Text

from gcs_cli.tui.fly.history import Series
from gcs_cli.tui.palette import Palette
from gcs_cli.vehicle.field_units import number

WINDOW_S = 120.0
_BLOCKS = np.array(list(" ▁▂▃▄▅▆▇█"))


class Trend(NamedTuple):
    """A field of telemetry: its title, unit and the factor to that unit."""

    title: str
    field: str
    unit: str
    factor: float = 1.0
    smallest_span: float = 1.0
    """Range of the curve of a constant value."""


TRENDS = (
    Trend("altitude", "GLOBAL_POSITION_INT.relative_alt", "m", 1e-3),
    Trend("ground speed", "VFR_HUD.groundspeed", "m/s"),
    Trend("climb", "VFR_HUD.climb", "m/s"),
    Trend("roll", "ATTITUDE.roll", "°", 180 / np.pi, 10.0),
    Trend("pitch", "ATTITUDE.pitch", "°", 180 / np.pi, 10.0),
    Trend("throttle", "VFR_HUD.throttle", "%", smallest_span=20.0),
    Trend("battery", "SYS_STATUS.voltage_battery", "V", 1e-3),
)


def trends_panel(
    series: Callable[[str], Series], now_s: float, width: int, height: int, colours: Palette
) -> list[Text]:
    """Draw as many trends as ``height`` holds, each a title and a curve."""
    known = [(trend, found) for trend in TRENDS if len((found := series(trend.field)).values)]
    if not known:
        return [Text("no telemetry yet", colours.muted)]
    shown = known[: max(1, height // 3)]
    rows, rest = divmod(height, len(shown))
    lines: list[Text] = []
    for index, (trend, found) in enumerate(shown):
        values = found.values * trend.factor
        columns = _columns(found.times_s, values, now_s, width)
        low, high = _range(columns, trend.smallest_span)
        title = Text(f"{trend.title} ", colours.muted, no_wrap=True)
        title.append(f"{number(float(values[-1]), 1)} {trend.unit}", f"bold {colours.text}")
        title.append(f"  {number(low, 1)} to {number(high, 1)}", colours.muted)
        lines += [title, *curve(columns, low, high, max(1, rows - 1 + (index < rest)), colours.sky)]
    return lines[:height]


def _columns(
    times_s: NDArray[np.float64], values: NDArray[np.float64], now_s: float, width: int
) -> NDArray[np.float64]:
    """Return the newest value of each column of time; NaN without one."""
    column_s = WINDOW_S / width
    at = np.floor(times_s / column_s).astype(int) - math.floor(now_s / column_s) + width - 1
    columns = np.full(width, np.nan)
    inside = (at >= 0) & (at < width) & np.isfinite(values)
    columns[at[inside]] = values[inside]
    return columns


def _range(columns: NDArray[np.float64], smallest: float) -> tuple[float, float]:
    if not np.isfinite(columns).any():
        return 0.0, smallest
    low, high = float(np.nanmin(columns)), float(np.nanmax(columns))
    lack = max(0.0, smallest - (high - low)) / 2
    return low - lack, high + lack


def curve(columns: NDArray[np.float64], low: float, high: float, rows: int, style: str) -> list[Text]:
    """Draw one value per column as a filled curve between ``low`` and ``high``."""
    eighths = np.nan_to_num((columns - low) / (high - low) * (8 * rows - 1) + 1, nan=0.0).round().astype(int)
    below = 8 * np.arange(rows - 1, -1, -1)[:, None]
    marks = _BLOCKS[np.clip(eighths - below, 0, 8)]
    return [Text("".join(row), style, no_wrap=True) for row in marks.tolist()]
