"""Themes of our own: the colours of ``palette``, dark and light."""

from __future__ import annotations

from textual.theme import Theme

from gcs_cli.tui.palette import DARK, LIGHT, Palette


def _theme(name: str, colours: Palette, dark: bool) -> Theme:
    return Theme(
        name=name,
        primary=colours.accent,
        secondary=colours.target,
        accent=colours.accent,
        success=colours.good,
        warning=colours.warning,
        error=colours.bad,
        foreground=colours.text,
        background=colours.background,
        surface=colours.surface,
        panel=colours.surface,
        dark=dark,
    )


THEMES = (_theme("gcs-dark", DARK, dark=True), _theme("gcs-light", LIGHT, dark=False))
