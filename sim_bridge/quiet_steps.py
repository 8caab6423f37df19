"""Hands the arrays of plant and sensors to the kernel of quiet steps: those without a fault or another message."""

from __future__ import annotations

from typing import Any

import numpy as np

from flightstack.core.compiled import IS_DISABLED
from flightstack.core.contract import ByteArray, FloatArray, RecordArray, SingleArray
from flightstack.core.kernels.calls import address_of, as_bytes
from flightstack.core.periods import NEVER_US
from flightstack.simulator_link.battery_frame import BatteryReport
from flightstack.simulator_link.frame_kernels import SENSOR_NEWS
from flightstack.simulator_link.gps_kernels import GPS_SIZE
from flightstack.simulator_link.sensor_frames import BARO as BARO_FIELDS
from flightstack.simulator_link.sensor_frames import HIL_VALUES, VALUES
from flightstack.simulator_link.sensor_frames import MAG as MAG_FIELDS
from sim_bridge.plant.battery import INTERVAL_US as BATTERY_INTERVAL_US
from sim_bridge.plant.battery import STATE_COLUMNS, BatteryState, note_battery
from sim_bridge.plant.compiled_plant import CompiledPlant
from sim_bridge.plant.layout import CONTACT
from sim_bridge.plant.near_ground import airspeed
from sim_bridge.sensors.barometer import Barometer, measure_baro
from sim_bridge.sensors.gnss import receive_gnss
from sim_bridge.sensors.imu import measure_imu
from sim_bridge.sensors.layout import IMU, MOTION
from sim_bridge.sensors.magnetometer import Magnetometer, measure_mag
from sim_bridge.sensors.suite import BARO_SLOT, MAG_SLOT
from sim_bridge.simulator import Simulator
from sim_bridge.step_kernel import BARO, MAG, STEP_CALLS, StepCalls, simulate

assert (MAG_SLOT, BARO_SLOT) == (MAG, BARO)
_NO_BYTES = np.zeros(0, np.uint8)
_NO_SENSOR: tuple[Any, ...] = (_NO_BYTES, np.zeros(3), np.zeros((0, 0)), np.zeros(1, np.int64))
_MOST_REPORTS = 8
"""Of the battery in one call."""
_NO_TIMES, _NO_FIX = np.full(1, NEVER_US), np.zeros(0)
_NO_RECEIVER: tuple[Any, ...] = (
    (
        _NO_BYTES,
        *(_NO_TIMES,) * 3,
        np.zeros((0, 0)),
        _NO_TIMES,
        _NO_FIX,
        _NO_FIX,
        np.zeros((0, 0)),
        _NO_TIMES,
    ),
    _NO_TIMES,
    _NO_FIX,
)


def compiles(simulator: Simulator) -> bool:
    """Return True if the plant is compiled Python."""
    return not IS_DISABLED and type(simulator.plant) is CompiledPlant


def _sensor(sensor: Magnetometer | Barometer | None) -> tuple[Any, ...]:
    """Return record, output, deviates and their cursor of a sensor."""
    if sensor is None:
        return _NO_SENSOR
    return as_bytes(sensor.records), sensor.out, sensor.noise.block, sensor.noise.cursor


