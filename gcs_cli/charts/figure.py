"""The description of a figure, independent of the library that draws it, and its colours by name. Pure data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

from flightstack.core.contract import FloatArray

Dash: TypeAlias = Literal["solid", "dash", "dot", "dashdot", "longdash", "none"]
"""Line style of a curve; ``none``: markers only."""
Shape: TypeAlias = Literal["", "circle", "x", "cross", "diamond", "square", "triangle-up", "circle-open"]
"""Marker at each sample; empty: none."""

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
"""Colours of pages and prints; a dark page has the same names."""
SERIES = 8
"""Colours of curves: s1 to s8."""


def nth_colour(index: int) -> str:
    """Return the name of the colour of curve ``index``, counted from 0; after the last comes the first."""
    return f"s{index % SERIES + 1}"


@dataclass(frozen=True)
class Axis:
    """A quantity with its unit. Without ``low`` and ``high`` the axis holds all that is drawn."""

    label: str = ""
    unit: str = ""
    low: float | None = None
    high: float | None = None
    log: bool = False

    @property
    def title(self) -> str:
        """Quantity and unit as the axis shows them."""
        return f"{self.label} [{self.unit}]".strip() if self.unit else self.label


TIME = Axis("time", "s")


@dataclass(frozen=True)
class Series:
    """A curve or marks: ``x`` and ``y`` of shape (n,) in the units of the axes; a value that is not finite is a gap."""

    name: str
    x: FloatArray
    y: FloatArray
    colour: str = "s1"
    """Name in ``colours``."""
    dash: Dash = "solid"
    width: float = 1.5
    marker: Shape = ""
    filled: bool = False
    """The line encloses an area, which is shaded."""
    texts: Sequence[str] = ()
    """Label beside each sample; empty or as long as ``x``."""
    hints: Sequence[str] = ()
    """Text at the cursor for each sample; empty or as long as ``x``."""
    in_legend: bool = True
    group: str = ""
    """Curves of one group are hidden together; without one, those of one name."""


@dataclass(frozen=True)
class Bars:
    """A histogram: bar i lies between ``edges[i]`` and ``edges[i + 1]``."""

    name: str
    edges: Sequence[float]
    heights: Sequence[float]
    colour: str = "s1"
    hints: Sequence[str] = ()


@dataclass(frozen=True)
class Level:
    """A straight line across a panel at one value, such as a limit; ``upright``: at a value of x."""

    label: str
    at: float
    upright: bool = False
    colour: str = "bad"


@dataclass(frozen=True)
class Band:
    """A stretch of x with a name, such as a flight mode."""

    start: float
    end: float
    label: str


@dataclass(frozen=True)
class Panel:
    """One pair of axes and its curves."""

    y: Axis
    series: Sequence[Series] = ()
    x: Axis = TIME
    title: str = ""
    bars: Sequence[Bars] = ()
    levels: Sequence[Level] = ()
    bands: Sequence[Band] = ()
    equal: bool = False
    """A unit is as long in x as in y."""

    @property
    def empty(self) -> bool:
        """True if no series has a sample and no bar is there."""
        return not any(len(series.x) for series in self.series) and not any(len(b.heights) for b in self.bars)


@dataclass(frozen=True)
class Figure:
    """Panels under one title. ``linked``: all panels share one x, which the linked charts of a page zoom together."""

    name: str
    """Identifier within a page, and name of its exported files."""
    title: str
    panels: Sequence[Panel]
    caption: str = ""
    """One plain sentence: the content, with unit and limits where they matter."""
    columns: int = 1
    linked: bool = False
    height: int = 210
    """Of a row of panels, pixels on a page."""

    @property
    def empty(self) -> bool:
        """True if no panel has anything to draw."""
        return all(panel.empty for panel in self.panels)


@dataclass(frozen=True)
class SpacePath:
    """A path or places in space: NED [m], shape (n, 3); a row that is not finite is a gap."""

    name: str
    ned_m: FloatArray
    colour: str = "s1"
    dash: Dash = "solid"
    width: float = 3.0
    marker: Shape = ""
    texts: Sequence[str] = ()
    in_legend: bool = True


@dataclass(frozen=True)
class Playback:
    """Poses that a time slider moves the vehicle through: time [s] (n,), NED [m] and roll, pitch, yaw [rad] (n, 3)."""

    time_s: FloatArray
    ned_m: FloatArray
    euler_rad: FloatArray


@dataclass(frozen=True)
class SpaceFigure:
    """Paths in three dimensions, drawn with east to the right, north ahead and height up."""

    name: str
    title: str
    paths: Sequence[SpacePath]
    caption: str = ""
    playback: Playback | None = None
    height: int = 560

    @property
    def empty(self) -> bool:
        """True if no path has a sample."""
        return not any(len(path.ned_m) for path in self.paths)


AnyFigure: TypeAlias = Figure | SpaceFigure
