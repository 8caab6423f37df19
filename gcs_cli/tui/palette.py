"""Colours of the drawing, taken from the theme of the application. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple


class Palette(NamedTuple):
    """Colours by role, as ``#rrggbb``."""

    text: str = "#e6e6e6"
    muted: str = "#8a94a6"
    accent: str = "#5fd7ff"
    good: str = "#5fd787"
    warning: str = "#ffd75f"
    bad: str = "#ff6b6b"
    target: str = "#d787ff"
    """Setpoints, beside the values."""
    background: str = "#11151c"
    surface: str = "#1a202b"
    sky: str = "#2a6ab4"
    ground: str = "#5f3a17"
    """Darker than the sky: without colour only the brightness differs."""


DARK = Palette()
LIGHT = Palette(
    text="#1c2430",
    muted="#667080",
    accent="#0060a8",
    good="#1a7f37",
    warning="#9a6700",
    bad="#c62828",
    target="#8839bf",
    background="#f6f8fa",
    surface="#e9edf2",
    sky="#3f7fc4",
    ground="#6b4623",
)


def monochrome(colours: Palette, dark: bool) -> Palette:
    """Return the palette for a screen without colour: warnings have the highest contrast, not the red's grey."""
    alarm = "#ffffff" if dark else "#000000"
    return colours._replace(warning=alarm, bad=alarm, good=colours.text)


def palette_of(variables: Mapping[str, str], dark: bool) -> Palette:
    """Return the palette of a theme, given its CSS variables; ours where it has no plain colour."""
    base = DARK if dark else LIGHT
    names = {
        "text": "foreground",
        "accent": "accent",
        "good": "success",
        "warning": "warning",
        "bad": "error",
        "target": "secondary",
        "background": "background",
        "surface": "surface",
    }
    found = {role: variables.get(name, "") for role, name in names.items()}
    return base._replace(**{role: c for role, c in found.items() if c.startswith("#") and len(c) == 7})
