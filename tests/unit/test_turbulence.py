"""Normal deviates that are made of PCG64's integers."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from flightstack.core.portable_math import log, sin_cos
from sim_bridge.plant.turbulence import normal_deviates

COUNT = 1_000_000


@pytest.fixture(scope="module")
def deviates() -> np.ndarray:
    return normal_deviates(np.random.PCG64(11), COUNT)


def test_normal_deviates_are_distributed_normally(deviates: np.ndarray) -> None:
    assert stats.kstest(deviates, "norm").pvalue > 0.01
    moments = [float(np.mean(deviates**power)) for power in range(1, 5)]
    spread = [math.sqrt(value / COUNT) for value in (1.0, 2.0, 15.0, 96.0)]  # of the means
    assert all(abs(m - e) < 3.0 * s for m, e, s in zip(moments, (0.0, 1.0, 0.0, 3.0), spread, strict=True))
    beyond = np.count_nonzero(np.abs(deviates) > 4.0)
    assert beyond == pytest.approx(COUNT * 2.0 * stats.norm.sf(4.0), abs=3.0 * math.sqrt(63.0))


@pytest.mark.parametrize("apart", [1, 2, 3, 6])  # a pair, and the axes of a row
def test_normal_deviates_do_not_depend_on_each_other(deviates: np.ndarray, apart: int) -> None:
    one, other = deviates[:-apart], deviates[apart:]
    assert abs(np.mean(one * other)) < 3.0 / math.sqrt(COUNT)
    assert abs(np.corrcoef(one**2, other**2)[0, 1]) < 3.0 / math.sqrt(COUNT)
    signs = np.histogram2d(one > 0.0, other > 0.0, bins=2)[0].ravel()
    assert stats.chisquare(signs).pvalue > 0.01


def test_normal_deviates_are_those_of_the_seed() -> None:
    first, second = np.random.PCG64(3), np.random.PCG64(3)
    whole = normal_deviates(first, 6)
    pieces = np.concatenate([normal_deviates(second, 2), normal_deviates(second, 4)])
    assert whole.tobytes() == pieces.tobytes()
    # the values themselves: they may change with no library and no processor
    assert [value.hex() for value in whole[:2].tolist()] == ["0x1.1ef6a20793941p-5", "0x1.afd98df97e2edp-2"]


def test_odd_number_of_deviates_leaves_out_the_last_one() -> None:
    odd, even = normal_deviates(np.random.PCG64(4), 3), normal_deviates(np.random.PCG64(4), 4)
    assert odd.tolist() == even[:3].tolist()


def test_normal_deviates_are_those_of_single_pairs() -> None:
    integers = np.random.PCG64(7).random_raw(2000).tolist()
    expected = []
    for first, second in zip(integers[::2], integers[1::2], strict=True):
        radius = math.sqrt(-2.0 * log(1.0 - (first >> 11) / 2.0**53))
        sine, cosine = sin_cos(2.0 * math.pi * ((second >> 11) / 2.0**53))
        expected += [radius * cosine, radius * sine]
    assert normal_deviates(np.random.PCG64(7), 2000).tolist() == expected
