"""The setpoint service: whose messages it takes, what it says of those it refuses, and when the stream is lost."""

from __future__ import annotations

import math

from flightstack.core.contract import Vector3
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.guidance.setpoints import OffboardSetpoint, PointSetpoint
from flightstack.mavlink.link import Address
from flightstack.services.streams.link_loss import StreamMonitor
from flightstack.services.streams.setpoint_server import PoseReference, SetpointServer
from tests.support.streams import local_point


class Vehicle:
    """Remembers what the service hands on."""

    def __init__(self) -> None:
        self.taken: list[OffboardSetpoint] = []
        self.texts: list[str] = []
        self.lost: list[bool] = []
        self.time_us = 0

    def reference(self) -> PoseReference:
        home = GeoPoint(47.0, 8.0, 500.0)
        return PoseReference(Vector3(0.0, 0.0, 0.0), 0.0, LocalFrame(home), 500.0)

    def take_offboard(self, setpoint: OffboardSetpoint) -> None:
        self.taken.append(setpoint)

    def refuse_offboard(self, reason: str) -> None:
        self.texts.append(reason)

    def server(self) -> SetpointServer:
        return SetpointServer(
            Address(1, 1),
            self.reference,
            self.take_offboard,
            self.refuse_offboard,
            StreamMonitor(lambda: self.time_us, lambda: 1.0, self.lost.append),
        )


def test_the_last_of_several_clients_wins_and_other_targets_are_ignored() -> None:
    vehicle = Vehicle()
    server = vehicle.server()
    server.receive(local_point((1.0, 0.0, -2.0)), "one", 0.0)
    server.receive(local_point((2.0, 0.0, -2.0), target=(0, 0)), "two", 0.01)
    server.receive(local_point((3.0, 0.0, -2.0), target=(2, 1)), "one", 0.02)
    server.receive(local_point((4.0, 0.0, -2.0), target=(1, 190)), "one", 0.03)
    norths = [setpoint.position_ned_m.x for setpoint in vehicle.taken if isinstance(setpoint, PointSetpoint)]
    assert norths == [1.0, 2.0]


def test_a_refusal_is_said_once_and_keeps_no_stream_alive() -> None:
    vehicle = Vehicle()
    server = vehicle.server()
    for tick in range(500):  # ten seconds at 50 Hz, less one message
        server.receive(local_point(velocity=(1.0, float("nan"), 0.0)), "one", 0.02 * tick)
    assert vehicle.texts == ["Setpoint refused: the velocity has only one of its horizontal parts"]
    assert vehicle.lost == []
    assert vehicle.taken == []
    server.receive(local_point(frame=11), "one", 10.0)
    assert vehicle.texts[1:] == ["Setpoint refused: coordinate frame 11 is not supported"]


def test_a_stream_that_ends_is_lost() -> None:
    vehicle = Vehicle()
    server = vehicle.server()
    assert server.next_deadline() is None
    server.receive(local_point((0.0, 0.0, -2.0)), "one", 0.0)
    assert server.next_deadline() == -math.inf  # at every poll: the timeout counts vehicle time
    vehicle.time_us = 900_000
    assert server.poll(0.9) == []
    vehicle.time_us = 1_100_000
    server.poll(1.1)
    assert vehicle.lost == [False, True]
