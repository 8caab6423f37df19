"""Time until an effect, on the vehicle's clock: a simulation may be faster or slower than real time. Pure."""

from __future__ import annotations

import math

from gcs_cli.vehicle.view_types import GeoPosition, VehicleView

MOVED_M = 1.0
"""Distance from which on the vehicle counts as moving."""
STALL_S = 30.0
"""Time of the receiver without progress of the vehicle's clock after which that clock counts as stopped."""
LONGEST_STEP_S = 0.5
"""Most time between two updates that counts towards a limit: in a longer gap of the telemetry the effect may have
occurred and its report been lost, so that a limit passes only while the vehicle is heard."""
_METRES_PER_DEGREE = 111_195.0


class EffectTimer:
    """Time since its creation, and since the vehicle moved last, on the vehicle's clock.

    Without a clock of the vehicle, or while it stands still, the receiver's time counts.
    """

    def __init__(self, view: VehicleView, now_s: float) -> None:
        self.now_s = now_s
        self.elapsed_s = 0.0
        self.was_in_mode = False
        """True once the vehicle was in a mode of the step."""
        self.was_armed = False
        """True once the vehicle was armed during the step."""
        self.disarmed_s = 0.0
        """Time since it disarmed; gaps of the telemetry count for ``LONGEST_STEP_S``."""
        self.reports_disarmed = 0
        """Reports of the landed state since it disarmed."""
        self._waited_s = 0.0
        self._still_s = 0.0
        self._clock_s = view.time_s
        self._clock_moved_s = now_s
        self._place = view.geo

    def update(self, view: VehicleView, now_s: float) -> None:
        """Take the present state of the vehicle."""
        step_s = now_s - self.now_s
        self.now_s = now_s
        if view.time_s is not None and self._clock_s is not None:
            step_s = self._vehicle_step(view.time_s, step_s, now_s)
        self._clock_s = view.time_s
        self.elapsed_s += step_s
        step_s = min(step_s, LONGEST_STEP_S)
        self._waited_s += step_s
        self._still_s += step_s
        self.was_armed |= view.armed
        if view.armed:
            self.reports_disarmed = 0
        self.disarmed_s = self.disarmed_s + step_s if self.was_armed and not view.armed else 0.0
        if view.geo is not None and (self._place is None or distance_m(self._place, view.geo) > MOVED_M):
            self._place, self._still_s = view.geo, 0.0

    def take_landed_state(self, view: VehicleView) -> None:
        """Count a report of the landed state; ``view`` includes it."""
        if not view.armed:
            self.reports_disarmed += 1

    def _vehicle_step(self, time_s: float, step_s: float, now_s: float) -> float:
        assert self._clock_s is not None
        if time_s > self._clock_s:
            self._clock_moved_s = now_s
            return time_s - self._clock_s
        if time_s < self._clock_s:  # it restarted, or datagrams changed their order
            return 0.0
        return step_s if now_s - self._clock_moved_s > STALL_S else 0.0

    def is_over(self, limit_s: float, is_flight: bool) -> bool:
        """Return True after ``limit_s``; in a flight, after ``limit_s`` without movement."""
        return (self._still_s if is_flight else self._waited_s) >= limit_s


def distance_m(one: GeoPosition, other: GeoPosition) -> float:
    """Return the distance of two positions, up to some kilometres apart, with the difference in altitude."""
    return math.hypot(horizontal_m(one, other), one.altitude_m - other.altitude_m)


def horizontal_m(one: GeoPosition, other: GeoPosition) -> float:
    """Return the horizontal distance of two positions that are up to some kilometres apart."""
    east_deg = (one.longitude_deg - other.longitude_deg + 180.0) % 360.0 - 180.0
    east_m = east_deg * math.cos(math.radians(one.latitude_deg)) * _METRES_PER_DEGREE
    return math.hypot((one.latitude_deg - other.latitude_deg) * _METRES_PER_DEGREE, east_m)
