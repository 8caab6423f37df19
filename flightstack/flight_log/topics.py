"""Topics of the log: those sampled from the traces of the loops, and those written at events.

Topics and fields have PX4's names where the meaning is the same. Fields are sorted by type size, as in PX4, so that no
padding is needed. The columns of the inner loop's trace are ``LoopRow``.
"""

from __future__ import annotations

from math import nan
from typing import NamedTuple

from flightstack.core.contract import LoopRow
from flightstack.core.enums import NAVIGATION_STATE, Mode
from flightstack.params.vehicle import system_type


class OuterColumns(NamedTuple):
    """First column of each group in the outer loop's trace; ``size`` is the row length."""

    state: int = 0  # VehicleState, 13
    setpoint: int = 13  # PositionSetpoint, 11
    target_attitude: int = 24  # AttitudeTarget: quaternion, 4
    target_thrust: int = 28  # AttitudeTarget: thrust [N]
    loop_flags: int = 29  # LoopFlags, 0 while the loops are idle
    size: int = 30


OUTER = OuterColumns()
ATTITUDE_AT = OUTER.state + 6


class Bit(NamedTuple):
    """A flag in a column of whole numbers; 0 is never set."""

    column: int
    flag: int


class Opposite(NamedTuple):
    """Numbers from a column on, with the opposite sign."""

    column: int


class Heading(NamedTuple):
    """Yaw [rad] of the quaternion in four columns."""

    column: int


class Field(NamedTuple):
    """A field, an array if ``length`` is not 0.

    ``source`` is the first column of the trace, something that is made of columns, or None for a constant.
    """

    type: str
    name: str
    length: int = 0
    source: int | Bit | Opposite | Heading | None = None
    default: float = 0.0


class Topic(NamedTuple):
    """A topic; its first field is ``uint64_t timestamp`` [µs]."""

    name: str
    fields: tuple[Field, ...]


class Group(NamedTuple):
    """Topics written from the rows of one trace with this number of columns."""

    name: str
    columns: int
    topics: tuple[Topic, ...]


def inner_topics(rotors: int) -> tuple[Topic, ...]:
    """Return the topics written at the inner loop's rate for a vehicle with ``rotors`` rotors."""
    return (
        Topic("vehicle_attitude", (Field("float", "q", 4, LoopRow.STATE.start + 6),)),
        Topic("vehicle_angular_velocity", (Field("float", "xyz", 3, LoopRow.STATE.start + 10),)),
        Topic(
            "attitude_reference",
            (
                Field("float", "q", 4, LoopRow.REFERENCE_ATTITUDE.start),
                Field("float", "rates_rad_s", 3, LoopRow.REFERENCE_RATES.start),
                Field("float", "acceleration_rad_s2", 3, LoopRow.REFERENCE_ACCELERATION.start),
            ),
        ),
        Topic(
            "wrench",
            (
                Field("float", "thrust_n", 0, LoopRow.WRENCH.start),
                Field("float", "torque_n_m", 3, LoopRow.WRENCH.start + 1),
                Field("float", "thrust_achieved_n", 0, LoopRow.WRENCH_ACHIEVED.start),
                Field("float", "torque_achieved_n_m", 3, LoopRow.WRENCH_ACHIEVED.start + 1),
                Field("uint16_t", "status", 0, LoopRow.STATUS),
            ),
        ),
        Topic(
            "rotor_speeds",
            (
                Field("float", "command_rad_s", rotors, LoopRow.ROTOR_COMMAND.start),
                Field("float", "speed_rad_s", rotors, LoopRow.ROTOR_SPEED.start),
            ),
        ),
    )


OUTER_TOPICS = (
    Topic(
        "vehicle_local_position",
        (
            Field("double", "ref_lat"),
            Field("double", "ref_lon"),
            Field("float", "x", 0, OUTER.state),
            Field("float", "y", 0, OUTER.state + 1),
            Field("float", "z", 0, OUTER.state + 2),
            Field("float", "vx", 0, OUTER.state + 3),
            Field("float", "vy", 0, OUTER.state + 4),
            Field("float", "vz", 0, OUTER.state + 5),
            Field("float", "heading", 0, Heading(ATTITUDE_AT)),
            Field("float", "ref_alt"),
            Field("bool", "xy_valid", default=1),
            Field("bool", "z_valid", default=1),
            Field("bool", "v_xy_valid", default=1),
            Field("bool", "v_z_valid", default=1),
            Field("bool", "heading_good_for_control", default=1),
            Field("bool", "xy_global", default=1),
            Field("bool", "z_global", default=1),
        ),
    ),
    Topic(
        "trajectory_setpoint",
        (
            Field("float", "position", 3, OUTER.setpoint),
            Field("float", "velocity", 3, OUTER.setpoint + 3),
            Field("float", "acceleration", 3, OUTER.setpoint + 6),
            Field("float", "yaw", 0, OUTER.setpoint + 9),
            Field("float", "yawspeed", 0, OUTER.setpoint + 10),
        ),
    ),
    Topic(
        "vehicle_attitude_setpoint",
        # in newtons, unlike PX4's normalised thrust_body
        (
            Field("float", "q_d", 4, OUTER.target_attitude),
            Field("float", "thrust_n", 0, OUTER.target_thrust),
            Field("uint8_t", "loop_flags", 0, OUTER.loop_flags),
        ),
    ),
)

