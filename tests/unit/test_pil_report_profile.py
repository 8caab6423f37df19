"""Execution-time profiles: figures against their definitions, histograms that hold every step."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from gcs_cli.pil.profile import StageProfile, branch_costs, stage_profiles

costs = st.lists(st.integers(1, 2**32 - 1), min_size=1, max_size=300)


def whole(values: list[int]) -> StageProfile:
    steps = np.zeros((len(values), 4))
    steps[:, 3] = values
    (profile,) = stage_profiles(steps)
    return profile


@given(costs)
def test_figures_and_histogram_hold_every_step(values: list[int]) -> None:
    profile = whole(values)
    assert (profile.steps, profile.smallest, profile.largest) == (len(values), min(values), max(values))
    assert abs(profile.mean - sum(values) / len(values)) <= 1e-6 * profile.mean
    not_above = sum(value <= profile.p99 for value in values) / len(values)
    below = sum(value < profile.p99 for value in values) / len(values)
    assert not_above >= 0.99 > below
    assert sum(profile.counts) == len(values)
    assert profile.edges[0] < min(values)
    assert profile.edges[-1] > max(values)
    assert len(profile.edges) == len(profile.counts) + 1 <= 26


@given(costs)
def test_the_bins_count_what_lies_in_them(values: list[int]) -> None:
    profile = whole(values)
    for left, right, count in zip(profile.edges, profile.edges[1:], profile.counts, strict=False):
        assert sum(left <= value < right for value in values) == count


def test_a_stage_counts_the_steps_in_which_it_ran() -> None:
    steps = np.array([[800, 900, 700, 2400], [0, 900, 710, 1620], [0, 910, 700, 1620]], np.float64)
    by_stage = {profile.stage: profile for profile in stage_profiles(steps)}
    assert list(by_stage) == ["outer", "inner", "mixer", "whole"]
    assert by_stage["outer"].steps == 1
    assert by_stage["inner"].as_json() == {
        "count": 3,
        "min": 900.0,
        "mean": 903.333,
        "p99": 910.0,
        "max": 910.0,
        "histogram": {"edges": [899.5 + index for index in range(12)], "counts": [2, *[0] * 9, 1]},
    }


def test_a_target_that_counts_nothing_has_no_profile() -> None:
    assert stage_profiles(np.zeros((5, 4))) == []
    assert stage_profiles(np.zeros((0, 4))) == []


def test_costs_of_branches_are_those_of_the_steps_that_took_them() -> None:
    steps = np.array([[800, 900, 700, 2400], [0, 900, 710, 1620], [0, 910, 700, 1640]], np.float64)
    overrun, roll, thrust = 1 << 18, 2, 16
    assert branch_costs(steps, np.array([overrun, roll | thrust, 0])) == {
        "outer loop due": {"count": 1, "mean": 2400.0, "max": 2400.0},
        "inner loop alone": {"count": 2, "mean": 1630.0, "max": 1640.0},
        "nothing limited": {"count": 2, "mean": 2020.0, "max": 2400.0},
        "torque limited": {"count": 1, "mean": 1620.0, "max": 1620.0},
        "thrust limited": {"count": 1, "mean": 1620.0, "max": 1620.0},
    }
