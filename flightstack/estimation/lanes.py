"""Estimators of several inertial sensors: their health, the selected one, and the change to another one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flightstack.core.contract import FloatArray, Quaternion, Record, RecordArray, Vector3
from flightstack.estimation.error_state import turn_between
from flightstack.estimation.estimator import Estimator
from flightstack.estimation.health import EstimateHealth, HealthMonitor
from flightstack.estimation.imu_track import IMU_MISSING_S
from flightstack.estimation.resets import count_of_resets
from flightstack.estimation.selector import (
    LaneFacts,
    LaneRecord,
    LaneReport,
    Selection,
    best_usable,
    change,
    combined_ratio,
    select,
)
from flightstack.estimation.sensor_feed import Lane, SensorFeed

MISSING_US, MISSING_STEPS = 10_000, 3
"""Lag of a sensor behind another one at which it is missing, and the same in its steps: the larger one counts."""
REPEATS = 10
"""Equal successive samples at which a sensor is stuck, if another one has fewer."""
_STILL = Vector3(0.0, 0.0, 0.0)


class StateOffset(NamedTuple):
    """Difference of the states of two estimators at the same time."""

    position_m: Vector3
    velocity_m_s: Vector3
    yaw_rad: float


class _View:
    """What selection reads of an estimator's memory."""

    def __init__(self, memory: RecordArray) -> None:
        self.state: FloatArray = memory["state"][0]
        self.checks: Record = memory["checks"][0]
        self.biases: FloatArray = memory["nominal"][0, 10:16]
        """Of the gyro and of the accelerometer."""
        self.output_s = memory["output"][0].data
        """Output, of which the first number is the time."""
        self.compared: FloatArray = self.state.copy()
        """State at the last comparison with the selected estimator."""


class Lanes:
    """Compares the estimators of a feed, and selects the one that flies the vehicle."""

    def __init__(self, feed: SensorFeed, estimators: Sequence[Estimator]) -> None:
        """``estimators`` are those of ``feed``, by the number of the inertial sensor."""
        self._feed = feed
        self.estimators = tuple(estimators)
        self._monitors = [HealthMonitor(each.memory) for each in estimators]
        self._views = [_View(each.memory) for each in estimators]
        self._is_compared = False
        self.selection = Selection((LaneRecord(),) * len(estimators))
        self.facts: tuple[LaneFacts, ...] = ()
        """Those of the newest comparison, by lane; empty before it."""
        self._compared_us = 0

    @property
    def estimator(self) -> Estimator:
        """The selected estimator."""
        return self.estimators[self.selection.selected]

    @property
    def report(self) -> LaneReport | None:
        """The selection for log and telemetry; None before the first one, and with one inertial sensor."""
        return LaneReport(self.selection, self.facts) if self.facts else None

    @property
    def is_alone(self) -> bool:
        """True with one inertial sensor."""
        return len(self.estimators) == 1

    def replace_lost(self, time_us: int) -> bool:
        """Select another lane if the selected inertial sensor has just failed; return True if it was changed.

        It is cheap enough for every tick: it compares the sensors with each other.
        """
        lanes = self._feed.lanes
        newest_us = max(lane.measured_us for lane in lanes)
        here = lanes[self.selection.selected]
        is_late = _is_late(here, newest_us)
        if not (is_late or _repeats(here) >= REPEATS):
            return False
        live = (not _is_late(lane, newest_us) and _repeats(lane) < REPEATS for lane in lanes)
        facts = [
            fact._replace(is_usable=fact.is_usable and is_live)
            for fact, is_live in zip(self.facts, live, strict=False)  # none before the first comparison
        ]
        best = best_usable(self.selection, facts)
        if best is None:
            return False
        self._take_over(change(self.selection, best, time_us * 1e-6, "is missing" if is_late else "is stuck"))
        return True

    @property
    def watch(self) -> RecordArray:
        """Memory of the health of the first estimator."""
        return self._monitors[0].watch

    def begin_watch(self) -> None:
        """Note the newest measurements of the first estimator: a kernel is to update its health."""
        self._monitors[0].take(self._feed.lanes[0].newest)

    def watched(self) -> EstimateHealth:
        """Return the health that a kernel has updated."""
        return self._monitors[0].health()

    def update(self, has_origin: bool, limit_m: float, time_us: int) -> tuple[EstimateHealth, bool]:
        """Compare all lanes at 20 Hz; return the health of the selected one, and True if another one was selected.

        ``limit_m`` is that of the horizontal deviation, -1 for none.
        """
        for each in self.estimators:
            each.refresh()
        healths = [
            monitor.update(lane.newest, has_origin, limit_m, time_us * 1e-6)
            for lane, monitor in zip(self._feed.lanes, self._monitors, strict=True)
        ]
        if self.is_alone:
            return healths[0], False
        since_s = self._compared_us * 1e-6
        self.facts = tuple(
            _facts_of(view, lane, health, combined_ratio(*monitor.magnitudes()), since_s)
            for view, lane, health, monitor in zip(
                self._views, self._feed.lanes, healths, self._monitors, strict=True
            )
        )
        dt_s = (time_us - self._compared_us) * 1e-6 if self._compared_us else 0.0
        self._compared_us = time_us
        self._compare_states()
        before = self.selection
        selection = select(before, self.facts, time_us * 1e-6, dt_s)
        has_changed = selection.changes != before.changes
        if has_changed:
            self._take_over(selection)
        self.selection = selection
        spares = [lane for number, lane in enumerate(self.facts) if number != selection.selected]
        health = healths[selection.selected]._replace(
            spare_imu_has_failed=not all(lane.is_usable for lane in spares),
            imus_disagree=selection.disagree,
        )
        return health, has_changed

    def _compare_states(self) -> None:
        """Keep the states of all estimators if they are of the same time."""
        self._is_compared = len({view.output_s[0] for view in self._views}) == 1
        if self._is_compared:
            for view in self._views:
                view.compared[:] = view.state

    def _take_over(self, selection: Selection) -> None:
        """Select a lane; its estimator counts the change of the state as a reset of each kind, after all earlier ones.

        Guidance, telemetry and log follow it as they follow a reset of one estimator.
        """
        here, there = self._views[self.selection.selected], self._views[selection.selected]
        if not self._is_compared:
            here.compared[:], there.compared[:] = here.state, there.state
        offset = _offset(there.compared, here.compared)
        _count_change(self.estimator.memory, self.estimators[selection.selected].memory, offset)
        self.selection = selection
        self._is_compared = False
        self._feed.select(selection.selected)


