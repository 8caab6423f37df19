"""Estimation in flight: the state of a vehicle that flies on its sensors. No I/O, no clock."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

from flightstack.commander.estimate_checks import estimate_refusals
from flightstack.commander.failsafe_monitor import FailsafeMonitor
from flightstack.control.backend import ControlBackend
from flightstack.core.contract import FloatArray, Vector3
from flightstack.core.earth_field import earth_field_ned_gauss
from flightstack.core.enums import Severity
from flightstack.core.portable_math import distance
from flightstack.estimation.estimator import Estimator
from flightstack.estimation.estimator_params import EstimatorParams, GnssLimits, tuning_of
from flightstack.estimation.health import NO_HEALTH, HealthMonitor
from flightstack.estimation.memory import (
    MAG_FAULT,
    POSITION_RESET,
    RESET_SUM,
    VELOCITY_RESET,
    YAW_RESET,
    YAW_RESET_SUM,
)
from flightstack.estimation.sensed import Sensed
from flightstack.estimation.sensor_feed import NewestSamples, SensorFeed
from flightstack.estimation.sensor_samples import BaroSample, ImuSample
from flightstack.estimation.snapshot import snapshot
from flightstack.flight_log.sensor_recorder import SensorRecorder
from flightstack.guidance.navigator import Navigator
from flightstack.params.estimator import ESTIMATOR_SPECS
from flightstack.params.store import ParamStore
from flightstack.params.vehicle import GRAVITY_M_S2
from flightstack.simulator_link.sensor_inbox import SensorInbox
from flightstack.vehicle.area import FlightArea
from flightstack.vehicle.autopilot import Autopilot
from flightstack.vehicle.flight_state import FlightState
from flightstack.vehicle.journal import Journal

HEALTH_US = 50_000
"""Interval of the health, in the time of the sensors."""
_ZERO = Vector3(0.0, 0.0, 0.0)


def _tuning(values: Mapping[str, float]) -> tuple[EstimatorParams, GnssLimits]:
    """Return the filter's parameters, with the gravity of the vehicle's model, which the simulator flies."""
    params, limits = tuning_of(values)
    return params._replace(gravity_m_s2=GRAVITY_M_S2), limits


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
    ) -> None:
        """``now.state`` is written in place. ``truth`` returns the simulator's state or None, for ``recorder``.

        ``params`` has the parameters of the estimator (EKF2_…).
        """
        self.estimator = Estimator(*_tuning(params.values()))
        self._params = params
        params.subscribe(self._on_parameter)
        self.health = NO_HEALTH
        """Newest health of the estimate."""
        self._sensors = sensors
        self._now = now
        self._users = users
        self._recorder, self._truth = recorder, truth
        self._feed = SensorFeed(self.estimator, now.state, recorder)
        self._monitor = HealthMonitor(self.estimator.memory)
        self._landed = False
        self._health_due_us = 0
        self._time_us = 0  # of the newest message of the sensors
        # as memory: a number of an array takes four times as long to read
        self._resets = self.estimator.memory["resets"][0].data
        self._seen, self._counts = self._resets.tolist(), (0.0, 0.0, 0.0)
        self._flags = self.estimator.memory["flags"][0].data
        self._mag_has_failed = False

    @property
    def samples(self) -> NewestSamples:
        """Newest sample of each sensor."""
        return self._feed.newest

    def sensed(self) -> Sensed:
        """Return what the estimator and its sensors know now; valid until the next update."""
        return Sensed(self.estimator.memory[0], self._feed.newest, self._now.has_state, self._time_us * 1e-6)

    def _on_parameter(self, name: str, value: float) -> None:
        if name in ESTIMATOR_SPECS:
            self.estimator.set_params(*_tuning({**self._params.values(), name: value}))

    def warm_up(self) -> None:
        """Compile the kernels of the estimator, or load them from the cache."""
        unknown = Vector3(math.nan, math.nan, math.nan)
        estimator = Estimator()
        estimator.imu(ImuSample(0.0, 0.0, unknown, unknown))
        estimator.baro(BaroSample(0.0, math.nan, math.nan, math.nan))
        estimator.set_earth_field(_ZERO)

    def _snapshot(self) -> bytes:
        return snapshot(self.estimator)

    def is_ready(self) -> bool:
        """Return True if the vehicle may take off on the estimate."""
        return self._now.has_state and not estimate_refusals(self.health, self._now.behaviour)

    def update(self, time_us: int) -> None:
        """Take the measurements since the last call; once per tick, at the time of the tick."""
        now, resets = self._now, self._resets
        self._recorder.begin(self._snapshot)
        if now.landed is not self._landed:
            self._landed = now.landed
            self.estimator.set_landed(now.landed)
        reports = self._sensors.take()
        if reports:
            self._time_us = reports[-1].time_us
        is_known = self._feed.update(reports)
        if is_known and not now.has_state:
            self._find_origin()
        self._recorder.state(time_us, self._truth, self.sensed)
        if (resets[POSITION_RESET], resets[VELOCITY_RESET], resets[YAW_RESET]) != self._counts:
            self._follow_resets()
            self._recorder.local_position(time_us, self.sensed())
        if reports and self._time_us >= self._health_due_us:
            self._update_health(self._time_us)

    def _find_origin(self) -> None:
        frame = self.estimator.frame
        if frame is not None:
            self.estimator.set_earth_field(earth_field_ned_gauss(frame.origin))
            self._users.area.move_origin(frame.origin)
            self._now.has_state = True

    def _follow_resets(self) -> None:
        """Shift the reference of guidance by the resets since the last call."""
        seen, users = self._seen, self._users
        x = self._seen = self._resets.tolist()
        self._counts = x[POSITION_RESET], x[VELOCITY_RESET], x[YAW_RESET]
        if not self._now.flying:
            return
        change = [new - old for new, old in zip(x, seen, strict=True)]
        position_m, velocity_m_s = (
            Vector3(*change[kind + RESET_SUM : kind + RESET_SUM + 3])
            for kind in (POSITION_RESET, VELOCITY_RESET)
        )
        yaw_rad = change[YAW_RESET_SUM]
        users.navigator.shift(position_m, velocity_m_s, yaw_rad)
        if change[YAW_RESET]:  # the reference attitude of the loops has the old yaw
            self._reset_loops()
        step = f"{distance(*position_m):.1f} m, {distance(*velocity_m_s):.1f} m/s, {math.degrees(yaw_rad):.0f} degrees"
        users.journal.say(Severity.NOTICE, f"Estimate reset by {step}")

    def _reset_loops(self) -> None:
        self._users.backend.reset(self._now.state)
        self._now.loops_reset = True

    def _update_health(self, time_us: int) -> None:
        now, users = self._now, self._users
        self._health_due_us = time_us + HEALTH_US
        limit_m = now.behaviour.position_accuracy_m
        self.health = self._monitor.update(self._feed.newest, now.has_state, limit_m, time_us * 1e-6)
        users.failsafes.take_health(self.health)
        if self._flags[MAG_FAULT] and not self._mag_has_failed:
            self._mag_has_failed = True
            users.journal.say(Severity.WARNING, "Compass disagrees with GNSS and is no longer used")
        failsafes = users.failsafes
        changed = users.navigator.set_known(failsafes.position_is_known, failsafes.velocity_is_known)
        if changed and now.flying:  # reference and integrators hold what followed from the position
            users.navigator.reset_reference(now.state)
            self._reset_loops()


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
