"""Watches a flight: gathers what the detectors, links, battery and fence say, and what the failsafes make of it.

No I/O and no clock. The autopilot calls ``update`` once per outer tick, ``evaluate`` if something is wrong, and carries
out the action.
"""

from __future__ import annotations

import math

import numpy as np

from flightstack.commander.arming_checks import ArmingFacts
from flightstack.commander.conditions import BatteryReading, LinkFacts, StateSource
from flightstack.commander.detectors import battery_level
from flightstack.commander.failsafe import Action, Decision, Failsafe, Phase
from flightstack.commander.failsafe_step import (
    IDLE,
    Announcement,
    Situation,
    active_failsafes,
    failsafe_step,
    override,
    renew,
)
from flightstack.commander.fault_detector import FaultDetector
from flightstack.commander.fence_monitor import FenceMonitor
from flightstack.commander.takeover import Takeovers, opponents
from flightstack.commander.transitions import Event, Status
from flightstack.core.contract import FloatArray
from flightstack.core.enums import STREAM_MODES, Mode
from flightstack.guidance.fence import Fence
from flightstack.params.behaviour import Behaviour
from flightstack.params.vehicle import Vehicle

HOLD_AFTER_US = 50_000
"""Age of a state from which on the loops rest: fed with what does not change, they would go to their limits."""


class StateMonitor:
    """Looks at the source of states once per outer tick."""

    def __init__(self, source: StateSource) -> None:
        self._source = source
        self.is_new = True
        """Whether the state has changed since the outer tick before."""
        self.holds_rotors = False
        """Whether the state must not be flown by: it is frozen or missing."""
        self.is_stale = False
        """Whether the newest state is too old, or frozen though its own speeds say that it must change."""

    def update(self, time_us: int, moves_in_air: bool, limit_s: float) -> None:
        """Find out whether the state is too old, or does not change although its own speeds say that it must.

        At rest on the ground, and in the calm at the end of a long hover, it may stay the same to the last bit.
        ``limit_s`` is the age from which on it is stale.
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
BATTERY_FAILSAFES = (Failsafe.BATTERY_LOW, Failsafe.BATTERY_CRITICAL, Failsafe.BATTERY_EMERGENCY)
EVENTS_OF_ACTION: dict[Action, tuple[Event, ...]] = {
    Action.POSITION: (Event.SELECT_POSITION, Event.SELECT_HOLD, Event.SELECT_LAND),
    Action.ALTITUDE: (Event.SELECT_ALTITUDE, Event.SELECT_HOLD, Event.SELECT_LAND),
    Action.HOLD: (Event.SELECT_HOLD, Event.SELECT_LAND),
    Action.RETURN: (Event.SELECT_RETURN, Event.SELECT_LAND),
    Action.LAND: (Event.SELECT_LAND,),
    Action.DISARM: (Event.FORCE_DISARM,),
    Action.TERMINATE: (Event.TERMINATE,),
}
"""What a failsafe's action means to the commander: the first event that is not refused."""


