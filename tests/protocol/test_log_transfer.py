"""The log protocol: our client against our server, over good and bad links."""

from __future__ import annotations

from collections.abc import Callable, Hashable

import pytest

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address, Link, Message
from flightstack.services.logs.log_server import LogServer
from flightstack.transports.memory import LOSSLESS, Conditions
from gcs_cli.clients.log_client import LogClient, LogDone, LogEntry, LogFailed
from gcs_cli.errors import NO_ANSWER, CliError
from gcs_cli.link.connection import Connection
from gcs_cli.link.endpoint import parse_endpoint
from gcs_cli.transfers import log_calls
from gcs_cli.transfers.log_calls import kept_logs, oldest_first
from gcs_cli.vehicle.view_types import VehicleView
from tests.protocol.file_harness import GCS, LOSSY, VEHICLE, Ether, MemoryLogs, Station, content
from tests.support.tools import NIGHTLY

LOGS = {"first.ulg": content(90 * 30), "empty.ulg": b"", "big.ulg": content(200_000), "open.ulg": content(91)}


class Vehicle:
    """A server, and what it said."""

    def __init__(self, logs: dict[str, bytes] | None = None) -> None:
        self.store = MemoryLogs(LOGS if logs is None else logs)
        self.is_armed = False
        self.texts: list[tuple[int, str]] = []
        self.server = LogServer(
            VEHICLE, self.store, lambda: self.is_armed, lambda level, text: self.texts.append((level, text))
        )

    def tell(self, message: Message, now_s: float = 0.0, source: Address = GCS) -> None:
        """Let a message of ``source`` arrive."""
        message.get_header().srcSystem, message.get_header().srcComponent = source
        self.server.receive(message, source, now_s)

    def answers(self, polls: int = 50) -> list[Message]:
        """Return what is sent in ``polls`` polls, one every hundredth of a second."""
        return [message for n in range(polls) for _, message in self.server.poll(n * 0.01)]


def entry_of(name: str) -> LogEntry:
    number = list(LOGS).index(name)
    return LogEntry(number, len(LOGS[name]), 1_700_000_000 + 86_400 * number)


def fetch(entry: LogEntry, conditions: Conditions = LOSSLESS, seed: int = 0) -> tuple[object, float]:
    client = LogClient(VEHICLE)
    client.start_download(entry)
    took_s = Ether(Vehicle().server, Station(client, conditions, seed)).run(lambda: client.result is not None)
    return client.result, took_s


@pytest.mark.parametrize("seed", range(4 if NIGHTLY else 2))
def test_the_list_is_complete(seed: int) -> None:
    client = LogClient(VEHICLE)
    client.start_list()
    Ether(Vehicle().server, Station(client, LOSSY, seed)).run(lambda: client.result is not None, 10.0)
    assert client.result == LogDone(tuple(entry_of(name) for name in LOGS))


def test_no_logs_are_a_list_too() -> None:
    client = LogClient(VEHICLE)
    client.start_list()
    Ether(Vehicle({}).server, Station(client)).run(lambda: client.result is not None)
    assert client.result == LogDone()


@pytest.mark.parametrize("name", LOGS)
def test_a_log_comes_whole(name: str) -> None:
    result, took_s = fetch(entry_of(name))
    assert result == LogDone(content=LOGS[name])
    assert took_s < 0.6  # 2223 messages at 4000 per second


@pytest.mark.parametrize("seed", range(6 if NIGHTLY else 2))
def test_a_log_is_identical_over_a_link_that_loses_a_third(seed: int) -> None:
    result, took_s = fetch(entry_of("big.ulg"), LOSSY, seed)
    assert result == LogDone(content=LOGS["big.ulg"])
    assert took_s < 20.0  # the worst of these seeds takes 8 s


def test_a_vehicle_that_is_silent_is_given_up() -> None:
    result, _ = fetch(entry_of("big.ulg"), Conditions(loss=1.0))
    assert result == LogFailed("the vehicle (system 1) does not answer", silent=True)


def test_a_log_that_is_not_there_ends_at_once() -> None:
    result, took_s = fetch(LogEntry(9, 1000, 0))
    assert result == LogFailed("the vehicle cannot read the log, or it became shorter")
    assert took_s < 0.1


