"""Every message and log topic takes any value: clocks and counters wrap, quantities saturate, nothing raises."""

from __future__ import annotations

import io
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyulog import ULog

from flightstack.commander.fence_monitor import FenceBreaches
from flightstack.core.enums import Mode
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.flight_log.flight_log import FlightLog
from flightstack.flight_log.topics import EVENT_TOPICS
from flightstack.guidance.fence import FenceBreach
from flightstack.guidance.mission import MissionProgress
from flightstack.mavlink.dialect import FsLoopTiming, mavlink
from flightstack.mavlink.fields import fitted
from flightstack.mavlink.link import Link
from flightstack.mavlink.log_messages import log_data_message
from flightstack.params.vehicle import load_vehicle
from flightstack.services.telemetry.telemetry import STREAMED
from flightstack.services.telemetry.vehicle import status_texts
from flightstack.simulator_link.battery_frame import decode_battery, encode_battery
from flightstack.simulator_link.endpoint import Battery
from flightstack.vehicle.status import FlightTimes, PlanIds
from gcs_cli.clients.mission_client import MissionClient
from sim_bridge.plant.battery import BatteryState, battery_report
from sim_bridge.server.hil import hil_state
from sim_bridge.simulator import Simulator
from tests.support.synthetic_flight import HOME, KeptBytes
from tests.support.telemetry_status import status, telemetry

KINDS = sorted((kind for kind in mavlink.mavlink_map.values() if kind.id >= 0), key=lambda kind: kind.id)
DAY_US = 86_400_000_000
UNIX_US = 1_790_000_000_000_000
HUGE_INTEGERS = st.one_of(
    st.integers(-(2**70), 2**70), st.sampled_from([0, -1, 2**16, 2**31, 2**32, 2**63, 2**64, UNIX_US])
)
ANY_FLOAT = st.one_of(st.floats(), st.sampled_from([3.5e38, -1e300, math.nan, math.inf, -math.inf]))


def over_the_wire(message):
    """What the other end decodes; exactly one message."""
    (decoded,) = Link(255, 190).decode(Link(1, 1).encode(message))
    assert decoded.get_msgId() == message.get_msgId()
    return decoded


def filled(kind, number: float, text: bytes):
    """A message of ``kind`` with ``number`` in every field, ``text`` in every text."""
    arrays = {name: kind.array_lengths[kind.ordered_fieldnames.index(name)] for name in kind.fieldnames}
    values = []
    for name, field_type in zip(kind.fieldnames, kind.fieldtypes, strict=True):
        value = text if field_type == "char" else number
        is_list = arrays[name] and field_type != "char"
        values.append([value] * arrays[name] if is_list else value)
    return kind(*values)


@settings(max_examples=24)
@given(number=st.one_of(HUGE_INTEGERS, ANY_FLOAT), text=st.binary(max_size=300))
def test_every_message_of_the_dialect_takes_any_number(number: float, text: bytes) -> None:
    for kind in KINDS:
        try:
            over_the_wire(filled(kind, number, text))
        except Exception as error:
            error.add_note(kind.msgname)
            raise


@settings(max_examples=80)
@given(
    times=st.lists(HUGE_INTEGERS, min_size=5, max_size=5),
    counts=st.lists(HUGE_INTEGERS, min_size=8, max_size=8),
    values=st.lists(ANY_FLOAT, min_size=13, max_size=13),
)
def test_telemetry_of_extreme_facts_is_sent(times: list[int], counts: list[int], values: list[float]) -> None:
    strange = status(
        time_us=times[0], flight=FlightTimes(*times[1:4]), state=np.array(values),
        row=np.resize(values, 48), setpoint=np.resize(values, 11), attitude_target=np.array(values[:5]),
        fence_breaches=FenceBreaches(counts[0], times[4], FenceBreach.OUTSIDE), plan_ids=PlanIds(*counts[1:4]),
        mission=MissionProgress(counts[4], -1, False, False), mission_count=counts[5], mode=Mode.OFFBOARD,
        battery=Battery(voltage_v=values[0], current_a=values[1], remaining=values[2], valid=True),
    )  # fmt: skip

    def timing() -> FsLoopTiming:
        return FsLoopTiming(times[0], *counts[5:8], values[0], values[1], values[2], *values[3:9], 0)

    for message_id in STREAMED:
        for message in telemetry(strange, timing).messages(message_id):
            over_the_wire(message)


@settings(max_examples=40)
@given(time_us=HUGE_INTEGERS, values=st.lists(ANY_FLOAT, min_size=13, max_size=13))
def test_simulator_state_of_extreme_values_is_sent(time_us: int, values: list[float]) -> None:
    vehicle = load_vehicle("paper_quad")
    simulator = Simulator(vehicle)
    simulator.time_us = time_us
    simulator.frame.state[:] = values
    over_the_wire(hil_state(simulator, LocalFrame(GeoPoint(47.0, 8.0, 400.0))))
    frame = encode_battery(battery_report(BatteryState(*values[:5]), 4), 0, 1, 51)
    assert decode_battery(frame) is not None


@pytest.mark.parametrize("text", ["", "x" * 20_000, "ö" * 3000])
def test_long_texts_are_sent(text: str) -> None:
    for message in status_texts(6, text):
        over_the_wire(message)


