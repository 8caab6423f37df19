"""Aircraft that an ADS-B receiver on the link reports (ADSB_VEHICLE)."""

from __future__ import annotations

from typing import NamedTuple

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Message
from flightstack.mavlink.param_values import parse_value

OWN_ADDRESS = "ADSB_ICAO_ID"
"""Parameter of PX4 and ArduPilot: the ICAO address of the vehicle's own transponder, which its receiver reports too."""
KEPT_S = 30.0
"""An aircraft that does not transmit for this time has left."""
MESSAGES = frozenset({mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE, mavlink.MAVLINK_MSG_ID_PARAM_VALUE})
"""Ids of the messages to ``record``; others are ignored."""
_MOST_AIRCRAFT = 200
_REQUEST_PERIOD_S, _MOST_REQUESTS = 10.0, 3


class Aircraft(NamedTuple):
    """Position, altitude and heading of an aircraft; None: unknown."""

    name: str
    """Its callsign, else its ICAO address."""
    latitude_deg: float
    longitude_deg: float
    altitude_m: float | None
    """Above the sea if it is geometric, else pressure altitude."""
    heading_deg: float | None
    heard_s: float
    """Time of the aircraft's last transmission."""
    is_geometric: bool = False


class Traffic:
    """Aircraft by ICAO address, without the vehicles' own. Written by the thread of the link, read by the screens."""

    def __init__(self) -> None:
        self._aircraft: dict[int, Aircraft] = {}
        self._own: dict[int, int] = {}
        """ICAO addresses of vehicles by system id, as far as they sent it."""
        self._requests: dict[int, list[float]] = {}
        """Times of the requests for the own address, by system id."""

    def own_address_request(self, message: Message, now_s: float) -> Message | None:
        """Return the request for the address of the vehicle that sent an ADSB_VEHICLE; None if it is not due.

        A vehicle without the parameter may not answer: it is requested three times, 10 s apart.
        """
        system, component = message.get_srcSystem(), message.get_srcComponent()
        if message.get_msgId() != mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE or system in self._own:
            return None
        sent_s = self._requests.setdefault(system, [])
        if len(sent_s) >= _MOST_REQUESTS or (sent_s and now_s - sent_s[-1] < _REQUEST_PERIOD_S):
            return None
        sent_s.append(now_s)
        return mavlink.MAVLink_param_request_read_message(system, component, OWN_ADDRESS.encode(), -1)

    def record(self, message: Message, now_s: float, *, casts_parameters: bool = False) -> None:
        """Take an ADSB_VEHICLE with a valid position, or the PARAM_VALUE of a vehicle's own address."""
        if message.get_msgId() == mavlink.MAVLINK_MSG_ID_PARAM_VALUE and message.param_id == OWN_ADDRESS:
            parameter = parse_value(message, casts=casts_parameters)
            if parameter is not None:
                self._own[message.get_srcSystem()] = int(parameter.value)
            return
        if message.get_msgId() != mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE:
            return
        if not message.flags & mavlink.ADSB_FLAGS_VALID_COORDS:
            return
        address = message.ICAO_address
        if address not in self._aircraft and len(self._aircraft) >= _MOST_AIRCRAFT:
            self._aircraft = {key: each for key, each in self._aircraft.items() if _is_near(each, now_s)}
            if len(self._aircraft) >= _MOST_AIRCRAFT:
                return
        has_altitude = message.flags & mavlink.ADSB_FLAGS_VALID_ALTITUDE
        has_heading = message.flags & mavlink.ADSB_FLAGS_VALID_HEADING
        self._aircraft[address] = Aircraft(
            message.callsign.strip("\0 ") or f"{address:06X}",
            message.lat / 1e7,
            message.lon / 1e7,
            message.altitude / 1e3 if has_altitude else None,
            message.heading / 100 if has_heading else None,
            now_s - message.tslc,
            message.altitude_type == mavlink.ADSB_ALTITUDE_TYPE_GEOMETRIC,
        )

    def aircraft(self, now_s: float) -> list[Aircraft]:
        """Return the aircraft that transmitted within ``KEPT_S``, without the vehicles' own reports."""
        own = set(self._own.values())
        return [
            each for key, each in list(self._aircraft.items()) if key not in own and _is_near(each, now_s)
        ]


def _is_near(aircraft: Aircraft, now_s: float) -> bool:
    return now_s - aircraft.heard_s <= KEPT_S
