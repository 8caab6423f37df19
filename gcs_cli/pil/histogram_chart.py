"""A histogram of costs as SVG text. Pure."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape
from itertools import pairwise

from gcs_cli.pil.profile import STAGE_TITLES, StageProfile
from gcs_cli.report_svg import Scale, nice_ticks, rectangle, segment, text, tick_text

_WIDTH, _HEIGHT = 470, 190
_LEFT, _RIGHT, _TOP, _BOTTOM = 56, 22, 26, 36
_SMALLEST_BAR = 1.5
"""Pixels: a step that came once in ten thousand is seen too."""


def histogram_chart(profile: StageProfile, unit: str, style: str) -> str:
    """Return the histogram of one stage; ``unit`` is that of its costs."""
    low, high = profile.edges[0], profile.edges[-1]
    share = Scale(0.0, 100.0 * max(profile.counts) / profile.steps, _HEIGHT - _BOTTOM, _TOP)
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


def _axes(x: Scale, share: Scale, unit: str) -> Iterator[str]:
    bottom, right = _HEIGHT - _BOTTOM, _WIDTH - _RIGHT
    for value in nice_ticks(0.0, share.high, 4):
        at = share.pixel(value)
        yield segment("grid", _LEFT, at, right, at)
        yield text("tick y", _LEFT - 6, at + 4, f"{tick_text(value)} %")
    for value in nice_ticks(x.low, x.high, 6):
        if value == int(value):  # a bin may be one unit wide, and between units there is nothing
            yield text("tick x", x.pixel(value), bottom + 16, tick_text(value))
    yield segment("axis", _LEFT, bottom, right, bottom)
    yield text("label", 0.5 * (_LEFT + right), _HEIGHT - 4, f"[{unit}]" if unit else "")


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
