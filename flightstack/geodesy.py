"""WGS 84 positions and the local tangent plane: the only copy in the project (no compiled code)."""

from __future__ import annotations

import math
from typing import NamedTuple

from flightstack.contract import Vector3

EQUATORIAL_RADIUS_M = 6_378_137.0
ECCENTRICITY_SQUARED = 6.694379990141316e-3


class GeoPoint(NamedTuple):
    """A WGS 84 position; the altitude is above mean sea level, which the project equates with the ellipsoid."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float


class LocalFrame:
    """Tangent plane (NED) at an origin, with the ellipsoid's two radii of curvature there.

    ``to_geo`` is the exact inverse of ``to_ned``. What is left out is the change of the radii with latitude,
    which grows with the square of the distance.
    """

    def __init__(self, origin: GeoPoint) -> None:
        self.origin = origin
        sin_lat = math.sin(math.radians(origin.latitude_deg))
        w2 = 1.0 - ECCENTRICITY_SQUARED * sin_lat * sin_lat
        meridian_m = EQUATORIAL_RADIUS_M * (1.0 - ECCENTRICITY_SQUARED) / (w2 * math.sqrt(w2))
        parallel_m = EQUATORIAL_RADIUS_M / math.sqrt(w2) * math.cos(math.radians(origin.latitude_deg))
        self._north_m_per_deg = math.radians(meridian_m)
        self._east_m_per_deg = math.radians(max(parallel_m, 1e-6))

    def to_ned(self, point: GeoPoint) -> Vector3:
        """Return the NED position [m] of a geodetic point relative to the origin."""
        east_deg = (point.longitude_deg - self.origin.longitude_deg + 180.0) % 360.0 - 180.0
        return Vector3(
            (point.latitude_deg - self.origin.latitude_deg) * self._north_m_per_deg,
            east_deg * self._east_m_per_deg,
            self.origin.altitude_m - point.altitude_m,
        )

    def to_geo(self, position_ned_m: Vector3) -> GeoPoint:
        """Return the geodetic point of a NED position [m] relative to the origin."""
        return GeoPoint(
            self.origin.latitude_deg + position_ned_m.x / self._north_m_per_deg,
            self.origin.longitude_deg + position_ned_m.y / self._east_m_per_deg,
            self.origin.altitude_m - position_ned_m.z,
        )
