"""Decimation of samples for charts, which keeps every peak. Pure."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, TypeAlias

import numpy as np

from flightstack.core.contract import FloatArray

IndexArray: TypeAlias = np.ndarray[Any, np.dtype[np.intp]]

BUCKETS = 800
"""Of a curve on a page: the smallest and the largest sample of each are kept, about two for a pixel."""


def decimated(x: FloatArray, y: FloatArray, buckets: int = BUCKETS) -> tuple[FloatArray, FloatArray]:
    """Keep the smallest and the largest sample of each bucket in time order, and the first and the last one.

    No peak is lost. ``y`` must be finite; x and y have shape (n,).
    """
    count = len(x)
    if count <= 2 * buckets:
        return x, y
    starts = np.arange(buckets) * count // buckets
    low, high = np.minimum.reduceat(y, starts), np.maximum.reduceat(y, starts)
    bucket = np.repeat(np.arange(buckets), np.diff(np.append(starts, count)))
    kept = {0, count - 1}
    for extreme in (low, high):
        hits = np.flatnonzero(y == extreme[bucket])
        kept.update(hits[np.searchsorted(hits, starts)].tolist())  # the first one of each bucket
    index = np.array(sorted(kept))
    return x[index], y[index]


def finite_runs(x: FloatArray, y: FloatArray) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield the stretches in which both are finite; x and y have shape (n,)."""
    finite = np.isfinite(x) & np.isfinite(y)
    edges = np.flatnonzero(np.diff(np.concatenate(([False], finite, [False]))))
    for start, end in zip(edges[::2], edges[1::2], strict=True):
        yield x[start:end], y[start:end]


def drawn_samples(x: FloatArray, y: FloatArray, buckets: int = BUCKETS) -> tuple[FloatArray, FloatArray]:
    """Return the samples to draw, with one NaN between runs that a gap separates.

    A curve that runs forward in x keeps the extremes of each bucket; one that turns keeps evenly spaced samples.
    """
    runs = list(finite_runs(x, y))
    kept_x: list[FloatArray] = []
    kept_y: list[FloatArray] = []
    gap = np.array([np.nan])
    for run_x, run_y in runs:
        share = max(2, buckets * len(run_x) // max(1, len(x)))
        if bool(np.all(np.diff(run_x) >= 0.0)):
            part = decimated(run_x, run_y, share)
        else:
            index = spaced(len(run_x), 2 * share)
            part = run_x[index], run_y[index]
        kept_x += [part[0], gap]
        kept_y += [part[1], gap]
    if not runs:
        return np.zeros(0), np.zeros(0)
    return np.concatenate(kept_x[:-1]), np.concatenate(kept_y[:-1])


def spaced(count: int, most: int) -> IndexArray:
    """Return at most ``most`` evenly spaced indices below ``count``, with the first and the last one."""
    return np.linspace(0, count - 1, min(count, most)).round().astype(np.intp)  # no two: a step is 1 or more


def is_decimated(count: int, buckets: int = BUCKETS) -> bool:
    """True if a curve of ``count`` samples is drawn with fewer."""
    return count > 2 * buckets
