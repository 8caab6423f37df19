"""Messages folded into the vehicle's snapshot, through pymavlink's encoder and decoder."""

from __future__ import annotations

import math
import struct
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flightstack.mavlink.dialect import NAME_IN_VERSION, EscStatus, FsLoopTiming, ardupilot_dialect, mavlink
from flightstack.mavlink.link import Link
from gcs_cli.vehicle.status_texts import PIECE_TIMEOUT_S
from gcs_cli.vehicle.vehicle_view import FOLDS, MEASUREMENTS, TIMES
from gcs_cli.vehicle.view_types import TEXTS_KEPT, VehicleView
from tests.support.folded_vehicle import HOLD_MODE, Vehicle, heartbeat

NAN, INF = math.nan, math.inf


@pytest.fixture
def vehicle() -> Vehicle:
    made = Vehicle()
    made.send(heartbeat())
    return made


def test_the_first_heartbeat_of_an_autopilot_decides_who_it_is() -> None:
    vehicle = Vehicle(7, 1)
    assert vehicle.send(mavlink.MAVLink_attitude_message(1, 0, 0, 0, 0, 0, 0)).attitude is None
    assert vehicle.send(heartbeat(autopilot=8)).identity is None  # a ground station
    assert vehicle.send(heartbeat()).identity == (7, 1, 2, 12)


def test_messages_of_other_systems_and_components_change_nothing(vehicle: Vehicle) -> None:
    before = vehicle.view
    for system, component in ((2, 1), (1, 100)):
        stranger = Vehicle(system, component)
        stranger.view = before
        assert stranger.send(heartbeat(base=128)) is before


def test_heartbeat_tells_mode_arming_and_shut_down(vehicle: Vehicle) -> None:
    view = vehicle.send(heartbeat(base=128), 3.0)
    assert (view.mode, view.armed, view.ever_armed, view.last_heartbeat_s) == ("MISSION", True, True, 3.0)
    view = vehicle.send(heartbeat(state=7))
    assert (view.armed, view.ever_armed, view.powered_off) == (False, True, True)


def test_loss_is_five_seconds_without_heartbeat(vehicle: Vehicle) -> None:
    assert not vehicle.view.lost(6.0)
    assert vehicle.view.lost(6.01)
    assert not VehicleView().lost(1e9)


def test_kinematics(vehicle: Vehicle) -> None:
    vehicle.send(mavlink.MAVLink_attitude_message(12_500, 0.1, -0.2, 3.0, 0.01, 0.02, 0.03))
    vehicle.send(mavlink.MAVLink_local_position_ned_message(12_600, 1, 2, -3, 4, 5, -6))
    vehicle.send(
        mavlink.MAVLink_global_position_int_message(12_700, 473977420, -85455940, 491_000, 3_000, 0, 0, 0, 0)
    )
    view = vehicle.send(
        mavlink.MAVLink_home_position_message(10, 20, 488_000, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0, 0)
    )
    assert view.attitude == pytest.approx((0.1, -0.2, 3.0))
    assert view.rates_frd_rad_s == pytest.approx((0.01, 0.02, 0.03))
    assert (view.position_ned_m, view.velocity_ned_m_s) == ((1, 2, -3), (4, 5, -6))
    assert view.geo == pytest.approx((47.397742, -8.545594, 491.0, 3.0))
    assert view.home is not None
    assert view.home.altitude_m == 488.0
    assert view.time_s == 12.7


def test_setpoint_leaves_out_what_the_mask_ignores(vehicle: Vehicle) -> None:
    def target(mask: int, x: float = 1.0) -> Any:
        return mavlink.MAVLink_position_target_local_ned_message(
            0, 1, mask, x, 2, 3, 4, 5, 6, 0, 0, 0, 0.5, 0
        )

    view = vehicle.send(target(0))
    assert view.setpoint == ((1, 2, 3), (4, 5, 6), 0.5, False)
    assert vehicle.send(target(0b111)).setpoint == (None, (4, 5, 6), 0.5, False)
    assert vehicle.send(target(0b111 << 3 | 1 << 10)).setpoint == ((1, 2, 3), None, None, False)
    assert vehicle.send(target(0, NAN)).setpoint == (None, (4, 5, 6), 0.5, False)


