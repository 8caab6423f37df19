"""What an application on Textual shows, as lines of text."""

from __future__ import annotations

from typing import Any

from textual.app import App


def shown(app: App[Any]) -> list[str]:
    """Return the lines of the visible screen without trailing blanks."""
    strips = app.screen._compositor.render_strips()
    return ["".join(segment.text for segment in strip).rstrip() for strip in strips]
