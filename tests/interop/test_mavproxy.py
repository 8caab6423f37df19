"""MAVProxy from PyPI, with PX4's identity: what it says, beside what a second link of pymavlink sees.

It uses PX4's modes by ``long DO_SET_MODE``: its own ``mode`` fails with every autopilot that calls itself PX4, before
anything is sent (it hands pymavlink's ``set_mode`` three numbers where one is taken).
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.interop.mavproxy import MavProxy
from tests.interop.stack import HOST, RealVehicle
from tests.interop.witness import Witness, mavutil

mavlink = mavutil.mavlink
MISSIONS = Path(__file__).parents[2] / "missions"
HOME = (47.397742, 8.545594)
HOLD, TAKEOFF, RETURN, LAND = (4 << 16 | sub << 24 for sub in (3, 2, 5, 6))
FENCE = [(47.397, 8.545), (47.3985, 8.545), (47.3985, 8.5465), (47.397, 8.5465)]


def write_plan(path: Path, items: list[tuple[int, int, float, float, float, float]]) -> Path:
    """Write items (command, frame, parameter 1, latitude, longitude, altitude) as MAVProxy reads them."""
    lines = ["QGC WPL 110"]
    for seq, (command, frame, first, latitude, longitude, altitude) in enumerate(items):
        values = (seq, 0, frame, command, first, 0, 0, 0, latitude, longitude, altitude, 1)
        lines.append("\t".join(map(str, values)))
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture(scope="module")
def proxy(station_vehicle: RealVehicle, tmp_path_factory: pytest.TempPathFactory) -> Iterator[MavProxy]:
    """MAVProxy on TCP, after it has read the parameters."""
    master = f"tcp:{HOST}:{station_vehicle.tcp_port}"
    proxy = MavProxy(station_vehicle, master, tmp_path_factory.mktemp("mavproxy"))
    proxy.until("parameters (ftp)")
    yield proxy
    proxy.stop()


@pytest.fixture(scope="module")
def second_link(station_vehicle: RealVehicle) -> Iterator[Witness]:
    witness = Witness(f"tcp:{HOST}:{station_vehicle.tcp_port}", 1 + station_vehicle.instance)
    yield witness
    witness.close()


@pytest.fixture
def witness(second_link: Witness) -> Witness:
    """The second link, from now on."""
    second_link.catch_up()
    return second_link


def test_it_finds_the_vehicle_with_its_mode_its_place_and_its_fence(proxy: MavProxy) -> None:
    for words in ("Mode LOITER", "GPS lock at 488 meters", "fence present", "fence enabled"):
        assert words in proxy.said


def test_it_reads_parameters_by_ftp_with_their_defaults(proxy: MavProxy, witness: Witness) -> None:
    witness.mav.param_request_read_send(witness.system, 1, b"MIS_TAKEOFF_ALT", -1)
    count = witness.until("PARAM_VALUE", lambda value: value.param_id == "MIS_TAKEOFF_ALT").param_count
    assert f"Received {count} parameters (ftp)" in proxy.said
    proxy.tell("param diff MIS_TAKEOFF*", "Parameter        Current  Default")


def test_it_sets_parameters_and_tells_why_one_is_refused(proxy: MavProxy, witness: Witness) -> None:
    proxy.tell("param set MIS_TAKEOFF_ALT 4")
    changed = witness.until("PARAM_VALUE", lambda value: value.param_id == "MIS_TAKEOFF_ALT")
    assert changed.param_value == 4.0  # echoed on every link
    proxy.tell("param fetch MIS_TAKEOFF_ALT", "MIS_TAKEOFF_ALT = 4.0")  # it hears of it after the witness
    proxy.tell("param show MIS_TAKEOFF_ALT", "MIS_TAKEOFF_ALT  4.0")
    proxy.tell("param set NAV_DLL_ACT 2")  # an integer, whose bytes it sends
    integer = witness.until("PARAM_VALUE", lambda value: value.param_id == "NAV_DLL_ACT")
    assert integer.param_type == mavlink.MAV_PARAM_TYPE_INT32
    proxy.tell("param fetch NAV_DLL_ACT", "NAV_DLL_ACT = 2")
    proxy.tell("param show NAV_DLL_ACT", "NAV_DLL_ACT      2")
    proxy.tell("param set NAV_DLL_ACT 0")
    witness.until("PARAM_VALUE", lambda value: value.param_id == "NAV_DLL_ACT")
    proxy.tell("param set MIS_TAKEOFF_ALT 5000", "AP: Parameter MIS_TAKEOFF_ALT refused: 5000 is outside")
    proxy.until("Failed to set MIS_TAKEOFF_ALT to 5000")


def test_geofence_and_rally_points_go_up_and_come_back(proxy: MavProxy, tmp_path: Path) -> None:
    fence = write_plan(tmp_path / "fence.txt", [(5001, 0, 4, *corner, 0.0) for corner in FENCE])
    rally = write_plan(tmp_path / "rally.txt", [(5100, 3, 0, 47.3978, 8.5456, 10.0)])
    proxy.tell(f"fence load {fence}", "Got MISSION_ACK: TYPE_FENCE: ACCEPTED")
    proxy.tell("fence list", *(f"5001 0 {latitude:.10f} {longitude:.10f}" for latitude, longitude in FENCE))
    proxy.tell(f"rally load {rally}", "Got MISSION_ACK: TYPE_RALLY: ACCEPTED")
    proxy.tell("rally list", "5100 3 47.39", "Saved 1 rally items")
    proxy.tell("fence clear", "Got MISSION_ACK: TYPE_FENCE: ACCEPTED")
    proxy.tell("rally clear", "Got MISSION_ACK: TYPE_RALLY: ACCEPTED")
    proxy.tell("fence list", "Requesting 0 fence items")


def test_the_fence_is_switched_by_its_parameter_and_the_command_for_it_is_refused(proxy: MavProxy) -> None:
    """DO_FENCE_ENABLE is ArduPilot's; here as in PX4 the geofence's action is a parameter."""
    proxy.tell("param set GF_ACTION 0", "fence disabled")
    proxy.tell("param set GF_ACTION 2", "fence enabled")
    proxy.tell("fence enable", "Got COMMAND_ACK: DO_FENCE_ENABLE: UNSUPPORTED")


def test_a_takeoff_to_an_altitude_below_the_ground_is_refused_with_its_reason(proxy: MavProxy) -> None:
    """It sends metres above home; PX4's takeoff takes metres above the sea."""
    proxy.tell("arm throttle", "Got COMMAND_ACK: COMPONENT_ARM_DISARM: ACCEPTED", "AP: Armed")
    proxy.tell(
        "takeoff 4",
        "Got COMMAND_ACK: NAV_TAKEOFF: TEMPORARILY_REJECTED",
        "takeoff altitude -484 m is too low",
    )
    proxy.tell("disarm", "Got COMMAND_ACK: COMPONENT_ARM_DISARM: ACCEPTED")  # to component 0


