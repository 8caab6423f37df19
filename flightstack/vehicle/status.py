"""Status of the vehicle at one instant, as telemetry reports it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from flightstack.commander.failsafe import Action
from flightstack.commander.fence_monitor import FenceBreaches
from flightstack.core.contract import FloatArray
from flightstack.core.enums import Mode
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.guidance.navigator import MissionProgress
from flightstack.params.vehicle import Vehicle
from flightstack.simulator_link.endpoint import Battery
from flightstack.vehicle.assembly import VehicleParts


class VehicleInfo(NamedTuple):
    """Properties of the vehicle that do not change in flight."""

    model: str
    system_id: int
    is_generic: bool
    """True if the vehicle reports MAV_AUTOPILOT_GENERIC instead of PX4 (FS_AUTOPILOT)."""
    rotors: int
    max_thrust_n: float
    top_speed_rad_s: tuple[float, ...]
    """Largest speed of each rotor."""
    frame: LocalFrame


class FlightTimes(NamedTuple):
    """Vehicle times of the present flight; 0 before the event."""

    armed_us: int = 0
    takeoff_us: int = 0
    landing_us: int = 0


class PlanIds(NamedTuple):
    """Opaque ids of the stored plans; 0 for an empty one."""

    mission: int = 0
    fence: int = 0
    rally: int = 0


@dataclass(frozen=True, slots=True)
class VehicleStatus:
    """Snapshot of the vehicle; the arrays are copies."""

    info: VehicleInfo
    time_us: int
    armed: bool
    mode: Mode
    landed: bool
    can_arm: Callable[[], bool]
    """Returns True if armed, or if an arm command would be accepted; evaluated for SYS_STATUS only: a check of a long
    mission takes milliseconds."""
    failsafe_action: Action
    """Action of the active failsafes."""
    state_is_good: bool
    """True if the newest state is finite, and neither too old nor frozen."""
    state: FloatArray
    setpoint: FloatArray
    attitude_target: FloatArray
    row: FloatArray
    home: GeoPoint
    flight: FlightTimes
    mission: MissionProgress
    mission_count: int
    mission_complete: bool
    plan_ids: PlanIds
    battery: Battery
    battery_level: int
    """0 enough or unknown, 1 low, 2 critical, 3 emergency."""
    fence_acts: bool
    """True if a breach of the fence has an action (GF_ACTION)."""
    fence_breached: bool
    fence_breaches: FenceBreaches


def vehicle_info(vehicle: Vehicle, system_id: int, is_generic: bool, frame: LocalFrame) -> VehicleInfo:
    """Return the constant properties of ``vehicle``."""
    return VehicleInfo(
        model=vehicle.name,
        system_id=system_id,
        is_generic=is_generic,
        rotors=len(vehicle.rotors),
        max_thrust_n=vehicle.full_thrust_n,
        top_speed_rad_s=tuple(min(rotor.max_speed_rad_s, 1e6) for rotor in vehicle.rotors),
        frame=frame,
    )


def vehicle_status(info: VehicleInfo, parts: VehicleParts, battery: Battery) -> VehicleStatus:
    """Return the current status."""
    now, failsafes, fence = parts.now, parts.failsafes, parts.area.fence
    return VehicleStatus(
        info=info,
        time_us=now.time_us,
        armed=now.status.armed,
        mode=now.status.mode,
        landed=now.landed,
        can_arm=lambda: now.status.armed or not parts.readiness.arming_refusals(),
        failsafe_action=failsafes.decision.action,
        state_is_good=now.has_state and not failsafes.states.is_stale and bool(np.isfinite(now.state).all()),
        state=now.state.copy(),
        setpoint=now.setpoint.copy(),
        attitude_target=now.attitude_target.copy(),
        row=now.row.copy(),
        home=parts.area.home,
        flight=FlightTimes(now.armed_us, now.takeoff_us, now.landing_us),
        mission=now.progress,
        mission_count=now.mission_count,
        mission_complete=now.mission_complete,
        plan_ids=PlanIds(*parts.places.ids),
        battery=battery,
        battery_level=failsafes.battery_level,
        fence_acts=now.behaviour.fence_action != 0,
        fence_breached=bool(fence.flags),
        fence_breaches=fence.breaches,
    )
