"""QGroundControl connects in real time over UDP: its sequence of messages, with all that it expects of the answers.

Vehicle/InitialConnectStateMachine.cc: version, standard modes, component metadata, parameters, mission, geofence,
rally points. The tests are one connection, in its order.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from statistics import median

import pytest

from flightstack import __version__
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.param_pack import unpack_parameters
from tests.interop.qgc_actions import HOLD, LAND, MISSION, RETURN, TAKEOFF, Actions
from tests.interop.qgc_commands import Commands
from tests.interop.qgc_ftp import Files
from tests.interop.qgc_link import Station, UdpPort
from tests.interop.qgc_metadata import VALUE_TYPES, ComponentInformation, StandardModes, StreamConfig
from tests.interop.qgc_parameters import Parameters
from tests.interop.qgc_plans import FENCE, RALLY, PlanManager
from tests.interop.qgc_plans import MISSION as MISSION_PLAN
from tests.interop.stack import RealVehicle

PREARM_CHECK = 0x1000_0000
COMPONENT_INFORMATION = "395"

MANUAL = 1 << 16
"""A mode of PX4 that this vehicle does not have."""


@pytest.fixture(scope="module")
def station(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Station]:
    """QGroundControl, which was there before the vehicle."""
    vehicle = RealVehicle(
        tmp_path_factory.mktemp("qgroundcontrol"), 1.0, "--inner-hz", "500"
    )  # streams of 100 Hz
    station = Station(UdpPort(vehicle.gcs_port), 1 + vehicle.instance)
    yield station
    station.close()
    vehicle.stop()


@pytest.fixture(scope="module")
def commands(station: Station) -> Commands:
    return Commands(station)


@pytest.fixture(scope="module")
def files(station: Station) -> Files:
    return Files(station)


@pytest.fixture(scope="module")
def metadata(commands: Commands, files: Files) -> ComponentInformation:
    return ComponentInformation(commands, files)


@pytest.fixture(scope="module")
def parameters(station: Station) -> Parameters:
    return Parameters(station)


def test_the_heartbeat_makes_it_a_px4_multicopter(station: Station) -> None:
    """FirmwarePluginManager.cc, firmwarePluginForAutopilot; Vehicle.cc, px4Firmware and multiRotor."""
    beat = station.latest["HEARTBEAT"]
    assert (beat.autopilot, beat.type) == (mavlink.MAV_AUTOPILOT_PX4, mavlink.MAV_TYPE_QUADROTOR)
    assert beat.base_mode & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED


def test_the_version_says_what_it_can_do(commands: Commands) -> None:
    """_stateRequestAutopilotVersion, _autopilotVersionRequestMessageHandler."""
    version = commands.request("AUTOPILOT_VERSION")
    for needed in ("MAVLINK2", "MISSION_INT", "COMMAND_INT", "MISSION_FENCE", "MISSION_RALLY", "FTP"):
        assert version.capabilities & getattr(mavlink, f"MAV_PROTOCOL_CAPABILITY_{needed}"), needed
    # this stack's own version, although below 1.4.1 QGroundControl warns of an old PX4 (_handleAutopilotVersion)
    numbers = (version.flight_sw_version >> shift & 0xFF for shift in (24, 16, 8))
    assert ".".join(map(str, numbers)) == __version__
    assert version.uid or any(version.uid2)
    assert commands.request("PROTOCOL_VERSION").max_version == 200


def test_modes_come_all_at_once_or_one_by_one(station: Station, commands: Commands) -> None:
    """_stateRequestStandardModes; PX4FirmwarePlugin.cc finds its own modes by their custom mode."""
    modes = StandardModes(station, commands).request()
    for needed in (HOLD, TAKEOFF, MISSION, RETURN, LAND):
        assert modes[needed].can_be_set
    assert StandardModes(station, commands).request_one_by_one() == modes
    assert station.custom_mode in modes


def test_metadata_comes_by_ftp_and_is_what_its_crc_says(metadata: ComponentInformation) -> None:
    """_stateRequestCompInfo."""
    metadata.request_all()
    assert metadata.downloads == 3
    metadata.request_all()
    assert metadata.downloads == 3, "a second time it knows the files by their CRC"


def test_parameters_come_whole_and_the_second_time_from_the_cache(
    station: Station, parameters: Parameters, metadata: ComponentInformation
) -> None:
    """_stateRequestParameters."""
    values = parameters.load()
    assert not parameters.from_cache
    assert {name: value.kind for name, value in values.items()} == {
        name: VALUE_TYPES[entry["type"]] for name, entry in metadata.parameters.items()
    }
    assert parameters.load() == values
    assert parameters.from_cache
    # nothing comes after the digest was returned but what was on its way: the next answer proves the link
    commands = Commands(station)
    commands.request("AUTOPILOT_VERSION")
    late = station.wait("PARAM_VALUE", within_s=0.3)
    assert late is None or late.param_index == 65535


def test_parameters_come_as_one_file_too(files: Files, parameters: Parameters) -> None:
    """ParameterManager.cc, refreshAllParameters with _tryftp, _ftpDownloadComplete, _parseParamFile."""
    content = files.download("mftp://[;comp=1]@PARAM/param.pck")
    packed = {entry.name: entry.value for entry in unpack_parameters(content)}
    assert packed == {name: value.number for name, value in parameters.cache.items()}


def test_a_parameter_is_changed_or_read_again(station: Station, parameters: Parameters) -> None:
    """_mavlinkParamSet: a real number, an integer, and one that the vehicle refuses."""
    assert parameters.change("MIS_TAKEOFF_ALT", 3.25)
    assert parameters.change("NAV_DLL_ACT", 2)
    assert parameters.change("NAV_DLL_ACT", 0)
    assert not parameters.change("MIS_TAKEOFF_ALT", 5000.0)
    assert parameters.cache["MIS_TAKEOFF_ALT"].number == 3.25
    assert any("MIS_TAKEOFF_ALT refused" in text for text in station.texts)
    parameters.load()
    assert parameters.from_cache, "the digest counts the changes"


def test_there_are_no_plans_yet(station: Station) -> None:
    """_stateRequestMission, _stateRequestGeoFence, _stateRequestRallyPoints."""
    for plan_type in (MISSION_PLAN, FENCE, RALLY):
        assert PlanManager(station, plan_type).load() == []


def test_what_it_asks_of_every_vehicle_is_answered_though_by_no(station: Station, commands: Commands) -> None:
    """Gimbal/GimbalController.cc, Camera/QGCCameraManager.cc, and the forerunner of COMPONENT_METADATA.

    Without an answer each is asked again and again; a text for each would trouble the user at every connection.
    """
    refused = mavlink.MAV_RESULT_UNSUPPORTED, mavlink.MAV_RESULT_DENIED
    station.texts.clear()
    for kind in ("GIMBAL_MANAGER_INFORMATION", "CAMERA_INFORMATION", COMPONENT_INFORMATION):
        assert commands.request(kind) in refused, kind
    station.until("HEARTBEAT")
    assert station.texts == []


def interval_ms(station: Station, kind: str) -> float:
    """Return the median of the next twenty intervals of a message, on the vehicle's clock."""
    times = [station.until(kind).time_boot_ms for _ in range(21)]
    return median(later - sooner for sooner, later in pairwise(times))