def _is_late(lane: Lane, newest_us: int) -> bool:
    return newest_us - lane.measured_us >= max(MISSING_US, MISSING_STEPS * lane.step_us)


def _repeats(lane: Lane) -> int:
    return lane.newest.imu_track.repeats


def _facts_of(view: _View, lane: Lane, health: EstimateHealth, ratio: float, since_s: float) -> LaneFacts:
    """Return the facts of a lane; ``ratio`` is the combined one, ``since_s`` the time of the last facts."""
    means = lane.newest.imu_track.mean_since(since_s)
    measures = health.imu_age_s <= IMU_MISSING_S and not health.imu_is_stuck
    if means is None or not (health.aligned and measures and math.isfinite(ratio + health.tilt_rad)):
        return LaneFacts(False, ratio, _STILL, _STILL, health.tilt_rad)
    x = view.biases.tolist()
    (p, q, r), (fx, fy, fz) = means
    rates, force = Vector3(p - x[0], q - x[1], r - x[2]), Vector3(fx - x[3], fy - x[4], fz - x[5])
    wrong_s = max(float(view.checks["gyro_s"]), float(view.checks["accel_until_s"]))
    return LaneFacts(True, ratio, rates, force, health.tilt_rad, wrong_s)


def _offset(new: FloatArray, old: FloatArray) -> StateOffset:
    """Return the difference of two states in the array form of ``VehicleState``."""
    change = (new[:6] - old[:6]).tolist()
    turn_rad = turn_between(Quaternion(*old[6:10].tolist()), Quaternion(*new[6:10].tolist()))
    return StateOffset(Vector3(*change[:3]), Vector3(*change[3:]), turn_rad)


def _count_change(old: RecordArray, new: RecordArray, offset: StateOffset) -> None:
    """Let the record of one estimator continue the counts of resets of another."""
    resets = new["resets"][0]
    new["resets"] = old["resets"]
    for kind, moved in (("position", offset.position_m), ("velocity", offset.velocity_m_s)):
        reset = resets[kind]
        reset["number"] += 1.0
        reset["change"] = moved
        reset["sum"] += np.array(moved)
    yaw = resets["yaw"]
    yaw["number"] += 1.0
    yaw["change_rad"] = offset.yaw_rad
    yaw["sum_rad"] += offset.yaw_rad
    new["followed"][0] = count_of_resets(new[0])


def sum_of_resets(memory: RecordArray) -> StateOffset:
    """Return the sum of all changes by resets of an estimator."""
    position, velocity, yaw = memory["resets"][0]
    return StateOffset(
        Vector3(*position["sum"].tolist()), Vector3(*velocity["sum"].tolist()), float(yaw["sum_rad"])
    )
