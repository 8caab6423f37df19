"""Sticks: from the message to what guidance makes of them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightstack.core.enums import Mode
from flightstack.guidance.manual import shaped
from flightstack.guidance.setpoints import Sticks
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address
from flightstack.services.streams.link_loss import StreamMonitor
from flightstack.services.streams.manual_server import ManualServer, read_sticks
from tests.support.perfect_vehicle import PerfectVehicle


def message(x: int = 0, y: int = 0, z: int = 500, r: int = 0, target: int = 1):
    return mavlink.MAVLink_manual_control_message(target, x, y, z, r, 0)


@pytest.mark.parametrize(
    ("sent", "sticks"),
    [
        (message(), (0.0, 0.0, 0.0, 0.0)),
        (message(1000, -1000, 1000, 500), (1.0, -1.0, 1.0, 0.5)),
        (message(z=0), (0.0, 0.0, -1.0, 0.0)),
        (message(z=-1000), (0.0, 0.0, -1.0, 0.0)),
        (message(0x7FFF, 0x7FFF, 0x7FFF, 0x7FFF), (0.0, 0.0, 0.0, 0.0)),
        (message(-32768, 5000, 32766, -1001), (-1.0, 1.0, 1.0, -1.0)),
    ],
)
def test_the_message_is_read_as_px4_reads_it(sent, sticks: tuple[float, ...]) -> None:  # type: ignore[no-untyped-def]
    assert read_sticks(sent) == pytest.approx(sticks)


@given(st.floats(-1.0, 1.0), st.floats(0.0, 0.9), st.floats(0.0, 1.0))
def test_a_shaped_stick_is_odd_reaches_its_ends_and_rests_in_the_dead_zone(
    stick: float, deadzone: float, expo: float
) -> None:
    value = shaped(stick, deadzone, expo)
    assert abs(value) <= 1.0 + 1e-12
    assert value == -shaped(-stick, deadzone, expo)
    assert value * stick >= 0.0
    assert shaped(1.0, deadzone, expo) == pytest.approx(1.0)
    if abs(stick) <= deadzone:
        assert value == 0.0


def in_position(sticks: Sticks, down: float = -20.0, **params: float) -> PerfectVehicle:
    vehicle = PerfectVehicle(**params)
    vehicle.airborne_at(0.0, 0.0, down)
    vehicle.navigator.set_sticks(sticks)
    vehicle.enter(Mode.POSITION)
    return vehicle


def test_full_sticks_fly_at_the_speeds_of_the_parameters() -> None:
    vehicle = in_position(Sticks(1.0, 0.0, 1.0, 0.0), MPC_VEL_MANUAL=6.0, MPC_Z_VEL_MAX_UP=2.0)
    vehicle.run(6.0)
    assert vehicle.state[3:6] == pytest.approx([6.0, 0.0, -2.0], abs=1e-3)
    vehicle.navigator.set_sticks(Sticks(0.7, 0.7, -1.0, 0.0))  # the corner is no faster than the side
    vehicle.run(6.0)
    assert math.hypot(*vehicle.state[3:5]) <= 6.0 + 1e-3
    assert vehicle.state[5] == pytest.approx(1.5, abs=1e-3)


def test_forward_is_where_the_vehicle_looks_and_yaw_turns_at_its_rate() -> None:
    vehicle = in_position(Sticks(0.0, 0.0, 0.0, 1.0), MPC_MAN_Y_MAX=45.0)
    vehicle.run(8.0)
    assert vehicle.turned == pytest.approx(math.radians(45.0) * 8.0, abs=0.15)  # 0.11 rad to get going
    vehicle.navigator.set_sticks(Sticks(0.0, 0.0, 0.0, 0.0))
    vehicle.run(3.0)
    yaw = vehicle.yaw
    vehicle.navigator.set_sticks(Sticks(1.0, 0.0, 0.0, 0.0))
    vehicle.run(5.0)
    assert math.atan2(vehicle.state[4], vehicle.state[3]) == pytest.approx(yaw, abs=1e-3)


def test_centred_sticks_brake_and_hold_the_place() -> None:
    vehicle = in_position(Sticks(1.0, 0.0, 0.0, 0.0))
    vehicle.run(5.0)
    vehicle.navigator.set_sticks(Sticks(0.05, -0.05, 0.08, 0.02))  # not quite centred: within the dead zone
    vehicle.run(8.0)
    place = vehicle.position
    vehicle.run(10.0)
    assert vehicle.position == pytest.approx(place, abs=1e-4)
    assert np.abs(vehicle.state[3:6]).max() < 1e-4


def test_a_descent_by_stick_slows_near_the_ground_and_lands() -> None:
    vehicle = in_position(Sticks(0.0, 0.0, -1.0, 0.0), down=-6.0)
    vehicle.until(lambda: vehicle.navigator.landed)
    path = np.array(vehicle.path)
    sink = np.diff(path[:, 2]) / vehicle.dt_s
    assert sink.max() == pytest.approx(1.5, rel=0.01)
    assert sink[path[1:, 2] > -1.5].max() == pytest.approx(0.7, abs=0.02)


def test_only_a_raised_throttle_takes_off() -> None:
    vehicle = PerfectVehicle()
    for up, rises in ((-1.0, False), (0.0, False), (0.3, False), (0.9, True), (1.0, True)):
        vehicle.navigator.set_sticks(Sticks(0.0, 0.0, up, 0.0))
        for mode in (Mode.POSITION, Mode.ALTITUDE):
            assert vehicle.navigator.wants_to_rise(mode, 0.0) is rises


class Facts:
    """What the services report, and the vehicle's clock."""

    def __init__(self) -> None:
        self.time_us = 0
        self.lost = True
        self.reports: list[bool] = []
        self.sticks: list[Sticks] = []

    def report(self, lost: bool) -> None:
        self.lost = lost
        self.reports.append(lost)

    def server(self) -> ManualServer:
        watch = StreamMonitor(lambda: self.time_us, lambda: 0.5, self.report)
        return ManualServer(Address(1, 1), self.sticks.append, watch)


def test_stream_is_lost_after_its_timeout_in_vehicle_time() -> None:
    facts = Facts()
    server = facts.server()
    server.poll(0.0)
    assert facts.reports == []  # it never began
    server.receive(message(), "peer", 10.0)
    assert not facts.lost
    server.poll(12.0)  # the vehicle's time stands still
    assert not facts.lost
    facts.time_us += 500_000
    server.poll(12.0)
    assert not facts.lost
    facts.time_us += 1
    server.poll(12.0)
    assert facts.reports == [False, True]
    server.receive(message(), "peer", 20.0)
    assert facts.reports == [False, True, False]


def test_sticks_for_another_system_are_not_ours() -> None:
    facts = Facts()
    server = facts.server()
    server.receive(message(target=7), "peer", 0.0)
    assert facts.sticks == []
    assert facts.lost
    server.receive(message(x=1000), "one", 0.0)
    server.receive(message(x=-1000, target=0), "another", 0.01)
    assert facts.sticks[-1].forward == -1.0  # the last writer wins
