"""Quiet ticks with a simulator in another process: exchanges over the socket without Python between them."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from flightstack.core.contract import ByteArray, FloatArray, RecordArray, SingleArray
from flightstack.core.kernels.calls import address_of, as_bytes
from flightstack.params.config import TRUTH, StackConfig
from flightstack.process.assembly import Stack, build
from flightstack.process.connections import PAUSE_NS
from flightstack.process.exchange_kernel import EXCHANGE, Exchange, exchange
from flightstack.process.quiet_block import QuietBlock, compiles, least_charge
from flightstack.process.quiet_sensors import estimators_of
from flightstack.simulator_link.battery_frame import BATTERY_SHAPE, BatteryReport, report_in
from flightstack.simulator_link.battery_kernels import BATTERY_SIZE
from flightstack.simulator_link.frame_kernels import SENSOR_NEWS, SHAPE
from flightstack.simulator_link.gps_kernels import GPS_SIZE
from flightstack.simulator_link.sensor_frames import (
    ACCEL,
    BARO,
    GPS_SHAPE,
    GYRO,
    MAG,
    SENSOR_SHAPE,
    VALUES,
)
from flightstack.transports import compiled_socket
from flightstack.transports.compiled_socket import CompiledSocket

MOST = 1000
"""Exchanges of a call at most: two seconds of simulated time, which the deadline of the ground links cuts short."""


_MOST_REPORTS = 8
"""Of the battery in one call."""


class Span(NamedTuple):
    """When the ticks of a call begin and end, by the monotonic clock."""

    began_ns: int
    deadline_ns: int
    """Time after which the next outer tick ends them."""
    ends_in_pause: bool = False
    """True if they end where the simulator sends nothing for ``PAUSE_NS``."""


class ExchangedSteps:
    """The simulator's kernel is an exchange with its process; see ``QuietSimulator``."""

    def __init__(self, stack: Stack, descriptor: int) -> None:
        """``descriptor`` is that of the socket."""
        self._stack, link, inbox = stack, stack.simulator, stack.simulator.sensors
        answer, plant = link.actuators, link.plant
        self.socket = CompiledSocket(descriptor)
        self.commands: FloatArray = answer.rotor_speed_rad_s
        self.values: SingleArray = np.zeros(VALUES, np.float32) if inbox is None else inbox.frame.values
        count = len(estimators_of(stack))
        self.wires: SingleArray = (
            self.values[:6].reshape(1, 6) if count == 1 else np.zeros((count, 6), np.float32)
        )
        self.news: RecordArray = np.zeros(1, SENSOR_NEWS)
        self.gps: ByteArray = np.zeros(GPS_SIZE, np.uint8)
        self._estimation, self._autopilot = stack.estimation, stack.parts.autopilot
        self._link, self._interval_us = link, stack.rates.interval_us
        self.record: RecordArray = np.zeros(1, EXCHANGE)
        frame = as_bytes(answer.frame)
        self.record[0] = Exchange(
            frame.ctypes.data, answer.shape.size, answer.shape.extra, self._interval_us, int(ACCEL | GYRO),
            int(MAG), int(BARO), False, 0.0, 0, 0, stack.rates.divisor * self._interval_us, 0, False, PAUSE_NS, 0, 0,
        )  # fmt: skip
        self._took_ns = np.zeros(MOST, np.int64)
        shapes = np.array([[plant.shape], [SENSOR_SHAPE], [GPS_SHAPE], [BATTERY_SHAPE]], SHAPE)
        self._reports = np.zeros((_MOST_REPORTS, BATTERY_SIZE), np.uint8), np.zeros(_MOST_REPORTS, np.int64)
        self._report_count = np.zeros(1, np.int64)
        values, wires = self.values.view(np.uint8), self.wires.view(np.uint8)
        taking = (
            shapes, as_bytes(plant.frame), wires, values, self.news, self.gps, np.zeros(count, np.int64),
            (*self._reports, self._report_count),
        )  # fmt: skip
        self.world: tuple[Any, ...] = (self.socket.arguments, self.record, frame, self._took_ns, taking)
        self.step = address_of(exchange, self.world, 0, 0)

    def begin(self, span: Span) -> None:
        """Prepare for ticks in ``span``."""
        self.socket.clear()
        record = self.record
        record["deadline_ns"], record["ended_ns"] = span.deadline_ns, span.began_ns
        record["outer_us"] = self._link.stamp_us + self._autopilot.next_outer * self._interval_us
        record["waited_ns"], record["began"] = 0, 0
        record["ends_in_pause"] = span.ends_in_pause
        record["least_charge"] = least_charge(self._stack)
        record["takes_fixes"] = self._estimation is not None and self._estimation.takes_fixes

    def room(self) -> int:
        """Return how many exchanges a call can make."""
        return MOST - int(self.record["began"][0])

    def take_reports(self) -> list[tuple[int, BatteryReport]]:
        """Return the reports of the battery since the last call, with their times by the simulator's clock [µs]."""
        count, (payloads, times_us) = int(self._report_count[0]), self._reports
        self._report_count[0] = 0
        return [(int(times_us[k]), report_in(payloads[k].tobytes())) for k in range(count)]

    def pass_by(self, count: int, result: int) -> None:
        """Count steps: the link has counted them."""

    @property
    def took_ns(self) -> Any:
        """Durations of the ticks whose answer was sent."""
        return self._took_ns[: int(self.record["began"][0])]


def compile_any() -> None:
    """Compile the kernels of quiet ticks with those of a vehicle on the true state: for others they are the same."""
    compile_kernels(build(StackConfig(state=TRUTH), lambda: None))


def compile_kernels(stack: Stack) -> None:
    """Compile the kernels of quiet ticks, or load them from the cache, if they can run."""
    if compiled_socket.IS_AVAILABLE and compiles(stack):
        QuietBlock(stack, ExchangedSteps(stack, -1))