def test_setpoint_of_ardupilot_is_global_and_ends_with_the_mode(vehicle: Vehicle) -> None:
    def target(frame: int, altitude_m: float, mask: int = 0xFFF8) -> Any:
        return mavlink.MAVLink_position_target_global_int_message(
            0, frame, mask, 473980000, 85460000, altitude_m, 0, 0, 0, 0, 0, 0, 0, 0
        )

    assert vehicle.send(target(0, 500.0)).setpoint is None  # the vehicle's own position is unknown
    vehicle.send(mavlink.MAVLink_local_position_ned_message(0, 10, 20, -5, 0, 0, 0))
    vehicle.send(
        mavlink.MAVLink_global_position_int_message(0, 473970000, 85450000, 493_000, 3_000, 0, 0, 0, 0)
    )
    assert vehicle.send(target(0, 500.0, 7)).setpoint is None
    for frame, altitude_m in ((0, 500.0), (5, 500.0), (3, 10.0), (6, 10.0)):
        setpoint = vehicle.send(target(frame, altitude_m)).setpoint
        assert setpoint is not None
        # 1e-3 degrees at 47 degrees north: 111.18 m and 75.49 m
        assert setpoint.position_ned_m == pytest.approx((121.18, 95.49, -12.0), abs=0.01)
        assert setpoint.velocity_ned_m_s is None
    assert vehicle.send(heartbeat()).setpoint is not None
    assert vehicle.send(heartbeat(mode=HOLD_MODE)).setpoint is None
    vehicle.send(
        mavlink.MAVLink_position_target_local_ned_message(0, 1, 0, 1, 2, 3, 4, 5, 6, 0, 0, 0, 0.5, 0)
    )
    local = vehicle.view.setpoint
    assert vehicle.send(target(0, 500.0)).setpoint == local
    assert vehicle.send(heartbeat(mode=HOLD_MODE)).setpoint == local
    assert vehicle.send(heartbeat()).setpoint is None  # the vehicle may send it in another frame now
    assert vehicle.send(target(10, 500.0)).setpoint is None  # above the terrain


def test_attitude_target_is_shown_as_angles(vehicle: Vehicle) -> None:
    half = 0.25
    q = [math.cos(half), 0.0, 0.0, math.sin(half)]  # yaw 0.5
    assert vehicle.send(mavlink.MAVLink_attitude_target_message(0, 0, q, 0, 0, 0, 0.5)).attitude_target == (
        pytest.approx((0.0, 0.0, 0.5), abs=1e-6)  # 32-bit floats
    )
    for bad in ([0.0] * 4, [NAN, 0, 0, 1], [INF, 0, 0, 0]):
        message = mavlink.MAVLink_attitude_target_message(0, 0, bad, 0, 0, 0, 0.5)
        assert vehicle.send(message).attitude_target is None


def test_battery_is_none_when_it_is_not_measured(vehicle: Vehicle) -> None:
    def status(voltage: int, current: int, remaining: int, health: int = 1) -> Any:
        return mavlink.MAVLink_sys_status_message(
            1, 1, health, 0, voltage, current, remaining, 0, 0, 0, 0, 0, 0
        )

    assert vehicle.send(status(65535, -1, -1)).battery is None
    assert vehicle.send(status(12_100, 530, 76)).battery == pytest.approx((0.76, 12.1, 5.3, None))
    assert vehicle.send(status(12_100, -1, -1)).battery == (None, 12.1, None, None)
    assert vehicle.view.healthy is True
    assert vehicle.send(status(65535, -1, -1, health=0)).healthy is False


def test_mission_progress(vehicle: Vehicle) -> None:
    vehicle.send(mavlink.MAVLink_mission_current_message(2, 6, 3, 1))
    view = vehicle.send(mavlink.MAVLink_mission_item_reached_message(1))
    assert view.mission[:4] == (2, 6, 1, 3)
    assert not view.mission.complete
    assert vehicle.send(mavlink.MAVLink_mission_current_message(5, 6, 5, 1)).mission.complete
    shorter = vehicle.send(mavlink.MAVLink_mission_current_message(0, 1, 2, 1)).mission
    assert shorter[:4] == (0, 1, None, 2)  # the item reached was another mission's


