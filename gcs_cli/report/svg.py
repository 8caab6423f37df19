"""The elements of a chart as SVG text: scales, ticks, lines and labels. Colours come from the style sheet."""

from __future__ import annotations

import math
from html import escape
from typing import NamedTuple

import numpy as np

from flightstack.core.contract import FloatArray

WIDTH = 960


class Scale(NamedTuple):
    """Maps data in [low, high] to pixels in [start, end]; logarithmic if ``log``."""

    low: float
    high: float
    start: float
    end: float
    log: bool = False

    def pixels(self, values: FloatArray) -> FloatArray:
        """Return the pixels of an array of values."""
        if self.log:
            share = np.log(np.maximum(values, 1e-12) / self.low) / math.log(self.high / self.low)
        else:
            share = (values - self.low) / (self.high - self.low)
        return self.start + share * (self.end - self.start)

    def pixel(self, value: float) -> float:
        """Return the pixel of one value."""
        return float(self.pixels(np.array([value]))[0])


def nice_ticks(low: float, high: float, count: int) -> list[float]:
    """Return about ``count`` round values from ``low`` to ``high``, steps 1, 2 or 5 times a power of ten."""
    raw = (high - low) / max(count, 1)
    power = 10.0 ** math.floor(math.log10(raw))
    step = next((factor * power for factor in (1.0, 2.0, 5.0) if factor * power >= raw), 10.0 * power)
    return multiples(step, low, high)


def multiples(step: float, low: float, high: float) -> list[float]:
    """Return the multiples of ``step`` from ``low`` to ``high``."""
    return [index * step for index in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)]


def decade_ticks(low: float, high: float) -> list[float]:
    """Return the powers of ten from ``low`` to ``high``."""
    first, last = math.ceil(math.log10(low) - 1e-9), math.floor(math.log10(high) + 1e-9)
    return [10.0**power for power in range(first, last + 1)]


def tick_text(value: float) -> str:
    """Return a short label with a true minus sign; zero has none."""
    return f"{value + 0.0:.6g}".replace("-", "−")


def polyline(x: FloatArray, y: FloatArray, style: str) -> str:
    """Return a path through points in pixels."""
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x.tolist(), y.tolist(), strict=True))
    return f'<path class="line {style}" d="M{points}"/>' if points else ""


def segment(style: str, x1: float, y1: float, x2: float, y2: float) -> str:
    """Return a straight line."""
    return f'<line class="{style}" x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}"/>'


def rectangle(style: str, x: float, y: float, width: float, height: float) -> str:
    """Return a rectangle from its upper left corner."""
    return f'<rect class="{style}" x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}"/>'


def circle(style: str, x: float, y: float, radius: float, hint: str = "") -> str:
    """Return a circle, with a text to show when pointed at."""
    title = f"<title>{escape(hint)}</title>" if hint else ""
    return f'<circle class="{style}" cx="{x:.1f}" cy="{y:.1f}" r="{radius:.1f}">{title}</circle>'


def text(style: str, x: float, y: float, content: str) -> str:
    """Return a text at a point; the style decides on which side of it."""
    return f'<text class="{style}" x="{x:.1f}" y="{y:.1f}">{escape(content)}</text>'


def upright_text(style: str, x: float, y: float, content: str) -> str:
    """Return a text that reads upwards."""
    place = f"translate({x:.1f} {y:.1f}) rotate(-90)"
    return f'<text class="{style}" transform="{place}">{escape(content)}</text>'
