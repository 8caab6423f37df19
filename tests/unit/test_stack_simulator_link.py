"""The flight stack's end of the simulator link: exact frames, any chunks, junk, standard HIL messages."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flightstack.core.contract import Vector3
from flightstack.core.geodesy import LocalFrame
from flightstack.mavlink.dialect import FS_PLANT_STATE_ID, FsPlantState, mavlink
from flightstack.mavlink.link import Link
from flightstack.mavlink.signing import LinkSigning, Signing
from flightstack.simulator_link.endpoint import SimulatorEndpoint
from flightstack.simulator_link.hot_frames import ActuatorsFrame
from tests.support.link_to_simulator import HOME, PAPER, STATE, booted, link, plant_state, receive


def hil_state(time_us: int = 4000, **changes) -> bytes:
    fields = {
        "time_usec": time_us, "attitude_quaternion": [0.8, 0.0, 0.6, 0.0],
        "rollspeed": 0.1, "pitchspeed": -0.2, "yawspeed": 0.3,
        "lat": 473980000, "lon": 85460000, "alt": 495000, "vx": 150, "vy": -250, "vz": 35,
        "ind_airspeed": 0, "true_airspeed": 0, "xacc": 0, "yacc": 0, "zacc": 0,
    }  # fmt: skip
    return Link(1, 1).encode(mavlink.MAVLink_hil_state_quaternion_message(**{**fields, **changes}))


def heartbeat(status: int = mavlink.MAV_STATE_ACTIVE) -> bytes:
    return Link(1, 1).encode(mavlink.MAVLink_heartbeat_message(30, 8, 0, 0, status, 3))


# ---------------------------------------------------------------------- the exact exchange


def test_a_state_arrives_exactly_and_is_answered_with_its_time() -> None:
    stack = link()
    state = stack.state
    assert not stack.has_state
    assert receive(stack, plant_state(6000))
    assert stack.has_state
    assert state is stack.state
    assert state.tolist() == STATE
    assert stack.rotor_speed_rad_s.tolist() == [200.0] * 8
    answer = ActuatorsFrame()
    assert answer.open(stack.answer(np.arange(8.0), armed=True))
    assert answer.time_us == 6000
    assert answer.rotor_speed_rad_s.tolist() == list(range(8))
    assert (answer.rotor_count, answer.flags) == (4, 1 | 2 | 4)


@pytest.mark.parametrize(
    ("lockstep", "armed", "flags"), [(True, False, 5), (False, True, 3), (False, False, 1)]
)
def test_flags_say_armed_and_lockstep(lockstep: bool, armed: bool, flags: int) -> None:
    stack = link(lockstep)
    receive(stack, plant_state(0))
    answer = ActuatorsFrame()
    assert answer.open(stack.answer(np.zeros(8), armed))
    assert answer.flags == flags


def test_the_newest_of_several_states_counts() -> None:
    stack = booted()
    assert receive(stack, plant_state(2000) + plant_state(4000, [0.0] * 6 + STATE[6:]))
    assert stack.time_us == 4000
    assert stack.state[0] == 0.0


STREAM = heartbeat() + plant_state(2000) + heartbeat() + plant_state(4000)


def test_the_stream_may_be_cut_anywhere() -> None:
    for cut in range(1, len(STREAM)):
        stack = booted()
        receive(stack, STREAM[:cut])
        assert receive(stack, STREAM[cut:]), cut
        assert (stack.time_us, stack.state.tolist()) == (4000, STATE), cut
        # afterwards whole frames take the direct way again
        assert receive(stack, plant_state(6000)), cut
        assert stack.time_us == 6000, cut


def test_byte_by_byte() -> None:
    stack = booted()
    fresh = [receive(stack, STREAM[index : index + 1]) for index in range(len(STREAM))]
    assert sum(fresh) == 2
    assert stack.time_us == 4000


@pytest.mark.parametrize("junk", [b"\x00" * 7, b"hello", bytes(range(200)), b"\xfe\x00", b"\xff" * 300])
def test_junk_between_frames_costs_no_state(junk: bytes) -> None:
    """In lockstep a lost state would be the last: the simulator waits for its answer."""
    stack = booted()
    for time_us in range(2000, 22_000, 2000):
        receive(stack, junk)
        assert receive(stack, plant_state(time_us))
        assert stack.time_us == time_us
        assert stack.state.tolist() == STATE


@settings(max_examples=60)
@given(
    st.lists(
        st.one_of(st.binary(max_size=80), st.sampled_from([STREAM, hil_state(), heartbeat()])), max_size=10
    )
)
def test_no_bytes_raise(chunks: list[bytes]) -> None:
    stack = link()
    for chunk in chunks:
        receive(stack, chunk)
        stack.answer(np.full(8, 100.0), True)


def test_a_state_that_takes_the_general_way_is_taken_too() -> None:
    """Legal MAVLink that no hot frame is: signed, or with its trailing zeros cut."""
    codec = Link(1, 1, signing=LinkSigning(Signing(b"k" * 32, lambda: 1.8e9), 0))
    message = FsPlantState(8000, STATE[:3], STATE[3:6], STATE[6:10], STATE[10:], [150.0] * 8, 4, 1)
    stack = booted()
    assert receive(stack, codec.encode(message))
    assert (stack.time_us, stack.state.tolist()) == (8000, STATE)
    assert stack.rotor_speed_rad_s.tolist() == [150.0] * 8
    cut = Link(1, 1).encode(
        FsPlantState(9000, STATE[:3], STATE[3:6], STATE[6:10], STATE[10:], [0.0] * 8, 0, 0)
    )
    assert len(cut) < len(plant_state(0))
    assert receive(stack, cut)
    assert (stack.time_us, stack.state.tolist()) == (9000, STATE)
    assert stack.rotor_speed_rad_s.tolist() == [0.0] * 8


# ---------------------------------------------------------------------- third parties


def test_initial_requests_are_heartbeat_and_state_interval() -> None:
    messages = list(Link(1, 51).decode(link().initial_requests(2000)))
    assert messages[0].get_type() == "HEARTBEAT"
    assert messages[0].get_srcSystem() == 3
    asked = [(m.command, m.param1, m.param2) for m in messages[1:]]
    assert (mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, FS_PLANT_STATE_ID, 2000.0) in asked


def test_refused_state_request_falls_back_to_hil_message() -> None:
    stack = link()
    request = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
    receive(stack, Link(1, 1).encode(mavlink.MAVLink_command_ack_message(request, 0)))
    assert not stack.request_refused
    receive(stack, Link(1, 1).encode(mavlink.MAVLink_command_ack_message(request, 2)))
    assert stack.request_refused
    (message,) = Link(1, 51).decode(stack.fallback_request(4000))
    assert (message.param1, message.param2) == (115.0, 4000.0)


def test_hil_state_becomes_the_state() -> None:
    stack = booted()
    assert receive(stack, hil_state())
    place = LocalFrame(HOME).to_geo(Vector3(*stack.state[:3]))
    assert place == pytest.approx((47.398, 8.546, 495.0), abs=1e-9)
    # an independent figure: 258 µdeg of latitude are 28.69 m, 406 µdeg of longitude there 30.65 m
    assert stack.state[0] == pytest.approx(28.685, abs=0.01)
    assert stack.state[1] == pytest.approx(30.653, abs=0.01)
    assert stack.state[2] == pytest.approx(-7.0, abs=1e-9)
    assert stack.state[3:6].tolist() == [1.5, -2.5, 0.35]
    assert stack.state[6:10].tolist() == pytest.approx([0.8, 0.0, 0.6, 0.0], abs=1e-7)
    assert stack.state[10:].tolist() == pytest.approx([0.1, -0.2, 0.3], abs=1e-7)
    assert stack.time_us == 4000


def controls(stack: SimulatorEndpoint, speeds, armed: bool = True):
    (message,) = Link(1, 51).decode(bytes(stack.answer(np.array(speeds, dtype=float), armed)))
    assert message.get_type() == "HIL_ACTUATOR_CONTROLS"
    return message


def test_hil_states_are_answered_with_shares_of_thrust() -> None:
    stack = link()
    receive(stack, hil_state(8000))
    top = PAPER.rotors[0].max_speed_rad_s
    answer = controls(stack, [top, top / 2, 0.0, 2 * top, 5.0, 5.0, 5.0, 5.0])
    assert list(answer.controls) == pytest.approx([1.0, 0.25, 0.0, 1.0] + [0.0] * 12)
    assert (answer.time_usec, answer.flags) == (8000, 1)
    assert answer.mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED


def test_a_disarmed_or_failing_stack_stops_the_rotors() -> None:
    stack = link()
    receive(stack, hil_state())
    assert list(controls(stack, [200.0] * 8, armed=False).controls) == [0.0] * 16
    assert not controls(stack, [200.0] * 8, armed=False).mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    answer = controls(stack, [math.nan, -50.0, math.inf, 200.0] + [0.0] * 4)
    assert list(answer.controls)[:3] == [0.0, 0.0, 1.0]


def test_each_state_is_answered_in_its_own_kind() -> None:
    stack = link()
    receive(stack, hil_state())
    controls(stack, [0.0] * 8)
    receive(stack, plant_state(2000))
    assert ActuatorsFrame().open(stack.answer(np.zeros(8), True))
    receive(stack, hil_state())
    controls(stack, [0.0] * 8)


def test_shutdown_is_received_and_announced() -> None:
    stack = link()
    receive(stack, heartbeat())
    assert not stack.peer_is_shutting_down
    receive(stack, heartbeat(mavlink.MAV_STATE_POWEROFF))
    assert stack.peer_is_shutting_down
    (message,) = Link(1, 51).decode(stack.heartbeat(False, leaving=True))
    assert message.system_status == mavlink.MAV_STATE_POWEROFF


# ---------------------------------------------------------------------- battery, age and time


def battery(**changes) -> bytes:
    fields = {
        "id": 0, "battery_function": 1, "type": 1, "temperature": 0x7FFF,
        "voltages": [3900, 3910, 3920] + [0xFFFF] * 7, "current_battery": 1250, "current_consumed": 100,
        "energy_consumed": -1, "battery_remaining": 64,
    }  # fmt: skip
    return Link(1, 200).encode(mavlink.MAVLink_battery_status_message(**{**fields, **changes}))


def test_a_battery_is_taken_with_the_time_of_its_state() -> None:
    stack = booted()
    assert not stack.battery.valid
    assert receive(stack, plant_state(2000))
    assert receive(stack, battery() + plant_state(4000))
    assert stack.battery == (pytest.approx(11.73), pytest.approx(12.5), pytest.approx(0.64), 4000, True)
    assert stack.state.tolist() == STATE
    assert not receive(stack, battery(battery_remaining=50))
    assert (stack.battery.remaining, stack.battery.time_us) == (0.5, 4000)


def test_a_battery_and_state_are_the_same_whichever_way_they_come() -> None:
    """Both at once take a short cut; after junk, cut in two, or the other way round, they do not."""
    data = battery() + plant_state(4000)
    ways = [[data], [b"\x55\x66" + data], [data[:20], data[20:]], [data + battery()]]
    seen = []
    for way in ways:
        stack = booted()
        receive(stack, plant_state(2000))
        assert [receive(stack, piece) for piece in way][-1]
        seen.append((stack.battery, stack.state.tolist(), stack.time_us, stack.time_jumps))
    assert seen == [seen[0]] * len(ways)
    assert seen[0][0].time_us == seen[0][2] == 4000


def test_unknown_battery_values_are_nan() -> None:
    stack = link()
    receive(stack, battery(voltages=[0xFFFF] * 10, current_battery=-1, battery_remaining=-1))
    assert all(math.isnan(value) for value in stack.battery[:3])
    assert not stack.battery.valid
    receive(stack, battery(voltages=[65534, 9466] + [0xFFFF] * 8, voltages_ext=[0xFFFF, 0, 0, 0]))
    assert stack.battery.voltage_v == pytest.approx(75.0)  # more than one place holds
    receive(stack, battery(id=1, battery_remaining=3))
    assert stack.battery.remaining == pytest.approx(0.64)
    receive(stack, battery(battery_remaining=127))
    assert stack.battery.remaining == 1.0


def test_failure_request_uses_inject_failure() -> None:
    (m,) = Link(1, 51).decode(link().failure_request(101, 1, 2))
    assert (m.command, m.param1, m.param2, m.param3) == (mavlink.MAV_CMD_INJECT_FAILURE, 101.0, 1.0, 2.0)


@pytest.mark.parametrize("junk", [b"\xfd\xff\x00", b"\xfe\xff", b"\xfd\xff\x00" * 90, b"\xfd" * 500])
def test_junk_in_the_same_piece_costs_no_state(junk: bytes) -> None:
    stack = booted()
    for time_us in range(2000, 22_000, 2000):
        data = junk + plant_state(time_us)
        cut = len(junk) + 40
        assert receive(stack, data[:cut]) | receive(stack, data[cut:])
        assert stack.time_us == time_us
        assert receive(stack, junk + plant_state(time_us + 1000))


def test_an_ack_of_another_command_refuses_nothing() -> None:
    stack = link()
    receive(stack, Link(1, 1).encode(mavlink.MAVLink_command_ack_message(mavlink.MAV_CMD_INJECT_FAILURE, 3)))
    assert not stack.request_refused