def test_rotor_speeds_come_in_groups_of_four() -> None:
    vehicle = Vehicle()
    vehicle.send(heartbeat(kind=mavlink.MAV_TYPE_OCTOROTOR))
    vehicle.send(EscStatus(4, 0, [5, 6, 7, -8], [0.0] * 4, [0.0] * 4))
    view = vehicle.send(EscStatus(0, 0, [1, 2, 3, 4], [0.0] * 4, [0.0] * 4))
    assert view.rotor_rpm == (1, 2, 3, 4, 5, 6, 7, -8)
    assert view.rotor_peak_rpm == 8
    assert vehicle.send(EscStatus(250, 0, [1, 1, 1, 1], [0.0] * 4, [0.0] * 4)).rotor_rpm == view.rotor_rpm


@pytest.mark.parametrize(
    ("kind", "name", "rotors"),
    [
        (mavlink.MAV_TYPE_QUADROTOR, "quadrotor", 4),
        (mavlink.MAV_TYPE_HEXAROTOR, "hexarotor", 6),
        (mavlink.MAV_TYPE_OCTOROTOR, "octorotor", 8),
        (mavlink.MAV_TYPE_GENERIC_MULTIROTOR, "multirotor", 8),
    ],
)
def test_the_type_of_vehicle_names_it_and_counts_its_rotors(kind: int, name: str, rotors: int) -> None:
    vehicle = Vehicle()
    identity = vehicle.send(heartbeat(kind=kind)).identity
    assert identity is not None
    assert identity.kind == name
    for first in (0, 4):
        view = vehicle.send(EscStatus(first, 0, [1, 2, 3, 4], [0.0] * 4, [0.0] * 4))
    assert len(view.rotor_rpm) == rotors


def test_a_vehicle_without_a_mission_has_no_number_of_items(vehicle: Vehicle) -> None:
    view = vehicle.send(mavlink.MAVLink_mission_current_message(0, 65535, 1, 2))
    assert view.mission.total is None


def test_loop_timing_turns_nan_into_unknown(vehicle: Vehicle) -> None:
    message = FsLoopTiming(2_500_000, 1250, 3, 4, 500.0, 100.0, NAN, 12.0, 20.0, INF, 1.0, 2.0, 3.0, 1)
    timing = vehicle.send(message).timing
    assert timing is not None
    assert timing[:4] == (2.5, 1250, 3, 4)
    assert (timing.real_time_factor, timing.execution_max_us, timing.lockstep) == (None, None, False)
    assert (timing.inner_hz, timing.lateness_max_us) == (500.0, 3.0)


def test_loop_timing_in_lockstep_has_no_overruns(vehicle: Vehicle) -> None:
    timing = vehicle.send(FsLoopTiming(2_500_000, 1250, 3, 4, 500.0, 100.0, *[1.0] * 7, 0)).timing
    assert timing is not None
    assert (timing.lockstep, timing.ticks, timing.overruns, timing.missed) == (True, 1250, None, None)


def test_status_texts_are_kept_numbered_and_bounded(vehicle: Vehicle) -> None:
    for index in range(TEXTS_KEPT + 20):
        vehicle.send(mavlink.MAVLink_statustext_message(6, f"text {index}".encode()))
    view = vehicle.view
    assert (len(view.texts), view.text_count) == (TEXTS_KEPT, TEXTS_KEPT + 20)
    assert [entry.text for entry in view.texts_since(TEXTS_KEPT + 18)] == ["text 118", "text 119"]


def test_long_status_texts_are_joined(vehicle: Vehicle) -> None:
    pieces = [b"a" * 50, b"b" * 50, b"c" * 7]
    for index, piece in enumerate(pieces):
        vehicle.send(mavlink.MAVLink_statustext_message(4, piece, 99, index))
    vehicle.send(mavlink.MAVLink_statustext_message(4, b"next", 0, 0))
    assert [entry.text for entry in vehicle.view.texts] == ["a" * 50 + "b" * 50 + "c" * 7, "next"]
    assert vehicle.view.text_count == 2


def test_a_long_status_text_shows_once_it_is_whole(vehicle: Vehicle) -> None:
    text = "a refusal whose reason needs 50 octets and then a few more, äöü"
    octets = text.encode()
    vehicle.send(mavlink.MAVLink_statustext_message(4, octets[:50], 7, 0))
    assert vehicle.view.texts == ()
    vehicle.send(mavlink.MAVLink_statustext_message(4, octets[50:], 7, 1))
    assert [entry.text for entry in vehicle.view.texts] == [text]


