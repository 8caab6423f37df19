"""Aircraft that an ADS-B receiver on the link reports (ADSB_VEHICLE)."""

from __future__ import annotations

from typing import NamedTuple

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Message

KEPT_S = 30.0
"""An aircraft that does not transmit for this time has left."""
_MOST_AIRCRAFT = 200


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
    """The aircraft by ICAO address. Written by the thread of the link, read by the screens."""

    def __init__(self) -> None:
        self._aircraft: dict[int, Aircraft] = {}

    def record(self, message: Message, now_s: float) -> None:
        """Take a message; only ADSB_VEHICLE with a valid position counts."""
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
        """Return the aircraft that transmitted within ``KEPT_S``."""
        return [each for each in list(self._aircraft.values()) if _is_near(each, now_s)]


def _is_near(aircraft: Aircraft, now_s: float) -> bool:
    return now_s - aircraft.heard_s <= KEPT_S
