"""What telemetry reads of the vehicle."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple, Protocol

from flightstack.core.contract import FloatArray
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.core.modes import Mode
from flightstack.mavlink.link import Message


class BatteryView(Protocol):
    """The battery as the simulator tells it; NaN is a number that is not known."""

    @property
    def voltage_v(self) -> float:
        """Voltage of the pack."""
        ...

    @property
    def current_a(self) -> float:
        """Current out of the pack."""
        ...

    @property
    def remaining(self) -> float:
        """Share of the charge that is left, 0 to 1."""
        ...

    @property
    def valid(self) -> bool:
        """Whether there is a battery."""
        ...


class NoBattery(NamedTuple):
    """A vehicle whose simulator tells of no battery."""

    voltage_v: float = math.nan
    current_a: float = math.nan
    remaining: float = math.nan
    valid: bool = False


class FlightTimes(NamedTuple):
    """Times of the present flight on the vehicle's clock; 0 for what has not happened since arming."""

    armed_us: int = 0
    takeoff_us: int = 0
    landing_us: int = 0


class FenceBreaches(NamedTuple):
    """Breaches of the geofence since the vehicle booted."""

    number: int = 0
    latest_us: int = 0
    """When the latest began, on the vehicle's clock."""
    kind: int = 0
    """FENCE_BREACH of the latest."""


class PlanIds(NamedTuple):
    """Identifiers of the stored plans, as the mission protocol's opaque ids; 0 for an empty one."""

    mission: int = 0
    fence: int = 0
    rally: int = 0


class VehicleFacts(Protocol):
    """What telemetry reads."""

    state: FloatArray
    setpoint: FloatArray
    attitude_target: FloatArray
    max_thrust_n: float
    top_speed_rad_s: list[float]
    system_id: int
    is_generic: bool
    rotors: int
    frame: LocalFrame

    @property
    def time_us(self) -> int:
        """Time of the newest tick."""
        ...

    @property
    def home(self) -> GeoPoint:
        """Where a return goes to; the origin of the local frame until it is set elsewhere."""
        ...

    @property
    def armed(self) -> bool:
        """Whether the vehicle is armed."""
        ...

    @property
    def mode(self) -> Mode:
        """The mode."""
        ...

    @property
    def system_status(self) -> int:
        """MAV_STATE of the vehicle."""
        ...

    @property
    def landed(self) -> bool:
        """Whether the vehicle stands on the ground."""
        ...

    @property
    def climbing(self) -> bool:
        """Whether a takeoff is under way."""
        ...

    @property
    def descending(self) -> bool:
        """Whether a landing is under way."""
        ...

    @property
    def flight(self) -> FlightTimes:
        """When the present flight began."""
        ...

    @property
    def mission_current(self) -> int:
        """Number of the current item."""
        ...

    @property
    def mission_count(self) -> int:
        """Number of items."""
        ...

    @property
    def mission_state(self) -> int:
        """MISSION_STATE of the common dialect."""
        ...

    @property
    def plan_ids(self) -> PlanIds:
        """Identifiers of the stored plans."""
        ...

    @property
    def can_arm(self) -> bool:
        """Whether an arm command would be accepted."""
        ...

    @property
    def state_is_good(self) -> bool:
        """Whether the newest state is one to fly by: it has arrived, is finite, and neither too old nor frozen."""
        ...

    @property
    def battery(self) -> BatteryView:
        """The battery."""
        ...

    @property
    def battery_level(self) -> int:
        """How low the battery is: 0 enough or unknown, 1 low, 2 critical, 3 emergency."""
        ...

    @property
    def fence_acts(self) -> bool:
        """Whether a breach of the fence has a consequence."""
        ...

    @property
    def fence_breached(self) -> bool:
        """Whether the vehicle is outside its fence."""
        ...

    @property
    def fence_breaches(self) -> FenceBreaches:
        """Breaches of the fence so far."""
        ...

    @property
    def row(self) -> FloatArray:
        """The newest row of the inner loop, shape (48,)."""
        ...

    @property
    def loop_timing(self) -> Callable[[], Message]:
        """Makes FS_LOOP_TIMING."""
        ...
