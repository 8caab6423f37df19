"""Altitude of the next takeoff. No I/O, no clock."""

from __future__ import annotations

from flightstack.guidance.safe_places import SafePlaces, plan_limits
from flightstack.vehicle.area import FlightArea
from flightstack.vehicle.flight_state import FlightState
from flightstack.vehicle.readiness import Readiness


class Takeoff:
    """Holds the altitude to which TAKEOFF mode climbs."""

    def __init__(self, now: FlightState, places: SafePlaces, area: FlightArea, readiness: Readiness) -> None:
        self._now = now
        self._area = area
        self._readiness = readiness
        self._places = places
        self.altitude_m = now.behaviour.takeoff_altitude_m
        """Target altitude above the origin of the local frame."""

    def set_altitude(self, above_home_m: float | None) -> str | None:
        """Set the altitude above home; None stands for MIS_TAKEOFF_ALT above both home and vehicle.

        Return the refusal, or None.
        """
        b = self._now.behaviour
        limit_m, vehicle_m = plan_limits(b).max_altitude_m, self._vehicle_above_home_m()
        altitude = max(vehicle_m, 0.0) + b.takeoff_altitude_m if above_home_m is None else above_home_m
        if altitude - vehicle_m < b.altitude_acceptance_m < altitude:
            return f"takeoff altitude {altitude:g} m is not above the vehicle, which is at {vehicle_m:.4g} m above home"
        if not altitude > b.altitude_acceptance_m:
            return f"takeoff altitude {altitude:g} m is too low"
        if altitude > limit_m:
            return f"takeoff altitude {altitude:g} m is above {limit_m:g} m"
        self.altitude_m = altitude + self._places.home.altitude_m
        return None

    @property
    def is_reached(self) -> bool:
        """True if the vehicle is at the takeoff altitude, within NAV_MC_ALT_RAD."""
        error_m = float(self._now.state[2]) + self.altitude_m
        return abs(error_m) <= self._now.behaviour.altitude_acceptance_m

    @property
    def home_altitude_m(self) -> float:
        """Altitude of home above sea level at the takeoff: home may move to the vehicle on arming."""
        moves = (
            not self._now.status.armed and self._area.home_follows and self._readiness.facts.state_is_valid
        )
        return self._above_sea_m() if moves else self._area.home.altitude_m

    def _vehicle_above_home_m(self) -> float:
        """Return the height of the vehicle above home at the takeoff; 0 if it is unknown."""
        if not self._readiness.facts.state_is_valid:
            return 0.0
        return self._above_sea_m() - self.home_altitude_m

    def _above_sea_m(self) -> float:
        return self._places.frame.origin.altitude_m - float(self._now.state[2])
