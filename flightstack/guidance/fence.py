"""Geofence: margins and breaches of the present or the predicted stopping position.

Inclusion areas are in groups (MAVLink): the vehicle must be inside all areas of at least one group, and outside every
exclusion area. Ground stations use one group for all areas: the vehicle must be inside every one, as in PX4.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import IntFlag

import numpy as np

from flightstack.core.compiled import compiled
from flightstack.core.contract import STATE_SIZE, FloatArray, Record, RecordArray
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.core.portable_math import distance
from flightstack.plan import MissionItem
from flightstack.plan.fence import fence_shape
from flightstack.plan.fence_shape import FenceShape

HYSTERESIS_M = 1.0
"""Margin at which a breach of a limit ends, so that the breach does not chatter."""

LIMITS = np.dtype(
    [
        ("distance", "f8"),  # from home, m; 0 none
        ("altitude", "f8"),  # above home, m; 0 none
        ("home", "f8", 3),  # m NED
        ("deceleration", "f8"),  # for the prediction, m/s²; 0 to evaluate the present position only
        ("vertical_deceleration", "f8"),
    ]
)
BREACH = np.dtype(
    [
        ("flags", "i8"),  # of ``FenceBreach``
        ("margins", "f8", 4),  # to the limits in the order of the flags, m; negative when broken
    ]
)
NO_MARGIN = math.inf


class FenceBreach(IntFlag):
    """Limits of the geofence that are breached."""

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
def area_margin(areas: RecordArray, vertices: FloatArray, index: int, north_m: float, east_m: float) -> float:
    """Return the distance to the edge of area ``index`` [m]: positive inside, negative outside."""
    area = areas[index]
    radius_m = area["radius"]
    if radius_m > 0.0:
        return float(radius_m - distance(north_m - area["north"], east_m - area["east"]))
    inside = False
    nearest2 = math.inf
    end = area["end"]
    before = end - 1
    for vertex in range(area["start"], end):
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
    areas: RecordArray, vertices: FloatArray, groups: int, north_m: float, east_m: float
) -> tuple[float, float]:
    """Return the margins of a position to the inclusion areas and to the exclusion areas [m].

    Negative if breached; infinite without such areas. Exact for one area; for several that overlap, a bound on the
    distance with the right sign.
    """
    outside_m = math.inf
    inside_m = math.inf if groups == 0 else -math.inf
    for index in range(len(areas)):
        if areas[index]["inclusion"] == 0:
            outside_m = min(outside_m, -area_margin(areas, vertices, index, north_m, east_m))
    for group in range(groups):
        group_m = math.inf
        for index in range(len(areas)):
            if areas[index]["inclusion"] != 0 and areas[index]["group"] == group:
                group_m = min(group_m, area_margin(areas, vertices, index, north_m, east_m))
        inside_m = max(inside_m, group_m)
    return inside_m, outside_m


@compiled
def _stopping_position(position: float, velocity: float, deceleration: float) -> float:
    """Return the stopping position under constant deceleration."""
    return position + velocity * abs(velocity) / (2.0 * deceleration)


@compiled
def fence_step(
    areas: RecordArray,
    vertices: FloatArray,
    groups: int,
    limits: RecordArray,
    state: FloatArray,
    breach: RecordArray,
) -> None:
    """Compute margins and breaches for one outer tick.

    ``state`` (13,) is the vehicle's; ``limits`` (1,) holds ``LIMITS``, ``breach`` (1,) ``BREACH``. If the state is
    not finite, the flags are unchanged.
    """
    limit, found = limits[0], breach[0]
    north_m, east_m, down_m = state[0], state[1], state[2]
    if limit["deceleration"] > 0.0:
        speed = distance(state[3], state[4])
        ahead_s = speed / (2.0 * limit["deceleration"])
        north_m, east_m = north_m + state[3] * ahead_s, east_m + state[4] * ahead_s
        down_m = _stopping_position(down_m, state[5], limit["vertical_deceleration"])
    if not (math.isfinite(north_m) and math.isfinite(east_m) and math.isfinite(down_m)):
        return
    home, margins = limit["home"], found["margins"]
    margins[0], margins[1] = fence_margins(areas, vertices, groups, north_m, east_m)
    distance_m = distance(north_m - home[0], east_m - home[1])
    margins[2], margins[3] = math.inf, math.inf
    if limit["altitude"] > 0.0:
        margins[2] = limit["altitude"] - (home[2] - down_m)
    if limit["distance"] > 0.0:
        margins[3] = limit["distance"] - distance_m
    before = found["flags"]
    after = 0
    for index in range(4):
        needed_m = HYSTERESIS_M if before & (1 << index) else 0.0
        if margins[index] < needed_m:
            after |= 1 << index
    found["flags"] = after


class Fence:
    """Areas of a geofence, in metres from the origin of the local frame."""

    def __init__(self, shape: FenceShape) -> None:
        self.shape = shape

    @classmethod
    def from_items(cls, items: Sequence[MissionItem], frame: LocalFrame) -> Fence:
        """Create the fence from items that ``plan.check_fence`` accepted."""
        return cls(fence_shape(items, frame.origin))

    @property
    def is_empty(self) -> bool:
        """True without areas: every position is inside."""
        return not len(self.shape.areas)

    def margins(self, north_m: float, east_m: float) -> tuple[float, float]:
        """Return the margins of a position to the inclusion areas and to the exclusion areas [m]."""
        inside_m, outside_m = fence_margins(
            self.shape.areas, self.shape.vertices, self.shape.groups, north_m, east_m
        )
        return float(inside_m), float(outside_m)


NO_FENCE = Fence(FenceShape((), GeoPoint(0.0, 0.0, 0.0)))


def _no_breach() -> RecordArray:
    breach: RecordArray = np.zeros(1, BREACH)
    breach["margins"] = NO_MARGIN
    return breach


class FenceEvaluator:
    """Evaluates the fence; ``flags`` and ``margin_m`` are from the last step. No I/O, no clock."""

    def __init__(self) -> None:
        self.limits: RecordArray = np.zeros(1, LIMITS)
        self.breach = _no_breach()
        """Limits and memory of ``fence_step``."""
        self._flags = 0  # of ``_breach``: reading a record takes longer
        self.configure(NO_FENCE)

    def configure(
        self,
        fence: Fence,
        max_distance_m: float = 0.0,
        max_altitude_m: float = 0.0,
        home_ned_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
        decelerations_m_s2: tuple[float, float] | None = None,
    ) -> None:
        """Set a fence and limits (GF_MAX_HOR_DIST, GF_MAX_VER_DIST; 0 for none), both measured from home.

        With ``decelerations_m_s2``, horizontal and vertical and above 0, a predicted stopping position outside is a
        breach too (GF_PREDICT). A present breach continues if it also breaks the new limits.
        """
        self.fence = fence
        shape = fence.shape
        self.areas = shape.areas, shape.vertices, shape.groups
        """Areas, vertices and number of groups, for ``fence_step``."""
        self.limits[0] = (max_distance_m, max_altitude_m, home_ned_m, *(decelerations_m_s2 or (0.0, 0.0)))
        self.is_active = not fence.is_empty or max_distance_m > 0.0 or max_altitude_m > 0.0
        self.arguments = self.is_active, *self.areas, self.limits, self.breach
        """``is_active``, and the arguments of ``fence_step`` but for the state; replaced by ``configure``."""

    def step(self, state: FloatArray) -> int:
        """Evaluate ``state`` (13,), once per outer tick; return the flags of ``FenceBreach``."""
        if self.is_active:
            fence_step(*self.areas, self.limits, state, self.breach)
            self._flags = int(self.breach["flags"][0])
        elif self._flags:
            self.breach["flags"] = self._flags = 0
        return self._flags

    def flags_at(self, state: FloatArray) -> int:
        """Return the flags that ``step`` would return for ``state`` (13,), without a change of the evaluator."""
        if not self.is_active:
            return 0
        breach = self.breach.copy()
        fence_step(*self.areas, self.limits, state, breach)
        return int(breach["flags"][0])

    @property
    def is_breached(self) -> bool:
        """True if a limit is breached."""
        return self._flags != 0

    @property
    def flags(self) -> FenceBreach:
        """Breached limits."""
        return FenceBreach(self._flags)

    @property
    def margin_m(self) -> float:
        """Distance to the nearest limit [m]: negative if breached, infinite without limits."""
        return float(self.breach["margins"].min()) if self.is_active else NO_MARGIN

    def refusal(self, north_m: float, east_m: float, altitude_m: float = 0.0) -> str | None:
        """Return why a position (altitude above home) is not allowed, as the end of a sentence, or None.

        Used for arming, takeoff and goto: the subject is "the vehicle" or "the target".
        """
        breach = self._at(north_m, east_m, altitude_m)
        if breach is None:
            return "is nowhere"
        return self.text(int(breach["flags"])) or None

    def way_refusal(self, here: tuple[float, float, float], there: tuple[float, float, float]) -> str | None:
        """Return why the straight path to a position (north, east, altitude above home) is not allowed, or None.

        A vehicle outside a limit may go to any position that does not increase the violation.
        """
        present, target = self._at(*here), self._at(*there)
        if present is None or target is None:
            return "is nowhere"
        no_worse = target["margins"] >= present["margins"]
        broken, present_flags = int(target["flags"]), int(present["flags"])
        for limit in range(4):
            if broken & present_flags & 1 << limit and no_worse[limit]:
                broken &= ~(1 << limit)
        if broken:
            return self.text(broken)
        if present_flags & (FenceBreach.OUTSIDE | FenceBreach.EXCLUDED):
            return None
        segments_outside = self.fence.shape.segments_outside(np.array([here[:2]]), np.array([there[:2]]))
        return "is beyond an edge of the geofence" if segments_outside else None

    def _at(self, north_m: float, east_m: float, altitude_m: float) -> Record | None:
        """Return the ``BREACH`` of a position without prediction, or None if it is not finite."""
        state, breach = np.zeros(STATE_SIZE), _no_breach()
        limits = self.limits.copy()
        limits["deceleration"] = limits["vertical_deceleration"] = 0.0
        state[:3] = north_m, east_m, limits["home"][0, 2] - altitude_m
        if not np.isfinite(state).all():
            return None
        fence_step(*self.areas, limits, state, breach)
        return breach[0]

    def text(self, flags: int) -> str:
        """Return ``flags`` as the end of a sentence, such as "is outside the geofence"; empty for none."""
        distance_m, altitude_m = self.limits["distance"][0], self.limits["altitude"][0]
        parts = {
            FenceBreach.OUTSIDE: "outside the geofence",
            FenceBreach.EXCLUDED: "inside an exclusion area of the geofence",
            FenceBreach.TOO_HIGH: f"more than {altitude_m:g} m above home (GF_MAX_VER_DIST)",
            FenceBreach.TOO_FAR: f"more than {distance_m:g} m from home (GF_MAX_HOR_DIST)",
        }
        texts = [text for flag, text in parts.items() if flags & flag]
        return f"is {' and '.join(texts)}" if texts else ""
