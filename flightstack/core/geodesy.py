"""WGS 84 positions and the local tangent plane. Not compiled."""

from __future__ import annotations

import math
from typing import NamedTuple

from flightstack.core.contract import Vector3
from flightstack.core.portable_math import sin_cos

EQUATORIAL_RADIUS_M = 6_378_137.0
ECCENTRICITY_SQUARED = 6.694379990141316e-3


class GeoPoint(NamedTuple):
    """A WGS 84 position; altitude above mean sea level, which is taken as the ellipsoid."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float


class LocalFrame:
    """Flat earth (NED) around an origin, with the ellipsoid's two radii of curvature there.

    ``to_geo`` inverts ``to_ned`` up to rounding. Down is the difference of altitudes. Against the
    tangent plane, at 47° and 488 m above the ellipsoid, a position is off horizontally by 9 mm at 100 m,
    0.15 m at 1 km and 10 m at 10 km (the origin's altitude and the change of the parallel's radius with
    latitude are left out), and vertically by the earth's curvature: 0.08 m at 1 km, 7.9 m at 10 km.
    """

    def __init__(self, origin: GeoPoint) -> None:
        self.move_to(origin)

    def move_to(self, origin: GeoPoint) -> None:
        """Move the origin, for all users of this frame."""
        self.origin = origin
        sin_lat, cos_lat = sin_cos(math.radians(origin.latitude_deg))
        w2 = 1.0 - ECCENTRICITY_SQUARED * sin_lat * sin_lat
        meridian_m = EQUATORIAL_RADIUS_M * (1.0 - ECCENTRICITY_SQUARED) / (w2 * math.sqrt(w2))
        parallel_m = EQUATORIAL_RADIUS_M / math.sqrt(w2) * cos_lat
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
        longitude_deg = self.origin.longitude_deg + position_ned_m.y / self._east_m_per_deg
        if abs(longitude_deg) > 180.0:  # beyond the date line
            longitude_deg = (longitude_deg + 180.0) % 360.0 - 180.0
        return GeoPoint(
            self.origin.latitude_deg + position_ned_m.x / self._north_m_per_deg,
            longitude_deg,
            self.origin.altitude_m - position_ned_m.z,
        )
