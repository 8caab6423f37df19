"""Status of a vehicle in flight at a known state, for tests of telemetry."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from flightstack.commander.failsafe import Action
from flightstack.commander.fence_monitor import FenceBreaches
from flightstack.core.contract import MAX_ROTORS, LoopRow
from flightstack.core.enums import Mode
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.guidance.mission import MissionProgress
from flightstack.guidance.safe_places import SafePlaces
from flightstack.mavlink.dialect import FsLoopTiming
from flightstack.mavlink.link import Message
from flightstack.params.behaviour import Behaviour
from flightstack.services.telemetry.telemetry import Telemetry
from flightstack.simulator_link.endpoint import NO_BATTERY
from flightstack.vehicle.flight_state import FlightState
from flightstack.vehicle.status import (
    FlightTimes,
    PlanIds,
    VehicleInfo,
    VehicleStatus,
    VehicleSummary,
    in_single_precision,
)

HOME = GeoPoint(47.397742, 8.545594, 488.0)
EULER = (0.1, -0.2, 2.5)
X, Y, Z, W = Rotation.from_euler("ZYX", EULER[::-1]).as_quat()


def status(info: dict[str, object] | None = None, **changes: object) -> VehicleStatus:
    """Return the status with ``changes``, arrays as in flight; ``info`` changes its ``VehicleInfo``."""
    row = np.zeros(LoopRow.SIZE)
    row[LoopRow.REFERENCE_RATES] = 0.4, 0.5, 0.6
    row[LoopRow.WRENCH_ACHIEVED] = 6.0, 0.0, 0.0, 0.0
    row[LoopRow.ROTOR_SPEED] = [100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 0.0, 0.0]
    constant = VehicleInfo("paper_quad", 1, False, 4, 12.0, (600.0,) * 4, LocalFrame(HOME))
    usual = VehicleStatus(
        info=constant._replace(**(info or {})), time_us=12_345_678, armed=True, mode=Mode.MISSION, landed=False,
        can_arm=lambda: True, failsafe_action=Action.NONE, state_is_good=True,
        state=[10.0, -20.0, -30.0, 1.0, -2.0, 0.5, W, X, Y, Z, 0.01, 0.02, 0.03],
        setpoint=np.arange(11.0).tolist(), attitude_target=[1.0, 0.0, 0.0, 0.0, 5.0], row=row.tolist(), home=HOME,
        flight=FlightTimes(), mission=MissionProgress(2, 1, False, False), mission_count=5, mission_complete=False,
        plan_ids=PlanIds(), battery=NO_BATTERY, battery_level=0, fence_acts=True, fence_breached=False,
        fence_breaches=FenceBreaches(),
    )  # fmt: skip
    lists = {name: value.tolist() for name, value in changes.items() if isinstance(value, np.ndarray)}
    fitted = {name: in_single_precision(values) for name, values in lists.items() if name != "row"}
    return usual._replace(**{**changes, **lists, **fitted})


def usual_timing() -> Message:
    return FsLoopTiming(1, 2, 0, 0, 500.0, 100.0, 30.0, *[1.0] * 6, 0)


def flight_state(of: VehicleStatus) -> FlightState:
    """Return the state of the flight that ``of`` shows."""
    arrays = [np.array(values) for values in (of.state, of.setpoint, of.attitude_target, of.row)]
    state, setpoint, target, row = arrays
    has_place = of.sensed is None or of.sensed.has_origin
    return FlightState(
        Behaviour(), state, np.zeros(MAX_ROTORS), setpoint, target, row, has_place, time_us=of.time_us
    )


def telemetry(
    of: VehicleStatus | None = None,
    timing: Callable[[], Message] = usual_timing,
    now: FlightState | None = None,
) -> Telemetry:
    """Return telemetry of a constant status, and of ``now`` if its time advances."""
    shown = of or status()
    now = flight_state(shown) if now is None else now
    places = SafePlaces(shown.home)
    places.frame = shown.info.frame
    summary = VehicleSummary(shown.info, shown.armed, shown.mode, shown.failsafe_action)
    return Telemetry(
        lambda: shown, lambda: summary, now, places, shown.info, timing, shown.sensed is not None
    )
