"""The part of the plane that a map shows, north up: pan, zoom, fit, and conversion to dots. Pure."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flightstack.core.contract import FloatArray
from gcs_cli.charts.canvas import DOTS_X, DOTS_Y

SMALLEST_M_PER_DOT, LARGEST_M_PER_DOT = 1e-3, 1e5
_SMALLEST_FIT_M = 10.0
_MARGIN = 0.08
"""Free share of the view at each side after a fit."""


class Viewport(NamedTuple):
    """Centre [m north and east of the anchor], scale [m a dot] and size [cells]."""

    north_m: float = 0.0
    east_m: float = 0.0
    m_per_dot: float = 1.0
    width: int = 80
    height: int = 24

    @property
    def dots(self) -> tuple[int, int]:
        """Size in dots."""
        return DOTS_X * self.width, DOTS_Y * self.height

    def to_dots(self, places: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return x and y [dots] of places, shape (n, 2): north and east."""
        wide, high = self.dots
        x = wide / 2 + (places[:, 1] - self.east_m) / self.m_per_dot
        y = high / 2 - (places[:, 0] - self.north_m) / self.m_per_dot
        return x, y

    def to_place(self, x: float, y: float) -> tuple[float, float]:
        """Return the place, north and east, of a point [dots]."""
        wide, high = self.dots
        return self.north_m + (high / 2 - y) * self.m_per_dot, self.east_m + (x - wide / 2) * self.m_per_dot

    def cell_place(self, column: int, row: int) -> tuple[float, float]:
        """Return the place of the middle of a cell."""
        return self.to_place(DOTS_X * (column + 0.5), DOTS_Y * (row + 0.5))

    def panned(self, x: float, y: float) -> Viewport:
        """Return the view moved by x to the right and y down [dots]."""
        return self._replace(
            north_m=self.north_m - y * self.m_per_dot, east_m=self.east_m + x * self.m_per_dot
        )

    def zoomed(self, factor: float, place: tuple[float, float] | None = None) -> Viewport:
        """Return the view enlarged by ``factor``; ``place`` keeps its position on the screen, else the centre does."""
        scale = float(np.clip(self.m_per_dot / factor, SMALLEST_M_PER_DOT, LARGEST_M_PER_DOT))
        north_m, east_m = (self.north_m, self.east_m) if place is None else place
        share = scale / self.m_per_dot
        return self._replace(
            m_per_dot=scale,
            north_m=north_m + (self.north_m - north_m) * share,
            east_m=east_m + (self.east_m - east_m) * share,
        )

    def fitted(self, places: FloatArray) -> Viewport:
        """Return the view that holds all ``places``, shape (n, 2), with a margin; unchanged without places."""
        places = places[np.isfinite(places).all(axis=1)]
        if not len(places) or not self.width or not self.height:
            return self
        low, high = places.min(axis=0), places.max(axis=0)
        middle, span = (low + high) / 2, np.maximum(high - low, _SMALLEST_FIT_M)
        dots_wide, dots_high = self.dots
        room = np.maximum(1.0, np.array([dots_high, dots_wide]) * (1.0 - 2.0 * _MARGIN))
        scale = float(np.clip((span / room).max(), SMALLEST_M_PER_DOT, LARGEST_M_PER_DOT))
        return self._replace(north_m=float(middle[0]), east_m=float(middle[1]), m_per_dot=scale)

    def centred(self, place: tuple[float, float]) -> Viewport:
        """Return the view around ``place``."""
        return self._replace(north_m=place[0], east_m=place[1])

    def shows(self, place: tuple[float, float], margin: float = 0.0) -> bool:
        """True if ``place`` is on the screen, at least ``margin`` of its size away from each side."""
        x, y = self.to_dots(np.array([place]))
        wide, high = self.dots
        inside_x = margin * wide <= x[0] <= (1.0 - margin) * wide
        return bool(inside_x and margin * high <= y[0] <= (1.0 - margin) * high)


def round_step(least: float) -> float:
    """Return the smallest 1, 2 or 5 times a power of ten that is at least ``least`` (positive)."""
    decade = 10.0 ** np.floor(np.log10(least))
    return float(next(step * decade for step in (1, 2, 5, 10) if step * decade >= least * (1.0 - 1e-9)))
