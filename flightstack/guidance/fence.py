"""The geofence in flight: is the vehicle inside, by how much, and could it still stop inside.

Inclusion areas are in groups (MAVLink): the vehicle must be inside all areas of at least one group, and outside every
exclusion area. Ground stations use one group for all, so that it must be inside every inclusion area, as with PX4.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import IntFlag

import numpy as np

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.core.portable_math import distance
from flightstack.plan import FenceShape, MissionItem, fence_shape
from flightstack.plan.fence_shape import A_EAST, A_END, A_GROUP, A_INCLUSION, A_NORTH, A_RADIUS, A_START

HYSTERESIS_M = 1.0
"""How far inside a limit the vehicle must be for a breach of it to end, so that it does not flicker."""

F_FLAGS, F_INCLUSION_M, F_EXCLUSION_M, F_HEIGHT_M, F_DISTANCE_M = range(5)
FENCE_MEMORY_SIZE = 5
L_MAX_DISTANCE, L_MAX_ALTITUDE, L_HOME_NORTH, L_HOME_EAST, L_HOME_DOWN, L_DECELERATION, L_VERTICAL = range(7)
LIMITS_SIZE = 7
NO_MARGIN = math.inf


class FenceBreach(IntFlag):
    """Which limits of the geofence are broken."""

    NONE = 0
    OUTSIDE = 1
    """Outside the inclusion areas."""
    EXCLUDED = 2
    """Inside an exclusion area."""
    TOO_HIGH = 4
    """Above GF_MAX_VER_DIST."""
    TOO_FAR = 8
    """Beyond GF_MAX_HOR_DIST."""


@compiled
def area_margin(areas: FloatArray, vertices: FloatArray, index: int, north_m: float, east_m: float) -> float:
    """Return the distance to the edge of area ``index`` [m]: positive inside, negative outside."""
    radius_m = areas[index, A_RADIUS]
    if radius_m > 0.0:
        return float(radius_m - distance(north_m - areas[index, A_NORTH], east_m - areas[index, A_EAST]))
    inside = False
    nearest2 = math.inf
    end = int(areas[index, A_END])
    before = end - 1
    for vertex in range(int(areas[index, A_START]), end):
        n1, e1 = vertices[before, 0] - north_m, vertices[before, 1] - east_m
        n2, e2 = vertices[vertex, 0] - north_m, vertices[vertex, 1] - east_m
        dn, de = n2 - n1, e2 - e1
        # even-odd rule: the edge crosses the ray to the north when it changes sides in the east, and to its left
        if (e1 > 0.0) != (e2 > 0.0) and (n1 * de - e1 * dn) * de > 0.0:
            inside = not inside
        length2 = dn * dn + de * de
        share = 0.0
        if length2 > 0.0:
            share = min(1.0, max(0.0, -(n1 * dn + e1 * de) / length2))
        off_n, off_e = n1 + share * dn, e1 + share * de
        nearest2 = min(nearest2, off_n * off_n + off_e * off_e)
        before = vertex
    distance_m = math.sqrt(nearest2)
    return distance_m if inside else -distance_m


@compiled
def fence_margins(
    areas: FloatArray, vertices: FloatArray, groups: int, north_m: float, east_m: float
) -> tuple[float, float]:
    """Return by how much a place is inside the inclusion areas and outside the exclusion areas [m].

    Negative when it is not; infinite where there are no such areas. Exact for one area; where several overlap, a
    bound on the distance, of the right sign.
    """
    outside_m = math.inf
    inside_m = math.inf if groups == 0 else -math.inf
    for index in range(len(areas)):
        if areas[index, A_INCLUSION] == 0.0:
            outside_m = min(outside_m, -area_margin(areas, vertices, index, north_m, east_m))
    for group in range(groups):
        group_m = math.inf
        for index in range(len(areas)):
            if areas[index, A_INCLUSION] > 0.0 and areas[index, A_GROUP] == group:
                group_m = min(group_m, area_margin(areas, vertices, index, north_m, east_m))
        inside_m = max(inside_m, group_m)
    return inside_m, outside_m


@compiled
def _stops_at(position: float, velocity: float, deceleration: float) -> float:
    """Return where a motion ends that is slowed down from now on."""
    return position + velocity * abs(velocity) / (2.0 * deceleration)


@compiled
def fence_step(
    areas: FloatArray,
    vertices: FloatArray,
    groups: int,
    limits: FloatArray,
    state: FloatArray,
    memory: FloatArray,
) -> None:
    """Find the margins and breaches of one outer tick.

    ``state`` (13,) as everywhere; ``limits`` (7,): greatest distance and altitude (0: none), home in NED, and
    horizontal and vertical deceleration to look ahead with (0: look at the present only). ``memory`` (5,): flags
    of ``FenceBreach`` and the margins of its four limits; what is not finite keeps the flags as they are.
    """
    north_m, east_m, down_m = state[0], state[1], state[2]
    if limits[L_DECELERATION] > 0.0:
        speed = distance(state[3], state[4])
        ahead_s = speed / (2.0 * limits[L_DECELERATION])
        north_m, east_m = north_m + state[3] * ahead_s, east_m + state[4] * ahead_s
        down_m = _stops_at(down_m, state[5], limits[L_VERTICAL])
    if not (math.isfinite(north_m) and math.isfinite(east_m) and math.isfinite(down_m)):
        return
    inside_m, outside_m = fence_margins(areas, vertices, groups, north_m, east_m)
    distance_m = distance(north_m - limits[L_HOME_NORTH], east_m - limits[L_HOME_EAST])
    memory[F_INCLUSION_M], memory[F_EXCLUSION_M] = inside_m, outside_m
    memory[F_HEIGHT_M], memory[F_DISTANCE_M] = math.inf, math.inf
    if limits[L_MAX_ALTITUDE] > 0.0:
        memory[F_HEIGHT_M] = limits[L_MAX_ALTITUDE] - (limits[L_HOME_DOWN] - down_m)
    if limits[L_MAX_DISTANCE] > 0.0:
        memory[F_DISTANCE_M] = limits[L_MAX_DISTANCE] - distance_m
    before = int(memory[F_FLAGS])
    after = 0
    for limit in range(4):
        needed_m = HYSTERESIS_M if before & (1 << limit) else 0.0
        if memory[F_INCLUSION_M + limit] < needed_m:
            after |= 1 << limit
    memory[F_FLAGS] = float(after)


class Fence:
    """The areas of a geofence, in metres from the origin of the local frame."""

    def __init__(self, shape: FenceShape) -> None:
        self.shape = shape

    @classmethod
    def from_items(cls, items: Sequence[MissionItem], frame: LocalFrame) -> Fence:
        """Make the fence of items that ``plan.check_fence`` accepted; no items, no areas."""
        return cls(fence_shape(items, frame.origin))

    @property
    def is_empty(self) -> bool:
        """Whether there are no areas, so that every place is inside."""
        return not len(self.shape.areas)

    def margins(self, north_m: float, east_m: float) -> tuple[float, float]:
        """Return by how much a place is inside the inclusion areas, and outside the exclusion areas [m]."""
        inside_m, outside_m = fence_margins(
            self.shape.areas, self.shape.vertices, self.shape.groups, north_m, east_m
        )
        return float(inside_m), float(outside_m)


NO_FENCE = Fence(FenceShape((), GeoPoint(0.0, 0.0, 0.0)))


class FenceMonitor:
    """Watches the vehicle; ``flags`` and ``margin_m`` are those of the last step. No I/O, no clock."""

    def __init__(self) -> None:
        self._limits = np.zeros(LIMITS_SIZE)
        self._memory = np.full(FENCE_MEMORY_SIZE, NO_MARGIN)
        self._memory[F_FLAGS] = 0.0
        self.configure(NO_FENCE)

    def configure(
        self,
        fence: Fence,
        max_distance_m: float = 0.0,
        max_altitude_m: float = 0.0,
        home_ned_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
        decelerations_m_s2: tuple[float, float] | None = None,
    ) -> None:
        """Take a fence and limits (GF_MAX_HOR_DIST, GF_MAX_VER_DIST; 0 for none), both measured from home.

        ``decelerations_m_s2``, horizontal and vertical and above 0, make a breach of what the vehicle could no
        longer avoid by braking (GF_PREDICT). A breach under way goes on if it is one of the new limits too.
        """
        self.fence = fence
        shape = fence.shape
        self._areas, self._vertices, self._groups = shape.areas, shape.vertices, shape.groups
        self._limits[:] = (max_distance_m, max_altitude_m, *home_ned_m, *(decelerations_m_s2 or (0.0, 0.0)))
        self.is_active = not fence.is_empty or max_distance_m > 0.0 or max_altitude_m > 0.0

    def step(self, state: FloatArray) -> int:
        """Look at ``state`` (13,), once per outer tick; return the flags of ``FenceBreach``."""
        if not self.is_active:
            self._memory[F_FLAGS] = 0.0
            return 0
        fence_step(self._areas, self._vertices, self._groups, self._limits, state, self._memory)
        return int(self._memory[F_FLAGS])

    @property
    def flags(self) -> FenceBreach:
        """The limits that are broken."""
        return FenceBreach(int(self._memory[F_FLAGS]))

    @property
    def margin_m(self) -> float:
        """Distance to the nearest limit [m]: negative when broken, infinite when there is none."""
        return float(self._memory[F_INCLUSION_M:].min()) if self.is_active else NO_MARGIN

    def refusal(self, north_m: float, east_m: float, altitude_m: float = 0.0) -> str | None:
        """Return why the vehicle may not be at a place (altitude above home), as the end of a sentence, or None.

        For arming, takeoff and goto: "the vehicle" or "the target" " is outside the geofence".
        """
        memory = self._look_at(north_m, east_m, altitude_m)
        if memory is None:
            return "is nowhere"
        return self.text(int(memory[F_FLAGS])) or None

    def way_refusal(self, here: tuple[float, float, float], there: tuple[float, float, float]) -> str | None:
        """Return why the vehicle may not go straight to a place (north, east, altitude above home), or None.

        Who is outside a limit already may go where it is no farther outside: out of a breach there must be a way.
        """
        present, wanted = self._look_at(*here), self._look_at(*there)
        if present is None or wanted is None:
            return "is nowhere"
        no_worse = wanted[F_INCLUSION_M:] >= present[F_INCLUSION_M:]
        broken = int(wanted[F_FLAGS])
        for limit in range(4):
            if broken & int(present[F_FLAGS]) & 1 << limit and no_worse[limit]:
                broken &= ~(1 << limit)
        if broken:
            return self.text(broken)
        if int(present[F_FLAGS]) & (FenceBreach.OUTSIDE | FenceBreach.EXCLUDED):
            return None
        segments_outside = self.fence.shape.segments_outside(np.array([here[:2]]), np.array([there[:2]]))
        return "is beyond an edge of the geofence" if segments_outside else None

    def _look_at(self, north_m: float, east_m: float, altitude_m: float) -> FloatArray | None:
        """Return flags and margins of a place, as ``fence_step`` writes them; None if it is nowhere."""
        probe, memory = np.zeros(13), np.zeros(FENCE_MEMORY_SIZE)
        limits = self._limits.copy()
        limits[[L_DECELERATION, L_VERTICAL]] = 0.0
        probe[:3] = north_m, east_m, limits[L_HOME_DOWN] - altitude_m
        if not np.isfinite(probe).all():
            return None
        fence_step(self._areas, self._vertices, self._groups, limits, probe, memory)
        return memory

    def text(self, flags: int) -> str:
        """Return what ``flags`` mean, as the end of a sentence: "is outside the geofence"; empty for none."""
        distance_m, altitude_m = self._limits[L_MAX_DISTANCE], self._limits[L_MAX_ALTITUDE]
        parts = {
            FenceBreach.OUTSIDE: "outside the geofence",
            FenceBreach.EXCLUDED: "inside an exclusion area of the geofence",
            FenceBreach.TOO_HIGH: f"more than {altitude_m:g} m above home (GF_MAX_VER_DIST)",
            FenceBreach.TOO_FAR: f"more than {distance_m:g} m from home (GF_MAX_HOR_DIST)",
        }
        said = [text for flag, text in parts.items() if flags & flag]
        return f"is {' and '.join(said)}" if said else ""
