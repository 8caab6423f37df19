"""Selection of the estimator that flies the vehicle, of those of several inertial sensors. Pure.

The rules are those of PX4's EKF2Selector: an estimator whose sensor fails is left at once; another one replaces it if
its test ratios were smaller for a while, or if the inertial sensors contradict each other and its own are smaller.

Rates and specific force are compared less the biases that each estimator found, so that the limits lie far below PX4's
(7°/s and 15°, 1 m/s² and 2 m/s): a change of a bias shows before the estimator has followed it. With three sensors the
faulty one is the one that no other agrees with. Of two, the one whose estimate fits the other measurements worse.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from flightstack.core.contract import Vector3
from flightstack.core.portable_math import distance

LEAST_GAIN, ENOUGH = 0.2, 0.5
"""Difference of combined test ratios that counts (EKF2_SEL_ERR_RED), and their sum at which the lane changes."""
MOST_RELATIVE = 1.0
LESS_CERTAIN = 2.0
"""Ratio of the deviations of the tilt from which smaller test ratios do not count: they are those of a wide gate."""
ALIKE_S, SUSPECT_S = 2.0, 60.0
"""Difference in which two filters find their sensors wrong for the same reason, and time for which it counts."""
BETWEEN_S = 10.0
"""Least time between two changes to a lane that is only better."""
RATE_RAD_S, TURN_RAD = math.radians(1.5), math.radians(0.5)
"""Difference of rates that counts, and its integral at which two sensors disagree."""
FORCE_M_S2, SPEED_M_S = 0.3, 0.15
"""The same of the specific force."""
LARGEST_SUMS = 4.0
"""Largest integral, in its limits: sensors that agree again are trusted after a time."""


class LaneFacts(NamedTuple):
    """What is known of one estimator and its inertial sensor at one time."""

    is_usable: bool
    """True if the sensor measures and the attitude is known."""
    ratio: float
    """Combined test ratio, 1 at the gates."""
    rates_rad_s: Vector3
    """Mean since the last selection, less the bias."""
    force_m_s2: Vector3
    tilt_rad: float = 0.0
    """Deviation."""
    wrong_s: float = 0.0
    """Time at which its filter has found the sensor wrong last, and learnt its biases anew."""


class LaneRecord(NamedTuple):
    """Memory of one lane."""

    turn_rad: float = 0.0
    """Integral of the difference of its rates to the most similar sensor, beyond ``RATE_RAD_S``."""
    speed_m_s: float = 0.0
    relative: float = 0.0
    """Sum of the differences of its test ratio to that of the selected lane."""

    @property
    def disagrees(self) -> bool:
        """True if no other inertial sensor measures the same motion."""
        return self.turn_rad >= TURN_RAD or self.speed_m_s >= SPEED_M_S


class Selection(NamedTuple):
    """The selected lane and the memory of all."""

    lanes: tuple[LaneRecord, ...]
    selected: int = 0
    changes: int = 0
    changed_s: float = 0.0
    left: int = 0
    """The lane before the last change."""
    reason: str = ""
    """What was wrong with its inertial sensor."""

    @property
    def disagree(self) -> bool:
        """True if two inertial sensors contradict each other."""
        return any(lane.disagrees for lane in self.lanes)


class LaneReport(NamedTuple):
    """The selection and the facts that it followed from, by lane."""

    selection: Selection
    facts: tuple[LaneFacts, ...]


def combined_ratio(velocity: float, position: float, height: float, heading: float) -> float:
    """Return the combined test ratio of an estimator, PX4's with the heading besides."""
    return max(0.5 * (velocity + position), height, heading)


def change(before: Selection, lane: int, time_s: float, reason: str) -> Selection:
    """Return the selection of another lane."""
    lanes = tuple(record._replace(relative=0.0) for record in before.lanes)
    return Selection(lanes, lane, before.changes + 1, time_s, before.selected, reason)