class FailsafeMonitor:
    """Holds what the detectors and failsafes remember."""

    def __init__(
        self,
        vehicle: Vehicle,
        behaviour: Behaviour,
        outer_hz: float,
        divisor: int,
        state: FloatArray,
        source: StateSource,
    ) -> None:
        """Watch ``state`` (13,), which ``source`` writes in place; ``divisor`` inner ticks make an outer one."""
        self.links = LinkFacts()
        self.fence = FenceMonitor(behaviour)
        self.faults = FaultDetector(vehicle, behaviour, outer_hz, divisor, state)
        self.follow_rotors = self.faults.follow_rotors
        self.take_unmeasured = self.faults.take_unmeasured
        self.states = StateMonitor(source)
        self.position_is_controlled = False
        """Whether the setpoint's place is flown to: not on the ground, nor while a stream gives attitudes."""
        self.on_ground = True
        """Whether the vehicle stands, or touches the ground without being found landed yet."""
        self.battery_level = 0
        self._reading: BatteryReading | None = None
        self._source = source
        self._state = state
        self._behaviour = behaviour
        self._memory = IDLE
        self._takeovers = Takeovers()
        self._phase = Phase.DISARMED
        self._time_us = 0

    def warm_up(self) -> None:
        """Compile the fence, or load it from the cache."""
        self.fence.warm_up(self._state)

    # ------------------------------------------------------------------ what is

    @property
    def active(self) -> tuple[Failsafe, ...]:
        """Active failsafes in order of priority, those overridden by a user too."""
        return active_failsafes(self._memory)

    @property
    def overridden(self) -> tuple[Failsafe, ...]:
        """Active failsafes that a user has overridden."""
        entries = self._memory.entries
        return tuple(failsafe for failsafe in active_failsafes(self._memory) if entries[failsafe].overridden)

    @property
    def decision(self) -> Decision:
        """What the failsafes ask for, and the cause."""
        return self._memory.decision

    def arming_facts(self, mode: Mode, has_state: bool) -> ArmingFacts:
        """Return what the arming checks look at."""
        self._watch_battery()
        finite = bool(np.isfinite(self._state).all())
        qx, qy = float(self._state[7]), float(self._state[8])
        breach = self.fence.text(self.fence.step(self._state))
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
            step_refusal=self._source.step_refusal,
        )

    # ------------------------------------------------------------------ what is told

    def set_behaviour(self, behaviour: Behaviour) -> None:
        """Take new parameters, from the next outer tick on."""
        self._behaviour = behaviour
        self.faults.set_behaviour(behaviour)
        self.fence.set_behaviour(behaviour)
        self._reading = None

    def set_fence(self, fence: Fence) -> None:
        """Take the areas of a geofence that was checked; ``NO_FENCE`` for none."""
        self.fence.set_fence(fence)

    def armed(self) -> None:
        """Forget what the detectors saw before: a flight begins."""
        self.faults.begin()
        self._takeovers.begin_flight()

    def refusal(self, phase: Phase) -> str | None:
        """Return why a user may not fly in ``phase`` for a failsafe's sake, or None; once for each request."""
        return self._takeovers.refusal(self._memory, phase, self._time_us, self._behaviour)

    def override(self, phase: Phase) -> None:
        """A user flies in ``phase`` from now on: the failsafes that stood against it act no more."""
        against = opponents(self._memory, phase, self._behaviour)
        if Failsafe.FENCE in against:
            self.fence.note_override()
        self._memory = override(self._memory, against)
        self._takeovers.clear()

    def action_applied(self) -> None:
        """The decision was carried out, and has ended the phase of flight of the last step."""
        if self.decision.cause is not None:
            self._takeovers.record(self._phase, self.decision.cause)

    # ------------------------------------------------------------------ time passes

    def update(
        self, time_us: int, status: Status, landed: bool, setpoint: FloatArray, row: FloatArray
    ) -> frozenset[Failsafe] | None:
        """Advance by one outer tick; return what is wrong, or None when nothing is and nothing was.

        ``setpoint`` (11,) and ``row`` (48,) are the newest of the outer and the inner loop. A flight in which all is
        well takes the short way through here, a hundred times a second.
        """
        self._time_us = time_us
        self._watch_battery()
        armed, mode = status
        states, faults = self.states, self.faults
        states.update(time_us, armed and not landed and faults.moves, self._behaviour.stale_s)
        if not armed:
            self._memory = IDLE
            return None
        if not states.holds_rotors:
            faults.update(setpoint, row, self.position_is_controlled, self.on_ground)
        breached = self.fence.update(self._state, time_us)
        entries = self._memory.entries
        if (
            faults.is_quiet
            and not (breached or entries or states.is_stale or self.battery_level or self.links.gcs_lost)
            and mode not in STREAM_MODES
        ):
            return None
        conditions = self._conditions(breached, mode)
        return conditions if conditions or entries else None

    def evaluate(self, conditions: frozenset[Failsafe], phase: Phase) -> tuple[Announcement, ...]:
        """Let the failsafes act on what ``update`` returned; ``decision`` is what to do then."""
        self._phase = phase
        entry = self._memory.entries.get(Failsafe.FENCE)
        if entry is not None and entry.overridden and self.fence.breach_grows:
            self._memory = renew(self._memory, Failsafe.FENCE)
        situation = Situation(self._time_us, phase, not self.links.manual_lost)
        self._memory, said = failsafe_step(self._memory, conditions, situation, self._behaviour)
        return said

    def _conditions(self, breached: bool, mode: Mode) -> frozenset[Failsafe]:
        """Return what is wrong now.

        A stream that was lost in its mode stays lost until it is back, in whichever mode that ended.
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
        present |= self.faults.failsafes()
        return frozenset(present.union(BATTERY_FAILSAFES[: self.battery_level]))

    def _watch_battery(self) -> None:
        battery, b = self._source.battery, self._behaviour
        if battery is self._reading:  # most of the time: it is read ten times a second
            return
        self._reading = battery
        remaining = battery.remaining if battery.valid else math.nan
        thresholds = (b.battery_low, b.battery_critical, b.battery_emergency)
        self.battery_level = battery_level(self.battery_level, remaining, thresholds)
