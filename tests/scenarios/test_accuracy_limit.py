"""The filter in flight beside the batch smoother, the accuracy limit of its sensors."""

from __future__ import annotations

import pytest

from tests.support.accuracy_limit import QUANTITIES, Limit, fly, rms

_MOST_OF_SMOOTHER = (2.5, 7.0, 3.8, 3.6, 1.4, 1.6, 2.0)
"""Filter over smoother, by ``QUANTITIES``. Measured: 2.0, 5.8, 3.1, 3.0, 1.2, 1.3, 1.6."""
_MOST_OF_BEST = (1.5, 1.5, 2.3, 2.1, 1.2, 1.6, 2.0)
"""Filter over the smoother without later measurements. Measured: 1.25, 1.14, 1.8, 1.7, 1.0, 1.3, 1.7."""
_LEAST = 0.9
"""A filter that is clearly better than the limit would show that the smoother's model is wrong."""


@pytest.fixture(scope="module")
def square() -> Limit:
    return rms([fly("square", seed, with_best=True) for seed in (101, 102)])


def test_model_of_the_smoother_is_that_of_the_sensors(square: Limit) -> None:
    assert square.residuals[0] == pytest.approx(1.0, abs=0.07)  # measured 1.01


@pytest.mark.parametrize("index", range(len(QUANTITIES)), ids=QUANTITIES)
def test_filter_is_close_to_the_accuracy_limit_of_its_sensors(square: Limit, index: int) -> None:
    ratio = square.filter[index] / square.smoother[index]
    assert _LEAST < ratio < _MOST_OF_SMOOTHER[index]
    ratio = square.filter_then[index] / square.best_filter[index]
    assert _LEAST < ratio < _MOST_OF_BEST[index]
