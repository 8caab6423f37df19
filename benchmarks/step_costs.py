"""What one step costs, part by part, in a vehicle that flies its mission."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from benchmarks.measure import Figure, interleaved_us
from benchmarks.one_process import Station, flying
from flightstack.core.contract import MAX_ROTORS, LoopRow, Vector3
from flightstack.mavlink.dialect import LAYOUT_BY_NAME, mavlink
from flightstack.mavlink.frame_packer import FramePacker
from flightstack.mavlink.link import Link, Message
from flightstack.params.vehicle import Vehicle
from flightstack.services.telemetry.motion import CONTENTS
from flightstack.services.telemetry.motion_values import VALUES
from flightstack.services.telemetry.streams import GROUND_RATES_HZ, Streams
from flightstack.services.telemetry.telemetry import Telemetry
from flightstack.simulator_link.hot_frames import ARMED_FLAG, ActuatorsFrame, PlantStateFrame
from flightstack.testing import World
from flightstack.vehicle.status import vehicle_summary
from sim_bridge.plant.compiled_plant import CompiledPlant
from sim_bridge.plant.plant import InitialState, PlantOptions
from sim_bridge.server.endpoint import FlightStackEndpoint
from sim_bridge.simulator import Simulator

Call = Callable[[], object]
PACK = "telemetry: values of seven messages packed and framed"
PACK_BY_PYMAVLINK = "telemetry: the same by pymavlink"
POLLS_HZ = 50.0
"""Rate at which messages are due."""


class Part(NamedTuple):
    """One part of a step: how often a step of the inner loop needs it, at 500 and 100 Hz."""

    name: str
    call: Call
    per_step: float
    is_floor: bool
    """Whether no flight can do without it: the others hold parts of these, or are for comparison."""


def _flying() -> World:
    world = flying(True, Station.READS)
    world.run_for(6.0)
    return world


def _holding() -> Call:
    """Return a tick of a vehicle that holds its place for as long as it is ticked, without a ground station.

    A tick on a state that stays the same would be another one: the rotors would be held.
    """
    world = flying(True, Station.READS)
    world.run_for(6.0)
    world.set_mode("HOLD")
    engine = world.engine

    def tick() -> None:
        engine.tick()
        engine.advance()

    return tick


def _hover_rad_s(vehicle: Vehicle) -> float:
    return math.sqrt(vehicle.weight_n / sum(rotor.thrust_coefficient_n_s2 for rotor in vehicle.rotors))


def _hovering(vehicle: Vehicle) -> Simulator:
    """Return a simulator in the air that stays there, however long it runs without control."""
    options = PlantOptions(initial=InitialState(position_ned_m=Vector3(0.0, 0.0, -100.0)))
    simulator = Simulator(vehicle, options=options)
    assert isinstance(simulator.plant, CompiledPlant)
    simulator.plant.set_rotor_speeds((_hover_rad_s(vehicle),) * len(vehicle.rotors))
    return simulator


def _hot_codec() -> Call:
    state, actuators = PlantStateFrame(), ActuatorsFrame()
    other_state, other_actuators = PlantStateFrame(), ActuatorsFrame()

    def exchange() -> None:
        other_state.open(state.seal(1, 0))
        actuators.open(other_actuators.seal(1, 0))

    return exchange


def _pymavlink_codec() -> Call:
    """Do the same as ``_hot_codec`` with pymavlink's classes."""
    sender, receiver = mavlink.MAVLink(None, 1, 1), mavlink.MAVLink(None, 1, 1)
    messages = []
    for name in ("FS_PLANT_STATE", "FS_ACTUATORS"):
        layout = LAYOUT_BY_NAME[name]
        fields = sorted(layout.fields, key=lambda field: field.declared_index)
        values = [[1.0] * field.length if field.is_array else 1 for field in fields]
        messages.append((mavlink.mavlink_map[layout.message_id], values))

    def exchange() -> None:
        for kind, values in messages:
            receiver.decode(bytearray(kind(*values).pack(sender)))

    return exchange


class _Turns:
    """Calls the members of a list in turns."""

    def __init__(self, calls: list[Call]) -> None:
        self._next = itertools.cycle(calls).__next__

    def __call__(self) -> None:
        self._next()()


def _telemetry(world: World) -> tuple[Call, Call, Call, Call]:
    """Return calls for the messages at the vehicle's default rates.

    They make the frames of a poll of the status; pack and frame the values of the messages of motion by kernels, and by
    pymavlink; decode a frame.
    """
    stack, link, station = world.engine.stack, Link(1, 1), Link(255, 190)
    info = stack.status().info
    summary = partial(vehicle_summary, info, stack.parts)
    told = Telemetry(stack.status, summary, stack.now, stack.parts.places, info, stack.report.message)
    polls = _polls()
    frames = [frame for ids in polls for frame in told.frames(ids, link)]
    values = np.ones(1, VALUES)
    packer = FramePacker(values, CONTENTS)
    numbers = [packer.index[number] for number, rate in GROUND_RATES_HZ.items() if rate == POLLS_HZ]
    messages = [
        message for number in numbers for message in station.decode(link.encode(packer.message(number)))
    ]
    fields = [
        (mavlink.mavlink_map[m.get_msgId()], [getattr(m, name) for name in m.fieldnames]) for m in messages
    ]
    return (
        _Turns([partial(_poll, told, ids, link) for ids in polls]),
        partial(link.encode_numbered, packer, numbers),
        partial(_pack_by_pymavlink, link, fields),
        _Turns([partial(_decode, station, frame) for frame in frames]),
    )


