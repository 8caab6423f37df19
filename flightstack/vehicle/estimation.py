"""Estimation in flight: the state of a vehicle that flies on its sensors. No I/O, no clock."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from flightstack.commander.estimate_checks import (
    BARO_FAULT,
    LIMITS,
    MAG_FAULT,
    MAG_MISSING,
    conditions_of,
    estimate_refusals,
    limits_of,
)
from flightstack.commander.failsafe_monitor import FailsafeMonitor
from flightstack.control.backend import ControlBackend
from flightstack.core.compiled import plain
from flightstack.core.contract import FloatArray, SingleArray, Vector3
from flightstack.core.enums import Severity
from flightstack.core.geodesy import earth_field_ned_gauss
from flightstack.core.periods import NEVER_US, next_due
from flightstack.core.portable_math import distance
from flightstack.estimation.estimator import Estimator
from flightstack.estimation.estimator_params import EstimatorParams, GnssLimits, tuning_of
from flightstack.estimation.estimator_report import report_kernel
from flightstack.estimation.filter_core import FilterCore
from flightstack.estimation.health import NO_HEALTH
from flightstack.estimation.lanes import Lanes, sum_of_resets
from flightstack.estimation.sensed import Sensed
from flightstack.estimation.sensor_feed import NewestSamples, SensorFeed, SlowSamples
from flightstack.estimation.sensor_samples import BaroSample, ImuSample
from flightstack.estimation.snapshot import snapshot
from flightstack.flight_log.sensor_recorder import SensorRecorder
from flightstack.guidance.navigator import Navigator
from flightstack.params.estimator import ESTIMATOR_SPECS, MULTI_IMU
from flightstack.params.store import ParamStore
from flightstack.params.vehicle import GRAVITY_M_S2
from flightstack.simulator_link.sensor_inbox import SensorInbox
from flightstack.vehicle.autopilot import Autopilot
from flightstack.vehicle.flight_state import FlightState, Journal
from flightstack.vehicle.plans import FlightArea

HEALTH_US = 50_000
"""Interval of the health, in the time of the sensors."""
_SMALL_TURN_RAD = math.radians(2.0)
"""Reset of the yaw that the attitude loop follows without a reset of its own."""
_TOLD_S = 1.0
"""Time after a change of the inertial sensor in which the failure of the former one is not reported again."""
_ZERO = Vector3(0.0, 0.0, 0.0)


def _tuning(values: Mapping[str, float]) -> tuple[EstimatorParams, GnssLimits]:
    """Return the filter's parameters, with the gravity of the vehicle's model, which the simulator flies."""
    params, limits = tuning_of(values)
    return params._replace(gravity_m_s2=GRAVITY_M_S2), limits


class _SensorFault(NamedTuple):
    """A condition of a sensor, with the texts at its begin and end; no end is reported during ``unless``."""

    bit: int
    begins: str
    ends: str = ""
    unless: int = 0


_SENSOR_FAULTS = (
    _SensorFault(MAG_FAULT, "Compass disagrees with GNSS and is no longer used"),
    _SensorFault(MAG_MISSING, "Compass is missing and not used", "Compass is used again", MAG_FAULT),
    _SensorFault(BARO_FAULT, "Barometer is stuck or missing and not used", "Barometer is used again"),
)


class Watched(NamedTuple):
    """The health that a kernel updated."""

    due_us: int
    """Time of the next one."""
    conditions: int
    """Those of the newest one."""


class Users(NamedTuple):
    """The parts of the vehicle that follow the estimate besides the loops."""

    area: FlightArea
    failsafes: FailsafeMonitor
    navigator: Navigator
    backend: ControlBackend
    journal: Journal


class Estimation:
    """Feeds the estimator with the new measurements, and writes the state of the flight.

    The estimate of the first fix becomes the origin of the vehicle's local frame. Guidance follows a reset of the
    estimate without a movement of the vehicle.
    """

    def __init__(
        self,
        sensors: SensorInbox,
        now: FlightState,
        users: Users,
        params: ParamStore,
        recorder: SensorRecorder,
        truth: Callable[[], FloatArray | None],
        imu_count: int = 1,
        core: FilterCore | None = None,
    ) -> None:
        """``now.state`` is written in place. ``truth`` returns the simulator's state or None, for ``recorder``.

        ``params`` has the parameters of the estimator (EKF2_…), ``imu_count`` is the vehicle's. ``core`` runs the
        filter of the first inertial sensor alone; by default, filters run in this process, compiled from Python.
        """
        count = 1 if core is not None else max(1, min(imu_count, int(params.value(MULTI_IMU.name))))
        first, *spares = estimators = [Estimator(*_tuning(params.values()), core) for _ in range(count)]
        self._params = params
        params.subscribe(self._on_parameter)
        self.health = NO_HEALTH
        """Newest health of the estimate."""
        self._sensors = sensors
        self._now = now
        self._users = users
        self.recorder, self._truth = recorder, truth
        self._feed = SensorFeed(first, now.state, recorder, spares)
        self._lanes = Lanes(self._feed, estimators)
        self.watch, self.limits = self._lanes.watch, np.zeros(1, LIMITS)
        """Memory and limits of the health, for a kernel that updates it."""
        self._landed = False
        self._health_due_us, self._conditions = 0, 0
        self._time_us = 0  # of the newest message of the sensors
        self._read_selected()
        self._seen, self._counts = sum_of_resets(self.estimator.memory), (0.0, 0.0, 0.0)
        self._reported, self._spare_has_failed = 0, False

    def _read_selected(self) -> None:
        """Read resets and the fault of the magnetometer of the selected estimator from now on."""
        # as memory: a number of an array takes four times as long to read
        memory = self.estimator.memory
        self._numbers = tuple(
            memory["resets"][kind]["number"].data for kind in ("position", "velocity", "yaw")
        )
        self._mag_fault = memory["flags"]["mag_fault"].data

    @property
    def estimator(self) -> Estimator:
        """The estimator that flies the vehicle."""
        return self._lanes.estimator

    @property
    def samples(self) -> NewestSamples:
        """Newest sample of each sensor."""
        return self._feed.newest

    def sensed(self) -> Sensed:
        """Return what the estimator and its sensors know now; valid until the next update."""
        self.estimator.refresh()
        now_s, memory = self._time_us * 1e-6, self.estimator.memory
        return Sensed(memory, self._feed.newest, self._now.has_state, now_s, self._lanes.report)

    def _on_parameter(self, name: str, value: float) -> None:
        if name in ESTIMATOR_SPECS:
            for estimator in self._lanes.estimators:
                estimator.set_params(*_tuning({**self._params.values(), name: value}))

    def warm_up(self) -> None:
        """Compile the kernels of the estimator and of its rows in the log, or load them from the cache."""
        unknown = Vector3(math.nan, math.nan, math.nan)
        estimator = Estimator()
        estimator.imu(ImuSample(0.0, 0.0, unknown, unknown))
        estimator.baro(BaroSample(0.0, math.nan, math.nan, math.nan))
        estimator.set_earth_field(_ZERO)
        track = NewestSamples().imu_track.memory
        report_kernel(estimator.memory, track, 0.0)
        self.recorder.warm_up(estimator.memory, track)

    def _snapshot(self) -> bytes:
        self.estimator.refresh()
        return snapshot(self.estimator)

    def is_ready(self) -> bool:
        """Return True if the vehicle may take off on the estimate."""
        return self._now.has_state and not estimate_refusals(self.health, self._now.behaviour)

    def update(self, time_us: int) -> None:
        """Take the measurements since the last call; once per tick, at the time of the tick."""
        now = self._now
        self.recorder.begin(self._snapshot)
        if now.landed is not self._landed:
            self._landed = now.landed
            for estimator in self._lanes.estimators:
                estimator.set_landed(now.landed)
        reports = self._sensors.take()
        if reports:
            self._time_us = reports[-1].time_us
        is_known = self._feed.update(reports)
        if reports and not self._lanes.is_alone and self._lanes.replace_lost(self._time_us):
            self._follow_selection()
        if is_known and not now.has_state:
            self._find_origin()
        self.recorder.state(time_us, self._truth, self.sensed)
        self._check_resets(time_us)
        if reports and self._time_us >= self._health_due_us:
            self._update_health(self._time_us)

    def quiet_until_us(self, measures: bool) -> int:
        """Return the time from which a tick has more to do than ``update_imus``; 0 if the next one has.

        With ``measures``, kernels also take magnetometer and barometer and record the true state; those of a single
        inertial sensor also record the estimate and update its health.
        """
        now = self._now
        if self._reset_counts() != self._counts:  # another sensor was selected after the last check
            return 0
        finds_origin = not now.has_state and self.estimator.frame is not None
        if (
            finds_origin
            or now.landed is not self._landed
            or not self._sensors.is_quiet
            or self.recorder.is_new
        ):
            return 0
        if measures and self._lanes.is_alone:
            return NEVER_US
        return min(self._health_due_us, self.recorder.due_us(with_truth=not measures))

    @property
    def health_due_us(self) -> int:
        """Time from which the health is updated."""
        return self._health_due_us

    def begin_watch(self) -> tuple[int, tuple[int, bool, bool]]:
        """Return the time from which a kernel updates the health, and what it is given.

        That is the conditions of the health now, and True if there is an origin, and if the vehicle is flying. The
        kernel stops when the conditions change. The health of several inertial sensors is left to ``update``.
        """
        if not self._lanes.is_alone:
            return NEVER_US, (0, False, False)
        self._lanes.begin_watch()
        self.limits[0] = limits_of(self._now.behaviour)
        return self._health_due_us, (self._conditions, self._now.has_state, self._now.flying)

    @property
    def takes_fixes(self) -> bool:
        """True if kernels may give fixes of GNSS to the filters: they have a local frame."""
        return self._lanes.estimators[0].frame is not None

    def pass_by(self, time_us: int, step_us: int, samples: SlowSamples, watched: Watched) -> None:
        """Follow the measurements up to ``time_us`` that the kernels of sensors and filters took, and the health.

        A health of the kernel was updated before a reset, which ends its call.
        """
        self._time_us = time_us
        self._feed.pass_by(time_us, step_us, samples)
        self.recorder.state(time_us, self._truth, self.sensed)
        if self._lanes.is_alone and watched.due_us != self._health_due_us:
            self._health_due_us, self.health = watched.due_us, self._lanes.watched()
            self._use_health(watched.conditions)
        self._check_resets(time_us)
        if time_us >= self._health_due_us:  # in a tick with a reset
            self._update_health(time_us)

    @property
    def feed(self) -> SensorFeed:
        """Feeds the estimators."""
        return self._feed

    @property
    def estimators(self) -> tuple[Estimator, ...]:
        """Those of the feed, by the number of their inertial sensor."""
        return self._lanes.estimators

    def update_imus(self, time_us: int, step_us: int, wires: Sequence[SingleArray]) -> None:
        """Take a measurement of each inertial sensor, the only messages of a tick before ``quiet_until_us``.

        ``wires`` have the values of HIL_SENSOR, ``step_us`` is the time since the last tick.
        """
        self._time_us = time_us
        self._feed.update_imus(time_us, step_us, wires)
        self._check_resets(time_us)

    def _reset_counts(self) -> tuple[float, float, float]:
        position, velocity, yaw = self._numbers
        return position[0], velocity[0], yaw[0]

    def _check_resets(self, time_us: int) -> None:
        counts = self._reset_counts()
        if counts != self._counts:
            self._counts = counts
            self._follow_resets()
            self.recorder.local_position(time_us, self.sensed())

    def _find_origin(self) -> None:
        frame = self.estimator.frame
        if frame is not None:
            for estimator in self._lanes.estimators:
                estimator.set_earth_field(earth_field_ned_gauss(frame.origin))
            self._users.area.move_origin(frame.origin)
            self._now.has_state = True
            self._health_due_us = 0  # at once: the vehicle counts as healthy now, and a client may arm it

    def _follow_resets(self) -> None:
        """Shift the reference of guidance by the resets since the last call."""
        seen, users = self._seen, self._users
        now = self._seen = sum_of_resets(self.estimator.memory)
        if not self._now.flying:
            return
        position_m, velocity_m_s = (
            _difference(now.position_m, seen.position_m),
            _difference(now.velocity_m_s, seen.velocity_m_s),
        )
        yaw_rad = now.yaw_rad - seen.yaw_rad
        users.navigator.shift(self._now.status.mode, position_m, velocity_m_s, yaw_rad)
        if abs(yaw_rad) > _SMALL_TURN_RAD:  # the reference attitude of the loops has the old yaw
            self._reset_loops()
        step = f"{distance(*position_m):.1f} m, {distance(*velocity_m_s):.1f} m/s, {math.degrees(yaw_rad):.0f} degrees"
        users.journal.say(Severity.NOTICE, f"Estimate reset by {step}")

    def _follow_selection(self) -> None:
        """Fly on the estimator that was selected just now."""
        self._read_selected()
        selection = self._lanes.selection
        text = f"Inertial sensor {selection.left + 1} {selection.reason}: flying on {selection.selected + 1}"
        self._users.journal.say(Severity.WARNING, text)
        self.recorder.selection(self._now.time_us, self.sensed())

    def _reset_loops(self) -> None:
        self._users.backend.reset(self._now.state)
        self._now.loops_reset = True

    def _update_health(self, time_us: int) -> None:
        now, users = self._now, self._users
        self._health_due_us = next_due(time_us, HEALTH_US)
        limit_m = now.behaviour.position_accuracy_m
        self.health, is_selected = self._lanes.update(now.has_state, limit_m, time_us)
        if is_selected:
            self._follow_selection()
        has_failed, had_failed = self.health.spare_imu_has_failed, self._spare_has_failed
        self._spare_has_failed = has_failed
        since_change_s = time_us * 1e-6 - self._lanes.selection.changed_s
        if has_failed and not had_failed and now.has_state and since_change_s > _TOLD_S:
            users.journal.say(Severity.WARNING, "A spare inertial sensor has failed")
        limits = limits_of(now.behaviour)
        self._use_health(plain(conditions_of)(self.health, limits, self._mag_fault[0], now.flying))

    def _use_health(self, conditions: int) -> None:
        """Act on the newest health, with its conditions."""
        now, users = self._now, self._users
        if conditions != self._conditions:
            self._conditions = conditions
            self.recorder.local_position(self._time_us, self.sensed())
        users.failsafes.take_health(self.health, self._conditions)
        self._report_sensors()
        failsafes = users.failsafes
        changed = users.navigator.set_known(failsafes.position_is_known, failsafes.velocity_is_known)
        if changed and now.flying:  # reference and integrators hold what followed from the position
            users.navigator.reset_reference(now.state)
            self._reset_loops()

    def _report_sensors(self) -> None:
        """Report sensors that fail, and, in flight, their return. A rejected magnetometer stays unused."""
        faults = self._conditions | self._reported & MAG_FAULT
        began, ended, self._reported = faults & ~self._reported, self._reported & ~faults, faults
        for fault in _SENSOR_FAULTS:
            if began & fault.bit:
                self._users.journal.say(Severity.WARNING, fault.begins)
            elif ended & fault.bit and not (faults & fault.unless) and self._now.flying:
                self._users.journal.say(Severity.NOTICE, fault.ends)


def _difference(new: Vector3, old: Vector3) -> Vector3:
    return Vector3(new.x - old.x, new.y - old.y, new.z - old.z)


class SensorAutopilot:
    """An autopilot that estimates its state before each tick."""

    def __init__(self, autopilot: Autopilot, estimation: Estimation) -> None:
        self.now = autopilot.now
        self._autopilot = autopilot
        self._estimation = estimation

    def tick(self, time_us: int) -> FloatArray:
        """Estimate the state and run one inner tick; return the rotor speed commands [rad/s], shape (8,)."""
        self._estimation.update(time_us)
        return self._autopilot.tick(time_us)
