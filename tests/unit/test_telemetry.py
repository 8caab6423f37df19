"""Telemetry: every message against figures computed here, streams on both clocks, and absurd states."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from flightstack.commander.failsafe import Action
from flightstack.commander.fence_monitor import FenceBreaches
from flightstack.core.contract import LoopRow
from flightstack.core.enums import CUSTOM_MODE, Mode
from flightstack.core.geodesy import GeoPoint
from flightstack.guidance.fence import FenceBreach
from flightstack.guidance.mission import MissionProgress
from flightstack.mavlink.dialect import FS_LOOP_TIMING_ID, EscStatus, mavlink
from flightstack.mavlink.link import Link
from flightstack.services.telemetry.telemetry import STREAMED
from flightstack.services.telemetry.vehicle import autopilot_version, heartbeat, status_texts
from flightstack.simulator_link.endpoint import Battery
from tests.support.telemetry_status import EULER, HOME, W, X, Y, Z, status, telemetry

ATTITUDE = mavlink.MAVLINK_MSG_ID_ATTITUDE


def on_the_wire(message_id: int, **changes: object):
    """What a ground station decodes of the message."""
    (message,) = Link(255, 190).decode(
        Link(1, 1).encode(telemetry(status(**changes)).messages(message_id)[0])
    )
    assert message.get_msgId() == message_id
    return message


# ---------------------------------------------------------------------- what is said


def test_attitude_and_rates() -> None:
    m = on_the_wire(ATTITUDE)
    assert (m.roll, m.pitch, m.yaw) == pytest.approx(EULER, abs=1e-6)
    assert (m.rollspeed, m.pitchspeed, m.yawspeed) == pytest.approx((0.01, 0.02, 0.03))
    assert m.time_boot_ms == 12345
    q = on_the_wire(mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION)
    assert (q.q1, q.q2, q.q3, q.q4, q.yawspeed) == pytest.approx((W, X, Y, Z, 0.03), abs=1e-7)


def test_local_and_global_position() -> None:
    m = on_the_wire(mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED)
    assert (m.x, m.y, m.z, m.vx, m.vy, m.vz) == (10.0, -20.0, -30.0, 1.0, -2.0, 0.5)
    g = on_the_wire(mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT)
    # 10 m of latitude are 89.9 µdeg, 20 m of longitude at 47.4° 264.9 µdeg
    assert g.lat == pytest.approx(473977420 + 899, abs=2)
    assert g.lon == pytest.approx(85455940 - 2649, abs=3)
    assert (g.alt, g.relative_alt) == (518_000, 30_000)
    assert (g.vx, g.vy, g.vz) == (100, -200, 50)
    assert g.hdg == round(math.degrees(2.5) * 100)


def test_targets() -> None:
    a = on_the_wire(mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET)
    assert (list(a.q), a.thrust) == ([1.0, 0.0, 0.0, 0.0], pytest.approx(5.0 / 12.0))
    assert (a.body_roll_rate, a.body_pitch_rate, a.body_yaw_rate) == pytest.approx((0.4, 0.5, 0.6))
    p = on_the_wire(mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED)
    shown = (p.x, p.y, p.z, p.vx, p.vy, p.vz, p.afx, p.afy, p.afz, p.yaw, p.yaw_rate)
    assert shown == tuple(range(11))
    assert (p.coordinate_frame, p.type_mask) == (mavlink.MAV_FRAME_LOCAL_NED, 0)


def test_hud() -> None:
    m = on_the_wire(mavlink.MAVLINK_MSG_ID_VFR_HUD)
    assert m.groundspeed == pytest.approx(math.hypot(1.0, 2.0))
    assert (m.heading, m.throttle, m.alt, m.climb) == (143, 50, 518.0, -0.5)


@pytest.mark.parametrize(("yaw", "heading"), [(-0.1, 354), (-1e-9, 360), (math.pi, 180), (0.0, 0)])
def test_headings_are_0_to_360(yaw: float, heading: int) -> None:
    state = status().state.copy()
    state[6:10] = math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)
    assert on_the_wire(mavlink.MAVLINK_MSG_ID_VFR_HUD, state=state).heading == heading
    assert 0 <= on_the_wire(mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, state=state).hdg <= 35999


@pytest.mark.parametrize(("rotors", "expected"), [(4, [(0, 100.0)]), (6, [(0, 100.0), (4, 500.0)])])
def test_rotor_speeds_in_groups_of_four(rotors: int, expected: list[tuple[int, float]]) -> None:
    sent = telemetry(status({"rotors": rotors})).messages(EscStatus.id)
    decoded = [next(Link(2, 1).decode(Link(1, 1).encode(message))) for message in sent]
    assert [(m.index, m.rpm[0]) for m in decoded] == [
        (at, round(speed * 30 / math.pi)) for at, speed in expected
    ]
    assert math.isnan(decoded[0].voltage[0])


@pytest.mark.parametrize(
    ("changes", "state"),
    [
        ({"landed": True}, mavlink.MAV_LANDED_STATE_ON_GROUND),
        ({"landed": True, "mode": Mode.TAKEOFF}, mavlink.MAV_LANDED_STATE_ON_GROUND),
        ({}, mavlink.MAV_LANDED_STATE_IN_AIR),
        ({"mode": Mode.TAKEOFF}, mavlink.MAV_LANDED_STATE_TAKEOFF),
        ({"mode": Mode.LAND}, mavlink.MAV_LANDED_STATE_LANDING),
    ],
)
def test_landed_state(changes: dict[str, object], state: int) -> None:
    assert on_the_wire(mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE, **changes).landed_state == state


def test_heartbeat_is_px4s() -> None:
    armed, disarmed = heartbeat(status()), heartbeat(status(armed=False, mode=Mode.HOLD))
    assert (armed.type, armed.autopilot) == (mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_PX4)
    assert (armed.custom_mode, disarmed.custom_mode) == (4 << 16 | 4 << 24, 4 << 16 | 3 << 24)
    assert armed.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    assert not disarmed.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    states = (armed.system_status, disarmed.system_status, heartbeat(status(), leaving=True).system_status)
    assert states == (mavlink.MAV_STATE_ACTIVE, mavlink.MAV_STATE_STANDBY, mavlink.MAV_STATE_POWEROFF)


@pytest.mark.parametrize(
    ("changes", "state"),
    [
        ({}, mavlink.MAV_STATE_ACTIVE),
        ({"failsafe_action": Action.WARN}, mavlink.MAV_STATE_ACTIVE),
        ({"failsafe_action": Action.HOLD}, mavlink.MAV_STATE_CRITICAL),
        ({"failsafe_action": Action.LAND}, mavlink.MAV_STATE_EMERGENCY),
        ({"mode": Mode.TERMINATION, "armed": False}, mavlink.MAV_STATE_FLIGHT_TERMINATION),
    ],
)
def test_heartbeat_reports_the_failsafe_action(changes: dict[str, object], state: int) -> None:
    assert heartbeat(status(**changes)).system_status == state


@pytest.mark.parametrize(
    ("changes", "state"),
    [
        ({"mission_count": 0}, mavlink.MISSION_STATE_NO_MISSION),
        ({"mission_complete": True}, mavlink.MISSION_STATE_COMPLETE),
        ({"armed": False}, mavlink.MISSION_STATE_NOT_STARTED),
        ({"mode": Mode.HOLD}, mavlink.MISSION_STATE_PAUSED),
        (
            {"mode": Mode.HOLD, "mission": MissionProgress(0, -1, False, False)},
            mavlink.MISSION_STATE_NOT_STARTED,
        ),
    ],
)
def test_mission_state(changes: dict[str, object], state: int) -> None:
    assert on_the_wire(mavlink.MAVLINK_MSG_ID_MISSION_CURRENT, **changes).mission_state == state


def test_mission_progress_and_its_end() -> None:
    m = on_the_wire(mavlink.MAVLINK_MSG_ID_MISSION_CURRENT)
    assert (m.seq, m.total, m.mission_state, m.mission_mode) == (2, 5, 3, 1)
    assert (
        on_the_wire(mavlink.MAVLINK_MSG_ID_MISSION_CURRENT, mission=MissionProgress(5, 4, True, False)).seq
        == 4
    )
    nothing = on_the_wire(mavlink.MAVLINK_MSG_ID_MISSION_CURRENT, mission_count=0)
    assert (nothing.seq, nothing.total) == (0, 65535)


@pytest.mark.parametrize(
    ("rotors", "system_type"),
    [
        (3, mavlink.MAV_TYPE_TRICOPTER),
        (4, mavlink.MAV_TYPE_QUADROTOR),
        (5, mavlink.MAV_TYPE_GENERIC_MULTIROTOR),
        (6, mavlink.MAV_TYPE_HEXAROTOR),
        (8, mavlink.MAV_TYPE_OCTOROTOR),
    ],
)
def test_the_heartbeat_announces_the_type_by_the_rotors(rotors: int, system_type: int) -> None:
    assert heartbeat(status({"rotors": rotors})).type == system_type


@pytest.mark.parametrize("rotors", [4, 6, 8])
def test_every_message_about_rotors_has_all_of_them(rotors: int) -> None:
    top = {"info": {"rotors": rotors, "top_speed_rad_s": (600.0,) * rotors}}
    outputs = on_the_wire(mavlink.MAVLINK_MSG_ID_ACTUATOR_OUTPUT_STATUS, **top)
    pulses = on_the_wire(mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW, **top)
    assert outputs.active == (1 << rotors) - 1
    assert [getattr(pulses, f"servo{number}_raw") > 0 for number in range(1, 9)] == [
        number <= rotors for number in range(1, 9)
    ]


def test_status_says_whether_it_can_arm_and_that_there_is_no_battery() -> None:
    m = on_the_wire(mavlink.MAVLINK_MSG_ID_SYS_STATUS)
    prearm = mavlink.MAV_SYS_STATUS_PREARM_CHECK
    assert m.onboard_control_sensors_health & prearm
    assert (m.voltage_battery, m.current_battery, m.battery_remaining) == (65535, -1, -1)
    refused = on_the_wire(mavlink.MAVLINK_MSG_ID_SYS_STATUS, can_arm=lambda: False)
    assert not refused.onboard_control_sensors_health & prearm
    assert refused.onboard_control_sensors_health
    assert not on_the_wire(
        mavlink.MAVLINK_MSG_ID_SYS_STATUS, state_is_good=False
    ).onboard_control_sensors_health


def test_home_and_origin() -> None:
    for message_id in (mavlink.MAVLINK_MSG_ID_HOME_POSITION, mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN):
        m = on_the_wire(message_id)
        assert (m.latitude, m.longitude, m.altitude) == (473977420, 85455940, 488000)


def test_time_wraps_as_the_field_does() -> None:
    late = on_the_wire(ATTITUDE, time_us=(2**32 + 5) * 1000)
    assert late.time_boot_ms == 5
    assert on_the_wire(mavlink.MAVLINK_MSG_ID_SYSTEM_TIME).time_boot_ms == 12345


def test_gps_altitude_and_battery_say_what_is_known() -> None:
    gps = on_the_wire(mavlink.MAVLINK_MSG_ID_GPS_RAW_INT)
    assert (gps.fix_type, gps.satellites_visible, gps.alt) == (3, 255, 518_000)
    assert gps.vel == round(math.hypot(1.0, -2.0) * 100)
    assert gps.cog == round(math.degrees(math.atan2(-2, 1)) % 360 * 100)
    assert on_the_wire(mavlink.MAVLINK_MSG_ID_GPS_RAW_INT, state_is_good=False).fix_type == 1
    lower_home = GeoPoint(HOME.latitude_deg, HOME.longitude_deg, HOME.altitude_m - 8.0)
    altitude = on_the_wire(mavlink.MAVLINK_MSG_ID_ALTITUDE, home=lower_home)
    assert (altitude.altitude_amsl, altitude.altitude_local, altitude.altitude_relative) == (
        518.0,
        30.0,
        38.0,
    )
    assert on_the_wire(mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, home=lower_home).relative_alt == 38_000
    none = on_the_wire(mavlink.MAVLINK_MSG_ID_BATTERY_STATUS)
    assert (none.voltages[0], none.current_battery, none.battery_remaining) == (0xFFFF, -1, -1)
    pack = Battery(voltage_v=11.72, current_a=8.51, remaining=0.473, valid=True)
    battery = on_the_wire(mavlink.MAVLINK_MSG_ID_BATTERY_STATUS, battery=pack)
    assert (battery.voltages[0], battery.current_battery, battery.battery_remaining) == (11_720, 851, 47)
    status = on_the_wire(mavlink.MAVLINK_MSG_ID_SYS_STATUS, battery=pack)
    assert (status.voltage_battery, status.current_battery, status.battery_remaining) == (11_720, 851, 47)


def test_odometry_has_its_velocity_in_the_body_frame() -> None:
    m = on_the_wire(mavlink.MAVLINK_MSG_ID_ODOMETRY)
    expected = Rotation.from_quat((X, Y, Z, W)).inv().apply((1.0, -2.0, 0.5))
    assert (m.vx, m.vy, m.vz) == pytest.approx(expected, abs=1e-6)
    assert (m.frame_id, m.child_frame_id) == (mavlink.MAV_FRAME_LOCAL_NED, mavlink.MAV_FRAME_BODY_FRD)


def test_a_breached_fence_is_ill() -> None:
    fence = mavlink.MAV_SYS_STATUS_GEOFENCE
    assert on_the_wire(mavlink.MAVLINK_MSG_ID_SYS_STATUS).onboard_control_sensors_health & fence
    ill = on_the_wire(mavlink.MAVLINK_MSG_ID_SYS_STATUS, fence_breached=True)
    assert not ill.onboard_control_sensors_health & fence
    assert ill.onboard_control_sensors_enabled & fence
    assert on_the_wire(mavlink.MAVLINK_MSG_ID_FENCE_STATUS, fence_breached=True).breach_status == 1


def test_a_breach_is_told_with_its_kind_number_and_time() -> None:
    breaches = FenceBreaches(3, 1_234_567, FenceBreach.TOO_HIGH)
    for broken in (True, False):  # the latest is told after its end too
        m = on_the_wire(mavlink.MAVLINK_MSG_ID_FENCE_STATUS, fence_breached=broken, fence_breaches=breaches)
        assert (m.breach_status, m.breach_count, m.breach_type, m.breach_time) == (broken, 3, 2, 1234)


@pytest.mark.parametrize(
    ("level", "state"),
    [
        (0, mavlink.MAV_BATTERY_CHARGE_STATE_OK),
        (1, mavlink.MAV_BATTERY_CHARGE_STATE_LOW),
        (2, mavlink.MAV_BATTERY_CHARGE_STATE_CRITICAL),
        (3, mavlink.MAV_BATTERY_CHARGE_STATE_EMERGENCY),
    ],
)
def test_the_charge_has_a_state_where_it_is_known(level: int, state: int) -> None:
    kind = mavlink.MAVLINK_MSG_ID_BATTERY_STATUS
    pack = Battery(voltage_v=11.7, current_a=8.5, remaining=0.1, valid=True)
    assert on_the_wire(kind, battery=pack, battery_level=level).charge_state == state
    assert on_the_wire(kind, battery_level=level).charge_state == mavlink.MAV_BATTERY_CHARGE_STATE_UNDEFINED


def test_nothing_is_estimated_from_a_state_that_is_not_good() -> None:
    kind = mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS
    assert on_the_wire(kind).flags
    assert on_the_wire(kind, state_is_good=False).flags == 0


def test_a_fence_without_action_is_not_enabled() -> None:
    idle = on_the_wire(mavlink.MAVLINK_MSG_ID_SYS_STATUS, fence_acts=False)
    assert not idle.onboard_control_sensors_enabled & mavlink.MAV_SYS_STATUS_GEOFENCE
    assert idle.onboard_control_sensors_present & mavlink.MAV_SYS_STATUS_GEOFENCE


def test_every_mode_is_listed_and_named_once() -> None:
    listed = telemetry().requested(mavlink.MAVLINK_MSG_ID_AVAILABLE_MODES)
    assert sorted(m.custom_mode for m in listed) == sorted(CUSTOM_MODE.values())
    assert [m.mode_index for m in listed] == list(range(1, len(listed) + 1))
    assert {m.number_modes for m in listed} == {len(listed)}
    (third,) = telemetry().requested(mavlink.MAVLINK_MSG_ID_AVAILABLE_MODES, 3.0)
    assert third.custom_mode == listed[2].custom_mode
    for index in (-1.0, 0.5, len(listed) + 1.0, math.inf, 1e30):
        some = telemetry().requested(mavlink.MAVLINK_MSG_ID_AVAILABLE_MODES, index)
        assert len(some) in (0, len(listed))
    (decoded,) = Link(255, 190).decode(Link(1, 1).encode(listed[0]))
    assert decoded.mode_name == "Hold"
    assert on_the_wire(mavlink.MAVLINK_MSG_ID_CURRENT_MODE).custom_mode == CUSTOM_MODE[Mode.MISSION]


def test_a_generic_vehicle_does_not_call_itself_px4() -> None:
    assert heartbeat(status({"is_generic": True})).autopilot == mavlink.MAV_AUTOPILOT_GENERIC


def test_version_is_ours() -> None:
    m = autopilot_version(status({"system_id": 3}))
    assert m.uid == 3
    assert m.capabilities & mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT


@settings(max_examples=60)
@given(st.lists(st.floats(allow_nan=True, allow_infinity=True), min_size=13, max_size=13), st.floats())
def test_no_state_is_too_absurd_to_be_told(values: list[float], thrust: float) -> None:
    """Doubles of any size go through single-precision and integer fields."""
    state, row = np.array(values), np.resize(values, LoopRow.SIZE)
    strange = status(
        state=state, row=row, setpoint=np.resize(values, 11), attitude_target=np.array([*values[:4], thrust])
    )
    codec = Link(1, 1)
    for message_id in STREAMED:
        for message in telemetry(strange).messages(message_id):
            assert codec.encode(message)


# ---------------------------------------------------------------------- texts


@pytest.mark.parametrize("length", [0, 1, 49, 50, 51, 99, 100, 101, 150, 240])
def test_long_texts_come_in_chunks_of_which_only_the_last_is_not_full(length: int) -> None:
    text = "".join(chr(65 + index % 26) for index in range(length))
    link, station = Link(1, 1), Link(255, 190)
    chunks = [next(station.decode(link.encode(message))) for message in status_texts(4, text)]
    assert "".join(chunk.text for chunk in chunks) == text
    if length <= 50:
        assert [(chunk.id, chunk.chunk_seq) for chunk in chunks] == [(0, 0)]
    else:
        assert len({chunk.id for chunk in chunks}) == 1
        assert chunks[0].id > 0
        assert [chunk.chunk_seq for chunk in chunks] == list(range(len(chunks)))
        # "any null character in the text field is taken to mean this was the last chunk"
        assert [len(chunk.text) == 50 for chunk in chunks] == [True] * (len(chunks) - 1) + [False]


def test_texts_are_utf_8() -> None:
    (message,) = status_texts(6, "Höhe 5 m")
    assert message._text_raw == "Höhe 5 m".encode()  # pymavlink shows texts as ASCII


def test_the_loops_timing_is_streamed() -> None:
    assert on_the_wire(FS_LOOP_TIMING_ID).inner_hz == 500.0
