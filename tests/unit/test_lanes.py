"""Estimators of several inertial sensors: which samples they take, and the change from one to another."""

from __future__ import annotations

import numpy as np
import pytest

from flightstack.core.contract import Vector3
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.estimation.estimator import Estimator
from flightstack.estimation.lanes import Lanes
from flightstack.estimation.selector import LaneFacts
from flightstack.estimation.sensor_feed import SensorFeed
from flightstack.mavlink.dialect import mavlink
from flightstack.simulator_link.sensor_frames import ACCEL, BARO, GYRO, HilGps
from flightstack.simulator_link.sensor_inbox import HilReport, Report

GOOD = LaneFacts(True, 0.2, Vector3(0.0, 0.0, 0.0), Vector3(0.0, 0.0, -9.8))


class Pair:
    """Two estimators whose sensors may be late or stuck."""

    def __init__(self) -> None:
        self.state = np.zeros(13)
        self.estimators = Estimator(), Estimator()
        self.feed = SensorFeed(self.estimators[0], self.state, spares=self.estimators[1:])
        self.lanes = Lanes(self.feed, self.estimators)
        self.lanes.facts = (GOOD, GOOD)
        self._rng = np.random.default_rng(1)

    def step(self, time_us: int, number: int, step_us: int = 2000, *, repeats: bool = False) -> None:
        values = np.ones(6) if repeats else self._rng.normal(size=6)
        report = HilReport(number, ACCEL | GYRO, np.array([*values, *[0.0] * 7], np.float32), step_us)
        self.feed.update([Report(time_us, report)])


@pytest.mark.parametrize(
    ("step_us", "lag_us", "is_late"),
    [(2000, 8000, False), (2000, 10_000, True), (10_000, 20_000, False), (10_000, 30_000, True)],
)
def test_sensor_is_missing_after_10_ms_and_three_steps(step_us: int, lag_us: int, is_late: bool) -> None:
    pair = Pair()
    pair.step(100_000 - lag_us, 0, step_us)
    pair.step(100_000, 1, step_us)
    assert pair.lanes.replace_lost(100_000) is is_late
    assert pair.lanes.selection.selected == is_late


@pytest.mark.parametrize(("both", "is_stuck"), [(False, True), (True, False)])
def test_sensor_is_stuck_if_it_alone_repeats_ten_samples(both: bool, is_stuck: bool) -> None:
    pair = Pair()
    for tick in range(1, 12):
        assert not pair.lanes.replace_lost(tick * 2000)
        pair.step(tick * 2000, 0, repeats=True)
        pair.step(tick * 2000, 1, repeats=both)
    assert pair.lanes.replace_lost(22_000) is is_stuck


def test_change_before_the_first_comparison_is_left_out() -> None:
    pair = Pair()
    pair.lanes.facts = ()
    pair.step(100_000, 1)
    assert not pair.lanes.replace_lost(100_000)


def test_change_counts_as_a_reset_after_those_of_the_former_estimator() -> None:
    pair = Pair()
    old, new = (each.memory for each in pair.estimators)
    earlier, later = old["resets"][0], new["resets"][0]
    earlier["position"]["number"], earlier["position"]["sum"][0] = 4.0, 10.0
    later["position"]["number"], later["yaw"]["number"] = 7.0, 3.0
    old["state"][0, 6], new["state"][0, 6:10] = 1.0, [np.cos(0.1), 0.0, 0.0, np.sin(0.1)]
    new["state"][0, :6] = old["state"][0, :6] + [0.5, -1.0, 0.25, 0.1, 0.2, -0.3]
    pair.step(100_000, 1)
    assert pair.lanes.replace_lost(100_000)
    assert [later[kind]["number"] for kind in ("position", "velocity", "yaw")] == [5.0, 1.0, 1.0]
    assert later["position"]["sum"] == pytest.approx([10.5, -1.0, 0.25])
    assert later["velocity"]["sum"] == pytest.approx([0.1, 0.2, -0.3])
    assert later["yaw"]["sum_rad"] == pytest.approx(0.2)
    assert pair.lanes.estimator is pair.estimators[1]


def test_all_estimators_take_other_sensors_and_one_local_frame() -> None:
    pair = Pair()
    baro = HilReport(0, BARO, np.array([0.0] * 9 + [950.0, 0.0, 540.0, 15.0], np.float32), 0)
    fix = HilGps(0, 47.0, 8.0, 500.0, 1.0, 1.0, (0.0, 0.0, 0.0), mavlink.GPS_FIX_TYPE_3D_FIX, 12)
    pair.estimators[1].frame = frame = LocalFrame(GeoPoint(47.0, 8.0, 500.0))
    pair.feed.update([Report(4000, baro), Report(4000, fix)])
    assert [lane.newest.baro for lane in pair.feed.lanes] == [pair.feed.newest.baro] * 2
    assert pair.feed.newest.baro is not None
    assert pair.estimators[0].frame is frame
