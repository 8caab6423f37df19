"""Long flights: memory and log buffers do not grow, and each step is exact.

``python -m tools.long_flight`` flies 24 hours and prints the figures.
"""

from __future__ import annotations

import pytest

from flightstack.params.config import ESTIMATED, TRUTH
from tests.support.tools import NIGHTLY
from tools.long_flight import HOUR_S, Sample, problems, samples, setup

INTERVAL_S = 20.0


def flown(state: str, interval_s: float, count: int) -> tuple[Sample, Sample]:
    first, *_, last = samples(setup(state), interval_s, count)
    return first, last


# measured: 2 objects and up to 160 blocks more; one object kept a second would be 60 of each, and one kept for each
# message of telemetry 20 000
@pytest.mark.parametrize("state", [ESTIMATED, TRUTH][: 1 + NIGHTLY])
def test_a_minute_keeps_no_objects_and_has_exact_steps(state: str) -> None:
    first, last = flown(state, INTERVAL_S, 4)
    assert last.kept.objects - first.kept.objects < 40
    assert last.kept.blocks - first.kept.blocks < 400
    assert last.kept.buffers_mb == first.kept.buffers_mb
    assert (last.late_us, last.uneven) == (0, 0)


@pytest.mark.skipif(not NIGHTLY, reason="nightly")
@pytest.mark.parametrize("state", [TRUTH, ESTIMATED])
def test_hours_do_not_grow_and_have_exact_steps(state: str) -> None:
    assert problems(*flown(state, HOUR_S, 4), state) == []
