"""A fake vehicle with parameters, and their metadata over MAVLink FTP, for tests of the ground station."""

from __future__ import annotations

import json
import lzma
import struct
from dataclasses import dataclass, field
from typing import Any

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.files import FileTree, fixed
from flightstack.mavlink.link import Address
from flightstack.services.files.ftp_server import FtpServer
from tests.support.fake_vehicle import ACCEPTED, FakeVehicle

INT32, REAL32 = 6, 9
STORAGE = 245
RESET_ALL = 2.0

METADATA: list[dict[str, Any]] = [
    {"name": "MPC_XY_CRUISE", "type": "Float", "default": 4.0, "min": 0.1, "max": 20.0, "units": "m/s",
     "shortDesc": "Horizontal speed in auto modes"},
    {"name": "MPC_YAW_MODE", "type": "Int32", "default": 0, "min": 0, "max": 5,
     "shortDesc": "Heading of waypoints without yaw", "rebootRequired": True,
     "values": [{"value": 0, "description": "Towards the waypoint"}, {"value": 5, "description": "Unchanged"}]},
    {"name": "ROLL_P", "type": "Float", "default": 0.38729833462074170, "min": 0.0,
     "shortDesc": "Proportional gain of roll"},
]  # fmt: skip


@dataclass
class ParamVehicle(FakeVehicle):
    """Refuses values outside the ranges of its metadata, with PARAM_ERROR and a text."""

    has_metadata: bool = True
    values: dict[str, float] = field(
        default_factory=lambda: {"MPC_XY_CRUISE": 4.0, "MPC_YAW_MODE": 0, "ROLL_P": 0.3872983455657959}
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        document = json.dumps({"version": 1, "parameters": METADATA}).encode()
        files = {"etc/extras/parameters.json.xz": fixed(lzma.compress(document))} if self.has_metadata else {}
        self._ftp = FtpServer(Address(1, 1), FileTree(files, {}))
        self._about = {entry["name"]: entry for entry in METADATA}

    def _on_file_transfer_protocol(self, message: Any) -> None:
        self._ftp.receive(message, "gcs", self._now_s)

    def poll(self, now_s: float) -> list[bytes]:
        self._out += [message for _, message in self._ftp.poll(now_s)]
        return super().poll(now_s)

    def _is_integer(self, name: str) -> bool:
        return self._about.get(name, {}).get("type") == "Int32"

    def _send_value(self, name: str) -> None:
        value, kind = self.values[name], REAL32
        if self._is_integer(name):
            kind = INT32
            (value,) = struct.unpack("<f", struct.pack("<i", int(value)))
        index = list(self.values).index(name)
        self._out.append(
            mavlink.MAVLink_param_value_message(name.encode(), value, kind, len(self.values), index)
        )

    def _on_param_request_list(self, _message: Any) -> None:
        for name in self.values:
            self._send_value(name)

    def _on_param_request_read(self, message: Any) -> None:
        name = message.param_id if message.param_index < 0 else list(self.values)[message.param_index]
        if name in self.values:
            self._send_value(name)
        else:
            self._out.append(mavlink.MAVLink_param_error_message(255, 190, name.encode(), -1, 1))

    def _on_param_set(self, message: Any) -> None:
        name, value = message.param_id, message.param_value
        if self._is_integer(name):
            (value,) = struct.unpack("<i", struct.pack("<f", value))
        about = self._about[name]
        if about["min"] <= value <= about.get("max", 1e9):
            self.values[name] = value
        else:
            self._out.append(mavlink.MAVLink_param_error_message(255, 190, name.encode(), -1, 2))
            self.say(f"Parameter {name} refused: {value:g} is outside {about['min']:g} to {about['max']:g}")
        self._send_value(name)

    def execute(self, command: int, params: tuple[float, ...]) -> int:
        if (command, params[0]) != (STORAGE, RESET_ALL):
            return super().execute(command, params)
        self.values = {name: about["default"] for name, about in self._about.items()}
        return ACCEPTED
