"""One link as QGroundControl holds it: its ids, its heartbeat, and what it remembers of the vehicle.

The modules ``qgc_*`` repeat, message by message, what QGroundControl's source does (github.com/mavlink/qgroundcontrol,
the file and function named at each step), with its time-outs, retries and conditions; none of its code.
"""

from __future__ import annotations

import socket
import time
from collections import deque
from collections.abc import Callable
from typing import Any

from flightstack.mavlink.dialect import mavlink
from tests.interop.stack import HOST
from tests.support.process import BOUND_S

QGC = (255, mavlink.MAV_COMP_ID_MISSIONPLANNER)
"""System and component: Comms/MAVLinkProtocol.cc, getSystemId and getComponentId."""
HEARTBEAT_S = 1.0
AUTOPILOT = mavlink.MAV_COMP_ID_AUTOPILOT1
_LARGEST = 65536


class UdpPort:
    """Comms/UDPLink.cc: bound to its port, it knows only who has written to it."""

    def __init__(self, port: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((HOST, port))
        self._peer: Any = None

    def read(self, within_s: float) -> bytes:
        self._socket.settimeout(within_s)
        try:
            data, self._peer = self._socket.recvfrom(_LARGEST)
        except TimeoutError:
            return b""
        return data

    def write(self, data: bytes) -> None:
        if self._peer is not None:
            self._socket.sendto(data, self._peer)

    def close(self) -> None:
        self._socket.close()


class TcpPort:
    """Comms/TCPLink.cc: a client of the vehicle's server."""

    def __init__(self, port: int) -> None:
        self._socket = socket.create_connection((HOST, port), BOUND_S)

    def read(self, within_s: float) -> bytes:
        self._socket.settimeout(within_s)
        try:
            return self._socket.recv(_LARGEST)
        except TimeoutError:
            return b""

    def write(self, data: bytes) -> None:
        self._socket.settimeout(BOUND_S)
        self._socket.sendall(data)

    def close(self) -> None:
        self._socket.close()


class Station:
    """QGroundControl on one link, with one vehicle; messages are taken one after the other."""

    def __init__(self, port: UdpPort | TcpPort, system: int) -> None:
        """Wait for the first heartbeat: Vehicle/MultiVehicleManager.cc, _vehicleHeartbeatInfo."""
        self.system = system
        self.latest: dict[str, Any] = {}
        """The last message of each type: Vehicle/Vehicle.cc, _mavlinkMessageReceived, keeps what is in them."""
        self.texts: list[str] = []
        self.mode_lists: list[int] = []
        """Sequence numbers of the AVAILABLE_MODES_MONITOR that came."""
        self._port = port
        self._codec = mavlink.MAVLink(None, *QGC)
        self._codec.robust_parsing = True
        self._inbox: deque[Any] = deque()
        self._beat_s = time.monotonic()
        self.until("HEARTBEAT")

    def close(self) -> None:
        self._port.close()

    # ------------------------------------------------------------------ messages

    def send(self, message: Any) -> None:
        self._port.write(message.pack(self._codec))

    def wait(
        self, *kinds: str, within_s: float, holds: Callable[[Any], object] = lambda message: True
    ) -> Any | None:
        """Return the next message of these types for which ``holds``, or None when none came in time."""
        end_s = time.monotonic() + within_s
        while True:
            self._beat()
            while self._inbox:
                message = self._inbox.popleft()
                self._remember(message)
                if message.get_type() in kinds and holds(message):
                    return message
            left_s = end_s - time.monotonic()
            if left_s <= 0.0:
                return None
            self._read(min(left_s, HEARTBEAT_S))

    def until(self, *kinds: str, holds: Callable[[Any], object] = lambda message: True) -> Any:
        """Return such a message, whenever it comes: where QGroundControl has no time-out, as in flight."""
        message = self.wait(*kinds, within_s=BOUND_S, holds=holds)
        assert message is not None, f"no {kinds} came; {self.texts[-5:]}"
        return message

    def until_text(self, part: str) -> None:
        """Wait until a STATUSTEXT with ``part`` has come."""
        while not any(part in text for text in self.texts):
            self.until("STATUSTEXT")

    def _read(self, within_s: float) -> None:
        data = self._port.read(max(within_s, 1e-3))
        for message in self._codec.parse_buffer(data) or []:
            if (message.get_srcSystem(), message.get_srcComponent()) == (self.system, AUTOPILOT):
                self._inbox.append(message)

    def _beat(self) -> None:
        """Vehicle/Vehicle.cc, _sendGCSHeartbeat: once a second."""
        if time.monotonic() < self._beat_s:
            return
        self._beat_s = time.monotonic() + HEARTBEAT_S
        self.send(
            mavlink.MAVLink_heartbeat_message(
                mavlink.MAV_TYPE_GCS,
                mavlink.MAV_AUTOPILOT_INVALID,
                mavlink.MAV_MODE_MANUAL_ARMED,
                0,
                mavlink.MAV_STATE_ACTIVE,
                3,
            )
        )

    def _remember(self, message: Any) -> None:
        kind = message.get_type()
        assert kind != "BAD_DATA"
        self.latest[kind] = message
        if kind == "STATUSTEXT":
            self.texts.append(message.text)
        elif kind == "AVAILABLE_MODES_MONITOR":
            self.mode_lists.append(message.seq)

    # ------------------------------------------------------------------ what it knows of the vehicle

    @property
    def armed(self) -> bool:
        """Vehicle.cc, _handleHeartbeat."""
        return bool(self.latest["HEARTBEAT"].base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)

    @property
    def custom_mode(self) -> int:
        return int(self.latest["HEARTBEAT"].custom_mode)

    @property
    def flying(self) -> bool:
        """Vehicle.cc, _handleExtendedSysState."""
        return bool(self.latest["EXTENDED_SYS_STATE"].landed_state != mavlink.MAV_LANDED_STATE_ON_GROUND)

    @property
    def altitude_amsl_m(self) -> float:
        """Vehicle.cc, _handleAltitude: ALTITUDE, which counts more than GLOBAL_POSITION_INT once it was seen."""
        return float(self.latest["ALTITUDE"].altitude_amsl)

    @property
    def altitude_relative_m(self) -> float:
        return float(self.latest["ALTITUDE"].altitude_relative)

    @property
    def coordinate(self) -> tuple[float, float]:
        """Latitude and longitude in degrees: Vehicle.cc, _handleGlobalPositionInt."""
        place = self.latest["GLOBAL_POSITION_INT"]
        return place.lat * 1e-7, place.lon * 1e-7

    @property
    def home_altitude_m(self) -> float:
        """Vehicle.cc, _handleHomePosition."""
        return float(self.latest["HOME_POSITION"].altitude) * 1e-3
