"""What dronekit-python sends, message by message, as its source does it.

dronekit's last release does not run under a Python of today; its users' programs do, in older ones. The names behind
"dronekit:" are functions of https://github.com/dronekit/dronekit-python, ``dronekit/__init__.py`` and
``dronekit/mavlink.py``. What it waits for by polling, these tests wait for by the message.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from pymavlink import mavwp

from tests.interop.stack import HOST, RealVehicle
from tests.interop.witness import mavutil
from tests.support.process import BOUND_S

mavlink = mavutil.mavlink
CORNER = (47.3978499, 8.5455145, 4.0)


class DroneKit:
    """The messages of ``dronekit.connect``'s Vehicle, on a connection of pymavlink."""

    def __init__(self, url: str) -> None:
        """dronekit: MAVConnection.__init__ (system 255, component 0) and Vehicle.initialize up to the heartbeat."""
        self.master = mavutil.mavlink_connection(url, source_system=255, source_component=0)
        self.target_system = 0
        self.parameters: dict[int, Any] = {}
        self.loader = mavwp.MAVWPLoader()
        send = self.master.mav.send

        def fix_targets(message: Any, *args: Any, **kwargs: Any) -> None:
            if hasattr(message, "target_system"):
                message.target_system = self.target_system
            send(message, *args, **kwargs)

        self.master.mav.send = fix_targets  # dronekit: MAVConnection.fix_targets
        self.master.message_hooks.append(self.hear)
        self.beat()
        self.target_system = self.until("HEARTBEAT").get_srcSystem()

    def beat(self) -> None:
        """dronekit: Vehicle.__init__, its forward_loop that sends heartbeats."""
        self.master.mav.heartbeat_send(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 0)

    def hear(self, _: Any, message: Any) -> None:
        """dronekit: Vehicle.__init__, the listener of HEARTBEAT: a mode that pymavlink does not name is an error."""
        if message.get_type() == "HEARTBEAT" and message.autopilot == mavlink.MAV_AUTOPILOT_PX4:
            mode = mavutil.interpret_px4_mode(message.base_mode, message.custom_mode)
            assert mode in self.master.mode_mapping(), (
                f"APIException: mode {message.custom_mode} not available"
            )

    def until(self, *kinds: str) -> Any:
        """Return the next message of these types from the vehicle."""
        while True:
            message = self.master.recv_match(type=list(kinds), blocking=True, timeout=BOUND_S)
            assert message is not None, f"no {kinds} came"
            if message.get_type() != "HEARTBEAT" or self.master.probably_vehicle_heartbeat(message):
                return message

    def fetch_parameters(self) -> None:
        """dronekit: Vehicle.initialize (param_fetch_all), and the listener of PARAM_VALUE in Vehicle.__init__."""
        self.master.param_fetch_all()
        count = -1
        while len(self.parameters) != count:
            value = self.until("PARAM_VALUE")
            if count != value.param_count:  # "we are receiving a new param set"
                count, self.parameters = value.param_count, {}
            if value.param_index < value.param_count:
                self.parameters[value.param_index] = value

    def download(self) -> None:
        """dronekit: CommandSequence.download, and the listeners of MISSION_COUNT and MISSION_ITEM; it never acks."""
        self.master.waypoint_request_list_send()
        self.loader.clear()
        self.loader.expected_count = self.until("MISSION_COUNT").count
        while self.loader.count() < self.loader.expected_count:
            self.master.waypoint_request_send(self.loader.count())
            item = self.until("MISSION_ITEM")
            assert item.seq == self.loader.count()
            self.loader.add(item)

    def upload(self) -> None:
        """dronekit: CommandSequence.upload, and the listener of MISSION_REQUEST: it knows no MISSION_REQUEST_INT."""
        self.master.waypoint_clear_all_send()
        self.master.waypoint_count_send(self.loader.count())
        uploaded = [False] * self.loader.count()
        while not all(uploaded):
            request = self.until("MISSION_REQUEST")
            self.master.mav.send(self.loader.wp(request.seq))
            uploaded[request.seq] = True

    def close(self) -> None:
        self.master.close()


@pytest.fixture(scope="module")
def drone(station_vehicle: RealVehicle) -> Iterator[DroneKit]:
    """Its connection, with the vehicle's streams and parameters: what ``connect(wait_ready=True)`` waits for."""
    drone = DroneKit(f"tcp:{HOST}:{station_vehicle.tcp_port}")
    drone.master.mav.request_data_stream_send(0, 0, mavlink.MAV_DATA_STREAM_ALL, 4, 1)
    drone.fetch_parameters()
    yield drone
    drone.close()


