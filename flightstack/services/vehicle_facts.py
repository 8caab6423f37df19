"""The autopilot as telemetry sees it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flightstack.commander.failsafe import Action
from flightstack.core.contract import FloatArray
from flightstack.core.geodesy import GeoPoint
from flightstack.core.modes import Mode
from flightstack.guidance.fence import FenceBreach
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Message
from flightstack.params.vehicle import Vehicle
from flightstack.services.telemetry.facts import BatteryView, FenceBreaches, FlightTimes, PlanIds
from flightstack.vehicle.autopilot import Autopilot


class AutopilotFacts:
    """Implements ``telemetry.VehicleFacts``; every property reads the present."""

    def __init__(
        self,
        autopilot: Autopilot,
        vehicle: Vehicle,
        system_id: int,
        is_generic: bool,
        loop_timing: Callable[[], Message],
        battery: Callable[[], BatteryView],
    ) -> None:
        self._autopilot = autopilot
        self._now = autopilot.now
        self.loop_timing = loop_timing
        self.system_id = system_id
        self.rotors = len(vehicle.rotors)
        self.max_thrust_n = vehicle.weight_n * 2.0 if vehicle.ideal_rotors else vehicle.max_thrust_n
        self.model = vehicle.name
        self.is_generic = is_generic
        self.frame = autopilot.places.frame
        self.top_speed_rad_s = [min(rotor.max_speed_rad_s, 1e6) for rotor in vehicle.rotors]
        self._battery = battery
        self.fence_breaches = FenceBreaches()
        self._fence_was_breached = False
        self.state: FloatArray = self._now.state
        self.setpoint: FloatArray = self._now.setpoint
        self.attitude_target: FloatArray = self._now.attitude_target

    @property
    def row(self) -> FloatArray:
        """The newest row of the inner loop."""
        return self._now.row

    @property
    def time_us(self) -> int:
        """Time of the newest tick."""
        return self._now.time_us

    @property
    def armed(self) -> bool:
        """Whether the vehicle is armed."""
        return self._now.status.armed

    @property
    def mode(self) -> Mode:
        """The mode."""
        return self._now.status.mode

    @property
    def landed(self) -> bool:
        """Whether the vehicle stands on the ground."""
        return self._now.landed

    @property
    def climbing(self) -> bool:
        """Whether a takeoff is under way."""
        return self.mode is Mode.TAKEOFF

    @property
    def descending(self) -> bool:
        """Whether a landing is under way."""
        return self.mode is Mode.LAND

    @property
    def mission_current(self) -> int:
        """Number of the current item."""
        return self._now.progress.current

    @property
    def mission_count(self) -> int:
        """Number of items."""
        return self._now.mission_count

    @property
    def mission_state(self) -> int:
        """MISSION_STATE of the common dialect."""
        if not self._now.mission_count:
            return int(mavlink.MISSION_STATE_NO_MISSION)
        if self._now.mission_complete:
            return int(mavlink.MISSION_STATE_COMPLETE)
        if self.mode is Mode.MISSION:
            return int(mavlink.MISSION_STATE_ACTIVE if self.armed else mavlink.MISSION_STATE_NOT_STARTED)
        begun = self._now.progress.reached >= 0
        return int(mavlink.MISSION_STATE_PAUSED if begun else mavlink.MISSION_STATE_NOT_STARTED)

    @property
    def home(self) -> GeoPoint:
        """Where a return goes to."""
        return self._autopilot.home

    @property
    def system_status(self) -> int:
        """MAV_STATE: critical while a failsafe acts, emergency when it is about to end the flight."""
        if self.mode is Mode.TERMINATION:
            return int(mavlink.MAV_STATE_FLIGHT_TERMINATION)
        action = self._autopilot.supervisor.decision.action
        if self.armed and action >= Action.LAND:
            return int(mavlink.MAV_STATE_EMERGENCY)
        if self.armed and action > Action.WARN:
            return int(mavlink.MAV_STATE_CRITICAL)
        return int(mavlink.MAV_STATE_ACTIVE if self.armed else mavlink.MAV_STATE_STANDBY)

    @property
    def flight(self) -> FlightTimes:
        """When the present flight began."""
        now = self._now
        return FlightTimes(now.armed_us, now.takeoff_us, now.landing_us)

    @property
    def plan_ids(self) -> PlanIds:
        """Identifiers of the stored plans."""
        return PlanIds(*self._autopilot.places.ids)

    @property
    def battery(self) -> BatteryView:
        """The battery as the simulator last told it."""
        return self._battery()

    @property
    def fence_acts(self) -> bool:
        """Whether a breach of the fence has a consequence."""
        return self._autopilot.behaviour.fence_action != 0

    @property
    def fence_breached(self) -> bool:
        """Whether the vehicle is outside its fence."""
        return bool(self._autopilot.supervisor.fence.flags)

    def watch_fence(self) -> None:
        """Count the breaches of the fence; call it often."""
        flags = self._autopilot.supervisor.fence.flags
        if flags:
            # where both are broken, it is more urgent to come back
            high = flags is FenceBreach.TOO_HIGH
            kind = int(mavlink.FENCE_BREACH_MAXALT if high else mavlink.FENCE_BREACH_BOUNDARY)
            if self._fence_was_breached:
                self.fence_breaches = self.fence_breaches._replace(kind=kind)
            else:
                self.fence_breaches = FenceBreaches(self.fence_breaches.number + 1, self.time_us, kind)
        self._fence_was_breached = bool(flags)

    @property
    def state_is_good(self) -> bool:
        """Whether the newest state is one to fly by: it has arrived, is finite, and neither too old nor frozen."""
        stale = self._autopilot.supervisor.states.is_stale
        return self._autopilot.has_state and not stale and bool(np.isfinite(self.state).all())

    @property
    def battery_level(self) -> int:
        """How low the battery is: 0 enough or unknown, 1 low, 2 critical, 3 emergency."""
        return self._autopilot.supervisor.battery_level

    @property
    def can_arm(self) -> bool:
        """Whether an arm command would be accepted."""
        return self.armed or not self._autopilot.arming_refusals()
