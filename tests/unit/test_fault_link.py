"""Faults of the simulator on its link: lockstep, MAVLink commands, third parties."""

from __future__ import annotations

import math

import pytest

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link
from flightstack.simulator_link.hot_frames import ARMED_FLAG, LOCKSTEP_FLAG
from sim_bridge.server.endpoint import HIL_STATE_QUATERNION_ID, FlightStackEndpoint
from tests.support.faulty_simulator import HOME, LAG_SPEED, PAPER, command, flown, fly, speeds


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


def test_fault_of_a_sensor_is_rejected_on_the_true_state() -> None:
    for flags in (ARMED_FLAG, ARMED_FLAG | LOCKSTEP_FLAG):
        link = linked("sensor:gyro:off@100")
        link.receive(memoryview(bytes(command(flags=flags).frame)))
        assert link.error == (
            "the fault of the sensor gyro cannot act: the flight stack flies on the true state; start it with "
            "--state estimated"
        )
    link = linked("sensor:gyro:off@100")
    send(link, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAVLINK_MSG_ID_HIL_SENSOR, 2000)
    link.receive(memoryview(bytes(command(flags=ARMED_FLAG | LOCKSTEP_FLAG).frame)))
    assert link.error is None


@pytest.mark.parametrize("fault", ["state:freeze", "state:nan", "state:drop", "state:late=0.01"])
@pytest.mark.parametrize("flags", [ARMED_FLAG, ARMED_FLAG | LOCKSTEP_FLAG])
def test_fault_of_the_state_is_rejected_on_sensors(fault: str, flags: int) -> None:
    link = linked(f"{fault}@100")
    send(link, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAVLINK_MSG_ID_HIL_SENSOR, 2000)
    link.receive(memoryview(bytes(command(flags=flags).frame)))
    assert link.error == (
        f"{fault.partition('=')[0]} cannot act: the flight stack flies on its sensors; start it with --state truth, "
        "or use a fault of a sensor, such as sensor:imu:freeze"
    )


def test_lockstep_goes_on_with_another_clock() -> None:
    link = linked("clock jump 5 @0.004", "clock stalled @0.008-0.02")
    for _ in range(20):
        link.state()
        link.receive(
            memoryview(
                bytes(command(flags=ARMED_FLAG | LOCKSTEP_FLAG, time_us=link.simulator.stamp_us).frame)
            )
        )
        assert link.answered
        link.step()
    assert (link.stale, link.simulator.stamp_us) == (0, 5_028_000)


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
        sent = {message.get_type(): message for message in Link(1, 1).decode(bytes(link.state()))}
        rows.append(sent["HIL_STATE_QUATERNION"])
        link.simulator.apply(command(300.0))
    assert all(math.isnan(value) for value in rows[0].attitude_quaternion)
    assert len({row.alt for row in rows[5:10]}) == 1
    assert rows[14].vz < rows[9].vz
