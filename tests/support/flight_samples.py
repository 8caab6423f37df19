"""Samples of a synthetic flight, for tests of the comparison and verdict of PIL reports."""

from __future__ import annotations

import numpy as np

from flightstack.core.contract import LoopStatus
from gcs_cli.pil.flight_samples import FlightSamples, Samples
from gcs_cli.pil.signals import SIGNALS


def flight(ticks: int = 10, height_m: float = 2.0, start_us: int = 1_000_000) -> FlightSamples:
    """Return a flight that is on the ground in the first tick and hovers afterwards. All other signals are 1."""
    time_us = start_us + 2000 * np.arange(ticks, dtype=np.int64)
    signals = {}
    for signal in SIGNALS:
        values = np.ones((ticks, len(signal.fields)), np.float32)
        signals[signal.name] = Samples(time_us, values)
    position = np.zeros((ticks, 3), np.float32)
    position[1:, 2] = -height_m
    signals["position"] = Samples(time_us, position)
    status = np.zeros((ticks, 1), np.float32)
    status[0] = LoopStatus.IDLE
    return FlightSamples(signals, Samples(time_us, status), {}, {}, {}, ())


def changed(of: FlightSamples, name: str, row: int, column: int, value: float) -> FlightSamples:
    samples = of.signals[name]
    values = samples.values.copy()
    values[row, column] = value
    return of._replace(signals={**of.signals, name: samples._replace(values=values)})
