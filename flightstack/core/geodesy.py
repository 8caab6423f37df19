"""WGS 84 positions, the local tangent plane, and the magnetic field of the earth."""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

from flightstack.core.compiled import compiled, plain
from flightstack.core.contract import Vector3
from flightstack.core.portable_math import sin_cos

EQUATORIAL_RADIUS_M = 6_378_137.0
ECCENTRICITY_SQUARED = 6.694379990141316e-3


class GeoPoint(NamedTuple):
    """A WGS 84 position; altitude above mean sea level, which is taken as the ellipsoid."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float


@compiled
def geographic(origin: GeoPoint, scales: tuple[float, float], position_ned_m: Vector3) -> GeoPoint:
    """Return the geodetic point of a NED position [m] relative to ``origin``; ``scales`` are those of its frame."""
    north_m_per_deg, east_m_per_deg = scales
    longitude_deg = origin.longitude_deg + position_ned_m.y / east_m_per_deg
    if abs(longitude_deg) > 180.0:  # beyond the date line
        longitude_deg = (longitude_deg + 180.0) % 360.0 - 180.0
    return GeoPoint(
        origin.latitude_deg + position_ned_m.x / north_m_per_deg,
        longitude_deg,
        origin.altitude_m - position_ned_m.z,
    )


@compiled
def relative(origin: GeoPoint, scales: tuple[float, float], point: GeoPoint) -> Vector3:
    """Return the NED position [m] of a geodetic point relative to ``origin``; ``scales`` are those of its frame."""
    north_m_per_deg, east_m_per_deg = scales
    east_deg = (point.longitude_deg - origin.longitude_deg + 180.0) % 360.0 - 180.0
    return Vector3(
        (point.latitude_deg - origin.latitude_deg) * north_m_per_deg,
        east_deg * east_m_per_deg,
        origin.altitude_m - point.altitude_m,
    )


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

    @property
    def scales(self) -> tuple[float, float]:
        """Metres per degree to the north and to the east."""
        return self._north_m_per_deg, self._east_m_per_deg

    def to_ned(self, point: GeoPoint) -> Vector3:
        """Return the NED position [m] of a geodetic point relative to the origin."""
        return plain(relative)(self.origin, self.scales, point)

    def to_geo(self, position_ned_m: Vector3) -> GeoPoint:
        """Return the geodetic point of a NED position [m] relative to the origin."""
        return plain(geographic)(self.origin, self.scales, position_ned_m)


FIELD_YEAR = 2026.0
"""Date of the field in all simulations: flights of the same seed stay equal. It changes by 0.1° a year at home."""
_MODELS = ((2025.0, "WMM_2025"), (2020.0, "WMM_2020"), (2015.0, "WMM_2015v2"), (2010.0, "WMM_2010"))
"""First year of each model, which is valid for five years."""
_DIGITS = 7  # of a value in gauss: more depend on the processor's libm


@cache
def earth_field_ned_gauss(place: GeoPoint, year: float = FIELD_YEAR) -> Vector3:
    """Return the field [gauss] at a place, from 2010 to 2030; an earlier or later year counts as the nearest one."""
    year = min(max(year, _MODELS[-1][0]), _MODELS[0][0] + 5.0)
    name = next(model for begin, model in _MODELS if year >= begin)
    from pygeomag import GeoMag

    field = GeoMag(coefficients_file=f"wmm/{name}.COF").calculate(
        glat=place.latitude_deg, glon=place.longitude_deg, alt=place.altitude_m * 1e-3, time=year
    )
    north, east, down = (round(value * 1e-5, _DIGITS) for value in (field.x, field.y, field.z))  # from nT
    return Vector3(north, east, down)
