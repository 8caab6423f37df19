"""Differences of two flights of the same mission, per signal. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from flightstack.core.contract import FloatArray
from gcs_cli.pil.flight_samples import FlightSamples, Samples
from gcs_cli.pil.signals import SIGNALS, Signal
from gcs_cli.pil.ulps import Float32Array, steps_apart, ulp_of

_LEAST_VARIATION = 0.01
"""Standard deviation of a component in least scales of its signal, from which a slope is meaningful."""


class Line(NamedTuple):
    """Least-squares line of the second flight on the first, of one component: ``slope`` × first + ``offset``."""

    component: int
    slope: float
    offset: float
    """In the signal's unit."""


class Difference(NamedTuple):
    """Difference of one signal in two flights, over ticks in which the loops of both ran."""

    pair: str
    signal: str
    samples: int
    largest: float
    """Largest difference of all components, in the signal's unit; infinite if only one of two values is a number."""
    rms: float
    at_s: float
    """Time of the largest difference since the start of the first log [s]; NaN without a difference."""
    full_scale: float
    """Largest value of the signal in the first flight, or its ``least_scale``."""
    steps: int
    """Largest number of float32 steps between two values."""
    line: Line | None = None
    """Regression of the component whose slope is furthest from 1; None if no component varies enough."""

    @property
    def ulps(self) -> float:
        """The largest difference in units of the last place of ``full_scale``."""
        return self.largest / ulp_of(self.full_scale)

    @property
    def rms_ulps(self) -> float:
        """The root mean square in units of the last place of ``full_scale``."""
        return self.rms / ulp_of(self.full_scale)

    @property
    def slope_ppm(self) -> float:
        """Distance of the slope from 1 [10⁻⁶]; NaN without a line."""
        return math.nan if self.line is None else abs(self.line.slope - 1.0) * 1e6

    def as_json(self, signal: Signal) -> dict[str, Any]:
        """Return the object for ``pil.json``; null for values that are not finite."""
        figures = {
            "largest": self.largest,
            "rms": self.rms,
            "at_s": self.at_s,
            "full_scale": self.full_scale,
            "ulps": self.ulps,
            "rms_ulps": self.rms_ulps,
            "slope": math.nan if self.line is None else self.line.slope,
            "offset": math.nan if self.line is None else self.line.offset,
        }
        return {
            "pair": self.pair,
            "signal": self.signal,
            "stage": signal.stage,
            "unit": signal.unit,
            "samples": self.samples,
            **{key: value if math.isfinite(value) else None for key, value in figures.items()},
            "float32_steps": self.steps,
            "slope_component": None if self.line is None else self.line.component,
        }


class Deviation(NamedTuple):
    """Difference of a signal over time: the largest of its components at ``time_s`` (n,)."""

    time_s: FloatArray
    size: FloatArray


def compared(
    pair: str, first: FlightSamples, second: FlightSamples, airborne: bool = False
) -> Iterator[Difference]:
    """Yield the difference of each signal that both flights have, in the order of ``SIGNALS``.

    ``airborne``: leave out the ticks in which a vehicle touches the ground. A touchdown is an impact, after which
    flights that differed by a micrometre diverge. Do not leave it out if the flights must be identical.
    """
    for signal in SIGNALS:
        matched = _matched(signal, first, second, airborne)
        if matched is not None:
            yield _difference(pair, signal, *matched, first)


def deviation(
    signal: Signal, first: FlightSamples, second: FlightSamples, airborne: bool = False
) -> Deviation:
    """Return the difference of a signal over time; without samples if one flight lacks the signal."""
    matched = _matched(signal, first, second, airborne)
    if matched is None:
        return Deviation(np.zeros(0), np.zeros(0))
    a, b = matched
    return Deviation(_since_start_s(a, first), _distance(a.values, b.values).max(axis=1))


def status_differences(first: FlightSamples, second: FlightSamples) -> tuple[int, int]:
    """Return the number of ticks with different status of the loops, and the number of ticks in both logs."""
    a, b = _at_same_times(first.status, second.status)
    return int(np.count_nonzero(a.values != b.values)), len(a.time_us)


