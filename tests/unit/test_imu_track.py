"""The ring of the last samples of an inertial sensor: when one repeats itself."""

from __future__ import annotations

import pytest

from flightstack.estimation.imu_track import ImuTrack

STILL, TURNS = (0.0, 0.0, 0.0), (0.01, 0.0, -0.02)
LIFT, NONE = (0.0, 0.0, -9.80665), (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("rates", "force", "repeats"),
    [(STILL, LIFT, 0), (TURNS, LIFT, 9), (STILL, NONE, 9), (TURNS, NONE, 9)],
    ids=["ideal sensor at rest", "stuck", "without output", "stuck without force"],
)
def test_equal_samples_are_repeats_but_at_rest(rates: tuple, force: tuple, repeats: int) -> None:
    track = ImuTrack()
    for step in range(1, 11):
        track.take(0.002 * step, 0.002, rates, force)
    assert track.repeats == repeats


def test_gyro_that_stops_beside_a_live_accelerometer_repeats_itself() -> None:
    track = ImuTrack()
    for step in range(1, 11):
        track.take(0.002 * step, 0.002, STILL, (0.0, 0.01 * step, -9.8))
    assert track.repeats == 9
