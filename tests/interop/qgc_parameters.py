"""QGroundControl's parameters: the list, its cache by digest, and a change."""

from __future__ import annotations

import struct
import zlib
from typing import Any, NamedTuple

from flightstack.mavlink.dialect import mavlink
from tests.interop.qgc_link import AUTOPILOT, Station

REQUEST_TIMEOUT_S, REQUEST_RETRIES = 5.0, 4
WAITING_TIMEOUT_S = 3.0
BATCH = 10
SET_TIMEOUT_S, SET_RETRIES = 1.0, 2
HASH = "_HASH_CHECK"
NO_INDEX = 65535
CODECS = {
    mavlink.MAV_PARAM_TYPE_INT32: "<i",
    mavlink.MAV_PARAM_TYPE_UINT32: "<I",
    mavlink.MAV_PARAM_TYPE_REAL32: "<f",
}


class Value(NamedTuple):
    """A parameter as the cache keeps it: its type and its four bytes."""

    kind: int
    octets: bytes

    @property
    def number(self) -> float:
        return float(struct.unpack(CODECS[self.kind], self.octets)[0])


def value_in(message: Any) -> Value:
    """ParameterManager.cc, _mavlinkParamUnionToVariant: the float's bytes are the value's."""
    return Value(message.param_type, struct.pack("<f", message.param_value))


def digest(cache: dict[str, Value]) -> int:
    """ParamHashCheckStateMachine.cc, _computeCacheHash: sorted names and values, CRC-32 from zero."""
    state = 0xFFFF_FFFF  # zlib inverts at both ends
    for name in sorted(cache):
        state = zlib.crc32(name.encode() + cache[name].octets, state)
    return state ^ 0xFFFF_FFFF


class Parameters:
    """FactSystem/ParameterManager.cc for PX4 firmware."""

    def __init__(self, station: Station) -> None:
        self._station = station
        self.cache: dict[str, Value] = {}
        self.from_cache = False
        """Whether the last load ended by the digest."""

    def load(self) -> dict[str, Value]:
        """Return all parameters: refreshAllParameters, _handleParamValue, _checkInitialLoadComplete."""
        first = self._request_list()
        self.from_cache = False
        if first.param_id == HASH:  # _tryCacheHashLoad
            (told,) = struct.unpack("<I", value_in(first).octets)
            assert first.param_type == mavlink.MAV_PARAM_TYPE_UINT32
            if self.cache and digest(self.cache) == told:
                self._return_hash(first.param_value)
                self.from_cache = True
                return self.cache
            first = None
        self.cache = self._collect(first)
        return self.cache

    def _request_list(self) -> Any:
        """_initialRequestTimeout: asked again while nothing came; values nobody asked for do not count."""
        for _ in range(1 + REQUEST_RETRIES):
            self._station.send(mavlink.MAVLink_param_request_list_message(self._station.system, 0))
            first = self._station.wait(
                "PARAM_VALUE",
                within_s=REQUEST_TIMEOUT_S,
                holds=lambda value: value.param_index != NO_INDEX or value.param_id == HASH,
            )
            if first is not None:
                return first
        raise AssertionError("the vehicle did not respond to the request for parameters")

    def _collect(self, first: Any | None) -> dict[str, Value]:
        """Take values until every index was seen; _waitingParamTimeout asks for ten of those that lack."""
        values: dict[str, Value] = {}
        waiting: set[int] | None = None
        message, timeouts = first, 0
        while waiting is None or waiting:
            message = message or self._station.wait("PARAM_VALUE", within_s=WAITING_TIMEOUT_S)
            if message is None:
                timeouts += 1
                assert timeouts <= 5, f"gave up on parameters {waiting}"
                self._ask_for(sorted(waiting or ())[:BATCH])
            elif message.param_id != HASH:
                if waiting is None:
                    waiting = set(range(message.param_count))
                waiting.discard(message.param_index)
                values[message.param_id] = value_in(message)
            message = None
        return values

    def _ask_for(self, indices: list[int]) -> None:
        """_readParameterRaw."""
        for index in indices:
            self._station.send(
                mavlink.MAVLink_param_request_read_message(self._station.system, AUTOPILOT, b"", index)
            )

    def _return_hash(self, bits: float) -> None:
        """ParamHashCheckStateMachine.cc, _sendHashAckToVehicle: that it wants no more of them."""
        self._set(HASH, bits, mavlink.MAV_PARAM_TYPE_UINT32)

    def change(self, name: str, number: float) -> bool:
        """Set a parameter, and tell whether the vehicle answered with it: _mavlinkParamSet.

        A value that is not the one sent does not count. After it gave up it reads the parameter again.
        """
        kind = self.cache[name].kind
        wanted = Value(kind, struct.pack(CODECS[kind], int(number) if kind != 9 else number))
        for _ in range(1 + SET_RETRIES):
            self._set(name, struct.unpack("<f", wanted.octets)[0], kind)
            echo = self._station.wait(
                "PARAM_VALUE",
                within_s=SET_TIMEOUT_S,
                holds=lambda value: value.param_id == name and value_in(value) == wanted,
            )
            if echo is not None:
                self.cache[name] = wanted
                return True
        self._station.send(
            mavlink.MAVLink_param_request_read_message(self._station.system, AUTOPILOT, name.encode(), -1)
        )
        told = self._station.until("PARAM_VALUE", holds=lambda value: value.param_id == name)
        self.cache[name] = value_in(told)
        return False

    def _set(self, name: str, bits: float, kind: int) -> None:
        self._station.send(
            mavlink.MAVLink_param_set_message(self._station.system, AUTOPILOT, name.encode(), bits, kind)
        )
