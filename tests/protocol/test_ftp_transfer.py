"""MAVLink FTP: our client against our server, over good and bad links."""

from __future__ import annotations

import json
import lzma
import math
from collections.abc import Hashable
from types import SimpleNamespace
from typing import Any

import pytest

from flightstack.mavlink.files import Entry, FileTree, fixed
from flightstack.mavlink.ftp_messages import FtpError, next_sequence, read_packet
from flightstack.mavlink.link import Address, Message
from flightstack.services.files.ftp_server import FtpServer
from flightstack.services.logs.log_store import DatedLogs, FlatLogs
from flightstack.transports.memory import LOSSLESS, Conditions
from gcs_cli.clients.ftp_client import RETRY_S, FtpClient, FtpDone, FtpFailed
from gcs_cli.transfers.param_calls import METADATA_SILENCE_S, fetch_metadata
from gcs_cli.vehicle.param_info import METADATA_PATH
from tests.protocol.file_harness import GCS, LOSSY, VEHICLE, Ether, MemoryLogs, Station, content
from tests.support.tools import NIGHTLY

BIG = content(300_000)
LOGS = MemoryLogs({"one.ulg": b"first", "two.ulg": content(1000)})


def tree() -> FileTree:
    return FileTree(
        {
            "big.bin": fixed(BIG),
            "empty": fixed(b""),
            "exact": fixed(BIG[: 239 * 4]),
            "@PARAM/param.pck": lambda arguments: f"pack {arguments}".encode(),
            "etc/extras/general.json": fixed(b"{}"),
        },
        {"@MAV_LOG": FlatLogs(LOGS), "fs/microsd/log": DatedLogs(LOGS)},
    )


def download(
    path: str, conditions: Conditions = LOSSLESS, seed: int = 0, limit_s: float = 60.0
) -> FtpDone | FtpFailed:
    client = FtpClient(VEHICLE, GCS)
    client.start_download(path)
    ether = Ether(FtpServer(VEHICLE, tree()), Station(client, conditions, seed))
    ether.run(lambda: client.result is not None, limit_s)
    assert client.result is not None
    return client.result


def test_a_file_comes_whole_and_fast() -> None:
    client = FtpClient(VEHICLE, GCS)
    client.start_download("/big.bin")
    ether = Ether(FtpServer(VEHICLE, tree()), Station(client))
    took_s = ether.run(lambda: client.result is not None)
    assert client.result == FtpDone(BIG)
    assert client.progress == (300_000, 300_000)
    assert took_s < 0.35  # 1256 packets at 4000 per second: 0.31 s
    assert ether.most_per_poll <= 17  # 16 of a burst, and an answer


@pytest.mark.parametrize("path", ["empty", "exact", "/@PARAM/param.pck", "etc/extras/general.json"])
def test_small_files_and_those_that_fill_their_packets_end(path: str) -> None:
    expected = {"empty": b"", "exact": BIG[: 239 * 4], "/@PARAM/param.pck": b"pack "}.get(path, b"{}")
    assert download(path) == FtpDone(expected)


def test_a_made_up_file_sees_its_arguments() -> None:
    assert download("@PARAM/param.pck?withdefaults=1") == FtpDone(b"pack withdefaults=1")


@pytest.mark.parametrize("seed", range(8 if NIGHTLY else 2))
def test_a_file_is_identical_over_a_link_that_loses_a_third(seed: int) -> None:
    # the worst of these seeds takes 9 s
    assert download("big.bin", LOSSY, seed, limit_s=25.0) == FtpDone(BIG)


@pytest.mark.parametrize(("delay_s", "loss", "most_s"), [(0.3, 0.0, 4.0), (1.0, 0.0, 12.0), (1.0, 0.1, 30.0)])
def test_a_file_is_identical_over_a_link_with_delay(delay_s: float, loss: float, most_s: float) -> None:
    # 2.9 s, 10 s and 20 s: a round trip to open, one for each of three bursts, and those of repeated requests
    assert download("big.bin", Conditions(loss, delay_s=delay_s), 1, limit_s=most_s) == FtpDone(BIG)


def test_directory_is_listed_over_a_link_with_delay() -> None:
    client = FtpClient(VEHICLE, GCS)
    client.start_list("@MAV_LOG")
    ether = Ether(FtpServer(VEHICLE, tree()), Station(client, Conditions(delay_s=1.0)))
    assert ether.run(lambda: client.result is not None) == pytest.approx(4.0, abs=0.3)
    assert client.result == FtpDone(entries=(Entry("one.ulg", 5), Entry("two.ulg", 1000)))


