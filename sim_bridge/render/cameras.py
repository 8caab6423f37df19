"""Camera views: functions of the moment alone, so that a picture equals the frame of a film.

World frame of the scene: NWU [m].
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sim_bridge.multibody.frames import flip_vector
from sim_bridge.render.poses import Moment

Point = tuple[float, float, float]

CAMERAS = ("chase", "fixed", "top", "side", "whole")
SCALED = ("fixed", "top", "whole")
"""Cameras whose pictures have a north arrow and a scale bar."""
FIELD_DEG = 45.0
"""Vertical field of view of all cameras but the fixed one, which zooms."""
_FIXED_AT = (-11.0, 6.0)
_EYE_M = 1.75
_DOWN_DEG = -89.9
_LEAST_MARGIN_M, _ROOM = 0.8, 1.08
_NEAREST_M, _FARTHEST_M = 0.05, 1000.0
_NARROWEST_DEG = 18.0
_CHASE_ASIDE_DEG = -24.0
"""From straight behind, the arms of a plus frame would hide each other and the trail."""


class View(NamedTuple):
    """A camera: look-at point, distance, azimuth (0 looks north, 90 west) and elevation [deg]."""

    look_at_m: tuple[float, float, float]
    distance_m: float
    azimuth_deg: float
    elevation_deg: float
    field_deg: float = FIELD_DEG

    def pixel_m(self, height_px: int) -> float:
        """Return the size of a pixel at the look-at point [m], for a picture of this height."""
        return 2.0 * self.distance_m * math.tan(math.radians(0.5 * self.field_deg)) / height_px


class Site(NamedTuple):
    """Parameters of a view beside the moment.

    ``span_m`` is half the width of the vehicle, ``ground_m`` the height of the ground, ``low_m`` and ``high_m`` are the
    corners of a box around the whole flight, ``aspect`` is width over height.
    """

    span_m: float
    ground_m: float
    low_m: Point = (0.0, 0.0, 0.0)
    high_m: Point = (0.0, 0.0, 0.0)
    aspect: float = 16.0 / 9.0


def view(camera: str, moment: Moment, site: Site) -> View:
    """Return the view of a camera of ``CAMERAS``."""
    span_m, ground_m = site.span_m, site.ground_m
    at = flip_vector(moment.position_ned_m)
    if camera == "chase":
        look = (at[0], at[1], at[2] + 0.25 * span_m)
        azimuth = _CHASE_ASIDE_DEG - math.degrees(moment.chase_heading_rad)
        return View(look, 4.7 * span_m, azimuth, -19.0)
    if camera == "top":
        return View(at, max(4.5, 12.0 * span_m), 0.0, _DOWN_DEG)
    if camera == "side":
        return View((at[0], at[1], at[2] + 0.1 * span_m), 8.0 * span_m, -90.0, -6.0)
    if camera == "whole":
        return _whole_view(site)
    return _fixed_view(at, span_m, ground_m)


def _whole_view(site: Site) -> View:
    """Look straight down, north up, on the whole flight from above its highest point."""
    (north_0, west_0, _), (north_1, west_1, top) = site.low_m, site.high_m
    margin = max(_LEAST_MARGIN_M, 2.0 * site.span_m)
    half_height, half_width = 0.5 * (north_1 - north_0) + margin, 0.5 * (west_1 - west_0) + margin
    half = _ROOM * max(half_height, half_width / site.aspect)
    distance = min(half / math.tan(math.radians(0.5 * FIELD_DEG)), _FARTHEST_M)
    return View((0.5 * (north_0 + north_1), 0.5 * (west_0 + west_1), top), distance, 0.0, _DOWN_DEG)


def project(seen: View, point_m: Point, size: tuple[int, int]) -> tuple[float, float] | None:
    """Return the pixel of a point in a picture of this width and height; None if behind the camera."""
    azimuth, elevation = math.radians(seen.azimuth_deg), math.radians(seen.elevation_deg)
    sin_a, cos_a, sin_e, cos_e = (
        math.sin(azimuth),
        math.cos(azimuth),
        math.sin(elevation),
        math.cos(elevation),
    )
    x, y, z = (a - b for a, b in zip(point_m, seen.look_at_m, strict=True))
    depth = seen.distance_m + cos_e * (cos_a * x + sin_a * y) + sin_e * z
    if depth <= _NEAREST_M:
        return None
    right = sin_a * x - cos_a * y
    up = cos_e * z - sin_e * (cos_a * x + sin_a * y)
    scale = 0.5 * size[1] / math.tan(math.radians(0.5 * seen.field_deg)) / depth
    return 0.5 * size[0] + scale * right, 0.5 * size[1] - scale * up


def _fixed_view(at: tuple[float, float, float], span_m: float, ground_m: float) -> View:
    """Look from the edge of the field and zoom in on a distant vehicle, which is above the middle of the picture."""
    dx, dy, dz = at[0] - _FIXED_AT[0], at[1] - _FIXED_AT[1], at[2] - (ground_m + _EYE_M)
    flat = math.hypot(dx, dy)
    distance = math.hypot(flat, dz)
    wanted = 2.0 * math.degrees(math.atan2(6.0 * span_m, distance))
    field = min(max(wanted, _NARROWEST_DEG), FIELD_DEG)
    elevation = math.degrees(math.atan2(dz, flat)) - 0.24 * field * min(1.0, max(0.0, dz / 3.0))
    azimuth, up = math.degrees(math.atan2(dy, dx)), math.radians(elevation)
    turn, along = math.radians(azimuth), distance * math.cos(up)
    look = (
        _FIXED_AT[0] + along * math.cos(turn),
        _FIXED_AT[1] + along * math.sin(turn),
        ground_m + _EYE_M + distance * math.sin(up),
    )
    return View(look, distance, azimuth, elevation, field)
