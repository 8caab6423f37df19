"""What keeps a vehicle from arming: every reason at once, each a sentence. Pure."""

from __future__ import annotations

from typing import NamedTuple

from flightstack.commander.transitions import TERMINATED, Need
from flightstack.core.enums import Mode
from flightstack.params.behaviour import Behaviour

THROTTLE_CENTRED = 0.2
"""Largest throttle that counts as not above the centre; PX4's value, below the one that takes off."""


class ArmingFacts(NamedTuple):
    """What the checks look at."""

    mode: Mode
    state_is_valid: bool
    state_is_fresh: bool
    upright: bool
    gcs_lost: bool
    gcs_heard: bool
    manual_fresh: bool
    offboard_fresh: bool
    fence_breach: str
    """How the geofence is breached, as the end of a sentence; empty: it is not."""
    battery_level: int
    """0 enough or unknown, 1 low, 2 critical, 3 emergency."""
    battery_remaining: float
    throttle: float = 0.0
    """Throttle stick, −1 to 1; 0 at the centre, and without sticks."""
    mode_fault: str = ""
    """Why the mode does not take a standing vehicle into the air; empty: it may."""
    is_at_rest: bool = True
    """Whether the vehicle neither falls nor rises."""
    step_refusal: str = ""
    """Why the steps between the simulator's states cannot be flown, a sentence; empty: they can."""


def arming_refusals(facts: ArmingFacts, behaviour: Behaviour) -> tuple[str, ...]:
    """Return every reason not to arm; empty when the vehicle may.

    What a failsafe would act on in the air keeps the vehicle on the ground, unless its action is switched off.
    """
    if facts.mode is Mode.TERMINATION:
        return (TERMINATED,)
    b = behaviour
    ordered = b.battery_emergency < b.battery_critical < b.battery_low
    flies_sticks = facts.mode in (Mode.POSITION, Mode.ALTITUDE)
    would_climb = flies_sticks and facts.manual_fresh and facts.throttle > THROTTLE_CENTRED
    gcs = "the ground station is lost" if facts.gcs_heard else "no ground station was heard"
    checks = (
        (facts.state_is_valid, Need.STATE.value),
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
    return tuple(sentence for passed, sentence in checks if not passed)