def test_download_continues_as_the_delay_of_the_link_grows() -> None:
    client = FtpClient(VEHICLE, GCS)
    client.start_download("big.bin")
    station = Station(client, Conditions(delay_s=0.02))
    ether = Ether(FtpServer(VEHICLE, tree()), station)
    ether.run(lambda: client.progress[0] > 50_000)
    for end in (station.wire.one, station.wire.two):
        end.conditions = Conditions(delay_s=1.0)
    ether.run(lambda: client.result is not None, 12.0)
    assert client.result == FtpDone(BIG)


@pytest.mark.parametrize("seed", range(4 if NIGHTLY else 2))
def test_half_of_all_packets_may_get_lost(seed: int) -> None:
    conditions = LOSSY._replace(loss=0.5)
    assert download("big.bin", conditions, seed, limit_s=60.0) == FtpDone(BIG)


@pytest.mark.parametrize(
    "path", ["nothing", "../etc/passwd", "etc/../big.bin", "etc", "", "@MAV_LOG/../big.bin"]
)
def test_what_is_not_there_is_refused(path: str) -> None:
    assert download(path) == FtpFailed("there is no such file", FtpError.FILE_NOT_FOUND)


def test_silence_ends_a_download() -> None:
    result = download("big.bin", Conditions(loss=1.0))
    assert result == FtpFailed("the vehicle (system 1) does not answer")


def test_the_link_breaks_in_the_middle_of_a_download() -> None:
    client = FtpClient(VEHICLE, GCS)
    client.start_download("big.bin")
    station = Station(client)
    ether = Ether(FtpServer(VEHICLE, tree()), station)
    ether.run(lambda: client.progress[0] > 50_000)
    station.wire.two.conditions = Conditions(loss=1.0)
    took_s = ether.run(lambda: client.result is not None)
    assert isinstance(client.result, FtpFailed)
    assert 5.0 < took_s < 8.0


def test_directories_are_listed() -> None:
    def listing(path: str) -> object:
        client = FtpClient(VEHICLE, GCS)
        client.start_list(path)
        Ether(FtpServer(VEHICLE, tree()), Station(client, LOSSY)).run(lambda: client.result is not None)
        return client.result.entries if isinstance(client.result, FtpDone) else client.result

    root = ("@MAV_LOG", "@PARAM", "etc", "fs")
    assert listing("/") == (
        *(Entry(name, None) for name in root),
        Entry("big.bin", 300_000), Entry("empty", 0), Entry("exact", 956),
    )  # fmt: skip
    assert listing("@PARAM") == (Entry("param.pck", 5),)
    assert listing("/fs/microsd/log") == (Entry("2023-11-14", None), Entry("2023-11-15", None))
    assert listing("/fs/microsd/log/2023-11-15") == (Entry("two.ulg", 1000),)
    assert listing("@MAV_LOG") == (Entry("one.ulg", 5), Entry("two.ulg", 1000))
    assert listing("/nothing") == FtpFailed("there is no such file", FtpError.FILE_NOT_FOUND)


def test_a_long_list_comes_in_parts() -> None:
    names = {f"log {n:04d} with a long name.ulg": bytes(n) for n in range(300)}
    client = FtpClient(VEHICLE, GCS)
    client.start_list("@MAV_LOG")
    server = FtpServer(VEHICLE, FileTree({}, {"@MAV_LOG": FlatLogs(MemoryLogs(names))}))
    Ether(server, Station(client, LOSSY, 3)).run(lambda: client.result is not None)
    assert client.result == FtpDone(entries=tuple(Entry(name, len(data)) for name, data in names.items()))


def test_an_empty_directory_ends() -> None:
    client = FtpClient(VEHICLE, GCS)
    client.start_list("@MAV_LOG")
    server = FtpServer(VEHICLE, FileTree({}, {"@MAV_LOG": FlatLogs(MemoryLogs({}))}))
    Ether(server, Station(client)).run(lambda: client.result is not None)
    assert client.result == FtpDone()


def test_clients_download_at_once_and_share_fairly() -> None:
    clients = [FtpClient(VEHICLE, Address(200 + n, 190)) for n in range(8)]
    stations = [Station(client, seed=n, address=client.own) for n, client in enumerate(clients)]
    for client in clients:
        client.start_download("big.bin")
    ether = Ether(FtpServer(VEHICLE, tree()), *stations)
    ether.run(lambda: any(client.result is not None for client in clients))
    assert min(client.progress[0] for client in clients) > 280_000
    ether.run(lambda: all(client.result is not None for client in clients))
    assert all(client.result == FtpDone(BIG) for client in clients)
    assert ether.most_per_poll <= 16 + len(clients)


