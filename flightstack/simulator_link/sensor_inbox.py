"""Sensor messages of a simulator that speaks PX4's contract, in the vehicle's time.

HIL_SENSOR of id 0 is the clock. Messages before it, of other inertial sensors or of GNSS, get its time: simulators may
stamp them by other clocks, and PX4 ignores their stamps as well. HIL_SENSOR of another id that follows the clock with
the same stamp, as a simulator for PX4 sends it, gets the time of this clock.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

from flightstack.core.contract import SingleArray
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Message
from flightstack.simulator_link.sensor_frames import (
    ACCEL,
    GYRO,
    HIL_GPS_ID,
    HIL_SENSOR_ID,
    HilGps,
    HilMeasurement,
    HilSensorFrame,
    HilValues,
    decode_gps,
    gps_of,
)

_IMU = ACCEL | GYRO
_DISTANCE_ID = mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR
_FLOW_ID = mavlink.MAVLINK_MSG_ID_HIL_OPTICAL_FLOW
MOST_WAITING = 64
"""Reports that are kept until they are taken; the oldest ones are dropped."""


class HilReport(NamedTuple):
    """Measurements of one HIL_SENSOR, as in ``HilSensorFrame``; valid where ``fields`` has their bits."""

    number: int
    fields: int
    wire: SingleArray
    """A copy, which later frames do not change, shape (13,)."""
    step_us: int
    """Time since the last inertial measurement of this sensor; 0 in the first one, and in a report without one.

    It includes the time of measurements that were lost or not taken, so that the sum is the time that passed.
    """

    @property
    def values(self) -> HilValues:
        """The measurements by name."""
        return HilValues(*self.wire.tolist())


class RangeReport(NamedTuple):
    """A distance downwards; ``quality`` 0 to 1, 0 for none."""

    distance_m: float
    quality: float


class FlowReport(NamedTuple):
    """Optical flow and the rotation of the gyro over ``dt_s`` [rad]."""

    dt_s: float
    flow_rad: tuple[float, float]
    gyro_rad: tuple[float, float, float]
    quality: float


Content: TypeAlias = HilReport | HilGps | RangeReport | FlowReport


class Report(NamedTuple):
    """A sensor message with its vehicle time."""

    time_us: int
    content: Content


class SensorInbox:
    """Collects sensor messages until they are taken."""

    def __init__(self) -> None:
        self.frame = HilSensorFrame()
        """The newest HIL_SENSOR."""
        self._waiting: list[Content] = []
        self._reports: list[Report] = []
        self._time_us, self._stamp_us = 0, -1  # of the last clock
        self._measured_us: dict[int, int] = {}  # last inertial measurement of each sensor

    @property
    def imu_count(self) -> int:
        """Number of inertial sensors that have measured; 0 if their numbers do not follow each other from 0."""
        count = len(self._measured_us)
        return count if self._measured_us.keys() == set(range(count)) else 0

    @property
    def clock_us(self) -> int:
        """Time stamp of the newest HIL_SENSOR."""
        return self.frame.time_us

    def open(self, frame: bytes | memoryview) -> bool | None:
        """Take a frame of a sensor message; return True for the clock, None if it is another message.

        After True call ``stamp``.
        """
        message_id = frame[7] | frame[8] << 8 | frame[9] << 16 if len(frame) > 9 else -1
        if message_id == HIL_SENSOR_ID and self.frame.open(frame):
            return self._take_sensor()
        if message_id == HIL_GPS_ID and (gps := decode_gps(frame)) is not None:
            self._wait(gps)
            return False
        return None

    def take_measurements(self, time_us: int, measurements: Sequence[HilMeasurement]) -> None:
        """Take the contents of HIL_SENSOR by their id; then call ``stamp``, for the first one is the clock."""
        for number in range(len(measurements) - 1, 0, -1):
            values, fields = measurements[number]
            self._wait(HilReport(number, fields, values.copy(), 0))
        self.frame.set(time_us, measurements[0])

    def take_message(self, message: Message) -> bool:
        """Take a message of the general decoder; return True for the clock. After True call ``stamp``."""
        kind = message.get_msgId()
        if kind == HIL_SENSOR_ID:
            self.frame.take(message)
            return self._take_sensor()
        if kind == HIL_GPS_ID:
            self._wait(gps_of(message))
        elif kind == _DISTANCE_ID and message.orientation == mavlink.MAV_SENSOR_ROTATION_PITCH_270:
            in_range = message.min_distance <= message.current_distance <= message.max_distance
            # 0 is an unknown quality, 1 an invalid signal
            quality = 0.0 if message.signal_quality == 1 or not in_range else 1.0
            self._wait(RangeReport(message.current_distance * 0.01, quality))
        elif kind == _FLOW_ID:
            m = message
            flow, gyro = (
                (m.integrated_x, m.integrated_y),
                (m.integrated_xgyro, m.integrated_ygyro, m.integrated_zgyro),
            )
            self._wait(FlowReport(m.integration_time_us * 1e-6, flow, gyro, m.quality / 255.0))
        return False

    @property
    def is_quiet(self) -> bool:
        """True if no message waits, and the inertial sensors have measured at the last clock."""
        waits, measured_us = self._waiting or self._reports, self._measured_us
        return not waits and 0 in measured_us and set(measured_us.values()) == {self._time_us}

    def pass_by(self, time_us: int, stamp_us: int) -> None:
        """Count the measurements of the inertial sensors to a clock as taken: they went to the estimator directly."""
        self._time_us, self._stamp_us = time_us, stamp_us
        self._measured_us = dict.fromkeys(self._measured_us, time_us)

    def _take_sensor(self) -> bool:
        frame = self.frame
        if frame.number == 0:
            return True
        if frame.time_us == self._stamp_us:
            self._report(self._time_us, frame.number, frame.fields, frame.values.copy())
        else:
            self._wait(HilReport(frame.number, frame.fields, frame.values.copy(), 0))
        return False

    def _wait(self, content: Content) -> None:
        if len(self._waiting) == MOST_WAITING:
            del self._waiting[0]
        self._waiting.append(content)

    def stamp(self, time_us: int) -> None:
        """Give the messages since the last clock, and the clock's own measurements, their vehicle time."""
        frame = self.frame
        if self._waiting:
            for content in self._waiting:
                if isinstance(content, HilReport):
                    self._report(time_us, *content[:3])
                else:
                    self._reports.append(Report(time_us, content))
            self._waiting.clear()
        self._time_us, self._stamp_us = time_us, frame.time_us
        self._report(time_us, 0, frame.fields, frame.values.copy())
        if len(self._reports) > MOST_WAITING:
            self._drop(len(self._reports) - MOST_WAITING)

    def _report(self, time_us: int, number: int, fields: int, wire: SingleArray) -> None:
        """Report the measurements of a HIL_SENSOR with the duration of the inertial one."""
        step_us = 0
        if fields & _IMU == _IMU:
            step_us = time_us - self._measured_us.get(number, time_us)
            self._measured_us[number] = time_us
        self._reports.append(Report(time_us, HilReport(number, fields, wire, step_us)))

    def _drop(self, count: int) -> None:
        """Drop the oldest reports; the next inertial measurement of each sensor lasts as long as all of them."""
        lost_us: dict[int, int] = {}
        kept: list[Report] = []
        for index, report in enumerate(self._reports):
            content = report.content
            if isinstance(content, HilReport) and content.fields & _IMU == _IMU:
                step_us = content.step_us + lost_us.pop(content.number, 0)
                if index < count:
                    lost_us[content.number] = step_us
                report = report._replace(content=content._replace(step_us=step_us))  # noqa: PLW2901
            if index >= count:
                kept.append(report)
        self._reports = kept

    def take(self) -> list[Report]:
        """Return the new reports, oldest first, and clear them."""
        reports, self._reports = self._reports, []
        return reports
