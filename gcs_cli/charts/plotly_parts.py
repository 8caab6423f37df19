"""Common parts of charts in the plane and in space, as JSON of plotly.js. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, TypeAlias

import numpy as np

from gcs_cli.charts.figure import Dash, Series, SpacePath

Json: TypeAlias = dict[str, Any]

_LARGEST_EXACT_POWER = 22.0
"""10 to this power is a float64 without rounding: a quotient by it is the float64 nearest to the decimal number."""
MARGIN = {"l": 64, "r": 18, "t": 44, "b": 44}


def colour(name: str) -> str:
    """Return the CSS variable of a colour."""
    return f"var(--{name})"


def plain(text: str) -> str:
    """Return a text so that plotly.js shows it as it is: it reads some HTML in texts."""
    return text.replace("&", "&amp;").replace("<", "&lt;")


def numbers(values: Iterable[float], digits: int = 6) -> list[float | None]:
    """Return values rounded to significant digits; None for one that is not finite."""
    given = np.asarray(values if isinstance(values, np.ndarray) else list(values), np.float64)
    finite = np.isfinite(given)
    with np.errstate(divide="ignore", invalid="ignore"):
        places = digits - 1 - np.floor(np.log10(np.abs(given)))
    places = np.clip(np.where(finite, places, 0.0), -_LARGEST_EXACT_POWER, _LARGEST_EXACT_POWER)
    up, down = 10.0 ** np.maximum(places, 0.0), 10.0 ** np.maximum(-places, 0.0)
    rounded: list[float | None] = (np.rint(given * up / down) / up * down + 0.0).tolist()
    if finite.all():
        return rounded
    return [value if is_finite else None for value, is_finite in zip(rounded, finite.tolist(), strict=True)]


def base_layout() -> Json:
    """Return the parts of a layout that all charts share."""
    return {
        "margin": dict(MARGIN),
        "paper_bgcolor": colour("card"),
        "plot_bgcolor": colour("card"),
        "font": {"family": "system-ui, sans-serif", "size": 12, "color": colour("soft")},
        "hoverlabel": {"bgcolor": colour("page"), "bordercolor": colour("axis"), "font": {"color": colour("ink")}},
        "legend": {"orientation": "h", "x": 0, "xanchor": "left", "y": 1, "yref": "container", "yanchor": "top",
                   "bgcolor": "rgba(0,0,0,0)", "font": {"color": colour("ink")}},
        "modebar": {"bgcolor": "rgba(0,0,0,0)", "color": colour("axis"), "activecolor": colour("ink")},
        "uirevision": "kept",
        "shapes": [],
        "annotations": [],
    }  # fmt: skip


def dash_of(dash: Dash) -> str:
    """Return how plotly.js names a dash."""
    return "solid" if dash == "none" else dash


def mode_of(curve: Series | SpacePath) -> str:
    """Return what of a curve is drawn: its line, markers and texts."""
    modes = [
        *(["lines"] if curve.dash != "none" else []),
        *(["markers"] if curve.marker else []),
        *(["text"] if curve.texts else []),
    ]
    return "+".join(modes) or "lines"