def test_a_letter_may_be_cut_between_two_pieces(vehicle: Vehicle) -> None:
    octets = b"x" * 49 + "é".encode()
    for index in (0, 1):
        vehicle.send(mavlink.MAVLink_statustext_message(4, octets[50 * index :][:50], 7, index))
    assert vehicle.view.texts[0].text == "x" * 49 + "é"


def test_a_text_of_exactly_full_pieces_ends_with_an_empty_one(vehicle: Vehicle) -> None:
    for index, piece in enumerate((b"a" * 50, b"")):
        vehicle.send(mavlink.MAVLink_statustext_message(4, piece, 7, index))
    assert [entry.text for entry in vehicle.view.texts] == ["a" * 50]


def test_a_text_whose_last_piece_is_lost_is_not(vehicle: Vehicle) -> None:
    vehicle.send(mavlink.MAVLink_statustext_message(4, b"a" * 50, 7, 0))
    assert vehicle.view.partial_text is not None
    first_s = vehicle.view.partial_text.received_s
    assert vehicle.send(heartbeat(), now_s=first_s + PIECE_TIMEOUT_S).texts == ()
    assert [entry.text for entry in vehicle.send(heartbeat(), now_s=first_s + 1.0).texts] == ["a" * 50]


def test_status_text_cannot_write_to_the_terminal(vehicle: Vehicle) -> None:
    vehicle.send(mavlink.MAVLink_statustext_message(6, b"\x1b[2Jhello\r\n[red]"))
    assert vehicle.view.texts[0].text == "�[2Jhello  [red]"


def test_gaps_in_the_sequence_are_counted_as_lost(vehicle: Vehicle) -> None:
    vehicle.link.encode(heartbeat())  # never arrives
    vehicle.link.encode(heartbeat())
    link = vehicle.send(heartbeat()).link
    assert (link.received, link.lost) == (2, 2)
    assert link.quality == 0.5


def test_a_message_that_others_overtook_is_not_lost(vehicle: Vehicle) -> None:
    late = vehicle.link.encode(heartbeat())
    vehicle.send(heartbeat())
    vehicle.receive(late)
    link = vehicle.send(heartbeat()).link
    assert (link.received, link.lost) == (4, 0)
    assert link.quality == 1.0


def test_a_sequence_that_begins_anew_counts_no_loss(vehicle: Vehicle) -> None:
    for _ in range(100):
        vehicle.send(heartbeat())
    vehicle.link = Link(1, 1)
    for _ in range(3):
        vehicle.send(heartbeat())
    assert vehicle.view.link.lost == 0


def test_a_vehicle_that_restarts_after_a_silence_has_lost_nothing(vehicle: Vehicle) -> None:
    for _ in range(200):
        vehicle.send(heartbeat())
    vehicle.link = Link(1, 1)
    assert vehicle.send(heartbeat(), now_s=6.0).link.lost == 0


def test_message_rate_is_measured_over_a_second() -> None:
    vehicle = Vehicle()
    for index in range(50):
        vehicle.send(heartbeat(), index * 0.1)
    assert vehicle.view.link.rate_hz == pytest.approx(10.0, rel=0.1)


