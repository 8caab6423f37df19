"""A histogram of costs as SVG text. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterator
from html import escape
from itertools import pairwise

from gcs_cli.pil.profile import STAGE_TITLES, StageProfile
from gcs_cli.report.svg import Scale, nice_ticks, rectangle, segment, text, tick_text, upright_text

_WIDTH, _HEIGHT = 470, 190
_LEFT, _RIGHT, _TOP, _BOTTOM = 56, 22, 26, 36
_TICKS = 4
_SMALLEST_BAR = 1.5
"""Pixels: a step that came once in ten thousand is seen too."""


def histogram_chart(profile: StageProfile, unit: str, style: str) -> str:
    """Return the histogram of one stage; ``unit`` is that of its costs."""
    low, high = profile.edges[0], profile.edges[-1]
    most = 100.0 * max(profile.counts) / profile.steps
    share = Scale(0.0, _full(most), _HEIGHT - _BOTTOM, _TOP)
    x = Scale(low, high, _LEFT, _WIDTH - _RIGHT)
    title = STAGE_TITLES[profile.stage]
    return "".join(
        (
            f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" aria-label="{escape(title)}">',
            *_axes(x, share, unit),
            *_bars(profile, x, share, style),
            text("bar-title", _LEFT, 15, title),
            "</svg>",
        )
    )


def _full(most: float) -> float:
    """Return where the axis of shares ends: at the tick above the tallest bar, or at all."""
    step = nice_ticks(0.0, most, _TICKS)[1]
    return min(100.0, step * math.ceil(most / step - 1e-9))


def _axes(x: Scale, share: Scale, unit: str) -> Iterator[str]:
    bottom, right = _HEIGHT - _BOTTOM, _WIDTH - _RIGHT
    for value in nice_ticks(0.0, share.high, _TICKS):
        at = share.pixel(value)
        yield segment("grid", _LEFT, at, right, at)
        yield text("tick y", _LEFT - 6, at + 4, tick_text(value))
    for value in nice_ticks(x.low, x.high, 6):
        if value == int(value):  # a bin may be one unit wide, and between units there is nothing
            yield text("tick x", x.pixel(value), bottom + 16, tick_text(value))
    yield segment("axis", _LEFT, bottom, right, bottom)
    yield upright_text("label", 13, 0.5 * (_TOP + bottom), "share of steps [%]")
    yield text("label", 0.5 * (_LEFT + right), _HEIGHT - 4, f"cost of a step [{unit}]" if unit else "")


def _bars(profile: StageProfile, x: Scale, share: Scale, style: str) -> Iterator[str]:
    bottom = _HEIGHT - _BOTTOM
    for (left, right), count in zip(pairwise(profile.edges), profile.counts, strict=True):
        if not count:
            continue
        height = max(_SMALLEST_BAR, bottom - share.pixel(100.0 * count / profile.steps))
        width = max(1.0, x.pixel(right) - x.pixel(left) - 1.0)
        hint = f"{_span(left, right)}: {count} of {profile.steps} steps"
        bar = rectangle(f"bar {style}", x.pixel(left) + 0.5, bottom - height, width, height)
        yield bar.replace("/>", f"><title>{escape(hint)}</title></rect>")


def _span(left: float, right: float) -> str:
    first, last = int(left + 0.5), int(right - 0.5)
    return f"{first}" if first == last else f"{first} to {last}"
