"""Scripts on pymavlink: the verbs of ``mavutil`` that its users write, over every kind of link."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from pymavlink import mavparm

from tests.interop.conftest import Fleet
from tests.interop.stack import HOST, RealVehicle
from tests.interop.witness import Witness, mavutil
from tests.support.process import BOUND_S

mavlink = mavutil.mavlink
NAN = math.nan
NO_VELOCITY_NO_YAW = 0b1101_1111_1000
"""Type mask of SET_POSITION_TARGET: the position alone."""


@pytest.fixture(scope="module")
def linked(station_vehicle: RealVehicle) -> Iterator[Witness]:
    """A script on the ground station's UDP port, to which the vehicle speaks first."""
    script = Witness(f"udpin:{HOST}:{station_vehicle.gcs_port}", 1 + station_vehicle.instance)
    yield script
    script.close()


@pytest.fixture
def script(linked: Witness) -> Witness:
    """The script, from now on."""
    linked.catch_up()
    linked.beat()
    return linked


def fly_up(script: Witness) -> None:
    """Arm, take off in PX4's way (all NaN: MIS_TAKEOFF_ALT) and wait for the end of the climb."""
    script.arm()
    script.mav.command_long_send(script.system, 1, mavlink.MAV_CMD_NAV_TAKEOFF, 0, *[NAN] * 7)
    until_mode(script, "TAKEOFF")  # its heartbeat may come before the acknowledgement
    until_mode(script, "LOITER")
    ack = script.connection.messages["COMMAND_ACK"]
    assert (ack.command, ack.result) == (mavlink.MAV_CMD_NAV_TAKEOFF, mavlink.MAV_RESULT_ACCEPTED)


def until_mode(script: Witness, name: str) -> None:
    """Wait for a flight mode by the name that pymavlink gives it."""
    script.until("HEARTBEAT", lambda _: script.connection.flightmode == name)


def change_mode(script: Witness, name: str) -> None:
    """Set a mode as scripts do, and see it in a heartbeat."""
    script.connection.set_mode(name)
    until_mode(script, name)


def refused_mode(script: Witness, name: str) -> bool:
    """Set a mode and tell whether that was refused."""
    script.connection.set_mode(name)
    ack = script.until("COMMAND_ACK", lambda ack: ack.command == mavlink.MAV_CMD_DO_SET_MODE)
    return bool(ack.result != mavlink.MAV_RESULT_ACCEPTED)


def hold_setpoint(script: Witness, send: Callable[[], None], arrived: Callable[[Any], object]) -> None:
    """Send a setpoint at each report of the position, until it is reached."""
    while True:
        send()
        if arrived(script.until("LOCAL_POSITION_NED")):
            return


def near(*place: float) -> Callable[[Any], bool]:
    """Return a test of a LOCAL_POSITION_NED: within 0.3 m of ``place`` (NED, m)."""
    return lambda at: math.dist((at.x, at.y, at.z), place) < 0.3


@pytest.mark.parametrize("kind", ["tcp", "udpin", "udpout"])
def test_it_connects_and_knows_the_vehicle(station_vehicle: RealVehicle, kind: str) -> None:
    """As every script begins: ``wait_heartbeat`` tells whom to address."""
    port = {
        "tcp": station_vehicle.tcp_port,
        "udpin": station_vehicle.api_port,
        "udpout": 18570 + station_vehicle.instance,
    }[kind]
    connection = mavutil.mavlink_connection(f"{kind}:{HOST}:{port}")
    try:
        connection.mav.heartbeat_send(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 4)
        assert connection.wait_heartbeat(timeout=BOUND_S) is not None
        assert connection.target_system == 1 + station_vehicle.instance
        assert connection.flightmode == "LOITER"
        assert "OFFBOARD" in connection.mode_mapping()
        connection.param_fetch_one("MIS_TAKEOFF_ALT")
        value = connection.recv_match(type="PARAM_VALUE", blocking=True, timeout=BOUND_S)
        assert connection.params == {"MIS_TAKEOFF_ALT": value.param_value}
    finally:
        connection.close()


def test_all_parameters_come_each_under_its_index(script: Witness) -> None:
    script.connection.param_fetch_all()

    def listed(value: Any) -> bool:
        return bool(value.param_index < value.param_count)  # _HASH_CHECK is sent beside the list

    first = script.until("PARAM_VALUE", listed)
    names = {first.param_index: first.param_id}
    while len(names) < first.param_count:
        value = script.until("PARAM_VALUE", listed)
        names[value.param_index] = value.param_id
    assert sorted(names) == list(range(first.param_count))
    assert len(set(names.values())) == first.param_count
    script.connection.param_fetch_one(7)
    assert script.until("PARAM_VALUE").param_id == names[7]