OUTER_GROUP = Group("outer", OUTER.size, OUTER_TOPICS)

BATTERY_GROUP = Group(
    "battery",
    3,
    (
        Topic(
            "battery_status",
            (
                Field("float", "voltage_v", 0, 0),
                Field("float", "current_a", 0, 1),
                Field("float", "remaining", 0, 2),
                Field("bool", "connected", default=1),
            ),
        ),
    ),
)

ARMING_STATE_DISARMED = 1
ARMING_STATE_ARMED = 2

_ROTARY_WING = 1

EVENT_TOPICS = (
    Topic(
        "vehicle_status",
        (
            Field("uint64_t", "nav_state_timestamp"),
            Field("uint8_t", "arming_state", default=ARMING_STATE_DISARMED),
            Field("uint8_t", "nav_state", default=NAVIGATION_STATE[Mode.HOLD]),
            Field("uint8_t", "vehicle_type", default=_ROTARY_WING),
            Field("uint8_t", "system_type", default=system_type(4)),
            Field("uint8_t", "system_id", default=1),
            Field("uint8_t", "component_id", default=1),
            Field("bool", "failsafe"),
            Field("bool", "pre_flight_checks_pass"),
        ),
    ),
    Topic(
        "mission_result",
        (
            Field("int32_t", "seq_reached", default=-1),
            Field("uint16_t", "mission_update_counter"),
            Field("uint16_t", "seq_current"),
            Field("uint16_t", "seq_total"),
            Field("bool", "valid"),
            Field("bool", "warning"),
            Field("bool", "finished"),
            Field("bool", "failure"),
        ),
    ),
    Topic(
        "vehicle_land_detected",
        (
            Field("bool", "freefall"),
            Field("bool", "ground_contact"),
            Field("bool", "maybe_landed"),
            Field("bool", "landed"),
        ),
    ),
    Topic(
        "home_position",
        (
            Field("double", "lat"),
            Field("double", "lon"),
            Field("float", "alt"),
            Field("float", "x"),
            Field("float", "y"),
            Field("float", "z"),
            Field("float", "yaw"),
            Field("bool", "valid_alt", default=1),
            Field("bool", "valid_hpos", default=1),
            Field("bool", "valid_lpos", default=1),
        ),
    ),
    Topic(
        "vehicle_command",
        (
            Field("double", "param5", default=nan),
            Field("double", "param6", default=nan),
            *(Field("float", f"param{index}", default=nan) for index in (1, 2, 3, 4, 7)),
            Field("uint32_t", "command"),
            Field("uint16_t", "source_component"),
            Field("uint8_t", "target_system"),
            Field("uint8_t", "target_component"),
            Field("uint8_t", "source_system"),
            Field("uint8_t", "confirmation"),
            Field("bool", "from_external", default=1),
        ),
    ),
    Topic(
        "vehicle_command_ack",
        (
            Field("uint32_t", "command"),
            Field("int32_t", "result_param2"),
            Field("uint16_t", "target_component"),
            Field("uint8_t", "result"),
            Field("uint8_t", "target_system"),
            Field("bool", "from_external"),
        ),
    ),
    # wall clock figures are NaN in lockstep, where the log must be deterministic
    Topic(
        "loop_timing",
        (
            Field("uint32_t", "ticks"),
            Field("uint32_t", "overruns"),
            Field("uint32_t", "missed"),
            Field("float", "inner_hz", default=nan),
            Field("float", "outer_hz", default=nan),
            Field("float", "execution_mean_us", default=nan),
            Field("float", "execution_p99_us", default=nan),
            Field("float", "execution_max_us", default=nan),
            Field("float", "lateness_mean_us", default=nan),
            Field("float", "lateness_p99_us", default=nan),
            Field("float", "lateness_max_us", default=nan),
            Field("uint8_t", "clock"),
        ),
    ),
)
