"""The low-pass filter of the rates against SciPy's Butterworth filter, and where it does nothing."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from flightstack.core.contract import Vector3
from flightstack.core.record_types import dtype_of
from flightstack.estimation.rate_filter import RateFilter, filtered_rates

DT_S, CUTOFF_HZ = 0.002, 40.0


def _filtered(rows: np.ndarray, cutoff_hz: float) -> np.ndarray:
    memory = np.zeros(1, dtype_of(RateFilter))[0]
    return np.array([filtered_rates(memory, Vector3(*row), DT_S, cutoff_hz) for row in rows.tolist()])


def test_rate_filter_is_scipys_butterworth_filter() -> None:
    rows = np.random.default_rng(2).normal(size=(300, 3))
    rows[0] = 0.0  # both start at rest
    b, a = signal.butter(2, CUTOFF_HZ, fs=1.0 / DT_S)
    assert np.abs(_filtered(rows, CUTOFF_HZ) - signal.lfilter(b, a, rows, axis=0)).max() < 1e-12


def test_rate_filter_starts_at_the_first_rate() -> None:
    rows = np.tile([0.3, -0.2, 1.0], (20, 1))
    assert np.abs(_filtered(rows, CUTOFF_HZ) - rows).max() < 1e-14


@pytest.mark.parametrize("cutoff_hz", [0.0, 0.45 / DT_S, 1000.0])
def test_rate_filter_without_effect_passes_rates_on(cutoff_hz: float) -> None:
    rows = np.random.default_rng(2).normal(size=(20, 3))
    assert (_filtered(rows, cutoff_hz) == rows).all()


def test_rate_filter_continues_through_a_longer_step() -> None:
    memory = np.zeros(1, dtype_of(RateFilter))[0]
    for dt_s in (DT_S, DT_S, 5.0 * DT_S, DT_S):
        rates = filtered_rates(memory, Vector3(0.3, -0.2, 1.0), dt_s, CUTOFF_HZ)
    assert np.abs(np.array(rates) - [0.3, -0.2, 1.0]).max() < 1e-14
