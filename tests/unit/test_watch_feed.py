"""The thread of the link behind ``gcs watch``, with a vehicle on UDP."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address, Link
from flightstack.mavlink.param_values import Parameter
from flightstack.transports.udp import UdpSocket
from gcs_cli.actions import in_flight, on_vehicle
from gcs_cli.clients.param_client import ParamClient
from gcs_cli.errors import CliError
from gcs_cli.link.connection import Connection
from gcs_cli.link.endpoint import parse_endpoint
from gcs_cli.link.session import Session
from gcs_cli.transfers.param_calls import TIMING, change_all
from gcs_cli.tui.feed import Feed
from tests.support.fake_vehicle import ARM, FakeVehicle, serve

HANG_S = 60.0


def until(condition: Callable[[], object]) -> None:
    """Wait for ``condition``; the limit is for a hang only."""
    end_s = time.monotonic() + HANG_S
    while not condition():
        assert time.monotonic() < end_s
        time.sleep(0.01)


@contextmanager
def fed(vehicle: FakeVehicle) -> Iterator[Feed]:
    with serve(vehicle) as socket:
        connection = Connection(parse_endpoint(f"udpout:127.0.0.1:{socket.address[1]}"))
        feed = Feed(connection)
        feed.start()
        try:
            until(lambda: feed.view.identity is not None)
            yield feed
        finally:
            feed.stop()
            connection.close()


def notices(feed: Feed) -> list[str]:
    return [notice.text for notice in feed.notices]


def test_an_action_reports_the_answer_and_the_time_of_its_effect() -> None:
    with fed(FakeVehicle()) as feed:
        feed.act(on_vehicle.arm(), 1)
        until(lambda: any(text.startswith("armed after ") for text in notices(feed)))
        assert feed.view.armed
        texts = [entry.text for entry in feed.messages.since(0) if entry.is_own]
        assert texts[-1].startswith("armed after ")


def test_a_refusal_gives_the_vehicles_reason() -> None:
    with fed(FakeVehicle(refusals={ARM: "Arming refused: no position"})) as feed:
        feed.act(on_vehicle.arm(), 1)
        until(lambda: feed.notices)
        assert "no position" in notices(feed)[-1]


def test_a_new_action_ends_the_wait_for_the_former_one() -> None:
    with fed(FakeVehicle(ignored={ARM})) as feed:
        feed.act(on_vehicle.arm(), 1)
        feed.act(in_flight.hold(), 1)
        until(lambda: "arm: no longer followed" in notices(feed))


def test_a_job_runs_beside_the_reception_of_messages() -> None:
    with fed(FakeVehicle()) as feed:
        count = feed.view.link.received

        def job(connection: Connection) -> int:
            connection.wait_for(lambda: connection.session.view.link.received > count + 5, HANG_S)
            return 42

        assert feed.submit(job).result(HANG_S) == 42


def test_order_is_performed_and_followed_during_a_job() -> None:
    with fed(FakeVehicle()) as feed:

        def job(connection: Connection) -> bool:
            feed.act(on_vehicle.arm(), 1)
            return connection.wait_for(lambda: any("armed after" in text for text in notices(feed)), HANG_S)

        assert feed.submit(job).result()


def test_stop_ends_a_job_that_waits() -> None:
    begun = threading.Event()
    with fed(FakeVehicle()) as feed:
        waiting = feed.submit(lambda connection: connection.wait_for(lambda: bool(begun.set()), HANG_S))
        begun.wait()
        feed.stop()
        with pytest.raises(CliError, match="interrupted"):
            waiting.result()


def test_stop_waits_for_a_job_that_ends_in_order() -> None:
    ended = []

    def job(connection: Connection) -> None:
        begun.set()
        connection.wait_for(lambda: feed.is_stopping, HANG_S)
        count = connection.session.view.link.received
        connection.wait_for(lambda: connection.session.view.link.received > count + 3, HANG_S)
        ended.append(True)

    begun = threading.Event()
    with fed(FakeVehicle()) as feed:
        feed.submit(job, ends_in_order=True)
        later = feed.submit(job)
        begun.wait()
        feed.stop()
        assert ended == [True]
        assert later.cancelled()


def test_job_for_another_vehicle_than_the_selected_one_fails() -> None:
    with fed(FakeVehicle()) as feed:
        assert feed.submit(lambda connection: connection.session.target[0], 1).result() == 1
        with pytest.raises(CliError, match="vehicle 2 is no longer selected"):
            feed.submit(lambda connection: connection.session.target, 2).result()


def test_transfer_stays_on_its_vehicle_if_the_selection_moves() -> None:
    with fed(FakeVehicle()) as feed:

        def job(connection: Connection) -> None:
            first = connection.session
            client = ParamClient(Address(*first.target), first.own, TIMING, casts=False)
            client.start_get("NONE")

            def move(_done: int, _total: int) -> None:
                connection.fleet.selection = (None, Session(wire=connection.fleet.wire))

            connection.run(client, "a parameter", 0.1, move)
            assert connection.session is not first
            assert first.service is None
            connection.fleet.selection = (None, first)
            with pytest.raises(CliError, match="vehicle 1 is no longer selected"):
                change_all(connection, {"NONE": 1.0}, {"NONE": Parameter("NONE", 0.0, False, 0, 1)}, move)

        feed.submit(job).result()


def test_an_error_in_a_job_goes_to_its_caller() -> None:
    def fail(_connection: Connection) -> None:
        raise ValueError("job")

    with fed(FakeVehicle()) as feed:
        with pytest.raises(ValueError, match="job"):
            feed.submit(fail).result(HANG_S)
        assert feed.error is None


def test_an_error_of_the_link_ends_the_feed() -> None:
    with fed(FakeVehicle()) as feed:

        def fail(_until_s: float) -> None:
            raise OSError("link")

        feed.connection.step = fail  # type: ignore[method-assign]
        until(lambda: feed.error is not None)
        assert str(feed.error) == "link"


def test_garbage_and_a_thousand_messages_arrive_beside_each_other() -> None:
    with UdpSocket("127.0.0.1") as vehicle:
        connection = Connection(parse_endpoint(f"udpout:127.0.0.1:{vehicle.address[1]}"))
        feed = Feed(connection)
        feed.start()
        try:
            vehicle.wait(HANG_S)
            ((_hello, peer),) = vehicle.receive()
            link = Link(1, 1)
            vehicle.send(link.encode(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3)), peer)
            for step in range(1_000):
                message = mavlink.MAVLink_attitude_message(step, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
                vehicle.send(link.encode(message), peer)
                if step % 10 == 0:
                    vehicle.send(b"\xfd\x00garbage" * 5, peer)
                    time.sleep(0.005)  # the socket's buffer is finite
            until(lambda: feed.view.link.received >= 1_001)
            assert len(feed.history.series("ATTITUDE.roll", 1).values) == 1_000
            assert feed.error is None
        finally:
            feed.stop()
            connection.close()


def test_several_vehicles_are_selected_and_commanded_together() -> None:
    with UdpSocket("127.0.0.1") as socket:
        connection = Connection(parse_endpoint(f"udpout:127.0.0.1:{socket.address[1]}"))
        feed = Feed(connection)
        feed.start()
        vehicles = {number: FakeVehicle(system_id=number) for number in (3, 4)}
        try:

            def run() -> bool:
                socket.wait(0.01)
                for data, peer in socket.receive():
                    for vehicle in vehicles.values():
                        vehicle.receive(data, time.monotonic())
                        for frame in vehicle.poll(time.monotonic()):
                            socket.send(frame, peer)
                return False

            until(lambda: run() or len(feed.views) == 2)
            assert [view.identity.system_id for view in feed.views if view.identity] == [3, 4]
            assert feed.connection.fleet.is_kept  # a lost vehicle stays selected
            feed.select(4)
            until(lambda: run() or feed.view.identity[0] == 4)
            for number in vehicles:
                feed.act(on_vehicle.arm(), number)
            until(lambda: run() or all(vehicle.armed for vehicle in vehicles.values()))
        finally:
            feed.stop()
            connection.close()
