"""Both ends of the simulator link against whatever arrives."""

from __future__ import annotations

import numpy as np

from flightstack.mavlink.dialect import FS_ACTUATORS_ID, FS_PLANT_STATE_ID, mavlink
from flightstack.mavlink.frames import LARGEST_FRAME
from flightstack.mavlink.link import Link
from flightstack.params.config import DEFAULT_HOME
from flightstack.params.vehicle import load_vehicle
from flightstack.simulator_link.endpoint import SimulatorEndpoint
from flightstack.simulator_link.hot_frames import ActuatorsFrame, PlantStateFrame
from sim_bridge.errors import PlantDivergedError
from sim_bridge.plant.plant import PlantOptions
from sim_bridge.server.endpoint import FlightStackEndpoint
from sim_bridge.simulator import LONGEST_INTERVAL_US, SHORTEST_INTERVAL_US, Simulator
from tests.fuzz.inputs import KINDS, Inputs
from tests.fuzz.measure import calls, held

MESSAGES = 6_000
VEHICLE = load_vehicle("x_quad")
_OF_THE_LINK = (
    FS_ACTUATORS_ID, FS_PLANT_STATE_ID, mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION,
    mavlink.MAVLINK_MSG_ID_HIL_ACTUATOR_CONTROLS, mavlink.MAVLINK_MSG_ID_BATTERY_STATUS,
    mavlink.MAVLINK_MSG_ID_COMMAND_ACK, mavlink.MAVLINK_MSG_ID_COMMAND_LONG, mavlink.MAVLINK_MSG_ID_HEARTBEAT,
)  # fmt: skip
KINDS_OF_THE_LINK = [kind for kind in KINDS if kind.number in _OF_THE_LINK]
LONG = [b"\xfd" * 20_000, b"\xfe" * 20_000, b"\xfe\x00" * 10_000, b"\xfd\xff\x00" * 7_000, bytes(20_000)]


def arrivals(seed: int, messages: int) -> list[bytes]:
    """Return pieces of a stream: half of it messages that this link knows."""
    inputs = Inputs(seed)
    pieces: list[bytes] = []
    for _ in range(messages):
        known = inputs.random.random() < 0.5
        data = inputs.frame(inputs.random.choice(KINDS_OF_THE_LINK)) if known else inputs.datagram()
        pieces += inputs.pieces(data)
    return pieces


def plant_state(time_us: int, north_m: float) -> bytes:
    frame = PlantStateFrame(1, 51)
    frame.state[:] = 0.0
    frame.state[0], frame.state[6] = north_m, 1.0
    frame.rotor_speed_rad_s[:] = 150.0
    frame.set_rotor_count(len(VEHICLE.rotors))
    return bytes(frame.seal(time_us, 0))


def test_the_vehicle_s_end_takes_anything_and_then_an_exact_state() -> None:
    stack = SimulatorEndpoint(VEHICLE, DEFAULT_HOME, lockstep=True)
    state, before = stack.state, held(stack)
    commands = np.full(8, 100.0)
    for piece in arrivals(61, MESSAGES):
        stack.receive(memoryview(piece))
        assert stack.finder.partial_size <= LARGEST_FRAME
        if stack.has_state:
            assert len(bytes(stack.answer(commands, armed=True))) <= LARGEST_FRAME
        assert stack.freshness(stack.time_us).age_us >= 0
    assert held(stack) < before + 4_000
    assert stack.receive(memoryview(plant_state(4_000, 7.0)))
    assert stack.state is state
    assert state.tolist()[:7] == [7.0, 0, 0, 0, 0, 0, 1.0]
    answer = ActuatorsFrame()
    assert answer.open(stack.answer(commands, armed=True))
    assert answer.time_us == 4_000


def simulator_end() -> FlightStackEndpoint:
    return FlightStackEndpoint(Simulator(VEHICLE, "rigid", PlantOptions()), VEHICLE, DEFAULT_HOME)


def test_the_simulator_s_end_takes_anything_and_then_a_request_and_actuators() -> None:
    """The plant is stepped on the way; that it refuses to go on with impossible commands is its right."""
    end = simulator_end()
    before = held(end)
    for number, piece in enumerate(arrivals(71, MESSAGES)):
        end.receive(memoryview(piece))
        assert end.finder.partial_size <= LARGEST_FRAME
        assert SHORTEST_INTERVAL_US <= end.simulator.interval_us <= LONGEST_INTERVAL_US
        if number % 20 == 0:
            assert len(end.replies()) <= 60
            end.state()
            try:
                end.step()
            except PlantDivergedError:
                end.simulator = Simulator(VEHICLE, "rigid", PlantOptions())
    end.replies()
    end.simulator = Simulator(VEHICLE, "rigid", PlantOptions())
    assert held(end) < before + 4_000

    for number in (-1, 1):  # the standard message may have been asked for: stop it, then ask for ours
        client = Link(1, 1)
        request = mavlink.MAVLink_command_long_message(
            0, 0, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 0, FS_PLANT_STATE_ID, 4_000 * number if number > 0 else -1,
            0, 0, 0, 0, 0,
        )  # fmt: skip
        end.receive(memoryview(client.encode(request)))
    assert end.ready
    opened = PlantStateFrame()
    end.simulator = Simulator(VEHICLE, "rigid", PlantOptions())
    end.state()
    answer = ActuatorsFrame()
    answer.set_rotor_count(len(VEHICLE.rotors))
    answer.rotor_speed_rad_s[:] = 120.0
    end.receive(memoryview(bytes(answer.seal(end.simulator.time_us, 4))))
    assert end.answered
    assert opened.open(end.state())


def test_the_work_is_bounded_by_the_size_of_what_arrives() -> None:
    stack, end = SimulatorEndpoint(VEHICLE, DEFAULT_HOME, lockstep=True), simulator_end()
    for data in LONG:
        assert calls(lambda data=data: stack.receive(memoryview(data))) < 20 * len(data)
        assert calls(lambda data=data: end.receive(memoryview(data))) < 20 * len(data)