def item(command: int, latitude: float, longitude: float, altitude: float) -> Any:
    """Return what its users give to ``vehicle.commands.add``: dronekit.Command(0, 0, 0, frame, …)."""
    return mavlink.MAVLink_mission_item_message(
        0,
        0,
        0,
        mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
        command,
        0,
        0,
        0,
        0,
        0,
        0,
        latitude,
        longitude,
        altitude,
    )


def test_its_connection_comes_to_wait_ready(drone: DroneKit) -> None:
    """dronekit: Vehicle.initialize, send_capabilities_request, and what wait_ready waits for."""
    assert drone.master.flightmode not in (None, "INITIALISING", "MAV")
    assert "MIS_TAKEOFF_ALT" in {value.param_id for value in drone.parameters.values()}
    drone.master.mav.command_long_send(
        0, 0, mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES, 0, 1, 0, 0, 0, 0, 0, 0
    )
    assert drone.until("AUTOPILOT_VERSION").capabilities != 0
    for kind in ("GLOBAL_POSITION_INT", "ATTITUDE", "VFR_HUD", "SYS_STATUS", "GPS_RAW_INT"):
        drone.until(kind)
    assert (
        drone.master.messages["GPS_RAW_INT"].fix_type >= 3
    )  # Vehicle.is_armable asks for it, as ArduPilot's EKF


def test_a_parameter_that_it_lost_is_asked_for_by_index(drone: DroneKit) -> None:
    """dronekit: Vehicle.__init__, the forward_loop of parameters, and Parameters.set."""
    index = next(i for i, value in drone.parameters.items() if value.param_id == "MIS_TAKEOFF_ALT")
    drone.master.mav.param_request_read_send(0, 0, b"", index)
    value = drone.until("PARAM_VALUE")
    assert (value.param_id, value.param_index) == ("MIS_TAKEOFF_ALT", index)
    for wanted in (3.5, value.param_value):
        drone.master.param_set_send("MIS_TAKEOFF_ALT", wanted)
        assert drone.until("PARAM_VALUE").param_value == wanted


def test_its_mission_goes_up_is_flown_and_comes_back(drone: DroneKit) -> None:
    drone.download()
    home = drone.master.location()
    drone.loader.clear()
    drone.loader.add(item(mavlink.MAV_CMD_NAV_WAYPOINT, home.lat, home.lng, home.alt))
    drone.loader.add(item(mavlink.MAV_CMD_NAV_TAKEOFF, home.lat, home.lng, 3.0))
    drone.loader.add(item(mavlink.MAV_CMD_NAV_WAYPOINT, *CORNER))
    drone.loader.add(item(mavlink.MAV_CMD_NAV_LAND, home.lat, home.lng, 0.0))
    drone.loader.wpoints[0].frame = mavlink.MAV_FRAME_GLOBAL  # dronekit: its first item is home
    sent = list(drone.loader.wpoints)
    drone.upload()
    assert drone.until("MISSION_ACK").type == mavlink.MAV_MISSION_ACCEPTED
    drone.download()
    assert [wp.command for wp in drone.loader.wpoints] == [wp.command for wp in sent]
    assert (drone.loader.wp(2).x, drone.loader.wp(2).y) == pytest.approx(CORNER[:2], abs=4e-6)
    drone.master.arducopter_arm()  # dronekit: Vehicle.armed
    drone.master.motors_armed_wait()
    drone.master.set_mode("MISSION")  # dronekit: Vehicle.mode, of PX4
    while drone.until("MISSION_CURRENT").seq != 2:  # dronekit: Vehicle.commands.next
        pass
    drone.master.motors_disarmed_wait()


def test_it_takes_off_to_an_altitude_above_the_sea_and_lands(drone: DroneKit) -> None:
    """dronekit: Vehicle.simple_takeoff, which sends zeros for latitude and longitude."""
    drone.master.arducopter_arm()
    drone.master.motors_armed_wait()
    home = drone.master.location()
    drone.master.mav.command_long_send(0, 0, mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 0, home.alt + 3.0)
    while abs(drone.until("GLOBAL_POSITION_INT").relative_alt - 3000) > 200:
        pass
    at = drone.master.location()
    assert (at.lat, at.lng) == pytest.approx((home.lat, home.lng), abs=1e-5)
    drone.master.set_mode("LAND")
    drone.master.motors_disarmed_wait()