def test_it_flies_by_modes_and_guided_commands(proxy: MavProxy, witness: Witness) -> None:
    proxy.tell("arm throttle", "AP: Armed")
    proxy.tell("takeoff 492", "Got COMMAND_ACK: NAV_TAKEOFF: ACCEPTED")
    witness.until_modes(TAKEOFF, HOLD)
    latitude, longitude = 47.39785, 8.54559
    proxy.tell(f"guided {latitude} {longitude} 5", "Got COMMAND_ACK: DO_REPOSITION: ACCEPTED")
    there = witness.until(
        "GLOBAL_POSITION_INT",
        lambda at: abs(at.lat - latitude * 1e7) < 20 and abs(at.relative_alt - 5000) < 200,
    )
    assert there.lon == pytest.approx(longitude * 1e7, abs=50)
    proxy.tell("setspeed 3", "Got COMMAND_ACK: DO_CHANGE_SPEED: ACCEPTED")
    proxy.tell("disarm", "Got COMMAND_ACK: COMPONENT_ARM_DISARM: TEMPORARILY_REJECTED")  # in the air
    proxy.tell("long DO_SET_MODE 1 4 5", "Got COMMAND_ACK: DO_SET_MODE: ACCEPTED")
    witness.until_modes(RETURN)
    proxy.tell("long NAV_LAND", "Got COMMAND_ACK: NAV_LAND: ACCEPTED")
    witness.until_modes(LAND)
    witness.until("HEARTBEAT", lambda beat: not beat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
    proxy.until("AP: Disarmed")


def test_it_loads_a_mission_reads_it_back_and_flies_it(proxy: MavProxy, witness: Witness) -> None:
    proxy.tell(f"wp load {MISSIONS / 'triangle.waypoints'}", "Sent all 5 waypoints", "TYPE_MISSION: ACCEPTED")
    proxy.tell("wp list", "22 3 47.3977420000 8.5455940000 4.000000", "p4=nan", "Saved 5 waypoints to")
    proxy.tell("arm throttle", "AP: Armed")
    proxy.tell("long MISSION_START", "Got COMMAND_ACK: MISSION_START: ACCEPTED")
    assert [witness.until("MISSION_ITEM_REACHED").seq for _ in range(2)][-1] > 0
    proxy.tell("pause", "Got COMMAND_ACK: DO_PAUSE_CONTINUE: ACCEPTED")
    witness.until_modes(HOLD)
    proxy.tell("resume", "Got COMMAND_ACK: DO_PAUSE_CONTINUE: ACCEPTED")
    witness.until("MISSION_CURRENT", lambda current: current.mission_state == mavlink.MISSION_STATE_COMPLETE)
    proxy.until("AP: Disarmed")
    proxy.tell("wp clear", "Got MISSION_ACK: TYPE_MISSION: ACCEPTED")
    proxy.tell("wp list", "Requesting 0 waypoints")


def test_it_lists_files_and_logs_and_asks_for_home(proxy: MavProxy, witness: Witness) -> None:
    proxy.tell("ftp list /", "D @MAV_LOG", "D @PARAM")
    proxy.tell("log list", "Log 0  numLogs")
    proxy.tell("gethome")
    witness.mav.command_long_send(witness.system, 1, mavlink.MAV_CMD_GET_HOME_POSITION, 0, *[0.0] * 7)
    home = witness.until("HOME_POSITION")  # where the last flight armed
    proxy.tell(
        "status HOME_POSITION", f"HOME_POSITION {{latitude : {home.latitude}, longitude : {home.longitude}"
    )


def test_it_counts_no_packet_as_lost(proxy: MavProxy) -> None:
    """It counts a message that it cannot decode, and a gap in the sequence numbers of any sender.

    This test stands before the one that adds a ground station. The vehicle forwards heartbeats between ground stations
    with the sender's sequence numbers; the messages in between are not forwarded, so MAVProxy counts them as lost.
    """
    assert proxy.lost() == 0


def test_it_had_nothing_to_complain_about(proxy: MavProxy) -> None:
    """All the tests above are one session of its user."""
    assert proxy.complaints() == []


def test_it_reads_parameters_one_by_one_over_udp(station_vehicle: RealVehicle, tmp_path: Path) -> None:
    """Without its module for files, as before MAVLink FTP."""
    master = f"udpin:{HOST}:{station_vehicle.gcs_port}"
    proxy = MavProxy(station_vehicle, master, tmp_path, "--default-modules", "param,arm,wp")
    try:
        proxy.until("Received", "Saved")
        assert "(ftp)" not in proxy.said
        proxy.tell("param show GF_ACTION", "GF_ACTION        2")
        proxy.stop()
    finally:
        proxy.kill()
    assert proxy.complaints() == []
