"""A flight in one process: simulator, flight stack and ground station exchange the bytes of their sockets.

Time is simulated; no clock is read. Example:

    world = World(vehicle="x_quad", wind=(4.0, 0.0, 0.0))
    world.upload("square.plan")
    world.start_mission()
    world.until_disarmed()
    assert world.reached == [0, 1, 2, 3, 4, 5]
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from flightstack.control.backend import ControlBackend
from flightstack.core.contract import Vector3
from flightstack.core.enums import Mode
from flightstack.core.geodesy import LocalFrame
from flightstack.core.port_numbers import GROUND
from flightstack.firmware.targets import make_loops
from flightstack.flight_log.flight_log import FlightLog
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address, Link, Message
from flightstack.params.config import DEFAULT_HOME, StackConfig
from flightstack.plan import MissionItem, MissionType, load_plan
from flightstack.process.assembly import Stack, build
from flightstack.services.logs.log_store import NO_LOGS, LogStore
from flightstack.services.routing.peer import PeerAddress
from flightstack.simulator_link.hot_frames import ActuatorsFrame
from flightstack.vehicle.lockstep import Lockstep
from gcs_cli.clients.command_client import CommandClient
from gcs_cli.clients.mission_client import Done, Failed, MissionClient
from sim_bridge.plant.disturbance import Disturbance
from sim_bridge.plant.faults import parse_fault
from sim_bridge.plant.plant import PlantOptions
from sim_bridge.server.failure_command import inject_failure
from sim_bridge.simulator import SIMULATOR_COMPONENT, Simulator

MISSIONS = Path(__file__).resolve().parents[2] / "missions"
PEER = PeerAddress(GROUND, "memory", 0)
GCS = Address(255, 190)
HELD_STEP_S = 0.001
SERVICE_LIMIT_S = 30.0
STREAM_STEP_S = 0.05


class SimulationTimeoutError(AssertionError):
    """A condition was not met within its limit of simulated time."""


class LogBuffer(io.BytesIO):
    """A log file in memory, readable after it was closed."""

    content = b""

    def close(self) -> None:
        self.content = self.getvalue()
        super().close()


class World:
    """A vehicle, its simulator and a ground station."""

    def __init__(
        self,
        *,
        plant: str = "rigid",
        wind: tuple[float, float, float] = (0.0, 0.0, 0.0),
        gust: float = 0.0,
        drag: bool = False,
        force: tuple[float, float, float] = (0.0, 0.0, 0.0),
        torque: tuple[float, float, float] = (0.0, 0.0, 0.0),
        torque_gust: float = 0.0,
        seed: int = 1,
        params: Sequence[str] = (),
        flight_logs: LogStore = NO_LOGS,
        wrap_loops: Callable[[ControlBackend], ControlBackend] = lambda loops: loops,
        **config: object,
    ) -> None:
        self.logs: list[LogBuffer] = []
        self.config = StackConfig(params=tuple(params), **config)  # type: ignore[arg-type]
        self.stack: Stack = build(
            self.config, self._open_log, flight_logs, lambda *choice: wrap_loops(make_loops(*choice))
        )
        disturbance = Disturbance(wind, gust, force, torque, torque_gust)
        vehicle = self.stack.vehicle.with_drag(plant) if drag else self.stack.vehicle
        self.simulator = Simulator(vehicle, plant, PlantOptions(disturbance=disturbance, seed=seed))
        self.simulator.set_interval_us(self.stack.rates.interval_us)
        self._lockstep = Lockstep(self.stack.simulator, self.stack.autopilot, self.stack.rates.interval_us)
        self.machine_ns = 0
        """Wall time for a simulator whose clock stands still."""
        self.actuators = ActuatorsFrame()
        self._simulator_codec = Link(1, SIMULATOR_COMPONENT)
        self.held_s = 0.0
        """Link time of exchanges while simulated time stood still."""
        self._link = Link(*GCS)
        autopilot = Address(self.config.system_id, 1)
        self._missions = MissionClient(autopilot, GCS)
        self._commands = CommandClient(autopilot, GCS)
        self._heartbeat_due_s, self._heartbeat_kind = -math.inf, -1
        self.received: dict[str, Message] = {}
        self.counts: dict[str, int] = {}
        self.texts: list[str] = []
        self.reached: list[int] = []
        self.sends_heartbeats = True
        """If True, heartbeats of a ground station; otherwise of a companion, which do not count for the data link."""
        self.loses_states = False
        """If True, ticks go on without states, as in real time when a simulator hangs."""
        self._missed_us = 0
        self.streams: dict[str, Callable[[], Message]] = {}
        """Constructors of messages that are sent at 20 Hz: offboard setpoints, sticks."""
        self._stream_due_s = -math.inf
        self._next_log_us = 0
        self._ticks = 0
        self.stack.simulator.receive(memoryview(self.states()))
        self.stack.now.has_state = True
        self.stack.ground.add_peer(PEER, permanent=True)

    def _open_log(self) -> FlightLog:
        self.logs.append(LogBuffer())
        return FlightLog(self.logs[-1], len(self.stack.vehicle.rotors))

    # ------------------------------------------------------------------ state

    @property
    def time_s(self) -> float:
        return self.stack.now.time_us * 1e-6

    @property
    def position(self) -> np.ndarray:
        return self.simulator.frame.state[:3].copy()

    @property
    def velocity(self) -> np.ndarray:
        return self.simulator.frame.state[3:6].copy()

    @property
    def altitude(self) -> float:
        return -float(self.simulator.frame.state[2])

    @property
    def armed(self) -> bool:
        return self.stack.now.status.armed

    @property
    def mode(self) -> Mode:
        return self.stack.now.status.mode

    @property
    def landed(self) -> bool:
        return self.stack.now.landed

    @property
    def log(self) -> bytes:
        return self.logs[-1].content

    # ------------------------------------------------------------------ time

    def link_now_s(self) -> float:
        """Return link time: simulated time and ``held_s``."""
        return self.time_s + self.held_s

    def tick(self) -> None:
        """Run one exchange: state to the stack, actuators back, all as bytes."""
        stack = self.stack
        if self._missed_us:
            commands = stack.autopilot.tick(stack.simulator.time_us + self._missed_us)
        else:
            commands = self._lockstep.tick(self.machine_ns)
        for severity, text in stack.simulator.steps.take_notices():
            stack.journal.say(severity, text)
        self.take_answer(stack.simulator.answer(commands, self.armed))
        self._ticks += 1
        if self._ticks % stack.rates.divisor == 0:
            time_us = stack.now.time_us
            if time_us >= self._next_log_us:
                self._next_log_us = time_us + 1_000_000
                stack.recorder.timing(time_us, **stack.report.log_fields(time_us // stack.rates.interval_us))
            self.exchange_with_ground()
        self.simulator.apply(self.actuators)
        if self.loses_states:
            self._missed_us += stack.rates.interval_us
        else:
            assert stack.simulator.receive(memoryview(self.states()))

    def states(self) -> bytes | memoryview:
        """Return the bytes that the simulator sends for one step."""
        return self.simulator.outgoing()

    def take_answer(self, answer: bytes | memoryview) -> None:
        """Take the stack's actuators."""
        assert self.actuators.open(answer)

    def _pass_requests(self) -> None:
        """Pass the vehicle's requests to the simulator, and the answers back."""
        requests = self.stack.simulator.take_requests()
        for request in self._simulator_codec.decode(requests) if requests else ():
            result = inject_failure(self.simulator, request.param1, request.param2, request.param3)
            ack = mavlink.MAVLink_command_ack_message(request.command, result)
            self.stack.simulator.receive(memoryview(self._simulator_codec.encode(ack)))

    def run(self, seconds: float) -> None:
        """Run for ``seconds`` of simulated time."""
        for _ in range(round(seconds * self.stack.rates.inner_hz)):
            self.tick()

    def until(self, condition: Callable[[], bool], limit_s: float = 120.0) -> None:
        """Run until ``condition`` is true; raise SimulationTimeoutError after ``limit_s`` of simulated time."""
        for _ in range(round(limit_s * self.stack.rates.inner_hz)):
            if condition():
                return
            self.tick()
        raise SimulationTimeoutError(
            f"not within {limit_s} s; mode {self.mode.name}, position {self.position}, {self.texts}"
        )

    def until_disarmed(self, limit_s: float = 180.0) -> None:
        """Run until the vehicle is disarmed."""
        self.until(lambda: not self.armed, limit_s)

    # ------------------------------------------------------------------ ground station

    def exchange_with_ground(self) -> None:
        """Exchange all pending messages between vehicle and ground station once."""
        now_s = self.link_now_s()
        ground = self.stack.ground
        kind = mavlink.MAV_TYPE_GCS if self.sends_heartbeats else mavlink.MAV_TYPE_ONBOARD_CONTROLLER
        if now_s >= self._heartbeat_due_s or kind != self._heartbeat_kind:
            self._heartbeat_due_s, self._heartbeat_kind = now_s + 1.0, kind
            self.send(mavlink.MAVLink_heartbeat_message(kind, 8, 0, 0, 4, 3))
        if self.streams and now_s >= self._stream_due_s:
            self._stream_due_s = now_s + STREAM_STEP_S
            for make in self.streams.values():
                self.send(make())
        for message in (*self._missions.poll(now_s), *self._commands.poll(now_s)):
            self.send(message)
        self._pass_requests()
        for _, data in list(ground.poll(now_s)):
            for message in self._link.decode(data):
                self._take(message, now_s)

    def inject(self, fault: str) -> None:
        """Start a fault of the simulator, in the syntax of ``sim-bridge --fault``."""
        self.simulator.inject(parse_fault(fault, len(self.stack.vehicle.rotors)))

    def send(self, message: Message) -> None:
        """Send a message from the ground station."""
        self.stack.ground.receive(PEER, self._link.encode(message), self.link_now_s())

    def _take(self, message: Message, now_s: float) -> None:
        kind = message.get_type()
        self.received[kind] = message
        self.counts[kind] = self.counts.get(kind, 0) + 1
        if kind == "STATUSTEXT":
            if message.id and message.chunk_seq:
                self.texts[-1] += message.text
            else:
                self.texts.append(message.text)
        elif kind == "MISSION_ITEM_REACHED":
            self.reached.append(message.seq)
        self._missions.receive(message, now_s)
        self._commands.receive(message, now_s)

    def _serve(self, done: Callable[[], bool]) -> None:
        """Exchange messages until ``done`` while simulated time stands still."""
        began_s = self.held_s
        while not done():
            self.held_s += HELD_STEP_S
            self.exchange_with_ground()
            if self.held_s - began_s > SERVICE_LIMIT_S:
                raise SimulationTimeoutError("no answer from the vehicle")

    def upload(
        self, plan: str | Sequence[MissionItem], kind: MissionType = MissionType.MISSION
    ) -> Done | Failed:
        """Upload a mission file of ``missions/`` or the items of a plan; return the result."""
        items = load_plan(MISSIONS / plan).items if isinstance(plan, str) else plan
        missions = self._missions
        if kind is not MissionType.MISSION:
            self._missions = MissionClient(Address(self.config.system_id, 1), GCS, kind)
        try:
            self._missions.start_upload(items)
            self._serve(lambda: self._missions.result is not None)
            assert self._missions.result is not None
            return self._missions.result
        finally:
            self._missions = missions

    def download(self) -> tuple[MissionItem, ...]:
        """Download and return the mission."""
        self._missions.start_download()
        self._serve(lambda: self._missions.result is not None)
        assert isinstance(self._missions.result, Done), self._missions.result
        return tuple(self._missions.result.items)

    def command(self, command: int, *params: float) -> int | None:
        """Send a command; return its MAV_RESULT."""
        self._commands.send(command, params, self.link_now_s())
        self._serve(lambda: self._commands.result is not None)
        assert self._commands.result is not None
        return self._commands.result.result

    def arm(self) -> int | None:
        return self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)

    def disarm(self, force: bool = False) -> int | None:
        return self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, 21196 if force else 0)

    def start_mission(self) -> int | None:
        """Arm and start the mission, as ``gcs fly`` does."""
        result = self.arm()
        return result if result else self.command(mavlink.MAV_CMD_MISSION_START)

    def takeoff(self, altitude_m: float = math.nan) -> int | None:
        """Take off to an altitude above home."""
        amsl = altitude_m + self.config.home.altitude_m
        return self.command(mavlink.MAV_CMD_NAV_TAKEOFF, *[math.nan] * 6, amsl)

    def land(self) -> int | None:
        return self.command(mavlink.MAV_CMD_NAV_LAND)

    def return_home(self) -> int | None:
        return self.command(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH)

    def hold(self) -> int | None:
        return self.command(mavlink.MAV_CMD_DO_SET_MODE, 1, 4, 3)

    def resume_mission(self) -> int | None:
        return self.command(mavlink.MAV_CMD_DO_SET_MODE, 1, 4, 4)


def item(command: int, north: float = 0.0, east: float = 0.0, z: float = 0.0, p1: float = 0.0) -> MissionItem:
    """Return a mission item at a position relative to the default home [m], altitude above home."""
    place = LocalFrame(DEFAULT_HOME).to_geo(Vector3(north, east, 0.0))
    position = round(place.latitude_deg * 1e7), round(place.longitude_deg * 1e7)
    if command in (93, 115, 177, 178):
        return MissionItem(command, 2, p1)
    return MissionItem(command, 6, p1, 0.0, 0.0, math.nan, *position, z)
