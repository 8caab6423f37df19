"""A curve of the paper's report."""

from __future__ import annotations

from typing import NamedTuple

from flightstack.core.contract import FloatArray
from gcs_cli.charts.decimate import decimated, finite_runs

__all__ = ["Line", "decimated", "finite_runs"]


class Line(NamedTuple):
    """A curve; ``style`` is a class of the style sheet."""

    label: str
    x: FloatArray
    y: FloatArray
    style: str
