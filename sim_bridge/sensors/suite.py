"""The sensors of a vehicle in one simulation: their rates, faults and messages.

The inertial sensors measure in each exchange, the others at their own rates, at the first exchange at or after each
multiple of their period. The messages are those that PX4 expects of a simulator: HIL_SENSOR with the bits of what is
new, HIL_GPS, DISTANCE_SENSOR and HIL_OPTICAL_FLOW. HIL_SENSOR of the first inertial sensor is the last one, because its
time is the clock of the vehicle: what arrives before it belongs to the same instant.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from flightstack.core.contract import FloatArray, RecordArray
from flightstack.core.earth_field import earth_field_ned_gauss
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.core.portable_math import sin_cos
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.fields import whole
from flightstack.mavlink.link import Link, Message
from flightstack.params.vehicle import Vehicle
from flightstack.simulator_link.hot_frames import PlantStateFrame
from flightstack.simulator_link.sensor_frames import (
    ACCEL,
    ACCEL_AT,
    ALTITUDE_AT,
    BARO,
    GYRO,
    GYRO_AT,
    MAG,
    MAG_AT,
    PRESSURE_AT,
    TEMPERATURE_AT,
    HilGps,
    HilSensorFrame,
    encode_gps,
)
from sim_bridge.plant.fault_table import Fault, Kind
from sim_bridge.plant.plant import Plant
from sim_bridge.sensors.barometer import Barometer
from sim_bridge.sensors.faults import HEALTHY, Channel, channel_faults
from sim_bridge.sensors.gnss import Fix, GnssReceiver
from sim_bridge.sensors.imu import ImuSet
from sim_bridge.sensors.magnetometer import Magnetometer
from sim_bridge.sensors.noise import UniformStream
from sim_bridge.sensors.optical_flow import OpticalFlow
from sim_bridge.sensors.rangefinder import Rangefinder

_DEGREE = math.pi / 180.0
_IMU = ACCEL | GYRO
_NEVER_US = 1 << 64
_UNKNOWN_VARIANCE = 255


class _Task(NamedTuple):
    """A sensor with a rate of its own."""

    period_us: int
    measure: Callable[[int], None]


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
        seed: int,
        truth: PlantStateFrame,
        plant: Plant,
        sender: Sender,
    ) -> None:
        self._truth, self._plant, self._sender = truth, plant, sender
        self._link = Link(*sender)
        self._frame = LocalFrame(home)
        numbers = vehicle.sensors.numbers
        self.imus = ImuSet(vehicle, seed, truth.state)
        count = len(self.imus.records)
        self._frames = [HilSensorFrame(*sender) for _ in range(count)]
        self._fields = [_IMU] * count
        self._wires = [
            (frame.values[:6], self.imus.records["wire"][index]) for index, frame in enumerate(self._frames)
        ]
        self._gps_seq = 0
        self._messages: list[bytes] = []
        self._channels: dict[tuple[str, int], Channel] = {}
        for index in range(count):
            self._channels["gyro", index] = Channel(self.imus.records, index, 0, _DEGREE)
            self._channels["accel", index] = Channel(self.imus.records, index, 1)
        self._losses = UniformStream(seed)
        self._has_faults = False
        self._imbalance = float(self.imus.motion[0]["imbalance"])
        self._tasks: list[_Task] = []
        if "mag" in numbers:
            self.mag = Magnetometer(vehicle, seed, earth_field_ned_gauss(home))
            self._mag_matrix: FloatArray = self.mag.records[0]["matrix"].copy()
            self._add("mag", self.mag.records, self._measure_mag)
        if "baro" in numbers:
            self.baro = Barometer(vehicle, seed, home.altitude_m)
            self._add("baro", self.baro.records, self._measure_baro)
        if "gnss" in numbers:
            self.gnss = GnssReceiver(vehicle, seed)
            self._add("gnss", self.gnss.records, self._measure_gnss)
        if "range" in numbers:
            self.range = Rangefinder(vehicle, seed)
            self._add("range", self.range.records, self._measure_range)
        if "flow" in numbers:
            self.flow = OpticalFlow(vehicle, seed)
            self._add("flow", self.flow.records, self._measure_flow)
        self._due_us = [0] * len(self._tasks)
        self._next_us = 0

    def _add(self, name: str, records: RecordArray, measure: Callable[[int], None]) -> None:
        self._channels[name, 0] = Channel(records)
        self._tasks.append(_Task(round(1e6 / float(records[0]["rate_hz"])), measure))

    def set_interval_us(self, interval_us: int) -> None:
        """Set the time between two exchanges."""
        self.imus.set_step(interval_us * 1e-6)

    # ------------------------------------------------------------------ faults

    def set_faults(self, active: Iterable[Fault]) -> None:
        """Set the active faults; those of an earlier call end."""
        causes = [fault for fault in active if fault.sensor]
        faults = channel_faults(causes, len(self.imus.records))
        self._has_faults = bool(faults)
        for key, channel in self._channels.items():
            channel.set(faults.get(key, HEALTHY), self._losses)
        values = {fault.kind: fault.value for fault in causes}
        self.imus.motion[0]["imbalance"] = self._imbalance * values.get(Kind.VIBRATION, 1.0)
        if ("mag", 0) in self._channels:
            sine, cosine = sin_cos(values.get(Kind.MAG_TURN, 0.0) * _DEGREE)
            turn = np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])
            self.mag.records[0]["matrix"] = np.array(  # in this order on every processor, unlike BLAS
                [
                    [sum(float(a) * float(b) for a, b in zip(row, column, strict=True)) for column in turn.T]
                    for row in self._mag_matrix
                ]
            )
        if ("gnss", 0) in self._channels:
            self.gnss.lost_share = values.get(Kind.GNSS_JAM, 0.0)
            self.gnss.records[0]["fault_rate"] = self._channels["gnss", 0].rate

    # ------------------------------------------------------------------ measurements

    def measure(self, time_us: int) -> None:
        """Measure the present state, at the simulated time."""
        self.imus.measure(self._truth.state, self._truth.rotor_speed_rad_s)
        if self._has_faults:
            self._measure_faulty_imus(time_us)
        else:
            for index, (values, wire) in enumerate(self._wires):
                values[:] = wire
                self._fields[index] = _IMU
        if time_us >= self._next_us:
            self._measure_slow(time_us)

    def _measure_faulty_imus(self, time_us: int) -> None:
        for channel in self._channels.values():
            channel.update(time_us)
        for index, frame in enumerate(self._frames):
            out = self.imus.records["out"][index]
            fields = 0
            for name, at, part, bits in (
                ("gyro", GYRO_AT, out[:3], GYRO),
                ("accel", ACCEL_AT, out[3:], ACCEL),
            ):
                sent = self._channels[name, index].pass_on(time_us, part.copy())
                if sent is not None:
                    frame.values[at] = sent
                    fields |= bits
            self._fields[index] = fields

    def _measure_slow(self, time_us: int) -> None:
        for index, (period_us, measure) in enumerate(self._tasks):
            if time_us >= self._due_us[index]:
                self._due_us[index] = (time_us // period_us + 1) * period_us
                measure(time_us)
        self._next_us = min(self._due_us, default=_NEVER_US)
        if ("gnss", 0) in self._channels:
            self._send_fix(time_us)

    def _passed(self, name: str, time_us: int, out: FloatArray) -> FloatArray | None:
        """Return the output of a sensor that is sent, or None."""
        return self._channels[name, 0].pass_on(time_us, out.copy()) if self._has_faults else out

    def _measure_mag(self, time_us: int) -> None:
        self.mag.measure(self._truth.state, self._plant.current_a)
        sent = self._passed("mag", time_us, self.mag.out)
        if sent is not None:
            self._frames[0].values[MAG_AT] = sent
            self._fields[0] |= MAG

    def _measure_baro(self, time_us: int) -> None:
        self.baro.measure(self._truth.state, self._plant.airspeed_m_s(), self._truth.rotor_speed_rad_s)
        sent = self._passed("baro", time_us, self.baro.out)
        if sent is not None:
            values = self._frames[0].values
            values[PRESSURE_AT], values[ALTITUDE_AT], values[TEMPERATURE_AT] = sent.tolist()
            self._fields[0] |= BARO

    def _measure_gnss(self, time_us: int) -> None:
        self.gnss.measure(time_us, self._truth.state)

    def _send_fix(self, time_us: int) -> None:
        """Send the fix that is due; until then look again in each exchange."""
        fix = self.gnss.due(time_us)
        if fix is not None:
            fix = self._channels["gnss", 0].pass_on(time_us, fix)
        if fix is not None:
            self._messages.append(self._gps_frame(time_us, fix))
        self._next_us = min(self._next_us, self.gnss.next_due_us)

    def _gps_frame(self, time_us: int, fix: Fix) -> bytes:
        geo = self._frame.to_geo(fix.position_ned_m)
        seq, self._gps_seq = self._gps_seq, (self._gps_seq + 1) & 255
        gps = HilGps(
            time_us, geo.latitude_deg, geo.longitude_deg, geo.altitude_m, fix.eph_m, fix.epv_m,
            fix.velocity_ned_m_s, fix.fix_type, fix.satellites,
        )  # fmt: skip
        return encode_gps(gps, seq, *self._sender)

    def _measure_range(self, time_us: int) -> None:
        self.range.measure(self._truth.state)
        sent = self._passed("range", time_us, self.range.records["out"][0])
        if sent is not None:
            self._messages.append(self._link.encode(self._distance_message(time_us, *sent.tolist())))

    def _distance_message(self, time_us: int, distance_m: float, quality: float) -> Message:
        sensor = self.range.records[0]
        return mavlink.MAVLink_distance_sensor_message(
            time_us // 1000,
            whole(float(sensor["min_m"]) * 100.0, 0, 65535),
            whole(float(sensor["max_m"]) * 100.0, 0, 65535),
            whole(distance_m * 100.0, 0, 65535),
            mavlink.MAV_DISTANCE_SENSOR_LASER,
            0,
            mavlink.MAV_SENSOR_ROTATION_PITCH_270,
            _UNKNOWN_VARIANCE,
            signal_quality=100 if quality > 0.0 else 1,
        )

    def _measure_flow(self, time_us: int) -> None:
        self.flow.measure(self._truth.state)
        sent = self._passed("flow", time_us, self.flow.records["out"][0])
        if sent is not None:
            self._messages.append(self._link.encode(self._flow_message(time_us, *sent.tolist())))

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

    def frames(self, stamp_us: int) -> bytes:
        """Return the messages of the present measurements, HIL_SENSOR of the first inertial sensor last."""
        parts = self._messages
        for number in range(len(self._frames) - 1, -1, -1):
            parts.append(bytes(self._frames[number].seal(stamp_us, self._fields[number], number)))
        self._messages = []
        return b"".join(parts)
