"""Consistency of the estimator over seeded flights; the campaign itself is tools/estimator_campaign.py."""

from __future__ import annotations

import numpy as np
import pytest

from tests.support.tools import NIGHTLY
from tools.estimator_campaign import KINDS, SENSORS, STATES, Consistency, campaign, consistency_of


def test_judgement_has_the_bounds_of_the_chi_square_distribution() -> None:
    rng = np.random.default_rng(4)
    values = np.mean(np.square(rng.normal(size=(200, 2))), axis=1)
    found = consistency_of(values, 2)
    assert found.low < found.mean < found.high
    assert (found.low, found.high) == pytest.approx(
        (0.866, 1.143), abs=1e-3
    )  # chi-square, 400 degrees of freedom


@pytest.mark.skipif(not NIGHTLY, reason="sixty flights: set NIGHTLY=1")
def test_estimator_claims_what_it_knows() -> None:
    found = campaign(60, 1000)
    assert set(found) == {*KINDS, "all"}
    # measured: the accelerometer's bias claims more than it knows; see estimator.md
    most = {"accelerometer bias": 1.6}  # 1.39, and 1.07 and 1.04 over 201 other flights
    for name in STATES:
        consistency = found["all"][name]
        assert isinstance(consistency, Consistency)
        assert consistency.low < consistency.mean < most.get(name, consistency.high), name
    for name in SENSORS:  # measured 0.99 to 1.03 for GNSS, 1.02 for the barometer, 0.81 for the magnetometer
        assert (0.65 if name == "magnetometer" else 0.85) < found["all"][name] < 1.2, name  # type: ignore[operator]