def best_usable(selection: Selection, facts: Sequence[LaneFacts]) -> int | None:
    """Return the best lane besides the selected one: one that agrees with another, of the least test ratio."""
    usable = [i for i, lane in enumerate(facts) if lane.is_usable and i != selection.selected]
    return min(usable, key=lambda i: (selection.lanes[i].disagrees, facts[i].ratio), default=None)


def select(before: Selection, facts: Sequence[LaneFacts], time_s: float, dt_s: float) -> Selection:
    """Return the selection at ``time_s``, ``dt_s`` after the last one."""
    here = before.selected
    compared = [
        _compared(record, i, facts, _worse(facts[i], facts[here], time_s), before.disagree, dt_s)
        for i, record in enumerate(before.lanes)
    ]
    selection = before._replace(lanes=tuple(compared))
    other = best_usable(selection, facts)
    if other is None:
        return selection
    if not facts[here].is_usable:
        return change(selection, other, time_s, "is missing or stuck")
    if selection.lanes[here].disagrees and not selection.lanes[other].disagrees:
        return change(selection, other, time_s, "disagrees with the others")
    return _better(selection, facts, time_s)


def _worse(lane: LaneFacts, here: LaneFacts, time_s: float) -> float:
    """Return by how much the test ratio of a lane is larger than that of the selected one.

    A noisy sensor makes a filter uncertain, and so its test ratios small, as do biases that it has learnt anew: it is
    not better for that.
    """
    is_suspect = lane.wrong_s > max(here.wrong_s + ALIKE_S, time_s - SUSPECT_S)
    worse = lane.ratio - here.ratio
    return max(worse, 0.0) if is_suspect or lane.tilt_rad > LESS_CERTAIN * here.tilt_rad else worse


def _better(selection: Selection, facts: Sequence[LaneFacts], time_s: float) -> Selection:
    """Return the selection of the lane whose test ratios have been smaller, if there is one."""
    usable = [i for i, lane in enumerate(facts) if lane.is_usable and i != selection.selected]
    best = min(usable, key=lambda i: selection.lanes[i].relative)
    waits = time_s - selection.changed_s < BETWEEN_S and not selection.disagree
    if selection.lanes[best].relative > -ENOUGH or waits:
        return selection
    reason = f"disagrees with inertial sensor {best + 1}" if selection.disagree else "has larger test ratios"
    return change(selection, best, time_s, reason)


def _compared(
    record: LaneRecord, index: int, facts: Sequence[LaneFacts], worse: float, disagree: bool, dt_s: float
) -> LaneRecord:
    """Return the memory of a lane after its comparison with the others; ``worse``: than the selected lane."""
    others = [lane for i, lane in enumerate(facts) if i != index and lane.is_usable]
    turn_rad = speed_m_s = 0.0
    if others and facts[index].is_usable:
        rates, force = facts[index].rates_rad_s, facts[index].force_m_s2
        rate = min(_difference(rates, lane.rates_rad_s) for lane in others)
        push = min(_difference(force, lane.force_m_s2) for lane in others)
        turn_rad = _summed(record.turn_rad, (rate - RATE_RAD_S) * dt_s, TURN_RAD)
        speed_m_s = _summed(record.speed_m_s, (push - FORCE_M_S2) * dt_s, SPEED_M_S)
    relative = record.relative
    if not facts[index].is_usable:
        relative = 0.0
    elif worse > 0.0 or worse < (0.0 if disagree else -LEAST_GAIN):
        relative = max(-MOST_RELATIVE, min(MOST_RELATIVE, relative + worse))
    return LaneRecord(turn_rad, speed_m_s, relative)


def _difference(a: Vector3, b: Vector3) -> float:
    return distance(a.x - b.x, a.y - b.y, a.z - b.z)


def _summed(total: float, more: float, limit: float) -> float:
    return max(0.0, min(LARGEST_SUMS * limit, total + more))