def test_clients_download_at_once() -> None:
    clients = [LogClient(VEHICLE) for _ in range(6)]
    stations = [Station(client, address=Address(200 + n, 190)) for n, client in enumerate(clients)]
    for client in clients:
        client.start_download(entry_of("big.ulg"))
    ether = Ether(Vehicle().server, *stations)
    ether.run(lambda: any(client.result is not None for client in clients))
    assert min(client.progress[0] for client in clients) > 190_000
    ether.run(lambda: all(client.result is not None for client in clients))
    assert all(client.result == LogDone(content=LOGS["big.ulg"]) for client in clients)
    assert ether.most_per_poll <= 16


def test_entries_are_numbered_from_zero_as_in_px4() -> None:
    vehicle = Vehicle()
    vehicle.tell(mavlink.MAVLink_log_request_list_message(1, 1, 0, 0xFFFF))
    entries = vehicle.answers()
    assert [(e.id, e.num_logs, e.last_log_num) for e in entries] == [(n, 4, 3) for n in range(4)]


def test_a_range_of_entries_is_brought_into_bounds() -> None:
    vehicle = Vehicle()
    vehicle.tell(mavlink.MAVLink_log_request_list_message(1, 1, 2, 2))
    assert [entry.id for entry in vehicle.answers()] == [2]
    vehicle.tell(mavlink.MAVLink_log_request_list_message(1, 1, 40, 50))
    assert [entry.id for entry in vehicle.answers()] == [3]


def test_a_log_that_begins_meanwhile_moves_no_number() -> None:
    vehicle = Vehicle()
    vehicle.tell(mavlink.MAVLink_log_request_list_message(1, 1, 0, 0xFFFF))
    vehicle.answers()
    vehicle.store.content = {"older.ulg": b"older", **vehicle.store.content}
    vehicle.tell(mavlink.MAVLink_log_request_data_message(1, 1, 0, 0, 90))
    assert bytes(vehicle.answers()[0].data) == LOGS["first.ulg"][:90]


def test_who_asks_for_more_than_there_is_learns_where_a_log_of_whole_blocks_ends() -> None:
    vehicle = Vehicle()
    vehicle.tell(mavlink.MAVLink_log_request_data_message(1, 1, 0, 0, 0xFFFFFFFF))
    blocks = vehicle.answers()
    assert [block.count for block in blocks] == [90] * 30 + [0]
    vehicle.tell(mavlink.MAVLink_log_request_data_message(1, 1, 0, 0, 2700))
    assert [block.count for block in vehicle.answers()] == [90] * 30


def test_small_requests_wait_for_each_other_and_a_large_one_begins_anew() -> None:
    vehicle = Vehicle()
    for offset in (180, 0, 90, 0):  # as MAVProxy fills gaps
        vehicle.tell(mavlink.MAVLink_log_request_data_message(1, 1, 2, offset, 90))
    assert [block.ofs for block in vehicle.answers(1)] == [180, 0, 90]
    vehicle.tell(mavlink.MAVLink_log_request_data_message(1, 1, 2, 0, 200_000))
    vehicle.tell(mavlink.MAVLink_log_request_data_message(1, 1, 2, 90_000, 1800))
    assert [block.ofs for block in vehicle.answers()] == list(range(90_000, 91_800, 90))


def test_end_stops_a_download() -> None:
    vehicle = Vehicle()
    vehicle.tell(mavlink.MAVLink_log_request_data_message(1, 1, 2, 0, 0xFFFFFFFF))
    assert vehicle.answers(1)
    vehicle.tell(mavlink.MAVLink_log_request_end_message(1, 1))
    assert not vehicle.answers()
    assert vehicle.server.next_deadline() is not None  # it is forgotten after a while


def test_erasing_keeps_the_open_log_and_tells() -> None:
    vehicle = Vehicle()
    vehicle.tell(mavlink.MAVLink_log_erase_message(1, 1))
    assert list(vehicle.store.content) == ["open.ulg"]
    assert vehicle.texts == [(mavlink.MAV_SEVERITY_NOTICE, "3 logs erased")]


def test_nothing_is_erased_while_armed() -> None:
    vehicle = Vehicle()
    vehicle.is_armed = True
    vehicle.tell(mavlink.MAVLink_log_erase_message(1, 1))
    assert len(vehicle.store.content) == 4
    assert vehicle.texts == [(mavlink.MAV_SEVERITY_WARNING, "Logs not erased: the vehicle is armed")]


