"""Watches a flight: gathers what the detectors, links, battery and fence say, and what the failsafes make of it.

No I/O and no clock. The autopilot calls ``step`` once per outer tick and carries out the action.
"""

from __future__ import annotations

import math

import numpy as np

from flightstack.commander.arming_checks import ArmingFacts
from flightstack.commander.conditions import BatteryReading, LinkFacts, StateSource
from flightstack.commander.detectors import (
    BEYOND_ATTITUDE,
    BEYOND_POSITION,
    DETECTOR_MEMORY_SIZE,
    MOVING,
    NOT_FINITE,
    ROTOR_FAULT,
    ROTOR_MEMORY_SIZE,
    battery_level,
    detect,
    detector_params,
    follow_rotors,
    rotor_params,
)
from flightstack.commander.failsafe import Action, Decision, Failsafe, Phase, phase_of
from flightstack.commander.failsafe_step import (
    IDLE,
    Announcement,
    Situation,
    active,
    failsafe_step,
    override,
    renew,
)
from flightstack.commander.takeover import Takeovers, opponents
from flightstack.commander.transitions import Event, Status
from flightstack.contract import SETPOINT_SIZE, FloatArray
from flightstack.guidance.fence import NO_FENCE, Fence, FenceMonitor
from flightstack.modes import Mode
from flightstack.params.behaviour import Behaviour
from flightstack.params.vehicle import Vehicle

UPRIGHT_COSINE = math.cos(math.radians(30.0))
STREAM_MODES = (Mode.POSITION, Mode.ALTITUDE, Mode.OFFBOARD)
BATTERY_FAILSAFES = (Failsafe.BATTERY_LOW, Failsafe.BATTERY_CRITICAL, Failsafe.BATTERY_EMERGENCY)
FAULTS = (
    (NOT_FINITE, Failsafe.NOT_FINITE),
    (BEYOND_ATTITUDE, Failsafe.ATTITUDE),
    (BEYOND_POSITION, Failsafe.POSITION_ERROR),
    (ROTOR_FAULT, Failsafe.ROTOR),
)
HOLD_AFTER_US = 50_000
"""Age of a state from which on the loops rest: fed with what does not change, they would go to their limits."""
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
BREACH_GROWS_M = 5.0
"""So much farther out, a fence that a user has overridden acts again."""
NO_CONDITION: frozenset[Failsafe] = frozenset()


