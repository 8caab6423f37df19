"""What QGroundControl learns of a vehicle when it connects: metadata files, modes, rates on request."""

from __future__ import annotations

import json
import lzma
import zlib
from typing import Any, NamedTuple

from flightstack.mavlink.dialect import mavlink
from tests.interop.qgc_commands import ACCEPTED, Commands
from tests.interop.qgc_ftp import Files
from tests.interop.qgc_link import Station

GENERAL, PARAMETER, EVENTS, ACTUATORS = 0, 1, 4, 5
"""COMP_METADATA_TYPE of those it asks for."""
VALUE_TYPES = {"Int32": mavlink.MAV_PARAM_TYPE_INT32, "Float": mavlink.MAV_PARAM_TYPE_REAL32}
"""FactSystem/FactMetaData.cc, stringToType: those that PX4's vehicles use."""


def crc32(data: bytes) -> int:
    """QGC.cc, crc32, from zero."""
    return zlib.crc32(data, 0xFFFF_FFFF) ^ 0xFFFF_FFFF


class ComponentInformation:
    """ComponentInformation/ComponentInformationManager.cc and RequestMetaDataTypeStateMachine.cc."""

    def __init__(self, commands: Commands, files: Files) -> None:
        self._commands = commands
        self._files = files
        self._cache: dict[str, Any] = {}
        """By type and CRC, as _getFileCacheTag names them."""
        self.downloads = 0
        self.parameters: dict[str, Any] = {}
        """Metadata of each parameter by its name."""

    def request_all(self) -> None:
        """requestAllComponentInformation: the general file, then those that it lists."""
        told = self._commands.request("COMPONENT_METADATA")
        assert not isinstance(told, int), f"refused with {told}: it would ask for COMPONENT_INFORMATION"
        general = self._file(GENERAL, told.uri, told.file_crc)
        assert isinstance(general["version"], int)  # CompInfoGeneral.cc, setJson
        listed = {entry["type"]: entry for entry in general["metadataTypes"]}
        assert all(isinstance(entry["uri"], str) for entry in listed.values())
        if PARAMETER in listed:
            entry = listed[PARAMETER]
            content = self._file(PARAMETER, entry["uri"], entry["fileCrc"])
            fallback = self._file(PARAMETER, entry["uriFallback"], entry["fileCrcFallback"])
            assert fallback == content
            self._read_parameters(content)

    def _file(self, kind: int, uri: str, crc: int) -> Any:
        """_requestFile, _downloadCompleteJsonWorker: from the cache when the CRC is known, unpacked by its name."""
        tag = f"{crc:08x}_{kind:02}"
        if tag not in self._cache:
            assert uri.lower().startswith("mftp://")
            data = self._files.download(uri)
            assert crc32(data) == crc, f"{uri} is not the file whose CRC was told"
            self.downloads += 1
            self._cache[tag] = json.loads(lzma.decompress(data) if uri.endswith(".xz") else data)
        return self._cache[tag]

    def _read_parameters(self, content: Any) -> None:
        """CompInfoParam.cc, setJson; FactMetaData.cc, createFromJsonObject."""
        assert isinstance(content["version"], int)
        for entry in content["parameters"]:
            assert entry["type"] in VALUE_TYPES, entry
            if "default" in entry:
                assert entry.get("min", entry["default"]) <= entry["default"], entry
                assert entry["default"] <= entry.get("max", entry["default"]), entry
            for choice in entry.get("values", ()):
                assert {"value", "description"} <= choice.keys()
            self.parameters[entry["name"]] = entry


class FlightMode(NamedTuple):
    """FirmwarePlugin.h, FirmwareFlightMode."""

    name: str
    standard: int
    custom: int
    can_be_set: bool


_STANDARD_NAMES = {
    1: "Position",
    2: "Orbit",
    3: "Cruise",
    4: "Altitude",
    5: "Safe Recovery",
    6: "Mission",
    7: "Land",
    8: "Takeoff",
}
_NOT_SELECTABLE = 2


def flight_mode(message: Any) -> FlightMode:
    """StandardModes.cc, availableModesReceived: standard modes get QGroundControl's own names."""
    name = _STANDARD_NAMES.get(message.standard_mode, message.mode_name)
    can_be_set = not message.properties & _NOT_SELECTABLE and name != "Orbit"
    return FlightMode(name, message.standard_mode, message.custom_mode, can_be_set)


class StandardModes:
    """Vehicle/StandardModes.cc."""

    def __init__(self, station: Station, commands: Commands) -> None:
        self._station = station
        self._commands = commands

    def request(self) -> dict[int, FlightMode]:
        """Return the modes by custom mode: request, then all that come, until the index is the number."""
        result, messages = self._commands.request_many("AVAILABLE_MODES", 0.0)
        assert result == ACCEPTED, "failed to request available modes"
        while messages[-1].mode_index < messages[-1].number_modes:
            messages.append(self._station.until("AVAILABLE_MODES"))
        modes = [flight_mode(message) for message in messages]
        assert [message.mode_index for message in messages] == list(range(1, len(modes) + 1))
        names = [mode.name for mode in modes]
        assert len(set(names)) == len(names), "ensureUniqueModeNames would have to rename"
        assert all(names)
        return {mode.custom: mode for mode in modes}

    def request_one_by_one(self) -> dict[int, FlightMode]:
        """As QGroundControl's releases did before: index 1, 2, … until the number that each message says."""
        modes, index, number = {}, 0, 1
        while index < number:
            index += 1
            message = self._commands.request("AVAILABLE_MODES", float(index))
            assert not isinstance(message, int), f"mode {index}: {message}"
            assert message.mode_index == index
            number = message.number_modes
            modes[message.custom_mode] = flight_mode(message)
        return modes


class StreamConfig:
    """Vehicle/MAVLinkStreamConfig.cc: its tuning pages ask for 100 Hz, and afterwards for the default again."""

    def __init__(self, commands: Commands) -> None:
        self._commands = commands

    def set_high_rates(self, *kinds: str) -> None:
        """setHighRateRateAndAttitude and the like: one at a time, since an ack does not say which."""
        self._set(1e6 / 100.0, kinds)

    def restore_defaults(self, *kinds: str) -> None:
        """restoreDefaults: interval 0."""
        self._set(0.0, kinds)

    def _set(self, interval_us: float, kinds: tuple[str, ...]) -> None:
        for kind in kinds:
            message_id = getattr(mavlink, f"MAVLINK_MSG_ID_{kind}")
            result = self._commands.long(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, message_id, interval_us)
            assert result == ACCEPTED, kind
