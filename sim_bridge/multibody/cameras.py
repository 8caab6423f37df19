"""Where the cameras are: functions of the moment alone, so that a picture equals the frame of a film.

World of the scene: x north, y west, z up [m].
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sim_bridge.multibody.frames import flip_vector
from sim_bridge.multibody.poses import Moment

CAMERAS = ("chase", "fixed", "top", "side")
FIELD_DEG = 45.0
"""Vertical field of view of all cameras but the fixed one, which zooms."""
_FIXED_AT = (-11.0, 6.0)
_EYE_M = 1.75
_NARROWEST_DEG = 18.0
_CHASE_ASIDE_DEG = -24.0
"""Seen from straight behind, the arms of a plus frame hide each other and the way flown."""


class View(NamedTuple):
    """A camera: it looks at a point from a distance, turned about up (0 looks north, 90 west) and raised [deg]."""

    look_at_m: tuple[float, float, float]
    distance_m: float
    azimuth_deg: float
    elevation_deg: float
    field_deg: float = FIELD_DEG


def view(camera: str, moment: Moment, span_m: float, ground_m: float) -> View:
    """Return the view of a camera of ``CAMERAS``.

    ``span_m`` is half the width of the vehicle, ``ground_m`` the height of the ground in the world of the scene.
    """
    at = flip_vector(moment.position_ned_m)
    if camera == "chase":
        look = (at[0], at[1], at[2] + 0.25 * span_m)
        azimuth = _CHASE_ASIDE_DEG - math.degrees(moment.chase_heading_rad)
        return View(look, 4.7 * span_m, azimuth, -19.0)
    if camera == "top":
        return View(at, max(4.5, 12.0 * span_m), 0.0, -89.9)
    if camera == "side":
        return View((at[0], at[1], at[2] + 0.1 * span_m), 8.0 * span_m, -90.0, -6.0)
    return _from_fixed_place(at, span_m, ground_m)


def _from_fixed_place(at: tuple[float, float, float], span_m: float, ground_m: float) -> View:
    """Look from the field's edge and zoom in on a vehicle that is far; it is above the middle, over the field."""
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
