"""Collect the conditions from detectors, links, battery and fence, and decide the failsafe action.

No I/O and no clock. The autopilot calls ``update`` once per outer tick, ``evaluate`` if it returns conditions, and
carries out the action.
"""

from __future__ import annotations

import math

import numpy as np

from flightstack.commander.arming_checks import ArmingFacts
from flightstack.commander.estimate_checks import VELOCITY_UNKNOWN, failsafes_of
from flightstack.commander.failsafe import BATTERY_FAILSAFES, Action, Decision, Failsafe, Phase, action_of
from flightstack.commander.failsafe_step import (
    IDLE,
    Announcement,
    Memory,
    Situation,
    active_failsafes,
    failsafe_step,
    goes_on,
    override,
    restart,
)
from flightstack.commander.fault_detector import FaultDetector, battery_level
from flightstack.commander.fence_monitor import FenceMonitor
from flightstack.commander.inputs import BatteryReading, LinkFacts, StateSource
from flightstack.commander.transitions import Event, Status
from flightstack.commander.user_takeover import UserTakeover, conflicting_failsafes
from flightstack.core.contract import FloatArray
from flightstack.core.enums import STREAM_MODES, Mode
from flightstack.estimation.health import EstimateHealth
from flightstack.guidance.fence import Fence
from flightstack.params.behaviour import Behaviour
from flightstack.params.vehicle import Vehicle

HOLD_AFTER_US = 50_000
"""Age of a state from which the control loops stop: with a constant input they would run to their limits."""


class StateMonitor:
    """Monitors the age of the state once per outer tick."""

    def __init__(self, source: StateSource) -> None:
        self._source = source
        self.is_new = True
        """True if the state has changed since the previous outer tick."""
        self.holds_rotors = False
        """True if the state is frozen or missing, so that the rotor speeds are held."""
        self.is_stale = False
        """True if the state is older than the limit, or frozen although its velocities and rates are not zero."""

    def update(self, time_us: int, moves_in_air: bool, limit_s: float) -> None:
        """Update the flags; ``limit_s`` is the age from which the state is stale.

        A frozen state counts only if ``moves_in_air``: at rest on the ground, or after a long hover in calm air, the
        state may be constant to the last bit.
        """
        fresh = self._source.freshness(time_us)
        age_us, frozen_us = fresh.age_us, fresh.frozen_us
        if not (age_us or frozen_us):
            self.is_new, self.holds_rotors, self.is_stale = True, False, False
            return
        old_us = max(age_us, frozen_us) if moves_in_air else age_us
        limit_us = limit_s * 1e6
        self.is_new = False
        self.holds_rotors = old_us >= min(limit_us, HOLD_AFTER_US)
        self.is_stale = old_us >= limit_us


UPRIGHT_COSINE = 0.5 * math.sqrt(3.0)  # of 30 degrees
EVENTS_OF_ACTION: dict[Action, tuple[Event, ...]] = {
    Action.POSITION: (Event.SELECT_POSITION, Event.SELECT_HOLD, Event.SELECT_LAND),
    Action.ALTITUDE: (Event.SELECT_ALTITUDE, Event.SELECT_HOLD, Event.SELECT_LAND),
    Action.HOLD: (Event.SELECT_HOLD, Event.SELECT_LAND),
    Action.RETURN: (Event.SELECT_RETURN, Event.SELECT_LAND),
    Action.LAND: (Event.SELECT_LAND,),
    Action.DISARM: (Event.FORCE_DISARM,),
    Action.TERMINATE: (Event.TERMINATE,),
}
"""Events that carry out an action: the first one that is not refused."""


