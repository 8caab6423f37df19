"""The sensors of a vehicle in one simulation: their rates, faults and messages.

The inertial sensors measure in each exchange, the others at their own rates, at the first exchange at or after each
multiple of their period. The messages are those that PX4 expects of a simulator: HIL_SENSOR with the bits of its
new fields, HIL_GPS, DISTANCE_SENSOR and HIL_OPTICAL_FLOW.

The time of HIL_SENSOR of the first inertial sensor is the clock of the vehicle. The flight stack gives all messages
before it the same time, so that it comes last. PX4 sets its clock on this message and stamps the other ones with its
clock when it reads them (SimulatorMavlink.cpp, ``handle_message_hil_sensor``), so that for PX4 it comes first: sent
last, a second inertial sensor would be one step old.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from flightstack.core.contract import FloatArray, RecordArray, SingleArray
from flightstack.core.geodesy import GeoPoint, earth_field_ned_gauss
from flightstack.core.periods import NEVER_US, next_due
from flightstack.core.portable_math import sin_cos
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link, Message
from flightstack.params.vehicle import Vehicle
from flightstack.simulator_link.gps_kernels import FixRow
from flightstack.simulator_link.hot_frames import PlantStateFrame
from flightstack.simulator_link.sensor_frames import (
    ACCEL,
    BARO,
    GYRO,
    MAG,
    HilMeasurement,
    HilSensorFrame,
    encode_gps,
    gps_buffer,
    gps_message,
)
from sim_bridge.plant.faults.table import Fault, Kind
from sim_bridge.plant.plant import Plant, PlantOptions
from sim_bridge.sensors.barometer import Barometer
from sim_bridge.sensors.faults import HEALTHY, Channel, channel_faults
from sim_bridge.sensors.gnss import GnssReceiver
from sim_bridge.sensors.imu import ImuSet
from sim_bridge.sensors.magnetometer import Magnetometer
from sim_bridge.sensors.optical_flow import OpticalFlow
from sim_bridge.sensors.rangefinder import Rangefinder, distance_message

_DEGREE = math.pi / 180.0
_IMU = ACCEL | GYRO
MAG_SLOT, BARO_SLOT, QUIET_SLOTS, SLOTS = 0, 1, 2, 4
"""Sensors by their index in ``due_us``, first those that quiet ticks measure as well, and its length."""


class _Sensor(NamedTuple):
    """A sensor with a rate of its own; ``measure`` returns the output, ``send`` puts it into a message.

    One that ``is_quiet`` is measured by quiet ticks as well. ``due_us`` is the time of the next call of ``measure``,
    which a sensor that returns None at times sets itself.
    """

    is_quiet: bool
    due_us: memoryview
    period_us: int
    channel: Channel
    measure: Callable[[int], Any]
    send: Callable[[int, Any], None]


class Sender(NamedTuple):
    """Identity of the simulator on the link."""

    system_id: int
    component_id: int


class SensorSuite:
    """Measures the true state in ``truth`` and encodes the measurements."""

    def __init__(
        self,
        vehicle: Vehicle,
        home: GeoPoint,
        options: PlantOptions,
        truth: PlantStateFrame,
        plant: Plant,
        sender: Sender,
    ) -> None:
        self._truth, self._plant, self._sender, self._seed = truth, plant, sender, options.seed
        seed = options.seed
        self._link = Link(*sender)
        self.imus = ImuSet(vehicle, seed, truth.state)
        count = len(self.imus.records)
        self._frames = [HilSensorFrame(*sender) for _ in range(count)]
        self._all_imus = [_IMU] * count
        self._fields = self._all_imus.copy()
        self._apart: SingleArray = np.zeros((count, 6), "<f4")  # measurements that go through channels
        self._wires = self._frames[0].values[:6].reshape(1, 6) if count == 1 else self._apart
        self.imu_wires: tuple[SingleArray, ...] = tuple(self._wires)
        """Newest measurement of each inertial sensor as in HIL_SENSOR: specific force and rates, shape (6,)."""
        self.gps_frame = gps_buffer(*sender)
        """A frame of HIL_GPS, with the sequence number of the newest one."""
        self._messages: list[bytes] = []
        self._channels: dict[tuple[str, int], Channel] = {}
        for index in range(count):
            for part, (name, scale) in enumerate((("gyro", _DEGREE), ("accel", 1.0))):
                key = (name, index)
                self._channels[key] = Channel(key, seed, self.imus.records, part, scale=scale)
        self._has_faults = False
        self._is_apart = False  # measurements of the inertial sensors go through their channels
        self._imbalance = float(self.imus.motion[0]["imbalance"])
        self._sensors: list[_Sensor] = []
        self.due_us = np.full(SLOTS, NEVER_US, np.int64)
        """Time of the next measurement of each sensor that is not inertial; never for one that is missing."""
        self.period_us = np.full(SLOTS, NEVER_US, np.int64)
        self._due_us = self.due_us.data
        self._add_slow_sensors(vehicle, home, options)
        self._next_us = self._next_other_us = 0

    def _add_slow_sensors(self, vehicle: Vehicle, home: GeoPoint, options: PlantOptions) -> None:
        """Add the sensors besides the IMU that the vehicle's file has."""
        numbers, seed = vehicle.sensors.numbers, self._seed
        self.mag: Magnetometer | None = None
        self.baro: Barometer | None = None
        self.gnss: GnssReceiver | None = None
        if "mag" in numbers:
            mag = self.mag = Magnetometer(vehicle, seed, earth_field_ned_gauss(home))
            self._mag_matrix: FloatArray = mag.records[0]["matrix"].copy()
            self._add(MAG_SLOT, "mag", mag.records, partial(self._measure_mag, mag), self._send_mag)
        if "baro" in numbers:
            baro = self.baro = Barometer(vehicle, seed, home.altitude_m)
            self._add(BARO_SLOT, "baro", baro.records, partial(self._measure_baro, baro), self._send_baro)
        if "gnss" in numbers:
            gnss = self.gnss = GnssReceiver(vehicle, seed, home)
            self._channels["gnss", 0] = channel = Channel(("gnss", 0), seed, gnss.records)
            receive = partial(self._receive_gnss, gnss)
            self._sensors.append(_Sensor(True, gnss.due_us.data, 1, channel, receive, self._send_fix))
        if "range" in numbers:
            self.range = Rangefinder(vehicle, options)
            self._add(2, "range", self.range.records, self._measure_range, self._send_range)
        if "flow" in numbers:
            self.flow = OpticalFlow(vehicle, options)
            self._add(3, "flow", self.flow.records, self._measure_flow, self._send_flow)

    def _add(
        self,
        slot: int,
        name: str,
        records: RecordArray,
        measure: Callable[[int], Any],
        send: Callable[[int, Any], None],
    ) -> None:
        channel = Channel((name, 0), self._seed, records)
        self._channels[name, 0] = channel
        period_us = round(1e6 / float(records[0]["rate_hz"]))
        self.due_us[slot], self.period_us[slot] = 0, period_us
        due_us = self.due_us[slot : slot + 1].data  # a number of an array takes four times as long to read
        self._sensors.append(_Sensor(slot < QUIET_SLOTS, due_us, period_us, channel, measure, send))

    def set_interval_us(self, interval_us: int) -> None:
        """Set the time between two exchanges."""
        self.imus.set_step(interval_us * 1e-6)

    # ------------------------------------------------------------------ faults

    def set_faults(self, active: Iterable[Fault], time_us: int) -> None:
        """Set the active faults at ``time_us``; those of an earlier call end."""
        causes = [fault for fault in active if fault.sensor]
        faults = channel_faults(causes, len(self.imus.records))
        self._has_faults = bool(faults)
        for key, channel in self._channels.items():
            channel.set(faults.get(key, HEALTHY), time_us)
        self._is_apart = not all(
            channel.is_direct for (name, _), channel in self._channels.items() if name in ("gyro", "accel")
        )
        values = {fault.kind: fault.value for fault in causes}
        self.imus.motion[0]["imbalance"] = self._imbalance * values.get(Kind.VIBRATION, 1.0)
        if self.mag is not None:
            sine, cosine = sin_cos(values.get(Kind.MAG_TURN, 0.0) * _DEGREE)
            turn = np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])
            self.mag.records[0]["matrix"] = np.array(  # in this order on every processor, unlike BLAS
                [
                    [sum(float(a) * float(b) for a, b in zip(row, column, strict=True)) for column in turn.T]
                    for row in self._mag_matrix
                ]
            )
        if self.gnss is not None:
            self.gnss.jam(values.get(Kind.GNSS_JAM, 0.0))
            self.gnss.records[0]["fault_rate"] = self._channels["gnss", 0].rate

    # ------------------------------------------------------------------ measurements

    def prime(self, time_us: int) -> None:
        """Measure once without a message, so that a sensor that is frozen from the start has a measurement."""
        self.imus.measure(self._truth.state, self._truth.rotor_speed_rad_s, self._apart)
        for sensor in self._sensors:
            sensor.measure(time_us)
        if self.gnss is not None:
            self.gnss.restart()

    def measure(self, time_us: int) -> None:
        """Measure the present state, at the simulated time."""
        if self._has_faults:
            for channel in self._channels.values():
                channel.update(time_us)
        truth = self._truth
        if self._is_apart:
            self.imus.measure(truth.state, truth.rotor_speed_rad_s, self._apart)
            for index in range(len(self._frames)):
                self._pass_on_imu(time_us, index)
        else:
            self.imus.measure(truth.state, truth.rotor_speed_rad_s, self._wires)
            self._fields[:] = self._all_imus
        if time_us >= self._next_us:
            self._measure_slow(time_us)

    @property
    def wires(self) -> SingleArray:
        """``imu_wires`` as one array, shape (sensors, 6)."""
        return self._wires

    def pass_by(self, count: int, fields: int) -> None:
        """Count quiet measurements that kernels made; ``fields`` are those of other sensors in the last one."""
        self.imus.take_rows(count)
        self._fields[:] = self._all_imus
        self._fields[0] |= fields
        self._next_us = min(*self._due_us[:QUIET_SLOTS], self.next_fix_us, self._next_other_us)

    @property
    def raw_frames(self) -> list[memoryview]:
        """The frame of HIL_SENSOR of each inertial sensor, with a payload that is not truncated."""
        return [frame.frame for frame in self._frames]

    @property
    def values(self) -> SingleArray:
        """Newest values of HIL_SENSOR of the first inertial sensor, in the order of the message."""
        return self._frames[0].values

    @property
    def parts(self) -> RecordArray:
        """``values`` as a record of ``HIL_VALUES``, shape (1,)."""
        return self._frames[0].parts

    @property
    def is_quiet(self) -> bool:
        """True while ``measure`` before ``next_us`` changes ``imu_wires`` alone: there are no faults.

        Before ``next_other_us``, it also changes what magnetometer, barometer and GNSS receiver measure.
        """
        return not (self._has_faults or self._is_apart or self._messages)

    @property
    def next_us(self) -> int:
        """Time of the next measurement of a sensor that is not inertial."""
        return self._next_us

    @property
    def next_other_us(self) -> int:
        """Time of the next measurement of a sensor that quiet ticks do not measure, or of the next late message."""
        return self._next_other_us

    @property
    def next_fix_us(self) -> int:
        """Time of the next measurement or message of the GNSS receiver."""
        return NEVER_US if self.gnss is None else int(self.gnss.due_us[0])

    @property
    def measurements(self) -> Sequence[HilMeasurement]:
        """Contents of HIL_SENSOR of each inertial sensor; none if there are other messages."""
        if self._messages:
            return ()
        self._fill_frames()
        return [
            HilMeasurement(frame.values, fields)
            for frame, fields in zip(self._frames, self._fields, strict=True)
        ]

    def _fill_frames(self) -> None:
        """Copy measurements that go through no channels to the frames of several sensors."""
        if len(self._frames) > 1 and not self._is_apart:
            for frame, wire in zip(self._frames, self.imu_wires, strict=True):
                frame.values[:6] = wire

    def _pass_on_imu(self, time_us: int, index: int) -> None:
        """Send the measurement of an inertial sensor that its faults leave."""
        out, parts, fields = self.imus.records["out"][index], self._frames[index].parts[0], 0
        for name, key, part, bits in (
            ("gyro", "gyro_rad_s", out[:3], GYRO),
            ("accel", "accel_m_s2", out[3:], ACCEL),
        ):
            sent = self._channels[name, index].pass_on(time_us, part.copy())
            if sent is not None:
                parts[key] = sent
                fields |= bits
        self._fields[index] = fields

    def _measure_slow(self, time_us: int) -> None:
        next_us = next_other_us = NEVER_US
        for is_quiet, due_us, period_us, channel, measure, send in self._sensors:
            out, is_direct = None, channel.is_direct
            if time_us >= due_us[0]:
                due_us[0] = next_due(time_us, period_us)
                out = measure(time_us)
                if not is_direct:
                    out = channel.due(time_us) if out is None else channel.pass_on(time_us, out.copy())
            elif not is_direct:
                out = channel.due(time_us)
            if out is not None:
                send(time_us, out)
            sensor_us = due_us[0] if is_direct else min(due_us[0], channel.next_due_us)
            next_us = min(next_us, sensor_us)
            if not (is_quiet and is_direct):
                next_other_us = min(next_other_us, sensor_us)
        self._next_us, self._next_other_us = next_us, next_other_us

    def _measure_mag(self, mag: Magnetometer, _time_us: int) -> FloatArray:
        return mag.measure(self._truth.state, self._plant.current_a)

    def _send_mag(self, _time_us: int, out: FloatArray) -> None:
        self.parts["mag_gauss"] = out
        self._fields[0] |= MAG

    def _measure_baro(self, baro: Barometer, time_us: int) -> FloatArray:
        truth = self._truth
        return baro.measure(time_us, truth.state, self._plant.airspeed_m_s(), truth.rotor_speed_rad_s)

    def _send_baro(self, _time_us: int, out: FloatArray) -> None:
        parts = self.parts
        parts["pressure_hpa"], parts["altitude_m"], parts["temperature_c"] = out.tolist()
        self._fields[0] |= BARO

    def _receive_gnss(self, receiver: GnssReceiver, time_us: int) -> FloatArray | None:
        return receiver.receive(time_us, self._truth.state)

    def _send_fix(self, time_us: int, out: FloatArray) -> None:
        seq = self.gps_frame[4] = (self.gps_frame[4] + 1) & 255
        self._messages.append(encode_gps(gps_message(time_us, FixRow(*out.tolist())), seq, *self._sender))

    def _measure_range(self, _time_us: int) -> FloatArray:
        return self.range.measure(self._truth.state)

    def _send_range(self, time_us: int, out: FloatArray) -> None:
        message = distance_message(self.range.records[0], time_us, *out.tolist())
        self._messages.append(self._link.encode(message))

    def _measure_flow(self, _time_us: int) -> FloatArray:
        return self.flow.measure(self._truth.state)

    def _send_flow(self, time_us: int, out: FloatArray) -> None:
        self._messages.append(self._link.encode(self._flow_message(time_us, *out.tolist())))

    def _flow_message(self, time_us: int, about_x: float, about_y: float, quality: float) -> Message:
        dt_s = 1.0 / float(self.flow.records[0]["rate_hz"])
        gyro = (self.imus.records["out"][0][:3] * dt_s).tolist()
        return mavlink.MAVLink_hil_optical_flow_message(
            time_us,
            0,
            round(dt_s * 1e6),
            about_x * dt_s,
            about_y * dt_s,
            *gyro,
            0,
            round(255 * quality),
            0,
            -1.0,
        )

    # ------------------------------------------------------------------ messages

    def frames(self, stamp_us: int, clock_first: bool = False) -> bytes | memoryview:
        """Return the messages of the present measurements, valid until the next call.

        HIL_SENSOR of the first inertial sensor is the last one, or with ``clock_first`` the first.
        """
        if not self._messages and len(self._frames) == 1:
            return self._frames[0].seal(stamp_us, self._fields[0], 0)
        self._fill_frames()
        others, self._messages = self._messages, []
        imus = [
            bytes(frame.seal(stamp_us, fields, number))
            for number, (frame, fields) in enumerate(zip(self._frames, self._fields, strict=True))
        ]
        return b"".join(imus + others if clock_first else others + imus[::-1])
