"""State of the flight that the parts of the autopilot share."""

from __future__ import annotations

from dataclasses import dataclass

from flightstack.commander.transitions import Status
from flightstack.core.contract import FloatArray
from flightstack.guidance.mission import MissionProgress
from flightstack.params.behaviour import Behaviour

DISARMED = Status()
NO_PROGRESS = MissionProgress(0, -1, False, False)


@dataclass(slots=True)
class FlightState:
    """The newest values of the flight, as PX4's modules share them by uORB topics.

    One part of the autopilot writes a field, every part may read it. The arrays are written in place.
    """

    behaviour: Behaviour
    """Parameters of guidance and commander."""
    state: FloatArray
    """Newest state, shape (13,): position and velocity [m, m/s NED], quaternion, body rates [rad/s]."""
    rotor_speed: FloatArray
    """Newest measured rotor speeds [rad/s], shape (8,)."""
    setpoint: FloatArray
    """Setpoint of the outer loop, shape (11,)."""
    attitude_target: FloatArray
    """Attitude and thrust that the outer loop commands, shape (5,)."""
    row: FloatArray
    """Newest row of the inner loop, shape (48,)."""
    has_state: bool = False
    """True once position and attitude are known: from the simulator's first state, or the estimator's origin."""
    time_us: int = 0
    """Vehicle time of the newest tick."""
    status: Status = DISARMED
    """Mode and arming."""
    landed: bool = True
    """Result of the land detector."""
    flying: bool = False
    """True while the loops control the vehicle."""
    loops_reset: bool = False
    """True if the loops were reset since the last tick."""
    rests: bool = False
    """True while the vehicle rests on the ground without control, before the land detector reports landed."""
    attitude_is_given: bool = False
    """True while guidance commands attitude and thrust instead of the outer loop."""
    throttle: float = 0.0
    """Throttle stick of the newest manual control, −1 to 1."""
    progress: MissionProgress = NO_PROGRESS
    mission_count: int = 0
    mission_complete: bool = False
    armed_us: int = 0
    """Vehicle time of arming, takeoff and landing of the present flight; 0 before the event."""
    takeoff_us: int = 0
    landing_us: int = 0