def test_messages_for_others_are_ignored() -> None:
    vehicle = Vehicle()
    vehicle.tell(mavlink.MAVLink_log_erase_message(2, 1))
    vehicle.tell(mavlink.MAVLink_log_request_list_message(1, 7, 0, 0xFFFF))
    assert len(vehicle.store.content) == 4
    assert not vehicle.answers()
    assert vehicle.server.next_deadline() is None


def test_a_silent_client_is_forgotten() -> None:
    vehicle = Vehicle()
    vehicle.tell(mavlink.MAVLink_log_request_data_message(1, 1, 2, 0, 90))
    assert vehicle.answers(1)
    assert not vehicle.server.poll(31.0)
    assert vehicle.server.next_deadline() is None


def test_log_data_waits_for_a_congested_peer_and_not_for_others() -> None:
    vehicle, congested, other = Vehicle(), {GCS}, Address(254, 190)
    server = LogServer(
        VEHICLE, vehicle.store, lambda: False, lambda *_: None, lambda peer: peer not in congested
    )
    for source in (GCS, other):
        request = mavlink.MAVLink_log_request_data_message(1, 1, 0, 0, 180)
        request.get_header().srcSystem, request.get_header().srcComponent = source
        server.receive(request, source, 0.0)
    assert [peer for peer, _ in server.poll(0.0)] == [other, other]
    for second in range(60):
        assert server.poll(float(second)) == []
    assert not server.is_busy
    congested.clear()
    assert server.is_busy
    assert [(peer, message.ofs) for peer, message in server.poll(60.0)] == [(GCS, 0), (GCS, 90)]


def listed(vehicle: Vehicle, conditions: Conditions = LOSSLESS, seed: int = 0) -> tuple[int, ...]:
    """Return the ids of the logs that a client lists."""
    client = LogClient(VEHICLE)
    client.start_list()
    Ether(vehicle.server, Station(client, conditions, seed)).run(lambda: client.result is not None, 10.0)
    assert isinstance(client.result, LogDone)
    return tuple(entry.log_id for entry in client.result.entries)


class Px4Server(LogServer):
    """Announces the number of logs as last_log_num, as PX4 does, whose ids end one before."""

    def poll(self, now_s: float) -> list[tuple[Hashable | None, Message]]:
        sent = super().poll(now_s)
        for _, message in sent:
            if message.get_type() == "LOG_ENTRY":
                message.last_log_num = message.num_logs
        return sent


@pytest.mark.parametrize("seed", range(4))
def test_log_list_of_px4_ends_with_the_last_id(seed: int) -> None:
    vehicle = Vehicle()
    vehicle.server = Px4Server(VEHICLE, vehicle.store, lambda: False, lambda *_: None)
    assert listed(vehicle, LOSSY if seed else LOSSLESS, seed) == (0, 1, 2, 3)


def silent_client(start: Callable[[LogClient], object], *, is_linked: bool = True) -> LogClient:
    """Return a client at its end with a vehicle that answers TIMESYNC if ``is_linked``, and no request for a list."""
    client = LogClient(VEHICLE, is_silent_without_logs=True)
    start(client)
    for tenth in range(100):
        for message in client.poll(tenth / 10):
            if message.get_type() == "TIMESYNC" and is_linked:
                client.receive(as_received(mavlink.MAVLink_timesync_message(7, message.ts1)), tenth / 10)
        client.receive(as_received(mavlink.MAVLink_timesync_message(7, 7)), tenth / 10)  # for another client
    return client


def test_silence_without_logs_is_an_empty_list_as_of_px4() -> None:
    assert silent_client(LogClient.start_list, is_linked=False).result == LogDone()


def test_silence_after_an_erase_is_an_empty_list_if_the_vehicle_answers() -> None:
    assert silent_client(lambda client: client.start_erase(3)).result == LogDone()


def test_silence_after_an_erase_confirms_nothing_if_the_vehicle_does_not_answer() -> None:
    result = silent_client(lambda client: client.start_erase(3), is_linked=False).result
    assert result == LogFailed("the vehicle (system 1) does not confirm it", silent=True)