def ticks_apart(first: FlightSamples, second: FlightSamples) -> int:
    """Return the number of ticks in which the loops ran in one flight only."""
    return len(np.setxor1d(first.flown_us, second.flown_us))


def _matched(
    signal: Signal, first: FlightSamples, second: FlightSamples, airborne: bool
) -> tuple[Samples, Samples] | None:
    a, b = first.signals.get(signal.name), second.signals.get(signal.name)
    if a is None or b is None:
        return None
    columns = min(a.values.shape[1], b.values.shape[1])
    ours, theirs = ((flight.airborne_us if airborne else flight.flown_us) for flight in (first, second))
    flown = np.intersect1d(ours, theirs)
    a, b = (_among(samples, flown) for samples in _at_same_times(a, b))
    a, b = a._replace(values=a.values[:, :columns]), b._replace(values=b.values[:, :columns])
    return (a, _same_sign(a, b)) if signal.is_attitude else (a, b)


def _at_same_times(a: Samples, b: Samples) -> tuple[Samples, Samples]:
    _, of_a, of_b = np.intersect1d(a.time_us, b.time_us, return_indices=True)
    return Samples(a.time_us[of_a], a.values[of_a]), Samples(b.time_us[of_b], b.values[of_b])


def _among(samples: Samples, times_us: Any) -> Samples:
    kept = np.isin(samples.time_us, times_us)
    return Samples(samples.time_us[kept], samples.values[kept])


def _same_sign(a: Samples, b: Samples) -> Samples:
    opposite = np.einsum("ij,ij->i", a.values, b.values) < 0.0
    return b._replace(values=np.where(opposite[:, None], -b.values, b.values))


def _distance(a: Float32Array, b: Float32Array) -> FloatArray:
    """Return the distance of each pair of values: 0 between equal ones, two infinite ones and two NaN."""
    with np.errstate(invalid="ignore"):
        apart = np.abs(a.astype(np.float64) - b.astype(np.float64))
    same = (a == b) | (np.isnan(a) & np.isnan(b))
    return np.where(same, 0.0, np.where(np.isnan(apart), math.inf, apart))


def _since_start_s(samples: Samples, flight: FlightSamples) -> FloatArray:
    start_us = flight.status.time_us[0] if len(flight.status.time_us) else 0
    return np.asarray((samples.time_us - start_us) * 1e-6, np.float64)


def _difference(pair: str, signal: Signal, a: Samples, b: Samples, first: FlightSamples) -> Difference:
    if not a.values.size:
        return Difference(pair, signal.name, 0, 0.0, 0.0, math.nan, signal.least_scale, 0)
    apart = _distance(a.values, b.values)
    largest = float(apart.max())
    sizes = np.abs(a.values[np.isfinite(a.values)])
    at = int(apart.max(axis=1).argmax())
    return Difference(
        pair,
        signal.name,
        len(a.time_us),
        largest,
        float(np.sqrt(np.mean(apart**2))),
        float(_since_start_s(a, first)[at]) if largest else math.nan,
        max(float(sizes.max(initial=0.0)), signal.least_scale),
        int(np.where(apart > 0.0, steps_apart(a.values, b.values), 0).max()),
        _regression(a.values, b.values, signal.least_scale),
    )


def _regression(a: Float32Array, b: Float32Array, least_scale: float) -> Line | None:
    """Return the line of the component whose slope is furthest from 1.

    A component that varies by less than ``_LEAST_VARIATION`` of ``least_scale`` has no meaningful slope. The slope is
    computed from the difference of the flights, so that its rounding is that of the difference.
    """
    first, second = a.astype(np.float64), b.astype(np.float64)
    if not (np.isfinite(first).all() and np.isfinite(second).all()):
        return None
    centred = first - first.mean(axis=0)
    variance = np.mean(centred**2, axis=0)
    varies = np.sqrt(variance) >= _LEAST_VARIATION * least_scale
    if not varies.any():
        return None
    excess = np.mean(centred * (second - first), axis=0) / np.where(varies, variance, 1.0)
    component = int(np.where(varies, np.abs(excess), -1.0).argmax())
    slope = 1.0 + float(excess[component])
    offset = float(second[:, component].mean() - slope * first[:, component].mean())
    return Line(component, slope, offset)
