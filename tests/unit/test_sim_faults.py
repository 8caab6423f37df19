"""Faults of the simulator: syntax, effect and schedule, from options, code and MAVLink commands."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flightstack.core.geodesy import GeoPoint
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link
from flightstack.params.vehicle import load_vehicle
from flightstack.simulator_link.hot_frames import ARMED_FLAG, LOCKSTEP_FLAG, ActuatorsFrame
from sim_bridge.errors import UsageProblemError
from sim_bridge.plant.faults import Fault, Kind, parse_fault
from sim_bridge.server.endpoint import HIL_STATE_QUATERNION_ID, FlightStackEndpoint
from sim_bridge.simulator import Simulator

PAPER = load_vehicle("paper_quad")
HOME = GeoPoint(47.397742, 8.545594, 488.0)
LAG_SPEED = 214.0


def command(speed: float = LAG_SPEED, flags: int = ARMED_FLAG, time_us: int = 0) -> ActuatorsFrame:
    frame = ActuatorsFrame()
    frame.rotor_speed_rad_s[:4] = speed
    frame.set_rotor_count(4)
    frame.seal(time_us, flags)
    return frame


def flown(*specs: str, seconds: float = 0.4, speed: float = LAG_SPEED) -> Simulator:
    simulator = Simulator(PAPER)
    for spec in specs:
        simulator.inject(parse_fault(spec, 4))
    fly(simulator, seconds, speed)
    return simulator


def fly(simulator: Simulator, seconds: float, speed: float = LAG_SPEED, flags: int = ARMED_FLAG) -> None:
    for _ in range(round(seconds * 500.0)):
        simulator.apply(command(speed, flags))


def speeds(simulator: Simulator) -> list[float]:
    return simulator.frame.rotor_speed_rad_s[:4].tolist()


# ---------------------------------------------------------------------- text


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("rotor:2:off@12.5", Fault(Kind.ROTOR_OFF, 1, 0.0, 12_500_000)),
        ("rotor:2:weak=0.7@10-20", Fault(Kind.ROTOR_WEAK, 1, 0.7, 10_000_000, 20_000_000)),
        ("rotor:1:stuck=150@8", Fault(Kind.ROTOR_STUCK, 0, 150.0, 8_000_000)),
        ("state:freeze@10-12", Fault(Kind.STATE_FREEZE, -1, 0.0, 10_000_000, 12_000_000)),
        ("state:nan@5-5.1", Fault(Kind.STATE_NAN, -1, 0.0, 5_000_000, 5_100_000)),
        ("state:drop@5-6", Fault(Kind.STATE_DROP, -1, 0.0, 5_000_000, 6_000_000)),
        ("battery:level=0.1@20", Fault(Kind.BATTERY_LEVEL, -1, 0.1, 20_000_000)),
        ("rotor:4:off", Fault(Kind.ROTOR_OFF, 3)),
    ],
)
def test_fault_is_parsed(text: str, fault: Fault) -> None:
    assert parse_fault(text, 4) == fault


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "expected rotor:N:off"), ("rotor", "expected rotor"), ("rotor:off@3", "expected rotor"),
        ("rotor:1:dance", "expected rotor"), ("state:1:freeze", "expected rotor"), ("engine:off", "expected rotor"),
        ("rotor:0:off", "rotors 1 to 4"), ("rotor:5:off", "rotors 1 to 4"), ("rotor:x:off", "rotors 1 to 4"),
        ("rotor:1:off=3", "takes no value"), ("rotor:1:weak", "weak=NUMBER"), ("rotor:1:weak=2", "0 to 1"),
        ("rotor:1:weak=much", "not a number"), ("rotor:1:stuck=nan", "0 to 100000"), ("rotor:1:weak=1_0", "0 to 1"),
        ("rotor:1:off@", "not a number"), ("rotor:1:off@-3", "not a number"), ("rotor:1:off@5-", "not a number"),
        ("rotor:1:off@5-5", "not after its begin"), ("rotor:1:off@5-4", "not after its begin"),
        ("rotor:1:off@inf", "0 to 1e+06"), ("battery:level=0.5@3-4", "give no end"), ("battery:level=-1", "0 to 1"),
    ],
)  # fmt: skip
def test_a_bad_fault_is_named_in_one_sentence(text: str, said: str) -> None:
    with pytest.raises(UsageProblemError) as caught:
        parse_fault(text, 4)
    assert said in str(caught.value)
    assert str(caught.value).startswith(f"--fault {text}: ")
    assert "\n" not in str(caught.value)


@settings(max_examples=300)
@given(st.one_of(st.text(max_size=40), st.from_regex(r"(rotor:\d*:|state:|battery:)\w*=?[\d.e-]*@?[\d.e-]*")))
def test_any_fault_text_is_parsed_or_rejected(text: str) -> None:
    try:
        fault = parse_fault(text, 4)
    except UsageProblemError:
        return
    assert fault.begin_us >= 0
    assert math.isfinite(fault.value)


# ---------------------------------------------------------------------- rotors


def test_a_rotor_without_power_runs_down_with_its_lag() -> None:
    simulator = flown("rotor:2:off@0.2", seconds=0.2)
    assert speeds(simulator) == pytest.approx([LAG_SPEED] * 4, rel=1e-6)
    fly(simulator, 0.01)
    expected = LAG_SPEED * math.exp(-0.01 / PAPER.rotors[0].lag_s)
    assert speeds(simulator)[1] == pytest.approx(expected, rel=1e-6)
    assert speeds(simulator)[0] == pytest.approx(LAG_SPEED, rel=1e-6)


def test_rotor_recovers_at_the_end_of_a_fault() -> None:
    simulator = flown("rotor:2:off@0.1-0.2", seconds=0.2)
    assert speeds(simulator)[1] < 1e-3
    assert simulator.faults == ()
    fly(simulator, 0.2)
    assert speeds(simulator)[1] == pytest.approx(LAG_SPEED, rel=1e-6)


def test_a_weak_rotor_gives_its_share_of_the_thrust() -> None:
    """The vertical acceleration is that of 3.7 rotors: exactly, with the body still level."""
    simulator = Simulator(PAPER)
    fly(simulator, 0.3, 230.0)
    whole = simulator.plant.acceleration_ned_m_s2().z
    simulator.inject(parse_fault("rotor:3:weak=0.7", 4))
    weak = simulator.plant.acceleration_ned_m_s2().z
    assert (9.81 - weak) / (9.81 - whole) == pytest.approx(3.7 / 4.0, rel=1e-6)
    assert speeds(simulator)[2] == pytest.approx(230.0, rel=1e-6)


def test_a_stuck_rotor_turns_at_its_speed_while_armed() -> None:
    simulator = flown("rotor:1:stuck=150")
    assert speeds(simulator)[0] == pytest.approx(150.0, rel=1e-6)
    fly(simulator, 0.2, math.nan)
    assert speeds(simulator)[0] == pytest.approx(150.0, rel=1e-6)
    fly(simulator, 0.2, flags=0)
    assert max(speeds(simulator)) < 1e-3


def test_last_of_two_faults_of_a_rotor_wins() -> None:
    simulator = flown("rotor:1:stuck=150", "rotor:1:off@0.2-0.3", seconds=0.28)
    assert speeds(simulator)[0] < 1.0
    fly(simulator, 0.2)
    assert speeds(simulator)[0] == pytest.approx(150.0, rel=1e-6)
    simulator.clear_faults()
    fly(simulator, 0.2)
    assert speeds(simulator)[0] == pytest.approx(LAG_SPEED, rel=1e-6)


# ---------------------------------------------------------------------- state


def states(simulator: Simulator, count: int, speed: float = 260.0) -> list:
    found = []
    for _ in range(count):
        found.extend(
            m for m in Link(1, 1).decode(bytes(simulator.outgoing())) if m.get_type() == "FS_PLANT_STATE"
        )
        simulator.apply(command(speed))
    return found


def test_frozen_state_has_new_timestamps() -> None:
    simulator, twin = flown("state:freeze@0.5-0.6", seconds=0.48), flown(seconds=0.48)
    seen, truth = states(simulator, 100), states(twin, 100)
    assert [m.time_us for m in seen] == [m.time_us for m in truth]
    same = [m.position_ned_m == t.position_ned_m for m, t in zip(seen, truth, strict=True)]
    assert same == [True] * 11 + [False] * 49 + [True] * 40  # the first frozen state is the true one
    assert len({tuple(m.position_ned_m) for m in seen[10:60]}) == 1
    assert simulator.frame.state.tobytes() == twin.frame.state.tobytes()


def test_nan_fault_sends_nan_states() -> None:
    simulator = flown("state:nan@0.5-0.6", seconds=0.48)
    numbers = [
        [*m.position_ned_m, *m.velocity_ned_m_s, *m.q, *m.rates_frd_rad_s] for m in states(simulator, 100)
    ]
    finite = [bool(np.isfinite(row).any()) for row in numbers]
    assert finite == [True] * 10 + [False] * 50 + [True] * 40
    assert np.isfinite(simulator.frame.state).all()


def test_a_dropped_state_is_not_sent_and_the_battery_is() -> None:
    simulator = flown("state:drop@0.5-0.6", seconds=0.48)
    kinds = []
    for _ in range(100):
        kinds += [m.get_type() for m in Link(1, 1).decode(bytes(simulator.outgoing()))]
        simulator.apply(command(260.0))
    assert kinds.count("FS_PLANT_STATE") == 50
    assert kinds.count("BATTERY_STATUS") == 3  # the first one was due, then at 0.5 s and 0.6 s


def test_the_battery_is_set_at_its_time_and_drains_from_there() -> None:
    simulator = flown("battery:level=0.1@0.25", seconds=0.248)
    before = simulator.plant.battery
    fly(simulator, 0.002)
    at = simulator.plant.battery
    fly(simulator, 0.5)
    end = simulator.plant.battery
    assert before is not None
    assert at is not None
    assert end is not None
    assert before.remaining > 0.99
    assert at.remaining == 0.1
    assert end.remaining == pytest.approx(0.1 - end.current_a * 0.5 / (2.2 * 3600.0), abs=1e-6)
    assert simulator.faults == ()


def test_faults_are_the_same_in_every_run() -> None:
    specs = (
        "rotor:2:weak=0.7@0.1-0.3",
        "state:freeze@0.2-0.25",
        "battery:level=0.5@0.3",
        "state:nan@0.3-0.31",
    )
    runs = []
    for _ in range(2):
        simulator = flown(*specs, seconds=0.0)
        data = b""
        for _ in range(250):
            data += bytes(simulator.outgoing())
            simulator.apply(command(225.0))
        runs.append(data)
    assert runs[0] == runs[1]


# ---------------------------------------------------------------------- the link


def linked(*specs: str) -> FlightStackEndpoint:
    link = FlightStackEndpoint(flown(*specs, seconds=0.0), PAPER, HOME)
    send(link, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 53000, 2000)
    return link


def send(link: FlightStackEndpoint, number: int, *params: float) -> int:
    filled = [*params, *[0.0] * (7 - len(params))]
    link.receive(
        memoryview(Link(1, 1).encode(mavlink.MAVLink_command_long_message(1, 1, number, 0, *filled)))
    )
    (reply,) = link.replies()
    (ack,) = Link(1, 1).decode(reply)
    assert ack.command == number
    return int(ack.result)


def inject(link: FlightStackEndpoint, *params: float) -> int:
    return send(link, mavlink.MAV_CMD_INJECT_FAILURE, *params)


def test_state_drop_is_rejected_in_lockstep() -> None:
    link = linked("state:drop@100-101")
    link.state()
    link.receive(memoryview(bytes(command(flags=ARMED_FLAG | LOCKSTEP_FLAG).frame)))
    assert "state:drop needs a flight stack on its own clock" in (link.error or "")
    free = linked("state:drop@0-0.1")
    free.receive(memoryview(bytes(command(flags=ARMED_FLAG).frame)))
    assert free.error is None
    assert [m.get_type() for m in Link(1, 1).decode(bytes(free.state()))] == ["BATTERY_STATUS"]
    assert bytes(free.state()) == b""


def test_motors_fail_and_recover_by_command() -> None:
    link = linked()
    simulator = link.simulator
    fly(simulator, 0.1)
    assert inject(link, mavlink.FAILURE_UNIT_SYSTEM_MOTOR, mavlink.FAILURE_TYPE_OFF, 2) == 0
    fly(simulator, 0.1)
    assert [speed < 1.0 for speed in speeds(simulator)] == [False, True, False, False]
    assert inject(link, mavlink.FAILURE_UNIT_SYSTEM_MOTOR, mavlink.FAILURE_TYPE_OK, 0) == 0
    fly(simulator, 0.1)
    assert speeds(simulator) == pytest.approx([LAG_SPEED] * 4, rel=1e-6)
    assert inject(link, mavlink.FAILURE_UNIT_SYSTEM_MOTOR, mavlink.FAILURE_TYPE_STUCK, 0) == 0
    fly(simulator, 0.1, 100.0)
    assert speeds(simulator) == pytest.approx([LAG_SPEED] * 4, rel=1e-6)


def test_the_battery_fails_by_command() -> None:
    link = linked()
    assert inject(link, mavlink.FAILURE_UNIT_SYSTEM_BATTERY, mavlink.FAILURE_TYPE_OFF, 0) == 0
    battery = link.simulator.plant.battery
    assert battery is not None
    assert 0.0 < battery.remaining < 0.05
    assert inject(link, mavlink.FAILURE_UNIT_SYSTEM_BATTERY, mavlink.FAILURE_TYPE_OK, 1) == 0
    assert link.simulator.plant.battery is not None
    assert link.simulator.plant.battery.remaining == 1.0


@pytest.mark.parametrize(
    ("params", "result"),
    [
        ((101, 1, 5), mavlink.MAV_RESULT_DENIED), ((101, 1, -1), mavlink.MAV_RESULT_DENIED),
        ((101, 1, 1.5), mavlink.MAV_RESULT_DENIED), ((101, 1, math.nan), mavlink.MAV_RESULT_DENIED),
        ((101, 3, 1), mavlink.MAV_RESULT_UNSUPPORTED), ((101, math.nan, 1), mavlink.MAV_RESULT_UNSUPPORTED),
        ((4, 1, 0), mavlink.MAV_RESULT_UNSUPPORTED), ((math.inf, 1, 0), mavlink.MAV_RESULT_UNSUPPORTED),
        ((100, 2, 0), mavlink.MAV_RESULT_UNSUPPORTED), ((100, 1, 7), mavlink.MAV_RESULT_DENIED),
    ],
)  # fmt: skip
def test_unsupported_failures_are_rejected(params: tuple[float, ...], result: int) -> None:
    link = linked()
    assert inject(link, *params) == result
    assert link.simulator.faults == ()


def test_repeated_failures_do_not_pile_up() -> None:
    link = linked()
    for failure in (mavlink.FAILURE_TYPE_OFF, mavlink.FAILURE_TYPE_SLOW, mavlink.FAILURE_TYPE_STUCK) * 50:
        inject(link, mavlink.FAILURE_UNIT_SYSTEM_MOTOR, failure, 0)
        inject(link, mavlink.FAILURE_UNIT_SYSTEM_BATTERY, mavlink.FAILURE_TYPE_OFF, 0)
    assert len(link.simulator.faults) == 4


def test_third_parties_see_the_faults_too() -> None:
    link = FlightStackEndpoint(flown("state:nan@0-0.01", "state:freeze@0.01-0.02", seconds=0.0), PAPER, HOME)
    send(link, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, HIL_STATE_QUATERNION_ID, 2000)
    rows = []
    for _ in range(15):
        rows.append(list(Link(1, 1).decode(bytes(link.state())))[-1])
        link.simulator.apply(command(300.0))
    assert all(math.isnan(value) for value in rows[0].attitude_quaternion)
    assert len({row.alt for row in rows[5:10]}) == 1
    assert rows[14].vz < rows[9].vz
