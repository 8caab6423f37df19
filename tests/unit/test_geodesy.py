"""The local frame against positions computed through earth-centred coordinates."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flightstack.core.contract import Vector3
from flightstack.core.geodesy import GeoPoint, LocalFrame

SEMI_MAJOR_M = 6378137.0
FLATTENING = 1.0 / 298.257223563  # WGS 84 by definition: independent of the module's eccentricity


def earth_centred(point: GeoPoint) -> np.ndarray:
    """Earth-centred, earth-fixed position [m]."""
    latitude, longitude = math.radians(point.latitude_deg), math.radians(point.longitude_deg)
    polar_ratio = (1.0 - FLATTENING) ** 2
    normal = SEMI_MAJOR_M / math.sqrt(math.cos(latitude) ** 2 + polar_ratio * math.sin(latitude) ** 2)
    across = (normal + point.altitude_m) * math.cos(latitude)
    return np.array(
        [
            across * math.cos(longitude),
            across * math.sin(longitude),
            (normal * polar_ratio + point.altitude_m) * math.sin(latitude),
        ]
    )


def exact_ned(origin: GeoPoint, point: GeoPoint) -> np.ndarray:
    """Position in the tangent plane at the origin [m]."""
    la, lo = math.radians(origin.latitude_deg), math.radians(origin.longitude_deg)
    north = (-math.sin(la) * math.cos(lo), -math.sin(la) * math.sin(lo), math.cos(la))
    east = (-math.sin(lo), math.cos(lo), 0.0)
    down = (-math.cos(la) * math.cos(lo), -math.cos(la) * math.sin(lo), -math.sin(la))
    return np.array([north, east, down]) @ (earth_centred(point) - earth_centred(origin))


# distance, horizontal and vertical error allowed; seen: 9 mm / 1 mm, 0.149 m / 78 mm, 10.1 m / 7.85 m
ACCURACY = [(100.0, 0.012, 0.0012), (1_000.0, 0.18, 0.085), (10_000.0, 12.0, 8.5)]


@pytest.mark.parametrize(("distance", "horizontal", "vertical"), ACCURACY)
@pytest.mark.parametrize("latitude", [47.397742, -47.397742, 0.0])
def test_accuracy_matches_docstring(
    distance: float, horizontal: float, vertical: float, latitude: float
) -> None:
    origin = GeoPoint(latitude, 8.545594, 488.0)
    frame = LocalFrame(origin)
    for bearing in np.linspace(0.0, 2.0 * math.pi, 73):
        ned = Vector3(distance * math.cos(bearing), distance * math.sin(bearing), -50.0)
        exact = exact_ned(origin, frame.to_geo(ned))
        assert math.hypot(exact[0] - ned.x, exact[1] - ned.y) < horizontal
        assert abs(exact[2] - ned.z) < vertical


def test_close_to_the_origin_at_sea_level_it_is_exact() -> None:
    origin = GeoPoint(47.397742, 8.545594, 0.0)
    for ned in (Vector3(1.0, 0.0, 0.0), Vector3(0.0, 1.0, 0.0), Vector3(-3.0, 2.0, -1.0)):
        exact = exact_ned(origin, LocalFrame(origin).to_geo(ned))
        # the earth's curvature over 3 m is 2e-6 m; altitude 1 m is 2e-7 of the radius: 1.2e-6 m seen
        assert np.abs(exact - ned).max() < 3e-6


@settings(max_examples=60)
@given(
    st.floats(-89.0, 89.0),
    st.floats(-180.0, 180.0),
    st.floats(-400.0, 9000.0),
    st.tuples(st.floats(-2e4, 2e4), st.floats(-2e4, 2e4), st.floats(-5e3, 5e3)),
)
def test_there_and_back_is_the_identity(
    latitude: float, longitude: float, altitude: float, place: tuple[float, float, float]
) -> None:
    frame = LocalFrame(GeoPoint(latitude, longitude, altitude))
    back = frame.to_ned(frame.to_geo(Vector3(*place)))
    # an ulp of 180 degrees is 3 nm of arc: 4e-9 m seen, times the rounding of two sums
    assert np.abs(np.array(back) - place).max() < 2e-8


@pytest.mark.parametrize(
    ("origin_lon", "lon", "east_sign"), [(179.9999, -179.9999, 1), (-179.9999, 179.9999, -1)]
)
def test_the_date_line_is_no_border(origin_lon: float, lon: float, east_sign: int) -> None:
    origin = GeoPoint(10.0, origin_lon, 0.0)
    ned = LocalFrame(origin).to_ned(GeoPoint(10.0, lon, 0.0))
    expected = exact_ned(origin, GeoPoint(10.0, lon, 0.0))
    assert ned.y == pytest.approx(expected[1], abs=1e-4)
    assert ned.y * east_sign == pytest.approx(21.93, abs=0.01)


def test_positions_beyond_the_date_line_are_longitudes() -> None:
    """What goes to the wire and to other programs lies within ±180 degrees."""
    frame = LocalFrame(GeoPoint(10.0, 179.9999, 0.0))
    east = frame.to_geo(Vector3(0.0, 30.0, 0.0))
    assert -180.0 <= east.longitude_deg <= 180.0
    assert frame.to_ned(east).y == pytest.approx(30.0, abs=1e-8)


def test_the_pole_divides_by_no_zero() -> None:
    assert math.isfinite(LocalFrame(GeoPoint(90.0, 0.0, 0.0)).to_geo(Vector3(1.0, 0.0, 0.0)).latitude_deg)