class RepeatingServer(FtpServer):
    """Takes a request with the number of the last one for its repetition, as PX4's mavlink_ftp.cpp does."""

    last: Message = None
    repeated: tuple[tuple[Hashable, Message], ...] = ()

    def receive(self, message: Message, peer: Hashable, now_s: float) -> None:
        sequence = next_sequence(read_packet(message).sequence)
        if self.last is not None and read_packet(self.last).sequence == sequence:
            self.repeated = ((peer, self.last),)
        else:
            super().receive(message, peer, now_s)

    def poll(self, now_s: float) -> list[tuple[Hashable | None, Message]]:
        answers = super().poll(now_s)
        self.last = answers[-1][1] if answers else self.last
        repeated, self.repeated = self.repeated, ()
        return [*repeated, *answers]


@pytest.mark.parametrize("first", [0, 65_535])
def test_an_answer_to_an_earlier_client_is_not_taken_for_a_refusal(
    first: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("random.randrange", lambda _end: first)
    earlier, client = FtpClient(VEHICLE, GCS), FtpClient(VEHICLE, GCS)
    earlier.start_list("nothing")
    client.start_download("exact")
    stations = [Station(earlier), Station(client)]
    ether = Ether(RepeatingServer(VEHICLE, tree()), stations[0])
    ether.run(lambda: earlier.result is not None)
    ether.stations = (stations[1],)
    ether.run(lambda: client.result is not None)
    assert client.result == FtpDone(BIG[: 239 * 4])


def test_clients_begin_with_different_numbers() -> None:
    numbers = set()
    for _ in range(4):  # equal by chance in one of 10^14 runs
        client = FtpClient(VEHICLE, GCS)
        client.start_list("etc")
        numbers |= {read_packet(message).sequence for message in client.poll(0.0)}
    assert len(numbers) > 1


@pytest.mark.parametrize("silence_s", [1.0, 3.0])
def test_a_download_ends_after_a_time_without_progress(silence_s: float) -> None:
    client = FtpClient(VEHICLE, GCS, silence_s)
    client.start_download("big.bin")
    ether = Ether(FtpServer(VEHICLE, tree()), Station(client, Conditions(loss=1.0)))
    assert ether.run(lambda: client.result is not None) == pytest.approx(silence_s, abs=RETRY_S)
    assert isinstance(client.result, FtpFailed)


class LossyConnection:
    """Runs a transfer from a vehicle with metadata over a link that loses 70 %, in simulated time."""

    session = SimpleNamespace(target=VEHICLE, own=GCS)
    took_s = 0.0

    def run(self, client: FtpClient, _name: str, timeout_s: float = math.inf) -> None:
        entry = {"name": "MPC_XY_CRUISE", "type": "Float", "longDesc": content(2000).hex()}
        document = json.dumps({"version": 1, "parameters": [entry]}).encode()
        files = FileTree({METADATA_PATH: fixed(lzma.compress(document))}, {})
        conditions = Conditions(loss=0.7, delay_s=0.02)
        ether = Ether(FtpServer(VEHICLE, files), Station(client, conditions, seed=6))
        end_s = ether.now_s + timeout_s
        self.took_s = ether.run(lambda: client.result is not None or ether.now_s >= end_s)


def test_metadata_on_a_slow_link_are_complete() -> None:
    connection: Any = LossyConnection()
    assert set(fetch_metadata(connection)) == {"MPC_XY_CRUISE"}
    assert connection.took_s > METADATA_SILENCE_S  # 6.4 s


def test_one_client_downloads_one_file_after_another() -> None:
    client = FtpClient(VEHICLE, GCS)
    ether = Ether(FtpServer(VEHICLE, tree()), Station(client, LOSSY, 5))
    for path, expected in (("big.bin", BIG), ("exact", BIG[: 239 * 4]), ("big.bin", BIG), ("empty", b"")):
        client.start_download(path)
        ether.run(lambda: client.result is not None)
        assert client.result == FtpDone(expected)


def test_a_new_download_takes_the_place_of_the_one_under_way() -> None:
    client = FtpClient(VEHICLE, GCS)
    ether = Ether(FtpServer(VEHICLE, tree()), Station(client, Conditions(delay_s=0.05)))
    client.start_download("big.bin")
    ether.run(lambda: client.progress[0] > 100_000)
    client.start_download("exact")
    ether.run(lambda: client.result is not None)
    assert client.result == FtpDone(BIG[: 239 * 4])  # nothing of the burst that still arrives
