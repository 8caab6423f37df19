"""TIMESYNC and PING."""

from __future__ import annotations

import pytest

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link
from flightstack.services.streams.timesync import TimeService


class Clock:
    time_us = 2_500_000


@pytest.fixture
def service() -> TimeService:
    return TimeService(lambda: Clock.time_us)


def asked(service: TimeService, message) -> list:
    (received,) = Link(9, 9).decode(Link(255, 190).encode(message))
    service.receive(received, "peer", 0.0)
    return service.poll(0.0)


def test_a_request_for_the_time_is_answered_with_the_vehicles_time(service) -> None:
    ((peer, answer),) = asked(service, mavlink.MAVLink_timesync_message(0, 123456789))
    assert peer == "peer"
    assert (answer.tc1, answer.ts1) == (2_500_000_000, 123456789)


def test_at_boot_the_answer_is_not_a_request_itself(monkeypatch, service) -> None:
    monkeypatch.setattr(Clock, "time_us", 0)
    ((_, answer),) = asked(service, mavlink.MAVLink_timesync_message(0, 5))
    assert answer.tc1 != 0


@pytest.mark.parametrize(
    "message",
    [
        mavlink.MAVLink_timesync_message(7, 5),  # somebody's answer
        mavlink.MAVLink_ping_message(9, 4, 1, 1),  # an answer to a ping of ours, though we sent none
        mavlink.MAVLink_ping_message(9, 4, 2, 1),
    ],
)
def test_what_asks_nothing_of_us_is_not_answered(service, message) -> None:
    assert asked(service, message) == []


def test_a_ping_is_echoed_to_its_sender(service) -> None:
    ((peer, answer),) = asked(service, mavlink.MAVLink_ping_message(99, 4, 0, 0))
    assert (peer, answer.time_usec, answer.seq) == ("peer", 99, 4)
    assert (answer.target_system, answer.target_component) == (255, 190)


def test_a_flood_of_requests_fills_no_memory(service) -> None:
    (received,) = Link(9, 9).decode(Link(255, 190).encode(mavlink.MAVLink_ping_message(0, 0, 0, 0)))
    for _ in range(10_000):
        service.receive(received, "peer", 0.0)
    assert len(service.poll(0.0)) <= 64
    assert service.next_deadline() is None