def test_log_blocks_take_any_number() -> None:
    over_the_wire(log_data_message(2**16 + 3, 2**32 + 5, b"x" * 90))


def test_a_plan_too_long_for_its_count_is_not_announced_as_a_short_one() -> None:
    client = MissionClient((1, 1), (255, 190))
    client.start_upload([object()] * (2**16 + 3))
    (count,) = client.poll(0.0)
    assert over_the_wire(count).count == 0xFFFF


@pytest.mark.parametrize(
    ("message_id", "field", "changes", "expected"),
    [
        (mavlink.MAVLINK_MSG_ID_FLIGHT_INFORMATION, "landing_time", {"flight": FlightTimes(1, 2, 60 * DAY_US)},
         60 * DAY_US // 1000 % 2**32),
        (mavlink.MAVLINK_MSG_ID_FLIGHT_INFORMATION, "time_boot_ms", {"time_us": UNIX_US}, UNIX_US // 1000 % 2**32),
        (mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW, "time_usec", {"time_us": UNIX_US}, UNIX_US % 2**32),
        (mavlink.MAVLINK_MSG_ID_FENCE_STATUS, "breach_time",
         {"fence_breaches": FenceBreaches(1, 50 * DAY_US, FenceBreach.OUTSIDE)},
         50 * DAY_US // 1000 % 2**32),
    ],
)  # fmt: skip
def test_clocks_wrap_at_the_range_of_their_field(message_id, field, changes, expected) -> None:
    (message,) = telemetry(status(**changes)).messages(message_id)
    assert getattr(over_the_wire(message), field) == expected


@pytest.mark.parametrize(
    ("value", "code", "wraps", "expected"),
    [
        (2**32 + 5, "I", True, 5), (-1, "I", True, 2**32 - 1), (2**63, "q", True, -(2**63)),
        (40_000, "h", False, 32_767), (-40_000.7, "h", False, -32_768), (math.nan, "h", False, 0),
        (math.inf, "I", True, 0), (1e39, "f", False, math.inf), (-(10**400), "d", False, -math.inf),
        (3.6, "B", False, 4), (7, "?", False, 1),
    ],
)  # fmt: skip
def test_number_is_fitted_into_its_field(value, code, wraps, expected) -> None:
    assert fitted(value, code, wraps) == expected


@pytest.mark.parametrize(
    ("kind", "field", "value", "expected"),
    [
        (mavlink.MAVLink_gps_raw_int_message, "eph", 70_000, 0xFFFF),
        (mavlink.MAVLink_gps_raw_int_message, "satellites_visible", 300, 255),
        (mavlink.MAVLink_hil_gps_message, "epv", -1, 0),
        (mavlink.MAVLink_rc_channels_message, "rssi", 256, 255),
        (mavlink.MAVLink_mission_current_message, "seq", 70_000, 0xFFFF),
        (mavlink.MAVLink_fence_status_message, "breach_count", 2**16 + 3, 3),
        (mavlink.MAVLink_odometry_message, "reset_counter", 258, 2),
        (mavlink.MAVLink_sys_status_message, "errors_comm", 2**16 + 1, 1),
    ],
)
def test_counters_wrap_and_other_fields_saturate(kind, field: str, value: int, expected: int) -> None:
    message = filled(kind, 0, b"")
    setattr(message, field, value)
    assert getattr(over_the_wire(message), field) == expected


def logged(*events: tuple[int, dict[str, float]], topic: str) -> ULog:
    file = KeptBytes()
    log = FlightLog(file, 4)
    log.start(0, {"many": 2**40}, {"HUGE": 1e39, "LARGE": 2**40}, HOME)
    for time_us, values in events:
        log.event(topic, time_us, **values)
    log.close()
    read = ULog(io.BytesIO(file.content))
    assert not read.file_corruption
    return read


@pytest.mark.parametrize("topic", EVENT_TOPICS, ids=lambda topic: topic.name)
@settings(max_examples=20)
@given(time_us=HUGE_INTEGERS, number=st.one_of(HUGE_INTEGERS, ANY_FLOAT))
def test_every_event_topic_takes_any_number(topic, time_us: int, number: float) -> None:
    read = logged((time_us, {field.name: number for field in topic.fields}), (5, {}), topic=topic.name)
    assert len(read.get_dataset(topic.name).data["timestamp"]) == 2


def test_logged_counters_wrap() -> None:
    data = logged((1, {"mission_update_counter": 2**16 + 7}), topic="mission_result").get_dataset(
        "mission_result"
    )
    assert data.data["mission_update_counter"].tolist() == [7]
    data = logged((1, {"ticks": 2**32 + 9}), topic="loop_timing").get_dataset("loop_timing")
    assert data.data["ticks"].tolist() == [9]


def test_logged_numbers_that_are_no_counters_saturate() -> None:
    data = logged((1, {"command": 2**32 + 9, "confirmation": 256}), topic="vehicle_command")
    fields = data.get_dataset("vehicle_command").data
    assert (fields["command"].tolist(), fields["confirmation"].tolist()) == ([2**32 - 1], [255])
