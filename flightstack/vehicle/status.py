"""Status of the vehicle at one instant, as telemetry reports it."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from flightstack.commander.failsafe import Action
from flightstack.commander.fence_monitor import FenceBreaches
from flightstack.core.enums import Mode
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.estimation.sensed import Sensed
from flightstack.guidance.mission import MissionProgress
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


class VehicleSummary(NamedTuple):
    """What a heartbeat shows, which is sent so often that it is not taken from the whole status."""

    info: VehicleInfo
    armed: bool
    mode: Mode
    failsafe_action: Action
    """Action of the active failsafes."""


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


class VehicleStatus(NamedTuple):
    """Snapshot of the vehicle, with lists in place of arrays."""

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
    state: list[float]
    """As ``FlightState.state``, and so the next two, ``in_single_precision``."""
    setpoint: list[float]
    attitude_target: list[float]
    row: list[float]
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
    sensed: Sensed | None = None
    """None for a vehicle that flies on the simulator's state."""


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


def vehicle_summary(info: VehicleInfo, parts: VehicleParts) -> VehicleSummary:
    """Return the current summary."""
    shown = parts.now.status
    return VehicleSummary(info, shown.armed, shown.mode, parts.failsafes.decision.action)


SINGLE_LIMIT = 1e18


def in_single_precision(values: list[float]) -> list[float]:
    """Return ``values`` with infinity for those beyond 1e18: single precision must hold them and products of them."""
    if (
        max(values) <= SINGLE_LIMIT and min(values) >= -SINGLE_LIMIT
    ):  # the usual case; False if NaN hides a value
        return values
    return [math.copysign(math.inf, value) if abs(value) > SINGLE_LIMIT else value for value in values]


def vehicle_status(
    info: VehicleInfo, parts: VehicleParts, battery: Battery, sensed: Sensed | None = None
) -> VehicleStatus:
    """Return the current status."""
    now, failsafes, fence = parts.now, parts.failsafes, parts.area.fence
    state: list[float] = now.state.tolist()
    return VehicleStatus(
        info=info,
        time_us=now.time_us,
        armed=now.status.armed,
        mode=now.status.mode,
        landed=now.landed,
        can_arm=lambda: now.status.armed or not parts.readiness.arming_refusals(),
        failsafe_action=failsafes.decision.action,
        state_is_good=now.has_state and not failsafes.states.is_stale and all(map(math.isfinite, state)),
        state=in_single_precision(state),
        setpoint=in_single_precision(now.setpoint.tolist()),
        attitude_target=in_single_precision(now.attitude_target.tolist()),
        row=now.row.tolist(),
        home=parts.area.home,
        flight=FlightTimes(now.armed_us, now.takeoff_us, now.landing_us),
        mission=now.progress,
        mission_count=now.mission_count,
        mission_complete=now.mission_complete,
        plan_ids=PlanIds(*parts.places.ids),
        battery=battery,
        battery_level=failsafes.battery_level,
        fence_acts=now.behaviour.fence_action != 0,
        fence_breached=fence.is_breached,
        fence_breaches=fence.breaches,
        sensed=sensed,
    )
