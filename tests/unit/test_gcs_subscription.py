"""Streams that the ground station asks for: once, again when they stop, and never again when they are refused."""

from __future__ import annotations

from typing import Any

import pytest

from flightstack.mavlink.dialect import FS_LOOP_TIMING_ID, EscStatus, FsLoopTiming, mavlink
from gcs_cli.link.subscription import RENEW_S, RETRY_S, ROTORS_AND_TIMING, Subscription
from gcs_cli.vehicle.view_types import Identity, VehicleView

VEHICLE = (7, 1)
SET_INTERVAL = int(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL)
TIMING = FsLoopTiming(0, 0, 0, 0, *[0.0] * 9, 0)


def seen(address: tuple[int, int], autopilot: int = mavlink.MAV_AUTOPILOT_PX4) -> VehicleView:
    if address == (0, 0):
        return VehicleView()
    return VehicleView(identity=Identity(*address, mavlink.MAV_TYPE_QUADROTOR, autopilot))


def ack(result: int) -> Any:
    return mavlink.MAVLink_command_ack_message(SET_INTERVAL, result)


def asked(subscription: Subscription, now_s: float) -> list[tuple[int, int, float]]:
    return [(m.target_system, int(m.param1), m.param2) for m in subscription.poll(now_s)]


@pytest.fixture
def subscription() -> Subscription:
    return Subscription(lambda: seen(VEHICLE).identity, ROTORS_AND_TIMING)


def test_a_subscription_asks_for_one_stream_after_the_other(subscription: Subscription) -> None:
    assert asked(subscription, 0.0) == [(7, FS_LOOP_TIMING_ID, 500_000.0)]
    assert asked(subscription, 0.1) == []
    subscription.receive(ack(0), 0.2)
    assert asked(subscription, 0.2) == [(7, EscStatus.id, 100_000.0)]


def test_a_request_without_an_answer_is_repeated(subscription: Subscription) -> None:
    asked(subscription, 0.0)
    assert subscription.next_deadline() == RETRY_S
    assert asked(subscription, RETRY_S) == [(7, FS_LOOP_TIMING_ID, 500_000.0)]


def test_a_stream_that_stops_is_asked_for_again(subscription: Subscription) -> None:
    for _ in range(2):
        asked(subscription, 0.0)
        subscription.receive(ack(0), 0.0)
    subscription.receive(TIMING, 1.0)
    assert asked(subscription, RENEW_S) == [(7, EscStatus.id, 100_000.0)]
    subscription.receive(ack(0), RENEW_S)
    assert asked(subscription, 1.0 + RENEW_S) == [(7, FS_LOOP_TIMING_ID, 500_000.0)]


def test_a_refused_stream_is_not_asked_for_again(subscription: Subscription) -> None:
    for _ in range(2):
        asked(subscription, 0.0)
        subscription.receive(ack(mavlink.MAV_RESULT_UNSUPPORTED), 0.0)
    assert asked(subscription, 1e6) == []
    assert subscription.next_deadline() is None


def test_another_vehicle_is_asked_anew() -> None:
    vehicle = [(0, 0)]
    subscription = Subscription(lambda: seen(vehicle[0]).identity, {FS_LOOP_TIMING_ID: 2.0})
    assert (asked(subscription, 0.0), subscription.next_deadline()) == ([], None)
    vehicle[0] = VEHICLE
    assert len(asked(subscription, 1.0)) == 1
    subscription.receive(ack(mavlink.MAV_RESULT_UNSUPPORTED), 1.0)
    vehicle[0] = (9, 1)
    assert asked(subscription, 2.0) == [(9, FS_LOOP_TIMING_ID, 500_000.0)]


def test_streams_of_ardupilot_are_requested_by_groups_and_again_when_they_stop() -> None:
    ardupilot = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
    subscription = Subscription(lambda: seen(VEHICLE, ardupilot).identity, {})

    def groups(now_s: float) -> int:
        return sum(message.get_type() == "REQUEST_DATA_STREAM" for message in subscription.poll(now_s))

    assert groups(0.0) == 7
    assert groups(1.0) == 0
    subscription.receive(mavlink.MAVLink_attitude_message(0, 0, 0, 0, 0, 0, 0), 2.0)
    assert groups(2.0 + RENEW_S - 0.1) == 0
    assert groups(2.0 + RENEW_S) == 7


def test_nothing_is_requested_from_a_vehicle_that_streams_by_itself() -> None:
    subscription = Subscription(lambda: seen(VEHICLE).identity, {})
    assert subscription.poll(0.0) == []
    assert subscription.next_deadline() is None
