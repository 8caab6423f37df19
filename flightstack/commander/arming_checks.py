"""Pre-arm checks: return all reasons not to arm at once, each as a sentence. Pure."""

from __future__ import annotations

from typing import NamedTuple

from flightstack.commander.estimate_checks import estimate_refusals
from flightstack.commander.transitions import TERMINATED, Need
from flightstack.core.enums import Mode
from flightstack.estimation.health import EstimateHealth
from flightstack.params.behaviour import Behaviour

THROTTLE_CENTRED = 0.2
"""Largest throttle that counts as centred; PX4's value, below the takeoff threshold."""


class ArmingFacts(NamedTuple):
    """Inputs of the checks."""

    mode: Mode
    state_is_valid: bool
    state_is_fresh: bool
    upright: bool
    gcs_lost: bool
    gcs_heard: bool
    manual_fresh: bool
    offboard_fresh: bool
    fence_breach: str
    """The geofence breach as the end of a sentence; empty without a breach."""
    battery_level: int
    """0 normal or unknown, 1 low, 2 critical, 3 emergency."""
    battery_remaining: float
    throttle: float = 0.0
    """Throttle stick, −1 to 1; 0 at the centre or without manual control."""
    mode_fault: str = ""
    """Reason that the mode cannot take off from the ground; empty if it can."""
    is_at_rest: bool = True
    """True if the vehicle neither falls nor rises."""
    health: EstimateHealth | None = None
    """Health of the estimate; None on the simulator's state."""
    step_refusal: str = ""
    """Reason that the simulator's time steps cannot be flown, a sentence; empty if they can."""


def arming_refusals(facts: ArmingFacts, behaviour: Behaviour) -> tuple[str, ...]:
    """Return every reason not to arm; empty if the vehicle may arm.

    A condition that triggers a failsafe in the air also prevents arming, unless the failsafe's action is disabled.
    """
    if facts.mode is Mode.TERMINATION:
        return (TERMINATED,)
    b = behaviour
    ordered = b.battery_emergency < b.battery_critical < b.battery_low
    flies_sticks = facts.mode in (Mode.POSITION, Mode.ALTITUDE)
    would_climb = flies_sticks and facts.manual_fresh and facts.throttle > THROTTLE_CENTRED
    gcs = "the ground station is lost" if facts.gcs_heard else "no ground station was heard"
    estimate = estimate_refusals(facts.health, behaviour)
    checks = (
        (facts.state_is_valid or bool(estimate), Need.STATE.value),
        (facts.state_is_fresh or not facts.state_is_valid, "the state is frozen or missing"),
        (not facts.mode_fault, facts.mode_fault),
        (not facts.step_refusal, facts.step_refusal),
        (facts.upright or not facts.state_is_valid, Need.UPRIGHT.value),
        (facts.is_at_rest or not facts.state_is_valid, "the vehicle is falling or rising"),
        (facts.battery_level == 0, f"the battery is low: {facts.battery_remaining:.0%} left"),
        (ordered, "BAT_EMERGEN_THR, BAT_CRIT_THR and BAT_LOW_THR do not rise in this order"),
        (not facts.fence_breach or not b.fence_action, f"the vehicle {facts.fence_breach}"),
        ((facts.gcs_heard and not facts.gcs_lost) or not b.gcs_loss_action, gcs),
        (facts.manual_fresh or not flies_sticks, Need.MANUAL_STREAM.value),
        (not would_climb, "the throttle is above the centre"),
        (facts.offboard_fresh or facts.mode is not Mode.OFFBOARD, Need.OFFBOARD_STREAM.value),
    )
    return estimate + tuple(sentence for passed, sentence in checks if not passed)
