"""Hands the arrays of magnetometer, barometer, filters and their logs to the kernel of quiet ticks."""

from __future__ import annotations

from typing import Any

import numpy as np

from flightstack.core.contract import FloatArray, RecordArray, Vector3
from flightstack.core.kernel_calls import address_of
from flightstack.estimation.delayed_filter import push_kernel
from flightstack.estimation.rings import MAG_RING
from flightstack.estimation.sensor_samples import BaroSample, MagSample
from flightstack.flight_log.flight_log import DEFAULT_CAPACITY, Trace
from flightstack.flight_log.sensor_recorder import NEVER_US, TRUTH_INTERVAL_US
from flightstack.flight_log.sensor_topics import BARO_GROUP, MAG_GROUP, TRUTH_GROUP
from flightstack.simulator_link.sensor_frames import BARO as BARO_FIELDS
from flightstack.simulator_link.sensor_frames import HIL_VALUES, HilValues
from flightstack.simulator_link.sensor_frames import MAG as MAG_FIELDS
from flightstack.vehicle.estimation import Estimation
from flightstack.vehicle.slow_kernel import (
    BARO,
    MAG,
    SLOW_CALLS,
    SLOW_MARKS,
    SlowCalls,
)
from sim_bridge.plant.compiled_plant import CompiledPlant
from sim_bridge.plant.near_ground import airspeed
from sim_bridge.sensors.barometer import Barometer, measure_baro
from sim_bridge.sensors.magnetometer import Magnetometer, measure_mag
from sim_bridge.sensors.suite import BARO_SLOT, MAG_SLOT
from sim_bridge.simulator import Simulator

assert (MAG_SLOT, BARO_SLOT) == (MAG, BARO)
_GROUPS = (MAG_GROUP, BARO_GROUP, TRUTH_GROUP)
"""In the order of the kernel's counters of new rows."""
_NO_SENSOR: tuple[Any, ...] = (np.zeros(0, np.uint8), np.zeros(3), np.zeros((0, 0)), np.zeros(1, np.int64))


def _bytes(records: Any) -> Any:
    return np.frombuffer(records, np.uint8)


def _sensor(sensor: Magnetometer | Barometer | None) -> tuple[Any, ...]:
    """Return record, output, deviates and their cursor of a sensor."""
    if sensor is None:
        return _NO_SENSOR
    return _bytes(sensor.records), sensor.out, sensor.noise.block, sensor.noise.cursor


