"""Colours of pages and prints by name: the only place that has them.

A module of its own: pages and prints take their colours from here.
"""

from __future__ import annotations

from collections.abc import Mapping

LIGHT: Mapping[str, str] = {
    "page": "#f5f6f8", "card": "#ffffff", "ink": "#16202c", "soft": "#5b6775", "line": "#e3e7ec",
    "axis": "#9aa5b1", "good": "#0b7a4b", "good-page": "#e0f4ea", "bad": "#b3261e", "bad-page": "#fbe6e4",
    "differs": "#fff3d6", "s1": "#1668c7", "s2": "#e0701a", "s3": "#12875a", "s4": "#c2397d",
    "s5": "#7a52c7", "s6": "#8a6d10", "s7": "#0f8f9c", "s8": "#6a7480", "odd": "#7f93ad14", "even": "#7f93ad2b",
}  # fmt: skip
DARK: Mapping[str, str] = {
    "page": "#12161b", "card": "#1b2128", "ink": "#e7ebf0", "soft": "#9fabb8", "line": "#2c343d",
    "axis": "#66727f", "good": "#5fd39b", "good-page": "#12352a", "bad": "#ff8f86", "bad-page": "#42201e",
    "differs": "#3a3013", "s1": "#63a8ff", "s2": "#ffa04d", "s3": "#4fd196", "s4": "#ff7ab8",
    "s5": "#b797ff", "s6": "#dcbb4a", "s7": "#4dd0dd", "s8": "#a7b2bd", "odd": "#a9bdd70d", "even": "#a9bdd71f",
}  # fmt: skip
SERIES = 8
"""Colours of curves: s1 to s8."""


def nth_colour(index: int) -> str:
    """Return the name of the colour of curve ``index``, counted from 0; after the last comes the first."""
    return f"s{index % SERIES + 1}"
