"""Estimation in flight: the state of a vehicle that flies on its sensors. No I/O, no clock."""

from __future__ import annotations

import math

from flightstack.core.contract import FloatArray, Vector3
from flightstack.core.earth_field import earth_field_ned_gauss
from flightstack.estimation.estimator import Estimator
from flightstack.estimation.estimator_params import tuning_of
from flightstack.estimation.sensed import Sensed
from flightstack.estimation.sensor_feed import NewestSamples, SensorFeed
from flightstack.estimation.sensor_samples import BaroSample, ImuSample
from flightstack.params.estimator import ESTIMATOR_SPECS
from flightstack.params.store import ParamStore
from flightstack.simulator_link.sensor_inbox import SensorInbox
from flightstack.vehicle.area import FlightArea
from flightstack.vehicle.autopilot import Autopilot
from flightstack.vehicle.flight_state import FlightState


class Estimation:
    """Feeds the estimator with the new measurements, and writes the state of the flight.

    The estimate of the first fix becomes the origin of the vehicle's local frame.
    """

    def __init__(self, sensors: SensorInbox, now: FlightState, area: FlightArea, store: ParamStore) -> None:
        """``now.state`` is written in place; ``store`` has the parameters of the estimator (EKF2_…)."""
        self.estimator = Estimator(*tuning_of(store.values()))
        self._store = store
        store.subscribe(self._on_parameter)
        self._sensors = sensors
        self._now = now
        self._area = area
        self._feed = SensorFeed(self.estimator, now.state)
        self._landed = False

    @property
    def samples(self) -> NewestSamples:
        """Newest sample of each sensor."""
        return self._feed.newest

    def sensed(self) -> Sensed:
        """Return what the estimator and its sensors know now; valid until the next update."""
        return Sensed(self.estimator.memory[0], self._feed.newest)

    def _on_parameter(self, name: str, value: float) -> None:
        if name in ESTIMATOR_SPECS:
            self.estimator.set_params(*tuning_of({**self._store.values(), name: value}))

    def warm_up(self) -> None:
        """Compile the kernels of the estimator, or load them from the cache."""
        unknown = Vector3(math.nan, math.nan, math.nan)
        estimator = Estimator()
        estimator.imu(ImuSample(0.0, 0.0, unknown, unknown))
        estimator.baro(BaroSample(0.0, math.nan, math.nan, math.nan))
        estimator.set_earth_field(Vector3(0.0, 0.0, 0.0))

    def is_ready(self) -> bool:
        """Return True if the vehicle may fly on the estimate."""
        return self._now.has_state

    def update(self) -> None:
        """Take the measurements since the last call; once per tick."""
        now = self._now
        if now.landed is not self._landed:
            self._landed = now.landed
            self.estimator.set_landed(now.landed)
        if self._feed.update(self._sensors.take()) and not now.has_state:
            self._find_origin()

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
        self._estimation.update()
        return self._autopilot.tick(time_us)