def test_rates_go_up_for_tuning_and_back(station: Station, commands: Commands) -> None:
    """Vehicle.cc, setPIDTuningTelemetryMode."""
    streams = StreamConfig(commands)
    kinds = ("ATTITUDE_QUATERNION", "POSITION_TARGET_LOCAL_NED")
    streams.set_high_rates(*kinds)
    for kind in kinds:
        assert interval_ms(station, kind) == pytest.approx(10, abs=2), kind
    streams.restore_defaults(*kinds)
    for kind in kinds:
        assert interval_ms(station, kind) == pytest.approx(20, abs=2), kind


def test_it_can_say_ready_to_fly(station: Station) -> None:
    """Vehicle.cc, _handleSysStatus; FlyView's indicators need a place, a home and a battery."""
    status = station.until("SYS_STATUS")
    enabled = status.onboard_control_sensors_enabled & status.onboard_control_sensors_present
    assert enabled & status.onboard_control_sensors_health == enabled, "allSensorsHealthy"
    assert enabled & PREARM_CHECK, "readyToFlyAvailable"
    for kind in (
        "HOME_POSITION",
        "ALTITUDE",
        "GLOBAL_POSITION_INT",
        "GPS_RAW_INT",
        "BATTERY_STATUS",
        "VFR_HUD",
    ):
        if kind not in station.latest:
            station.until(kind)
    home, here = station.latest["HOME_POSITION"], station.coordinate
    assert here == pytest.approx((home.latitude * 1e-7, home.longitude * 1e-7), abs=1e-6)
    assert station.latest["GPS_RAW_INT"].fix_type >= mavlink.GPS_FIX_TYPE_3D_FIX
    assert not station.flying


def test_modes_did_not_change(station: Station) -> None:
    """StandardModes.cc, availableModesMonitorReceived: another number makes it ask for all modes again."""
    while len(station.mode_lists) < 2:
        station.until("AVAILABLE_MODES_MONITOR")
    assert len(set(station.mode_lists)) == 1


def test_a_mode_that_cannot_be_is_seen_in_the_heartbeat(station: Station, commands: Commands) -> None:
    """FirmwarePlugin.cc, _setFlightModeAndValidate: three times 1.3 s without the mode mean that it failed."""
    before = station.custom_mode
    assert not Actions(station, commands).set_flight_mode(MANUAL)
    assert (station.custom_mode, station.armed) == (before, False)
    assert any(text.startswith("Mode change: ") for text in station.texts)


def test_a_mission_that_is_not_there_does_not_arm(station: Station, commands: Commands) -> None:
    """The mode is taken while disarmed, as with PX4; arming is what fails, with its reason."""
    actions = Actions(station, commands)
    assert not actions.start_mission()
    assert (station.custom_mode, station.armed) == (MISSION, False)
    assert any("no mission is loaded" in text for text in station.texts)
    assert actions.set_flight_mode(HOLD)