class QuietSlow:
    """The sensors that are not inertial, and the log of the truth, of a vehicle that flies on its sensors.

    Without ``sensors`` and ``estimation``, of one that flies on the true state: nothing is due.
    """

    def __init__(self, simulator: Simulator, estimation: Estimation | None, truth: FloatArray) -> None:
        """``truth`` is the true state in the vehicle's local frame, shape (13,)."""
        self._sensors = None if estimation is None else simulator.sensors
        self._estimation = estimation
        self._no_traces = [Trace(DEFAULT_CAPACITY, group.columns, lambda: None) for group in _GROUPS]
        self._marks = np.zeros(1, SLOW_MARKS)
        self._marks["truth_us"] = NEVER_US
        self.calls = self._addresses(simulator)
        """Addresses of the kernels."""
        self.constant = self._constant(simulator, truth)
        """Argument ``slow`` of the kernel."""

    def _addresses(self, simulator: Simulator) -> RecordArray:
        sensors, estimation = self._sensors, self._estimation
        if sensors is None or estimation is None:
            return np.zeros(1, SLOW_CALLS)
        plant, frame = simulator.plant, simulator.frame
        assert isinstance(plant, CompiledPlant)
        mag_call = baro_call = 0
        if sensors.mag is not None:
            mag = sensors.mag
            mag_call = address_of(measure_mag, mag.records, frame.state, 0.0, mag.noise.block[0])
        if sensors.baro is not None:
            baro, speeds = sensors.baro, frame.rotor_speed_rad_s
            baro_call = address_of(
                measure_baro, baro.records, 0, frame.state, 0.0, speeds, baro.noise.block[0]
            )
        push = address_of(push_kernel, estimation.estimators[0].memory, MAG_RING, np.zeros(4))
        calls = SlowCalls(mag_call, baro_call, address_of(airspeed, plant.memory), push)
        return np.array([calls], SLOW_CALLS)

    def _constant(self, simulator: Simulator, truth: FloatArray) -> tuple[Any, ...]:
        sensors, estimation = self._sensors, self._estimation
        if sensors is None or estimation is None:
            due_us = np.full(2, NEVER_US)
            parts, mag, baro = np.zeros(1, HIL_VALUES), None, None
            current_a, offset_m = np.zeros(1), np.zeros(3)
            period_us = np.ones(2, np.int64)
        else:
            assert isinstance(simulator.plant, CompiledPlant)
            due_us, period_us = sensors.due_us, sensors.period_us
            parts, mag, baro = sensors.parts, sensors.mag, sensors.baro
            current_a, offset_m = simulator.plant.currents_a, estimation.recorder.offset_m
        scratch = np.zeros(4), np.zeros(4), np.zeros(2), np.zeros(2)
        return (
            due_us, period_us, self._marks, parts, (*_sensor(mag), current_a), _sensor(baro), scratch,
            (truth, offset_m, TRUTH_INTERVAL_US),
        )  # fmt: skip

    def room(self) -> int:
        """Return for how many ticks logs and deviates suffice."""
        if self._sensors is None:
            return DEFAULT_CAPACITY
        left = [trace.capacity - trace.n for trace in self._open_traces()]
        left += [
            sensor.noise.ready() for sensor in (self._sensors.mag, self._sensors.baro) if sensor is not None
        ]
        return min(left)

    def following(self, boot_us: int) -> tuple[Any, ...]:
        """Return the argument ``following`` of the kernel; call once before each of its calls.

        ``boot_us`` is the simulator's time at the start of the vehicle's, not 0 after a power cycle.
        """
        marks, estimation, delays_s = self._marks, self._estimation, (0.0, 0.0)
        truth_us = marks["truth_us"][0]
        marks[0] = 0
        marks["truth_us"] = truth_us
        if estimation is not None:
            params = estimation.estimators[0].params
            delays_s = float(params.mag_delay_s), float(params.baro_delay_s)
            marks["truth_us"] = estimation.recorder.truth_due_us
        logs = ((trace.rows, trace.times_us, trace.n) for trace in self._open_traces())
        return (delays_s, *logs, boot_us)

    def _open_traces(self) -> list[Trace]:
        """Return the traces of the open log; without one, traces that are not recorded."""
        if self._estimation is None:
            return self._no_traces
        trace = self._estimation.recorder.trace
        return [trace(group) or none for group, none in zip(_GROUPS, self._no_traces, strict=True)]

    def pass_by(self) -> tuple[int, MagSample | None, BaroSample | None]:
        """Count the new rows; return the bits of HIL_SENSOR's fields in the last tick, and the newest samples."""
        estimation, sensors = self._estimation, self._sensors
        if estimation is None or sensors is None:
            return 0, None, None
        mag_us, baro_us, is_mag_new, is_baro_new, *rows, truth_us = self._marks[0].item()
        if truth_us != NEVER_US:
            estimation.recorder.pass_by(truth_us)
            for trace, new in zip(self._open_traces(), rows, strict=True):
                trace.n += new
        values = HilValues(*sensors.values.tolist())
        mag = MagSample(mag_us * 1e-6, Vector3(*values.mag_gauss)) if mag_us else None
        baro = (
            BaroSample(baro_us * 1e-6, values.pressure_hpa, values.altitude_m, values.temperature_c)
            if baro_us
            else None
        )
        return is_mag_new * MAG_FIELDS | is_baro_new * BARO_FIELDS, mag, baro