class QuietSteps:
    """The kernel of the quiet steps of a simulator for which ``compiles`` is True, with its arguments.

    The steps are those of its sensors and of its interval now; others need others.
    """

    def __init__(self, simulator: Simulator, commands: FloatArray, taken: memoryview | None = None) -> None:
        """``commands`` are rotor speeds [rad/s], shape (8,). ``taken`` gets a copy of the frame of each true state."""
        assert isinstance(simulator.plant, CompiledPlant)
        self._simulator, self._plant = simulator, simulator.plant
        self._sensors = simulator.sensors
        self._interval_us = simulator.interval_us
        self.commands = commands
        sensors = simulator.sensors
        self.wires: SingleArray = np.zeros((0, 6), np.float32) if sensors is None else sensors.wires
        """Measurements of the inertial sensors as in HIL_SENSOR, shape (sensors, 6)."""
        self.values: SingleArray = np.zeros(VALUES, np.float32) if sensors is None else sensors.values
        """Measurements in HIL_SENSOR of the first inertial sensor, shape (13,)."""
        self.news: RecordArray = np.zeros(1, SENSOR_NEWS)
        """New measurements in the last step, besides those of the inertial sensors."""
        self.gps: ByteArray = np.zeros(GPS_SIZE, np.uint8)
        """Payload of HIL_GPS with the newest fix."""
        plant = (
            as_bytes(self._plant.memory), commands, simulator.steps, as_bytes(self._plant.output), CONTACT,
            *self._copied(taken),
        )  # fmt: skip
        sensing = self._sensing()
        self.least_charge = np.zeros(1)
        """Charge up to which a step with a report of the battery is the last one."""
        self._reports = np.zeros((_MOST_REPORTS, STATE_COLUMNS)), np.zeros(_MOST_REPORTS, np.int64)
        self._report_count = np.zeros(1, np.int64)
        period_us = np.full(1, BATTERY_INTERVAL_US)
        battery = (
            simulator.battery_due_us, period_us, self.least_charge, *self._reports, self._report_count
        )  # fmt: skip
        self.world: tuple[Any, ...] = (
            self._addresses(sensing), plant, sensing, self._slow(), self.news, battery
        )  # fmt: skip
        """Argument ``world`` of ``simulate``."""
        self.step = address_of(simulate, self.world, 0, 0)
        """Address of ``simulate``."""

    def _copied(self, taken: memoryview | None) -> tuple[Any, Any]:
        """Return the bytes that a step copies, and where to."""
        if taken is None:
            return _NO_BYTES.copy(), _NO_BYTES.copy()
        return as_bytes(self._simulator.frame.frame), as_bytes(taken)

    def _sensing(self) -> tuple[Any, ...]:
        sensors, truth = self._sensors, self._simulator.frame
        if sensors is None:
            motion, imus, noise = np.zeros(1, MOTION), np.zeros(0, IMU), np.zeros((0, 0, 0))
        else:
            motion, imus, noise = sensors.imus.motion, sensors.imus.records, sensors.imus.noise
        return motion, imus, truth.state, truth.rotor_speed_rad_s, noise, self.wires

    def _slow(self) -> tuple[Any, ...]:
        sensors, parts = self._sensors, self.values.view(HIL_VALUES)
        if sensors is None:
            never_us, current_a = np.full(2, NEVER_US), np.zeros(1)
            mag, gnss = (*_NO_SENSOR, current_a), (*_NO_RECEIVER, self.gps)
            return never_us, np.ones(2, np.int64), parts, mag, _NO_SENSOR, gnss
        mag, gnss = (*_sensor(sensors.mag), self._plant.currents_a), _NO_RECEIVER
        if (receiver := sensors.gnss) is not None:
            gnss = (as_bytes(receiver.records), *receiver.arguments[1:]), receiver.due_us, receiver.sent
        return sensors.due_us, sensors.period_us, parts, mag, _sensor(sensors.baro), (*gnss, self.gps)

    def _addresses(self, sensing: tuple[Any, ...]) -> RecordArray:
        plant, frame, sensors = self._plant, self._simulator.frame, self._sensors
        calls = StepCalls(
            address_of(plant.kernel, plant.memory, self.commands, 0, 1, plant.output), 0, 0, 0, 0, 0,
            address_of(note_battery, plant.memory, self._reports[0][0]),
        )  # fmt: skip
        if sensors is not None:
            calls = calls._replace(
                measure=address_of(measure_imu, *sensing), airspeed=address_of(airspeed, plant.memory)
            )
            if (mag := sensors.mag) is not None:
                address = address_of(measure_mag, mag.records, frame.state, 0.0, mag.noise.block[0])
                calls = calls._replace(measure_mag=address)
            if (baro := sensors.baro) is not None:
                speeds, deviates = frame.rotor_speed_rad_s, baro.noise.block[0]
                address = address_of(measure_baro, baro.records, 0, frame.state, 0.0, speeds, deviates)
                calls = calls._replace(measure_baro=address)
            if (gnss := sensors.gnss) is not None:
                calls = calls._replace(receive_gnss=address_of(receive_gnss, gnss.arguments, 0, frame.state))
        return np.array([calls], STEP_CALLS)

    def fits(self, simulator: Simulator, commands: FloatArray) -> bool:
        """Return True if these are the steps of ``simulator`` as it is now, with the commands."""
        is_same = simulator is self._simulator and simulator.sensors is self._sensors
        return is_same and commands is self.commands and simulator.interval_us == self._interval_us

    def room(self) -> int:
        """Return for how many steps there are deviates, if no fault acts between steps of the plant."""
        sensors, steps = self._sensors, self._plant.quiet_steps() // self._simulator.steps
        if sensors is None:
            return steps
        measuring = sensors.mag, sensors.baro, sensors.gnss
        slow = [sensor.noise.ready() for sensor in measuring if sensor is not None]
        return min(steps, sensors.imus.rows_left(), *slow)

    def take_reports(self) -> list[tuple[int, BatteryReport]]:
        """Return the reports of the battery since the last call, with their times by the simulator's clock [µs]."""
        count = int(self._report_count[0])
        if not count:
            return []
        self._report_count[0] = 0
        rows, times_us = self._reports
        reports = [self._simulator.battery_report(BatteryState(*row)) for row in rows[:count].tolist()]
        return list(zip(times_us[:count].tolist(), reports, strict=True))

    def pass_by(self, count: int, result: int) -> None:
        """Count steps that the kernel made, with the result of the last one; raise PlantDivergedError."""
        has_mag, has_baro, _has_gnss = self.news[0].item()
        self._simulator.pass_by(count, result, has_mag * MAG_FIELDS | has_baro * BARO_FIELDS)
