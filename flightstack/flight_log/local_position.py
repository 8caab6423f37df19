"""The local position of a vehicle on its sensors in the log: validity, accuracies and resets of the estimate.

Names and contents are PX4's. The rows of the outer loop have further columns for them, those of ``LocalColumns``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from flightstack.core.array_items import store
from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray
from flightstack.estimation.error_state import ATTITUDE, VELOCITY
from flightstack.estimation.estimator_report import CONTROL, SOLUTION, report_kernel
from flightstack.estimation.imu_track import TrackArray
from flightstack.estimation.memory import MemoryArray
from flightstack.flight_log.topics import OUTER, OUTER_TOPICS, Field, Group, Topic


class LocalColumns(NamedTuple):
    """First column of each part of the estimate in a row of the outer loop; ``size`` is the row length."""

    position_change: int = OUTER.size  # north, east, down
    velocity_change: int = OUTER.size + 3
    heading_change: int = OUTER.size + 6
    accuracies: int = OUTER.size + 7  # heading variance, eph, epv, evh, evv
    counters: int = OUTER.size + 12  # position, velocity, heading
    valid: int = (
        OUTER.size + 15
    )  # position and velocity: horizontal, vertical; heading; on earth: horizontal, vertical
    dead_reckoning: int = OUTER.size + 22
    size: int = OUTER.size + 23


AT = LocalColumns()
_VALID = (
    "xy_valid",
    "z_valid",
    "v_xy_valid",
    "v_z_valid",
    "heading_good_for_control",
    "xy_global",
    "z_global",
)
_ON_TRUTH = OUTER_TOPICS[0]

LOCAL_POSITION = Topic(
    _ON_TRUTH.name,
    (
        *(field for field in _ON_TRUTH.fields if field.name not in _VALID),
        Field("float", "delta_xy", 2, AT.position_change),
        Field("float", "delta_z", 0, AT.position_change + 2),
        Field("float", "delta_vxy", 2, AT.velocity_change),
        Field("float", "delta_vz", 0, AT.velocity_change + 2),
        Field("float", "delta_heading", 0, AT.heading_change),
        *(
            Field("float", name, 0, AT.accuracies + at)
            for at, name in enumerate(("heading_var", "eph", "epv", "evh", "evv"))
        ),
        Field("uint8_t", "xy_reset_counter", 0, AT.counters),
        Field("uint8_t", "z_reset_counter", 0, AT.counters),
        Field("uint8_t", "vxy_reset_counter", 0, AT.counters + 1),
        Field("uint8_t", "vz_reset_counter", 0, AT.counters + 1),
        Field("uint8_t", "heading_reset_counter", 0, AT.counters + 2),
        *(Field("bool", name, 0, AT.valid + at) for at, name in enumerate(_VALID)),
        Field("bool", "dead_reckoning", 0, AT.dead_reckoning),
    ),
)
"""A reset counts in horizontal and vertical direction, with a change of zero where there is none."""
SENSED_OUTER = Group("outer", AT.size, (LOCAL_POSITION, *OUTER_TOPICS[1:]))


@compiled
def count_of(resets: float) -> int:
    """Return a number of resets as topics have it, modulo 256."""
    return int(resets) & 0xFF


@compiled
def store_local_position(
    memory: MemoryArray, track: TrackArray, has_origin: bool, time_s: float, row: FloatArray
) -> int:
    """Fill the columns of the estimate in a row of the outer loop, shape (23,), those of ``LocalColumns``.

    ``track`` has the inertial samples, ``time_s`` is the time of the sensors, ``has_origin`` is True after the first
    fix. Return 1 if the horizontal position is valid, else 0.
    """
    report, m = report_kernel(memory, track, time_s), memory[0]
    p, position, velocity, yaw = (
        m["covariance"],
        m["resets"]["position"],
        m["resets"]["velocity"],
        m["resets"]["yaw"],
    )
    moved_m, moved_m_s = position["change"], velocity["change"]
    solution, control = report.solution, report.control
    horizontal = has_origin and solution & SOLUTION.POSITION_RELATIVE != 0
    vertical = solution & SOLUTION.HEIGHT_ABSOLUTE != 0
    store(row, (
        moved_m[0], moved_m[1], moved_m[2], moved_m_s[0], moved_m_s[1], moved_m_s[2], yaw["change_rad"],
        p[ATTITUDE + 2, ATTITUDE + 2], report.horizontal_accuracy_m, report.vertical_accuracy_m,
        math.sqrt(abs(p[VELOCITY, VELOCITY] + p[VELOCITY + 1, VELOCITY + 1])),
        math.sqrt(abs(p[VELOCITY + 2, VELOCITY + 2])),
        count_of(position["number"]), count_of(velocity["number"]), count_of(yaw["number"]),
        horizontal, vertical,
        solution & SOLUTION.VELOCITY_HORIZONTAL != 0, solution & SOLUTION.VELOCITY_VERTICAL != 0,
        control & CONTROL.YAW_ALIGN != 0,
        has_origin and solution & SOLUTION.POSITION_ABSOLUTE != 0, has_origin and vertical,
        control & CONTROL.INERTIAL_DEAD_RECKONING != 0,
    ))  # fmt: skip
    return 1 if horizontal else 0
