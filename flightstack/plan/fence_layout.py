"""How the areas of a geofence lie in their array: shared by the check of plans and by compiled code."""

from __future__ import annotations

A_INCLUSION, A_GROUP, A_START, A_END, A_NORTH, A_EAST, A_RADIUS = range(7)
"""Inclusion (1) or exclusion (0); group from 0; first vertex and the one behind the last; centre and radius [m].

The radius of a polygon is 0. Vertices lie in an array of their own, shape (m, 2): north and east [m].
"""
AREA_COLUMNS = 7