def _raw_frame(message_id: int, payload: bytes) -> Any:
    """Decode ``payload`` as a message, whatever it holds."""
    kind = mavlink.mavlink_map[message_id]
    size = struct.calcsize(kind.unpacker.format)
    body = (payload * (size // max(1, len(payload)) + 1))[:size]
    frame = mavlink.MAVLink_message(message_id, kind.msgname)
    codec = mavlink.MAVLink(None, 1, 1)
    packed = frame._pack(codec, kind.crc_extra, body)
    return next(iter(Link(0, 0).decode(packed)), None)


ardupilot_dialect()
FOLDED = [
    0, 1, 2, 24, 30, 32, 33, 39, 42, 44, 46, 73, 74, 83, 85, 87, 147, 148, 162, 168, 193, 230, 231, 242, 245, 253, 291,
    435, 11030, 11031, 53002,
]  # fmt: skip


@settings(max_examples=150)
@given(st.lists(st.tuples(st.sampled_from(FOLDED), st.binary(min_size=1, max_size=64)), max_size=6))
def test_no_payload_raises(messages: list[tuple[int, bytes]]) -> None:
    vehicle = Vehicle()
    vehicle.send(heartbeat())
    for message_id, payload in messages:
        message = _raw_frame(message_id, payload)
        assert message is not None
        vehicle.receive(bytes(message.get_msgbuf()), 2.0)


def test_the_list_of_folded_messages_is_whole() -> None:
    assert {mavlink.mavlink_map[n].msgname for n in FOLDED} == {*FOLDS, *MEASUREMENTS, *TIMES}


def test_unhealthy_sensors_are_named(vehicle: Vehicle) -> None:
    present = mavlink.MAV_SYS_STATUS_SENSOR_GPS | mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG
    view = vehicle.send(
        mavlink.MAVLink_sys_status_message(
            present, present, mavlink.MAV_SYS_STATUS_SENSOR_GPS, 0, 15_000, -1, 90, 0, 0, 0, 0, 0, 0
        )
    )
    assert view.unhealthy == ("3d mag",)
    assert view.healthy is False


def test_battery_time_is_the_vehicles_own(vehicle: Vehicle) -> None:
    vehicle.send(mavlink.MAVLink_sys_status_message(0, 0, 0, 0, 15_000, -1, 90, 0, 0, 0, 0, 0, 0))
    cells = [15_000] + [65535] * 9
    message = mavlink.MAVLink_battery_status_message(0, 0, 0, 0, cells, -1, -1, -1, 90, 600)
    assert vehicle.send(message).battery_time_s == 600.0
    view = vehicle.send(mavlink.MAVLink_sys_status_message(0, 0, 0, 0, 15_000, -1, 89, 0, 0, 0, 0, 0, 0))
    assert view.battery_time_s == 600.0


def test_charge_at_arming_is_kept_until_disarmed(vehicle: Vehicle) -> None:
    def charge(percent: int) -> VehicleView:
        message = mavlink.MAVLink_sys_status_message(0, 0, 0, 0, 15_000, -1, percent, 0, 0, 0, 0, 0, 0)
        return vehicle.send(message)

    vehicle.send(heartbeat(base=1 | 128))
    vehicle.send(mavlink.MAVLink_system_time_message(0, 100_000))
    assert charge(90).charge_at_arming == (100.0, 0.9)
    vehicle.send(mavlink.MAVLink_system_time_message(0, 160_000))
    assert charge(80).battery_time_s == pytest.approx(480.0)
    vehicle.send(heartbeat())
    assert charge(80).charge_at_arming is None


def test_fence_breach_is_folded(vehicle: Vehicle) -> None:
    assert vehicle.send(mavlink.MAVLink_fence_status_message(1, 1, 3, 0)).fence_breached


def test_vehicle_of_this_project_is_distinguished_from_px4(vehicle: Vehicle) -> None:
    def version(custom: list[int]) -> Any:
        nothing = [0] * 8
        return mavlink.MAVLink_autopilot_version_message(0, 0, 0, 0, 0, custom, nothing, nothing, 0, 0, 0)

    assert vehicle.view.is_own is None
    assert vehicle.send(version(NAME_IN_VERSION)).is_own
    assert vehicle.send(version([1] * 8)).is_own is False


def test_rate_leaves_out_the_backlog_of_the_first_read() -> None:
    vehicle = Vehicle()
    for _ in range(500):
        vehicle.send(heartbeat(), 5.0)
    for step in range(1, 51):
        view = vehicle.send(heartbeat(), 5.0 + step / 40)
    assert view.link.rate_hz == pytest.approx(40.0)


def test_rate_counts_messages_that_were_read_late_once() -> None:
    vehicle = Vehicle()
    vehicle.send(heartbeat(), 5.0)
    for _ in range(120):  # of 3 s
        vehicle.send(heartbeat(), 8.0)
    for step in range(1, 51):
        assert vehicle.send(heartbeat(), 8.0 + step / 40).link.rate_hz == pytest.approx(40.0)


def test_standard_mode_without_a_name_has_the_standard_label() -> None:
    vehicle = Vehicle()
    vehicle.send(heartbeat())
    standard = mavlink.MAV_STANDARD_MODE_ALTITUDE_HOLD
    for name, mode in ((b"", standard), (b"Own", standard), (b"", 0)):
        message = mavlink.MAVLink_available_modes_message(1, 1, mode, 2 << 16, 0, name)
        view = vehicle.send(message)
        assert [each.label for each in view.modes] == ["Own" if name else "Altitude hold" if mode else ""]
