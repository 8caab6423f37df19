"""Exchanges with the flight stack without Python, while the simulator has nothing else to do."""

from __future__ import annotations

from typing import Any

import numpy as np

from flightstack.core.compiled import direct
from flightstack.core.geodesy import GeoPoint
from flightstack.core.kernels.calls import as_bytes
from flightstack.mavlink.frames import HEADER_V2
from flightstack.params.vehicle import Vehicle
from flightstack.simulator_link.battery_frame import BATTERY_SHAPE
from flightstack.simulator_link.battery_kernels import BATTERY_SIZE
from flightstack.simulator_link.frame_kernels import SHAPE
from flightstack.simulator_link.hot_frames import GROUND_CONTACT_FLAG, LOCKSTEP_FLAG, VALID_FLAG
from flightstack.simulator_link.sensor_frames import ACCEL, BARO, GPS_SHAPE, GYRO, MAG, SENSOR_SHAPE
from flightstack.transports import compiled_socket
from flightstack.transports.compiled_socket import CompiledSocket
from sim_bridge import quiet_steps
from sim_bridge.plant.layout import CONTACT
from sim_bridge.quiet_steps import QuietSteps
from sim_bridge.server.endpoint import FlightStackEndpoint
from sim_bridge.server.exchange_kernel import EXCHANGES, Exchanges, serve_steps
from sim_bridge.simulator import Simulator

MOST = 1000
"""Steps of a call at most: a signal ends the process between two calls, or in a wait."""
_OUTBOX = 4096
_NO_FRAME = np.zeros(0, np.uint8)


class QuietExchanges:
    """Runs quiet exchanges of a link over a socket in lockstep at full speed."""

    def __init__(self, link: FlightStackEndpoint, descriptor: int) -> None:
        """``descriptor`` is that of the socket."""
        self._link, self._simulator = link, link.simulator
        self._is_possible = compiled_socket.IS_AVAILABLE and quiet_steps.compiles(link.simulator)
        self._steps: QuietSteps | None = None
        self._socket = CompiledSocket(descriptor) if self._is_possible else None
        self._outbox = np.zeros(_OUTBOX, np.uint8)
        self._record = np.zeros(1, EXCHANGES)
        self._arguments: tuple[Any, ...] = ()
        self.count = 0
        """Number of exchanges until now."""
        self._serve: Any = None

    def room(self) -> int:
        """Return how many of the next exchanges are quiet, if the present state was sent and is not answered."""
        link, simulator = self._link, self._simulator
        if not (self._is_possible and link.is_quiet):
            return 0
        count = min(MOST, simulator.quiet_intervals(measures=True, reports=True))
        if count <= 0:
            return 0
        if self._steps is None or not self._steps.fits(simulator, link.actuators.rotor_speed_rad_s):
            self.prepare()
        assert self._steps is not None
        return min(count, self._steps.room())

    def prepare(self) -> None:
        """Compile the kernel, or load it from the cache, and collect its arguments, if exchanges can be quiet."""
        if self._socket is None:
            return
        link, simulator, sensors = self._link, self._simulator, self._simulator.sensors
        steps = self._steps = QuietSteps(simulator, link.actuators.rotor_speed_rad_s)
        state = simulator.frame
        pack, battery = simulator.vehicle.battery, as_bytes(simulator.battery_buffer)
        self._record[0] = Exchanges(
            self._outbox.ctypes.data, state.shape.size, state.shape.extra, SENSOR_SHAPE.extra, GPS_SHAPE.extra,
            BATTERY_SHAPE.extra, 0 if pack is None else pack.cells, VALID_FLAG, GROUND_CONTACT_FLAG, LOCKSTEP_FLAG,
            len(simulator.vehicle.rotors), simulator.interval_us, int(ACCEL | GYRO), int(MAG), int(BARO), CONTACT,
            0, 0, 0,
        )  # fmt: skip
        frames = (_NO_FRAME,) if sensors is None else tuple(map(as_bytes, sensors.raw_frames))
        gps = _NO_FRAME if sensors is None else as_bytes(sensors.gps_frame), steps.gps
        self._arguments = (
            self._socket.arguments, self._record, as_bytes(link.actuators.frame),
            np.array([link.actuators.shape], SHAPE), as_bytes(state.frame), (frames, steps.wires.view(np.uint8), *gps),
            (battery, battery[HEADER_V2:][:BATTERY_SIZE].copy()), self._outbox, steps.world,
        )  # fmt: skip
        self._serve = direct(serve_steps, *self._arguments, 0, 0)

    def run(self, count: int) -> None:
        """Run up to ``count`` exchanges, ``room`` at most; raise PlantDivergedError.

        Then send ``unsent``, and go on with ``received``.
        """
        assert self._socket is not None
        assert self._steps is not None
        self._socket.clear()
        self._serve(*self._arguments, count, self._simulator.time_us)
        done = Exchanges(*self._record[0].item())
        self.count += (
            done.steps if done.result <= CONTACT else done.steps - 1
        )  # as a step that raises in Python
        if done.steps:
            self._steps.pass_by(done.steps, done.result)

    @property
    def unsent(self) -> memoryview:
        """The rest of the messages of the last step."""
        assert self._socket is not None
        sent, size = self._socket.sent, int(self._record["size"][0])
        return self._outbox[size if sent < 0 else sent : size].data

    @property
    def received(self) -> memoryview | None:
        """Bytes that are not the expected answer, empty if the peer closed the connection; None without any."""
        assert self._socket is not None
        return self._socket.received


def compile_exchanges(simulator: Simulator, vehicle: Vehicle, home: GeoPoint) -> None:
    """Compile the kernels of the exchanges of a simulator that is not flown, with its sensors."""
    simulator.start_sensors(home)
    QuietExchanges(FlightStackEndpoint(simulator, vehicle, home), -1).prepare()
