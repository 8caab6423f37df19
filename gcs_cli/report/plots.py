"""A card of a page as HTML, for the paper's report."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape


def section(title: str, body: str, legend: Sequence[tuple[str, str, bool]] = (), note: str = "") -> str:
    """Return a card; the legend's entries are label, style and whether the line is dashed."""
    entries = "".join(
        f'<span class="{style}"><i class="{"dashed" if dashed else ""}"></i>{escape(label)}</span>'
        for label, style, dashed in legend
    )
    head = f'<div class="head"><h2>{escape(title)}</h2><div class="legend">{entries}</div></div>'
    foot = f'<p class="note">{escape(note)}</p>' if note else ""
    return f"<section>{head}{body}{foot}</section>"