@pytest.mark.parametrize(
    ("name", "value", "kind"),
    [
        ("MIS_TAKEOFF_ALT", 4.0, mavlink.MAV_PARAM_TYPE_REAL32),
        ("NAV_DLL_ACT", 2, mavlink.MAV_PARAM_TYPE_INT32),
    ],
)
def test_a_parameter_is_set_and_set_back(script: Witness, name: str, value: float, kind: int) -> None:
    """``mavset`` sends an integer bytewise, and waits for the echo."""
    script.connection.param_fetch_one(name)
    before = script.until("PARAM_VALUE")
    assert (before.param_id, before.param_type) == (name, kind)
    old = before.param_value if kind == mavlink.MAV_PARAM_TYPE_REAL32 else 0  # integers look like 0 as floats
    for wanted in (value, old):
        assert mavparm.MAVParmDict().mavset(script.connection, name, wanted, retries=3, parm_type=kind)


def test_unknown_and_impossible_parameters_are_refused(script: Witness) -> None:
    script.connection.param_fetch_one("NO_SUCH_PARAM")
    assert script.until("PARAM_ERROR").error == mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST
    script.connection.param_set_send("MIS_TAKEOFF_ALT", 1e9)
    assert script.until("PARAM_ERROR").error == mavlink.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE


def test_a_data_stream_is_requested_and_stopped(script: Witness) -> None:
    attitude = float(mavlink.MAVLINK_MSG_ID_ATTITUDE)
    target = (script.system, 0)
    script.mav.request_data_stream_send(*target, mavlink.MAV_DATA_STREAM_EXTRA1, 20, 1)
    script.command(mavlink.MAV_CMD_GET_MESSAGE_INTERVAL, attitude)
    assert script.connection.messages["MESSAGE_INTERVAL"].interval_us == 50_000
    first, second = script.until("ATTITUDE"), script.until("ATTITUDE")
    assert second.time_boot_ms - first.time_boot_ms >= 50
    script.mav.request_data_stream_send(*target, mavlink.MAV_DATA_STREAM_ALL, 0, 0)
    script.command(mavlink.MAV_CMD_GET_MESSAGE_INTERVAL, attitude)
    assert script.connection.messages["MESSAGE_INTERVAL"].interval_us == -1
    assert script.until(["ATTITUDE", "HEARTBEAT"]).get_type() == "HEARTBEAT"
    script.mav.request_data_stream_send(*target, mavlink.MAV_DATA_STREAM_ALL, 20, 1)
    script.until("ATTITUDE")


def test_it_flies_by_guided_commands_and_setpoints(script: Witness) -> None:
    fly_up(script)
    assert refused_mode(script, "OFFBOARD")  # nobody streams setpoints
    home = script.connection.location()
    latitude, longitude = round((home.lat + 4e-5) * 1e7), round(home.lng * 1e7)
    script.mav.command_int_send(
        script.system, 1, mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_CMD_DO_REPOSITION, 0, 0,
        -1.0, mavlink.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE, 0.0, NAN, latitude, longitude, home.alt + 1.0,
    )  # fmt: skip
    ack = script.until("COMMAND_ACK")
    assert (ack.command, ack.result) == (mavlink.MAV_CMD_DO_REPOSITION, mavlink.MAV_RESULT_ACCEPTED)
    there = script.until("GLOBAL_POSITION_INT", lambda at: abs(at.lat - latitude) < 20)
    assert abs(there.lon - longitude) < 50

    def local() -> None:
        script.mav.set_position_target_local_ned_send(
            0, script.system, 1, mavlink.MAV_FRAME_LOCAL_NED, NO_VELOCITY_NO_YAW,
            2.0, -2.0, -5.0, 0, 0, 0, 0, 0, 0, 0, 0,
        )  # fmt: skip

    hold_setpoint(script, local, lambda at: True)
    change_mode(script, "OFFBOARD")
    hold_setpoint(script, local, near(2.0, -2.0, -5.0))
    assert script.connection.flightmode == "OFFBOARD"

    def over_home() -> None:
        script.mav.set_position_target_global_int_send(
            0, script.system, 1, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, NO_VELOCITY_NO_YAW,
            round(home.lat * 1e7), longitude, 4.0, 0, 0, 0, 0, 0, 0, 0, 0,
        )  # fmt: skip

    hold_setpoint(script, over_home, near(0.0, 0.0, -4.0))
    change_mode(script, "RTL")
    change_mode(script, "LAND")
    script.connection.motors_disarmed_wait()


def test_modes_that_it_has_not_are_refused(script: Witness) -> None:
    for name in ("ACRO", "FOLLOWME"):
        assert refused_mode(script, name)
    assert script.connection.flightmode == "LOITER"


def test_it_flies_in_real_time(fleet: Fleet) -> None:
    vehicle = fleet.vehicle(1.0)
    script = Witness(f"tcp:{HOST}:{vehicle.tcp_port}", 1 + vehicle.instance)
    try:
        mavparm.MAVParmDict().mavset(script.connection, "MIS_TAKEOFF_ALT", 1.0)
        fly_up(script)
        change_mode(script, "LAND")
        script.connection.motors_disarmed_wait()
        mavparm.MAVParmDict().mavset(script.connection, "MIS_TAKEOFF_ALT", 2.5)
    finally:
        script.close()
