"""The Earth's magnetic field at the place and date of a log."""

from __future__ import annotations

from flightstack.core.contract import Vector3
from flightstack.core.geodesy import GeoPoint

_MODELS = (
    (2025.0, "WMM_2025.COF"),
    (2020.0, "WMM_2020.COF"),
    (2015.0, "WMM_2015v2.COF"),
    (2010.0, "WMM_2010.COF"),
)
_GAUSS = 1e-5  # per nanotesla


def field_at(place: GeoPoint, year: float | None) -> Vector3:
    """Return the field [gauss, NED] by the World Magnetic Model of ``year``; of 2025 if it is unknown."""
    from pygeomag import GeoMag  # noqa: PLC0415  # reads a table of coefficients

    year = 2025.0 if year is None else year
    begin, name = next(((start, model) for start, model in _MODELS if year >= start), _MODELS[0])
    year = year if begin <= year <= begin + 5.0 else begin
    model = GeoMag(coefficients_file=f"wmm/{name}")
    field = model.calculate(
        glat=place.latitude_deg, glon=place.longitude_deg, alt=place.altitude_m * 1e-3, time=year
    )
    return Vector3(field.x * _GAUSS, field.y * _GAUSS, field.z * _GAUSS)