def _polls() -> list[list[int]]:
    """Return the messages that are due in the polls of a second."""
    streams = Streams(GROUND_RATES_HZ)
    return [streams.due(poll / POLLS_HZ, poll / POLLS_HZ) for poll in range(round(POLLS_HZ))]


def _poll(told: Telemetry, message_ids: list[int], link: Link) -> None:
    told.begin_poll()
    told.frames(message_ids, link)


def _pack_by_pymavlink(link: Link, fields: list[tuple[type[Message], list[object]]]) -> None:
    for kind, values in fields:
        link.encode(kind(*values))


def _decode(station: Link, frame: bytes) -> None:
    for message in station.decode(frame):
        getattr(message, message.fieldnames[0])  # decodes all fields


def _log(world: World) -> Call:
    """Write five inner rows and one outer row, with their share of making bytes of them."""
    recorder, now = world.engine.stack.recorder, world.engine.stack.now
    state, target = np.ones(13), np.ones(5)
    setpoint, times = now.setpoint, [now.time_us]

    def five() -> None:
        for _ in range(5):
            times[0] += 2000
            recorder.inner_row(times[0])
        recorder.outer(times[0], state, setpoint, target, 0)

    return five


def parts() -> list[Part]:
    """Return the parts of a step, simulator first."""
    world = _flying()
    stack, simulator = world.engine.stack, world.engine.simulator
    link, backend, navigator, now = stack.simulator, stack.loops, stack.parts.navigator, stack.now
    state, speeds = now.state.copy(), now.rotor_speed.copy()
    row = np.zeros(LoopRow.SIZE)
    hover = np.zeros(MAX_ROTORS)
    hover[: len(stack.vehicle.rotors)] = _hover_rad_s(stack.vehicle)
    actuators_bytes = memoryview(bytearray(link.answer(hover, True)))
    state_bytes = memoryview(bytearray(simulator.state_frame()))
    hovering = _hovering(stack.vehicle)
    sim_link = FlightStackEndpoint(hovering, stack.vehicle, stack.area.home)
    sim_link.receive(memoryview(link.initial_requests(stack.rates.interval_us)))
    make, pack, pack_by_pymavlink, decode = _telemetry(world)
    messages_per_step = sum(GROUND_RATES_HZ.values()) / 500.0

    def simulator_side() -> None:
        sim_link.receive(actuators_bytes)
        sim_link.replies()
        sim_link.step()
        sim_link.state()

    def stack_side() -> None:
        link.receive(state_bytes)
        link.answer(now.row[LoopRow.ROTOR_COMMAND], True)

    return [
        Part("frames: state and actuators, sealed and opened", _hot_codec(), 1.0, True),
        Part("the same two messages by pymavlink", _pymavlink_codec(), 1.0, False),
        Part(
            "plant, 2 Runge-Kutta steps of 1 ms",
            lambda: hovering.plant.advance(hover, ARMED_FLAG, 2),
            1.0,
            True,
        ),
        Part(
            "inner loop: reference, attitude, mixer",
            lambda: backend.step(state, now.setpoint, speeds, False, row),
            0.8,
            True,
        ),
        Part(
            "outer and inner loop: position first",
            lambda: backend.step(state, now.setpoint, speeds, True, row),
            0.2,
            True,
        ),
        Part("guidance", lambda: navigator.step(now.status.mode, state, now.attitude_target, 0.0), 0.2, True),
        Part("log: rows, and bytes of them", _log(world), 0.2, True),
        Part("simulator, without its socket", simulator_side, 1.0, False),
        Part("flight stack's end of the simulator link", stack_side, 1.0, False),
        Part("both and the autopilot's tick with its log, holding", _holding(), 1.0, False),
        Part("telemetry: a poll, from status to frames", make, POLLS_HZ / 500.0, False),
        Part(PACK, pack, POLLS_HZ / 500.0, False),
        Part(PACK_BY_PYMAVLINK, pack_by_pymavlink, POLLS_HZ / 500.0, False),
        Part("ground station: decode it", decode, messages_per_step, False),
    ]


def costs(rounds: int, seconds: float) -> list[tuple[Part, Figure]]:
    """Time every part."""
    known = parts()
    figures = interleaved_us({part.name: part.call for part in known}, rounds, seconds)
    return [(part, figures[part.name]) for part in known]
