"""The magnetic field of the earth, by the World Magnetic Model."""

from __future__ import annotations

from functools import cache

from flightstack.core.contract import Vector3
from flightstack.core.geodesy import GeoPoint

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
    from pygeomag import GeoMag  # noqa: PLC0415  # reads a table of coefficients

    field = GeoMag(coefficients_file=f"wmm/{name}.COF").calculate(
        glat=place.latitude_deg, glon=place.longitude_deg, alt=place.altitude_m * 1e-3, time=year
    )
    north, east, down = (round(value * 1e-5, _DIGITS) for value in (field.x, field.y, field.z))  # from nT
    return Vector3(north, east, down)