def test_silence_after_the_text_of_an_erase_is_an_empty_list() -> None:
    client = LogClient(VEHICLE, is_silent_without_logs=True)
    client.start_erase(3)
    client.poll(0.0)
    client.receive(
        as_received(mavlink.MAVLink_statustext_message(mavlink.MAV_SEVERITY_NOTICE, b"3 logs erased")), 0.1
    )
    for tenth in range(2, 100):
        client.poll(tenth / 10)
    assert client.result == LogDone()


def test_silence_in_a_list_that_has_begun_is_no_empty_list() -> None:
    client = LogClient(VEHICLE, is_silent_without_logs=True)
    client.start_list()
    client.poll(0.0)
    client.receive(as_received(mavlink.MAVLink_log_entry_message(0, 3, 2, 0, 9)), 0.1)
    for tenth in range(2, 100):
        client.poll(tenth / 10)
    assert isinstance(client.result, LogFailed)


def test_logs_are_ordered_by_time_because_px4_numbers_them_in_no_order() -> None:
    logs = tuple(LogEntry(number, 9, time_s) for number, time_s in enumerate((50, 70, 40)))
    assert [log.log_id for log in oldest_first(logs)] == [2, 0, 1]
    unknown = (*logs, LogEntry(3, 9, 0))
    assert oldest_first(unknown) == unknown


def test_log_that_begins_after_an_erase_was_not_left_by_it() -> None:
    before = (LogEntry(1, 500, 0), LogEntry(2, 900, 0))
    assert kept_logs(before, (LogEntry(1, 0, 0),)) == ()
    assert kept_logs(before, (LogEntry(2, 950, 0), LogEntry(3, 10, 0))) == (LogEntry(2, 950, 0),)


def test_list_that_fails_after_a_download_leaves_it_open_if_the_log_grows(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fetch_list(connection: object) -> tuple[LogEntry, ...]:
        raise CliError("log list: the vehicle did not answer", NO_ANSWER)

    monkeypatch.setattr(log_calls, "fetch_list", fetch_list)
    newest = entry_of("open.ulg")
    with Connection(parse_endpoint("udpout:127.0.0.1:1")) as connection:
        assert log_calls.is_growing(connection, newest, (newest,)) is None
        connection.session.view = VehicleView(armed=True)
        assert log_calls.is_growing(connection, newest, (newest,)) is True


def erased(vehicle: Vehicle, conditions: Conditions = LOSSLESS, seed: int = 0) -> LogDone | LogFailed | None:
    client = LogClient(VEHICLE)
    client.start_erase(len(vehicle.store.content))
    Ether(vehicle.server, Station(client, conditions, seed)).run(lambda: client.result is not None, 20.0)
    return client.result


@pytest.mark.parametrize("seed", range(3))
def test_erase_ends_when_fewer_logs_are_left(seed: int) -> None:
    vehicle = Vehicle()
    result = erased(vehicle, LOSSY if seed else LOSSLESS, seed)
    assert isinstance(result, LogDone)
    assert [entry.size for entry in result.entries] == [len(LOGS["open.ulg"])]


def test_erase_without_effect_ends_with_the_same_list() -> None:
    vehicle = Vehicle({"open.ulg": b"abc"})
    assert erased(vehicle) == LogDone((LogEntry(0, 3, 1_700_000_000),))


def test_erase_reports_the_refusal_of_an_armed_vehicle() -> None:
    client = LogClient(VEHICLE)
    client.start_erase(4)
    client.poll(0.0)
    text = mavlink.MAVLink_statustext_message(
        mavlink.MAV_SEVERITY_WARNING, b"Logs not erased: the vehicle is armed"
    )
    client.receive(as_received(text), 0.1)
    assert client.result == LogFailed("the vehicle is armed")


def as_received(message: Message) -> Message:
    (decoded,) = Link(*GCS).decode(Link(*VEHICLE).encode(message))
    return decoded


def test_the_client_takes_numbers_from_one_as_ardupilot_gives_them() -> None:
    client = LogClient(VEHICLE)
    client.start_list()
    client.poll(0.0)
    for number in (2, 1, 3):
        message = mavlink.MAVLink_log_entry_message(number, 3, 3, 5, 100 * number)
        message.get_header().srcSystem, message.get_header().srcComponent = VEHICLE
        client.receive(message, 0.1)
    assert client.result == LogDone(tuple(LogEntry(n, 100 * n, 5) for n in (1, 2, 3)))
