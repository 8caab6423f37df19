"""The local position of a vehicle on its sensors in the log: validity, accuracies and resets of the estimate.

Names and contents are PX4's. The rows of the outer loop have further columns for them, those of ``LocalColumns``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from flightstack.core.contract import FloatArray
from flightstack.estimation.error_state import ATTITUDE, VELOCITY
from flightstack.estimation.estimator_report import ControlFlags, SolutionFlags
from flightstack.estimation.sensed import Sensed
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


def fill_local_position(row: FloatArray, sensed: Sensed) -> bool:
    """Fill the columns of the estimate, shape (23,); return True if the horizontal position is valid."""
    report, resets, variances = sensed.report, sensed.report.resets, sensed.report.variances
    solution, has_origin = report.solution, sensed.has_origin
    horizontal = has_origin and bool(solution & SolutionFlags.POSITION_RELATIVE)
    vertical = bool(solution & SolutionFlags.HEIGHT_ABSOLUTE)
    row[:] = (
        *resets.position_change_m, *resets.velocity_change_m_s, resets.yaw_change_rad,
        variances[ATTITUDE + 2], report.horizontal_accuracy_m, report.vertical_accuracy_m,
        math.sqrt(abs(variances[VELOCITY] + variances[VELOCITY + 1])), math.sqrt(abs(variances[VELOCITY + 2])),
        resets.position & 0xFF, resets.velocity & 0xFF, resets.yaw & 0xFF,
        horizontal, vertical,
        bool(solution & SolutionFlags.VELOCITY_HORIZONTAL), bool(solution & SolutionFlags.VELOCITY_VERTICAL),
        bool(report.control & ControlFlags.YAW_ALIGN),
        has_origin and bool(solution & SolutionFlags.POSITION_ABSOLUTE), has_origin and vertical,
        bool(report.control & ControlFlags.INERTIAL_DEAD_RECKONING),
    )  # fmt: skip
    return horizontal
