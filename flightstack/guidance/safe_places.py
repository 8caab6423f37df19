"""Geofence, home and rally points. No I/O, no clock."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from flightstack.core.contract import Vector3
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.core.portable_math import distance
from flightstack.guidance.fence import NO_FENCE, Fence
from flightstack.guidance.rally import HOME, NEAREST, RALLY_FIRST, ReturnPlace, choose, rally_points
from flightstack.params.behaviour import Behaviour
from flightstack.plan import DEFAULT_LIMITS, Limits, MissionItem, Rejection, check_mission
from flightstack.plan.fence import check_fence
from flightstack.plan.rally import check_rally


def plan_limits(b: Behaviour) -> Limits:
    """Return the limits of plans; without GF_MAX_VER_DIST, the default altitude limit applies."""
    return Limits(
        max_first_distance_m=b.first_waypoint_distance_m,
        max_distance_m=b.waypoint_distance_m,
        max_altitude_m=b.fence_max_altitude_m or DEFAULT_LIMITS.max_altitude_m,
        max_home_distance_m=b.fence_max_distance_m,
    )


FARTHEST_HOME_M = 100_000.0
"""Largest distance of home from the origin: the local frame is flat."""
GREATEST_HOME_STEP_M = 1_000.0
"""Largest height of home above or below the origin: missions and returns measure their altitudes from home."""
HOME_SPREAD_M = 0.05
"""Distance from home up to which a landed vehicle is at home; compliance of the ground moves it by less."""


class SafePlaces:
    """Present geofence, home and rally points, and the checks of plans against them."""

    def __init__(self, origin: GeoPoint) -> None:
        """Use ``origin`` as the origin of the local frame."""
        self.frame = LocalFrame(origin)
        self.home_point = origin
        self.fence: Fence = NO_FENCE
        self.home: ReturnPlace = HOME
        """Home, which may differ from the origin."""
        self.home_is_chosen = False
        """True if a user has set home; it then does not follow the vehicle."""
        self.points: tuple[ReturnPlace, ...] = ()
        self._has_origin = True
        self._fence_items: tuple[MissionItem, ...] = ()
        self._rally_items: tuple[MissionItem, ...] = ()
        self.ids: tuple[int, int, int] = (0, 0, 0)
        """Opaque ids of mission, geofence and rally points; the owner of the stores keeps them."""

    def set_home(self, point: GeoPoint, chosen: bool) -> str | None:
        """Set home; return the reason of a refusal, or None. ``chosen`` is true for a home set by a user."""
        if not all(math.isfinite(number) for number in point):
            return "home has no such position"
        if abs(point.latitude_deg) > 90.0 or abs(point.longitude_deg) > 180.0:
            return "home is not a place on earth"
        local = self.frame.to_ned(point)
        if self._has_origin and distance(local.x, local.y) > FARTHEST_HOME_M:
            return f"home is more than {FARTHEST_HOME_M / 1e3:g} km from where the vehicle started"
        if self._has_origin and abs(local.z) > GREATEST_HOME_STEP_M:
            return f"home is more than {GREATEST_HOME_STEP_M:g} m above or below where the vehicle started"
        self.home_point, self.home_is_chosen = point, chosen
        self.home = ReturnPlace(local.x, local.y, -local.z)
        self.set_rally(self._rally_items)
        return None

    def await_origin(self) -> None:
        """Accept a home at any distance until ``move_origin``: the vehicle does not know yet where it is."""
        self._has_origin = False

    def move_origin(self, origin: GeoPoint) -> str | None:
        """Move the origin of the local frame, and home with it unless a user has set home; keep all other places.

        Return the reason if the home of the user is refused and moves with the origin, or None.
        """
        self._has_origin = True
        self.frame.move_to(origin)
        self.set_fence(self._fence_items)
        refusal = self.set_home(self.home_point, chosen=True) if self.home_is_chosen else None
        if refusal is not None or not self.home_is_chosen:
            self.set_home(origin, chosen=False)
        return refusal

    def has_left_home(self, position_ned_m: Vector3) -> bool:
        """Return True if a position differs from home by more than ``HOME_SPREAD_M``."""
        home = self.home
        x, y, z = position_ned_m
        return distance(x - home.north_m, y - home.east_m, z + home.altitude_m) > HOME_SPREAD_M

    def check_mission(
        self, items: Sequence[MissionItem], limits: Limits, home: GeoPoint | None = None
    ) -> Rejection | None:
        """Return why a mission is refused, by its items, the limits or the geofence, relative to ``home``; or None."""
        return check_mission(items, home or self.home_point, limits, self.fence.shape)

    def check_fence(
        self, items: Sequence[MissionItem], vehicle_ne_m: tuple[float, float] | None
    ) -> Rejection | None:
        """Return why a geofence is refused, or None; ``vehicle_ne_m`` is the position of a flying vehicle."""
        if vehicle_ne_m is not None:
            vehicle_ne_m = (vehicle_ne_m[0] - self.home.north_m, vehicle_ne_m[1] - self.home.east_m)
        return check_fence(items, self.home_point, vehicle_ne_m)

    def check_rally(self, items: Sequence[MissionItem], limits: Limits) -> Rejection | None:
        """Return why a list of rally points is refused, or None."""
        return check_rally(items, self.home_point, limits, self.fence.shape)

    def set_fence(self, items: Sequence[MissionItem]) -> Fence:
        """Set a checked geofence, and return it."""
        self._fence_items = tuple(items)
        self.fence = Fence.from_items(items, self.frame) if items else NO_FENCE
        return self.fence

    def set_rally(self, items: Sequence[MissionItem]) -> None:
        """Set checked rally points."""
        self._rally_items = tuple(items)
        self.points = rally_points(items, self.frame, self.home_point)

    def return_place(
        self, north_m: float, east_m: float, return_type: float, allows: Callable[[ReturnPlace], bool]
    ) -> ReturnPlace | None:
        """Return the destination of a return from here (RTL_TYPE) among those that ``allows`` accepts, or None."""
        points = [point for point in self.points if allows(point)]
        if allows(self.home):
            return choose((north_m, east_m), self.home, points, return_type)
        return choose((north_m, east_m), self.home, points, RALLY_FIRST) if points else None

    def ground_m(self, north_m: float, east_m: float, stood: ReturnPlace) -> float:
        """Return the assumed ground altitude above the origin, that of the nearest known position.

        The position where the vehicle ``stood`` precedes a home at the same place, whose altitude a user may have set.
        """
        return choose((north_m, east_m), stood, (self.home, *self.points), NEAREST).altitude_m
