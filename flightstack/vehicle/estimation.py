"""Estimation in flight: the state of a vehicle that flies on its sensors. No I/O, no clock."""

from __future__ import annotations

import math

from flightstack.core.contract import FloatArray, Vector3
from flightstack.core.earth_field import earth_field_ned_gauss
from flightstack.estimation.estimator import Estimator
from flightstack.estimation.sensed import Sensed
from flightstack.estimation.sensor_feed import NewestSamples, SensorFeed
from flightstack.estimation.sensor_samples import BaroSample, ImuSample
from flightstack.estimation.snapshot import snapshot
from flightstack.flight_log.sensor_recorder import SensorRecorder
from flightstack.simulator_link.sensor_inbox import SensorInbox
from flightstack.vehicle.area import FlightArea
from flightstack.vehicle.autopilot import Autopilot
from flightstack.vehicle.flight_state import FlightState


class Estimation:
    """Feeds the estimator with the new measurements, and writes the state of the flight.

    The estimate of the first fix becomes the origin of the vehicle's local frame.
    """

    def __init__(
        self,
        sensors: SensorInbox,
        now: FlightState,
        area: FlightArea,
        recorder: SensorRecorder,
        truth: FloatArray,
    ) -> None:
        """``now.state`` is written in place. ``truth`` is the simulator's state, which only ``recorder`` reads."""
        self.estimator = Estimator()
        self._sensors = sensors
        self._now = now
        self._area = area
        self._recorder, self._truth = recorder, truth
        self._feed = SensorFeed(self.estimator, now.state, recorder.sample)
        self._landed = False

    @property
    def samples(self) -> NewestSamples:
        """Newest sample of each sensor."""
        return self._feed.newest

    def sensed(self) -> Sensed:
        """Return what the estimator and its sensors know now; valid until the next update."""
        return Sensed(self.estimator.memory[0], self._feed.newest)

    def warm_up(self) -> None:
        """Compile the kernels of the estimator, or load them from the cache."""
        unknown = Vector3(math.nan, math.nan, math.nan)
        estimator = Estimator()
        estimator.imu(ImuSample(0.0, 0.0, unknown, unknown))
        estimator.baro(BaroSample(0.0, math.nan, math.nan, math.nan))
        estimator.set_earth_field(Vector3(0.0, 0.0, 0.0))

    def _snapshot(self) -> bytes:
        return snapshot(self.estimator)

    def is_ready(self) -> bool:
        """Return True if the vehicle may fly on the estimate."""
        return self._now.has_state

    def update(self, time_us: int) -> None:
        """Take the measurements since the last call; once per tick, at the time of the tick."""
        now = self._now
        self._recorder.begin(self._snapshot)
        if now.landed is not self._landed:
            self._landed = now.landed
            self.estimator.set_landed(now.landed)
        if self._feed.update(self._sensors.take()) and not now.has_state:
            self._find_origin()
        self._recorder.state(time_us, self._truth, self.sensed)

    def _find_origin(self) -> None:
        frame = self.estimator.frame
        if frame is not None:
            self.estimator.set_earth_field(earth_field_ned_gauss(frame.origin))
            self._area.move_origin(frame.origin)
            self._now.has_state = True


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