class Supervisor:
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
        self.fence = FenceMonitor()
        self._areas = NO_FENCE
        self._home_ned_m = (0.0, 0.0, 0.0)
        self.position_is_controlled = False
        """Whether the setpoint's place is flown to: not on the ground, nor while a stream gives attitudes."""
        self.battery_level = 0
        self._reading: BatteryReading | None = None
        self._vehicle = vehicle
        self._source = source
        self._state = state
        self._dt_s = 1.0 / outer_hz
        self.set_behaviour(behaviour)
        self._detector = np.zeros(DETECTOR_MEMORY_SIZE)
        self._rotor_params = rotor_params(vehicle, self._dt_s / divisor)
        self._rotors = np.zeros(ROTOR_MEMORY_SIZE)
        self._nowhere = np.zeros(SETPOINT_SIZE)
        self._memory = IDLE
        self._takeovers = Takeovers()
        self._phase = Phase.DISARMED
        self._time_us = 0
        self._overridden_margin_m = math.inf
        self._found = 0
        self._stale = False
        self.holds_rotors = False
        """Whether the state must not be flown by: it is frozen or missing."""
        self.state_is_new = True
        """Whether the state has changed since the outer tick before."""

    def warm_up(self, row: FloatArray) -> None:
        """Compile the detectors, or load them from the cache."""
        detect(self._state, self._nowhere, row, self._rotors, self._detector, self._params, self._dt_s)
        self.follow_rotors(row)
        self.armed()
        probe = FenceMonitor()
        probe.configure(NO_FENCE, max_altitude_m=1.0)
        probe.step(self._state)

    # ------------------------------------------------------------------ what is

    @property
    def failsafes(self) -> tuple[Failsafe, ...]:
        """Active failsafes in order of priority, those overridden by a user too."""
        return active(self._memory)

    @property
    def decision(self) -> Decision:
        """What the failsafes ask for, and the cause."""
        return self._memory.decision

    @property
    def state_is_stale(self) -> bool:
        """Whether the newest state is too old, or frozen though its own speeds say that it must change."""
        return self._stale

    def arming_facts(self, mode: Mode, has_state: bool) -> ArmingFacts:
        """Return what the arming checks look at."""
        self._watch_battery()
        finite = bool(np.isfinite(self._state).all())
        qx, qy = float(self._state[7]), float(self._state[8])
        breach = self.fence.text(self.fence.step(self._state))
        return ArmingFacts(
            mode=mode,
            state_is_valid=finite and has_state,
            state_is_fresh=not self._stale,
            upright=finite and 1.0 - 2.0 * (qx * qx + qy * qy) >= UPRIGHT_COSINE,
            gcs_lost=self.links.gcs_lost,
            gcs_heard=self.links.gcs_heard,
            manual_fresh=not self.links.manual_lost,
            offboard_fresh=not self.links.offboard_lost,
            fence_breach=breach,
            battery_level=self.battery_level,
            battery_remaining=self._source.battery.remaining,
        )

    # ------------------------------------------------------------------ time passes

    def set_behaviour(self, behaviour: Behaviour) -> None:
        """Take new parameters, from the next outer tick on."""
        self._behaviour = behaviour
        self._params = detector_params(behaviour, self._vehicle)
        self._reading = None
        self._configure_fence()

    def set_fence(self, fence: Fence) -> None:
        """Take the areas of a geofence that was checked; ``NO_FENCE`` for none."""
        self._areas = fence
        self._configure_fence()

    def set_home(self, home_ned_m: tuple[float, float, float]) -> None:
        """Measure the fence's distance and altitude from another home."""
        self._home_ned_m = home_ned_m
        self._configure_fence()

    def _configure_fence(self) -> None:
        b = self._behaviour
        brakes = (b.acceleration_m_s2, b.vertical_acceleration_m_s2) if b.fence_predicts else None
        self.fence.configure(
            self._areas, b.fence_max_distance_m, b.fence_max_altitude_m, self._home_ned_m, brakes
        )

    def armed(self) -> None:
        """Forget what the detectors saw before: a flight begins."""
        self._detector[:] = 0.0
        self._rotors[:] = 0.0
        self._found = 0
        self._takeovers.forget()

    def follow_rotors(self, row: FloatArray) -> None:
        """Take the newest row of the inner loop, shape (48,), once per inner tick."""
        follow_rotors(row, self._rotors, self._rotor_params)

    def refusal(self, phase: Phase) -> str | None:
        """Return why a user may not fly in ``phase`` for a failsafe's sake, or None; once for each request."""
        return self._takeovers.refusal(self._memory, phase, self._time_us, self._behaviour)

    def override(self, phase: Phase) -> None:
        """A user flies in ``phase`` from now on: the failsafes that stood against it act no more."""
        against = opponents(self._memory, phase, self._behaviour)
        if Failsafe.FENCE in against:
            self._overridden_margin_m = self.fence.margin_m
        self._memory = override(self._memory, against)
        self._takeovers.granted()

    def took_over(self) -> None:
        """The decision was carried out, and has ended the phase of flight of the last step."""
        if self.decision.cause is not None:
            self._takeovers.took(self._phase, self.decision.cause)

    def step(
        self,
        time_us: int,
        status: Status,
        landed: bool,
        setpoint: FloatArray,
        row: FloatArray,
        goes: bool = False,
    ) -> tuple[Announcement, ...]:
        """Advance by one outer tick; ``decision`` is what to do then.

        ``setpoint`` (11,) and ``row`` (48,) are the newest of the outer and the inner loop; ``goes``: in hold mode,
        on the way to another place.
        """
        self._time_us = time_us
        self._watch_battery()
        self._watch_state(time_us, in_air=status.armed and not landed)
        if not status.armed:
            self._memory = IDLE
            return ()
        if not self.holds_rotors:
            if not self.position_is_controlled:
                self._nowhere[:3] = self._state[:3]
                setpoint = self._nowhere
            self._found = detect(
                self._state, setpoint, row, self._rotors, self._detector, self._params, self._dt_s
            )
        conditions = self._conditions(self._found, status.mode)
        if not conditions and not self._memory.entries:
            return ()
        self._watch_overridden_fence()
        self._phase = phase_of(status.armed, landed, status.mode, goes)
        situation = Situation(time_us, self._phase, not self.links.manual_lost)
        self._memory, said = failsafe_step(self._memory, conditions, situation, self._behaviour)
        return said

    def _conditions(self, found: int, mode: Mode) -> frozenset[Failsafe]:
        """Return what is wrong now.

        A stream that was lost in its mode stays lost until it is back, in whichever mode that ended.
        """
        breached = self.fence.step(self._state) != 0
        quiet = not (found & ~MOVING or self._stale or self.battery_level or breached or self.links.gcs_lost)
        if quiet and mode not in STREAM_MODES and not self._memory.entries:
            return NO_CONDITION
        links, entries = self.links, self._memory.entries
        flies_offboard = mode is Mode.OFFBOARD or Failsafe.OFFBOARD_LOST in entries
        flies_sticks = mode in (Mode.POSITION, Mode.ALTITUDE) or Failsafe.MANUAL_LOST in entries
        conditions = {
            Failsafe.STATE_STALE: self._stale,
            Failsafe.FENCE: breached,
            Failsafe.GCS_LOST: links.gcs_lost,
            Failsafe.OFFBOARD_LOST: links.offboard_lost and flies_offboard,
            Failsafe.MANUAL_LOST: links.manual_lost and flies_sticks,
        }
        present = {failsafe for failsafe, holds in conditions.items() if holds}
        present.update(failsafe for bit, failsafe in FAULTS if found & bit)
        return frozenset(present.union(BATTERY_FAILSAFES[: self.battery_level]))

    def _watch_overridden_fence(self) -> None:
        """Let a fence that was overridden act again when the vehicle leaves it farther behind."""
        entry = self._memory.entries.get(Failsafe.FENCE)
        grows = self.fence.margin_m < self._overridden_margin_m - BREACH_GROWS_M
        if entry is not None and entry.overridden and grows:
            self._memory = renew(self._memory, Failsafe.FENCE)

    def _watch_state(self, time_us: int, in_air: bool) -> None:
        """Find out whether the state is too old, or does not change although its own speeds say that it must.

        At rest on the ground, and in the calm at the end of a long hover, it may stay the same to the last bit.
        """
        fresh = self._source.freshness(time_us)
        old_us = max(fresh.age_us, fresh.frozen_us) if in_air and self._found & MOVING else fresh.age_us
        limit_us = self._behaviour.stale_s * 1e6
        self.state_is_new = not (fresh.age_us or fresh.frozen_us)
        self.holds_rotors = old_us >= min(limit_us, HOLD_AFTER_US)
        self._stale = old_us >= limit_us

    def _watch_battery(self) -> None:
        battery, b = self._source.battery, self._behaviour
        if battery is self._reading:  # most of the time: it is read ten times a second
            return
        self._reading = battery
        remaining = battery.remaining if battery.valid else math.nan
        thresholds = (b.battery_low, b.battery_critical, b.battery_emergency)
        self.battery_level = battery_level(self.battery_level, remaining, thresholds)