class FailsafeMonitor:
    """Holds the state of detectors and failsafes."""

    def __init__(
        self,
        vehicle: Vehicle,
        behaviour: Behaviour,
        outer_hz: float,
        divisor: int,
        state: FloatArray,
        source: StateSource,
    ) -> None:
        """Monitor ``state`` (13,), which ``source`` writes in place; ``divisor`` is inner ticks per outer tick."""
        self.links = LinkFacts()
        self.fence = FenceMonitor(behaviour)
        self.faults = FaultDetector(vehicle, behaviour, outer_hz, divisor, state)
        self.follow_rotors = self.faults.follow_rotors
        self.take_unmeasured = self.faults.take_unmeasured
        self.states = StateMonitor(source)
        self.position_is_controlled = False
        """True while the position setpoint is tracked: not on the ground, nor under attitude setpoints."""
        self.on_ground = True
        """True if the vehicle is landed, or in ground contact before the land detector reports landed."""
        self.battery_level = 0
        self._health: EstimateHealth | None = None
        self._conditions_of_estimate = 0
        self._estimate: frozenset[Failsafe] = frozenset()  # of these conditions
        self._reading: BatteryReading | None = None
        self._source = source
        self._state = state
        self._behaviour = behaviour
        self._memory = IDLE
        self._settled: tuple[Memory, frozenset[Failsafe], Situation] | None = None
        self._user_takeover = UserTakeover()
        self._phase = Phase.DISARMED
        self._time_us = 0

    @property
    def rotor_thrust_n(self) -> float:
        """Thrust at the mean speeds of the rotors: measured, or expected from their commands."""
        return self.faults.rotor_thrust_n

    def warm_up(self) -> None:
        """Compile the fence, or load it from the cache."""
        self.fence.warm_up(self._state)

    # ------------------------------------------------------------------ state

    @property
    def active(self) -> tuple[Failsafe, ...]:
        """Active failsafes in order of priority, including overridden ones."""
        return active_failsafes(self._memory)

    @property
    def overridden(self) -> tuple[Failsafe, ...]:
        """Active failsafes that a user has overridden."""
        entries = self._memory.entries
        return tuple(failsafe for failsafe in active_failsafes(self._memory) if entries[failsafe].overridden)

    @property
    def demands_action(self) -> bool:
        """True if an active failsafe that is not overridden has an action above a warning."""
        entries = self._memory.entries
        return any(
            not entry.overridden and action_of(failsafe, self._behaviour) > Action.WARN
            for failsafe, entry in entries.items()
        )

    @property
    def decision(self) -> Decision:
        """Action of the failsafes, and its cause."""
        return self._memory.decision

    def arming_facts(self, mode: Mode, has_state: bool) -> ArmingFacts:
        """Return the inputs of the arming checks."""
        self._update_battery_level()
        finite = bool(np.isfinite(self._state).all())
        qx, qy = float(self._state[7]), float(self._state[8])
        breach = self.fence.text(self.fence.flags_at(self._state))
        return ArmingFacts(
            mode=mode,
            state_is_valid=finite and has_state,
            state_is_fresh=not self.states.is_stale,
            upright=finite and 1.0 - 2.0 * (qx * qx + qy * qy) >= UPRIGHT_COSINE,
            gcs_lost=self.links.gcs_lost,
            gcs_heard=self.links.gcs_heard,
            manual_fresh=not self.links.manual_lost,
            offboard_fresh=not self.links.offboard_lost,
            fence_breach=breach,
            battery_level=self.battery_level,
            battery_remaining=self._source.battery.remaining,
            health=self._health,
            step_refusal=self._source.step_refusal,
        )

    @property
    def position_is_known(self) -> bool:
        """True unless the estimate of the position is lost."""
        return Failsafe.POSITION_LOST not in self._estimate

    @property
    def velocity_is_known(self) -> bool:
        """True unless the estimate of the velocity is too uncertain to brake by."""
        return not self._conditions_of_estimate & VELOCITY_UNKNOWN

    # ------------------------------------------------------------------ inputs

    def take_health(self, health: EstimateHealth, conditions: int) -> None:
        """Take the health of the estimate and its conditions; only of a vehicle that flies on its sensors."""
        self._health, self._conditions_of_estimate = health, conditions
        self._estimate = failsafes_of(conditions)

    def set_behaviour(self, behaviour: Behaviour) -> None:
        """Set new parameters, from the next outer tick on."""
        self._behaviour, self._settled = behaviour, None
        self.faults.set_behaviour(behaviour)
        self.fence.set_behaviour(behaviour)
        self._reading = None

    def set_fence(self, fence: Fence) -> None:
        """Set the areas of a checked geofence; ``NO_FENCE`` for none."""
        self.fence.set_fence(fence)

    def armed(self) -> None:
        """Reset the detectors at the start of a flight."""
        self.faults.begin()
        self._user_takeover.begin_flight()

    def refusal(self, phase: Phase) -> str | None:
        """Return the reason that a failsafe denies a user ``phase``, or None. Call once per request."""
        return self._user_takeover.refusal(self._memory, phase, self._time_us, self._behaviour)

    def override(self, phase: Phase) -> None:
        """Override the failsafes that conflict with ``phase``, which a user has selected."""
        conflicting = conflicting_failsafes(self._memory, phase, self._behaviour)
        if Failsafe.FENCE in conflicting:
            self.fence.record_override()
        self._memory = override(self._memory, conflicting)
        self._user_takeover.clear()

    def action_applied(self) -> None:
        """Record that the decision was carried out and has ended the phase of flight of the last step."""
        if self.decision.cause is not None:
            self._user_takeover.record(self._phase, self.decision.cause)

    # ------------------------------------------------------------------ ticks

    def update(
        self, time_us: int, status: Status, landed: bool, setpoint: FloatArray, row: FloatArray
    ) -> frozenset[Failsafe] | None:
        """Advance by one outer tick; return the present conditions, or None if none holds and no failsafe is active.

        ``setpoint`` (11,) and ``row`` (48,) are the newest of the outer and the inner loop. A nominal tick returns
        early: this runs at the outer rate.
        """
        self._time_us = time_us
        self._update_battery_level()
        armed, mode = status
        states, faults = self.states, self.faults
        states.update(time_us, armed and not landed and faults.moves, self._behaviour.stale_s)
        breached = self.fence.update(self._state, time_us)
        if not armed:
            self._memory = IDLE
            return None
        if not states.holds_rotors:
            faults.update(setpoint, row, self.position_is_controlled, self.on_ground)
        if faults.is_quiet and not (
            breached or states.is_stale or mode in STREAM_MODES or self._has_conditions
        ):
            return None
        conditions = self._conditions(breached, mode)
        return conditions if conditions or self._memory.entries else None

    @property
    def _has_conditions(self) -> bool:
        """True if a failsafe is active, or a condition holds that fence and detectors do not find in the state."""
        links, memory = self.links, self._memory
        return bool(memory.entries or self._estimate or self.battery_level or links.gcs_lost)

    def is_nominal(self, phase: Phase, mode: Mode) -> bool:
        """Return True if an update changes nothing for a new state in which fence and detectors find nothing.

        Either no failsafe is active, or those that are go on as in the last update.
        """
        self._update_battery_level()
        if self.fence.is_breached:
            return False
        if phase is Phase.DISARMED:  # also without a new state, as before the first one
            return self._memory is IDLE and not self.states.holds_rotors
        return (self.states.is_new and not self._has_conditions) or self._goes_on(phase, mode)

    def _goes_on(self, phase: Phase, mode: Mode) -> bool:
        if self._settled is None or not self.faults.is_quiet:
            return False
        memory, conditions, situation = self._settled
        if memory is not self._memory or phase is not situation.phase:
            return False
        is_same = self.links.manual_lost is not situation.sticks_are_live
        return is_same and conditions == self._conditions(False, mode)

    def pass_by(self, time_us: int, found: int) -> None:
        """Follow updates up to ``time_us`` that returned None; ``found`` are the last bits of ``detect``."""
        self._time_us, self.faults.found = time_us, found

    def evaluate(self, conditions: frozenset[Failsafe], phase: Phase) -> tuple[Announcement, ...]:
        """Evaluate the failsafes for the conditions from ``update``; sets ``decision``."""
        self._phase = phase
        entry = self._memory.entries.get(Failsafe.FENCE)
        if entry is not None and entry.overridden and self.fence.has_breach_grown:
            self._memory = restart(self._memory, Failsafe.FENCE)
        situation = Situation(self._time_us, phase, not self.links.manual_lost)
        before = self._memory
        self._memory, announcements = failsafe_step(before, conditions, situation, self._behaviour)
        is_settled = self._memory == before and goes_on(self._memory, situation, self._behaviour)
        self._settled = (self._memory, conditions, situation) if is_settled else None
        return announcements

    def _conditions(self, breached: bool, mode: Mode) -> frozenset[Failsafe]:
        """Return the present conditions.

        A stream lost in its own mode stays a condition in the mode of the failsafe, until the stream is back.
        """
        links, entries = self.links, self._memory.entries
        flies_offboard = mode is Mode.OFFBOARD or Failsafe.OFFBOARD_LOST in entries
        flies_sticks = mode in (Mode.POSITION, Mode.ALTITUDE) or Failsafe.MANUAL_LOST in entries
        conditions = {
            Failsafe.STATE_STALE: self.states.is_stale,
            Failsafe.FENCE: breached,
            Failsafe.GCS_LOST: links.gcs_lost,
            Failsafe.OFFBOARD_LOST: links.offboard_lost and flies_offboard,
            Failsafe.MANUAL_LOST: links.manual_lost and flies_sticks,
        }
        present = {failsafe for failsafe, holds in conditions.items() if holds}
        present |= self.faults.failsafes() | self._estimate
        return frozenset(present.union(BATTERY_FAILSAFES[: self.battery_level]))

    def _update_battery_level(self) -> None:
        battery, b = self._source.battery, self._behaviour
        if battery is self._reading:  # the measurement comes less often than ticks
            return
        self._reading = battery
        remaining = battery.remaining if battery.valid else math.nan
        thresholds = (b.battery_low, b.battery_critical, b.battery_emergency)
        self.battery_level = battery_level(self.battery_level, remaining, thresholds)
