"""Topics that are written when something changes, one message at a time. Names as in ``topics``."""

from __future__ import annotations

from math import nan

from flightstack.core.modes import NAVIGATION_STATE, Mode
from flightstack.flight_log.topics import Field, Topic
from flightstack.params.vehicle import system_type

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
    # Figures taken from the wall clock stay NaN in lockstep, where the same flight must give the same bytes.
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
