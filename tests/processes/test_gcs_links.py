"""``gcs`` over each kind of link against scripted vehicles: TCP, serial ports, recordings, shared links."""

from __future__ import annotations

import errno
import json
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from flightstack.transports.udp import UdpSocket
from gcs_cli.errors import CliError
from gcs_cli.link.connection import Connection
from gcs_cli.link.endpoint import VehicleEndpoint, parse_endpoint
from gcs_cli.link.lines import RETRY_S, Line, TcpInLine
from gcs_cli.link.share import ShareServer, open_shared, share_path
from gcs_cli.link.tlog import encode_record
from gcs_cli.tui.feed import Feed
from tests.support.commands import gcs
from tests.support.fake_links import running, serial_device, tcp_client, tcp_server, udp_vehicles
from tests.support.fake_vehicle import FakeVehicle

LONG_S = 30.0
"""Hang guard [s]."""


@pytest.fixture(autouse=True)
def _own_runtime_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "run").mkdir(mode=0o700)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "run"))


def free_port() -> int:
    with UdpSocket("127.0.0.1") as udp:
        return udp.address[1]


def test_command_over_tcp() -> None:
    with tcp_server(FakeVehicle()) as port:
        assert gcs("--connect", f"tcp:127.0.0.1:{port}", "arm") == ("armed\n", "", 0)


def test_command_to_a_vehicle_that_connects_over_tcp(monkeypatch: pytest.MonkeyPatch) -> None:
    port, listening, listen = free_port(), threading.Event(), TcpInLine.__init__

    def listen_and_tell(line: TcpInLine, host: str, number: int) -> None:
        listen(line, host, number)
        listening.set()

    monkeypatch.setattr(TcpInLine, "__init__", listen_and_tell)
    with tcp_client(FakeVehicle(), port, listening):
        assert gcs("--connect", f"tcpin:127.0.0.1:{port}", "arm") == ("armed\n", "", 0)


def test_command_over_a_serial_port() -> None:
    with serial_device(FakeVehicle()) as device:
        assert gcs("--connect", f"serial:{device}:115200", "arm") == ("armed\n", "", 0)


def test_closed_tcp_port_is_named_with_the_reason() -> None:
    result = gcs("--timeout", "0.3", "--connect", f"tcp:127.0.0.1:{free_port()}", "arm")
    assert result.returncode == 3
    assert "(connection refused)" in result.stderr


def test_tcp_connection_is_opened_again_after_a_loss() -> None:
    vehicle = FakeVehicle()
    with tcp_server(vehicle) as port:
        connection = Connection(parse_endpoint(f"tcp:127.0.0.1:{port}"))
        connection.wait_for_vehicle(LONG_S)
    with connection:
        assert connection.wait_for(lambda: connection.session.view.lost(connection.now_s), LONG_S)


def recording(path: Path, *vehicles: FakeVehicle) -> Path:
    """Write a tlog of two seconds."""
    with path.open("wb") as file:
        for tick in range(20):
            for vehicle in vehicles:
                for frame in vehicle.poll(tick / 10):
                    file.write(encode_record(1_800_000_000_000_000 + tick * 100_000, frame))
    return path


def test_recording_shows_the_state_of_its_vehicle(tmp_path: Path) -> None:
    result = gcs("--connect", recording(tmp_path / "flight.tlog", FakeVehicle(7)), "status", "--json")
    assert (result.stderr, result.returncode) == ("", 0)
    assert json.loads(result.stdout)["system"] == 7


def test_recording_takes_no_commands(tmp_path: Path) -> None:
    path = recording(tmp_path / "flight.tlog", FakeVehicle())
    result = gcs("--connect", path, "arm")
    assert result == ("", f"gcs: arm: {path} is a recording, which takes no commands\n", 2)


def test_file_without_frames_is_no_recording(tmp_path: Path) -> None:
    path = tmp_path / "empty.tlog"
    path.write_bytes(b"")
    result = gcs("--connect", path, "status")
    assert result == ("", f"gcs: {path}: is no telemetry log (tlog) with MAVLink frames\n", 2)


def test_commands_ask_for_the_system_among_several() -> None:
    one, two = FakeVehicle(1), FakeVehicle(2)
    with udp_vehicles(one, two) as port:
        link = f"udpout:127.0.0.1:{port}"
        result = gcs("--connect", link, "arm")
        assert (result.stdout, result.returncode) == ("", 2)
        assert result.stderr.endswith(
            f"several vehicles at UDP 127.0.0.1:{port}: choose one of 1, 2 with --system\n"
        )
        assert (one.commands, two.commands) == ([], [])
        assert gcs("--connect", link, "--system", "2", "arm").stdout == "armed\n"
        assert (one.armed, two.armed) == (False, True)
        result = gcs("--connect", link, "arm", "--system", "3", "--timeout", "2.5")
        assert result.returncode == 3
        assert "no vehicle with system id 3 answered" in result.stderr
        assert "only system 1, 2" in result.stderr


@pytest.mark.parametrize("words", [["--json", "arm"], ["arm", "--json"]])
def test_error_is_a_json_line_too(words: list[str]) -> None:
    result = gcs("--timeout", "0.1", "--connect", f"udpout:127.0.0.1:{free_port()}", *words)
    assert result.returncode == 3
    said = json.loads(result.stdout)
    assert (said["event"], said["exit_code"]) == ("error", 3)
    assert result.stderr == f"gcs: {said['message']}\n"


def test_json_may_stand_before_a_command() -> None:
    with udp_vehicles(FakeVehicle()) as port:
        result = gcs("--json", "--connect", f"udpout:127.0.0.1:{port}", "perf")
    assert json.loads(result.stdout)["lockstep"] is True


def test_second_process_uses_the_link_of_the_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """The vehicle talks to one client only, as PX4 does at its port for ground stations."""
    port, vehicle = free_port(), FakeVehicle()
    monkeypatch.setattr("gcs_cli.settings.DEFAULT_CONNECTION", f"udp:127.0.0.1:{port}")
    with udp_vehicles(vehicle, to_port=port), Connection(parse_endpoint(f"udp:{port}")) as first:
        first.share()
        first.wait_for_vehicle(LONG_S)
        with running(lambda: first.step(first.now_s + 0.05)):
            assert gcs("arm") == ("armed\n", "", 0)
            assert gcs("disarm", "--connect", f"udpin:127.0.0.1:{port}") == ("disarmed\n", "", 0)
        assert first.session.view.identity is not None


def test_view_passes_messages_on_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """A view receives in batches, which would delay both directions of the others."""
    monkeypatch.setattr("gcs_cli.tui.feed.GATHER_S", 10.0 * LONG_S)
    port = free_port()
    endpoint = parse_endpoint(f"udp:{port}")
    with udp_vehicles(FakeVehicle(), to_port=port), Connection(endpoint) as first:
        first.share()
        first.wait_for_vehicle(LONG_S)
        line = open_shared(endpoint)
        assert line is not None
        first.step(first.now_s)  # accepts it
        assert first.serves_others
        feed = Feed(first)
        feed.start()
        with Connection(endpoint, line=line) as second:
            second.wait_for_vehicle(LONG_S)
        feed.stop()


@pytest.mark.parametrize("kind", ["udp", "tcp"])
def test_process_that_takes_the_link_over_serves_the_others(kind: str) -> None:
    """All clients lose the link at once. A TCP vehicle with room for one client hears one of them only."""
    vehicle, port = FakeVehicle(), free_port()

    def shared() -> Connection:
        line = open_shared(endpoint)
        assert line is not None
        return Connection(endpoint, line=line)

    serving = udp_vehicles(vehicle, to_port=port) if kind == "udp" else tcp_server(vehicle)
    with serving as served:
        endpoint = parse_endpoint(f"udp:{port}" if kind == "udp" else f"tcp:127.0.0.1:{served}")
        with Connection(endpoint) as first:
            first.share()
            first.wait_for_vehicle(LONG_S)
            second, third = shared(), shared()
            with running(lambda: first.step(first.now_s + 0.05)):
                second.wait_for_vehicle(LONG_S)
                third.wait_for_vehicle(LONG_S)
        before = [each.session.view.link.received for each in (second, third)]

        def both_hear() -> bool:
            now = [each.session.view.link.received for each in (second, third)]
            return now[0] > before[0] + 20 and now[1] > before[1] + 20

        with second, third, running(lambda: second.step(second.now_s + 0.05)):
            assert third.wait_for(both_hear, LONG_S)


@pytest.mark.parametrize("fault", ["", "folder", "lock"])
def test_second_process_takes_the_link_over_although_it_cannot_serve(
    fault: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    port, vehicle = free_port(), FakeVehicle()
    endpoint = parse_endpoint(f"udp:{port}")
    with udp_vehicles(vehicle, to_port=port):
        with Connection(endpoint) as first:
            first.share()
            first.wait_for_vehicle(LONG_S)
            line = open_shared(endpoint)
            assert line is not None
            second = Connection(endpoint, line=line)
            with running(lambda: first.step(first.now_s + 0.05)):
                second.wait_for_vehicle(LONG_S)
        if fault == "folder":
            share_path(endpoint).parent.chmod(0o750)
        elif fault == "lock":
            monkeypatch.setattr("fcntl.flock", no_locks)
        received = second.session.view.link.received
        with second:
            assert second.wait_for(lambda: second.session.view.link.received > received + 20, LONG_S)
            assert share_path(endpoint).exists() is not bool(fault)


def no_locks(_descriptor: int, _operation: int) -> None:
    raise OSError(errno.ENOLCK, "No locks available")


def test_process_without_the_link_does_not_serve_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """It would be its own client, and never open the endpoint."""
    endpoint = parse_endpoint("udp:14550")
    server = ShareServer.open(endpoint)
    assert server is not None
    line = open_shared(endpoint)
    assert line is not None
    server.close()

    def busy(_endpoint: VehicleEndpoint) -> Line:
        raise CliError("the port is in use")

    monkeypatch.setattr("gcs_cli.link.share.open_line", busy)
    with Connection(endpoint, line=line) as connection:
        connection.share()
        for _ in range(3):
            connection.step(connection.now_s)
        assert open_shared(endpoint) is None


def test_shared_link_needs_a_private_folder() -> None:
    endpoint = parse_endpoint("udp:14550")
    folder = share_path(endpoint).parent
    folder.mkdir()
    folder.chmod(0o755)
    assert ShareServer.open(endpoint) is None
    assert open_shared(endpoint) is None


def test_socket_of_a_killed_process_is_replaced() -> None:
    endpoint = parse_endpoint("udp:14550")
    serve = "ShareServer.open(parse_endpoint('udp:14550')); os.kill(os.getpid(), signal.SIGKILL)"
    imports = f"import os, signal; from {__name__} import ShareServer, parse_endpoint"
    assert subprocess.run([sys.executable, "-c", f"{imports}; {serve}"], check=False).returncode == -9
    assert share_path(endpoint).exists()
    second = ShareServer.open(endpoint)
    assert second is not None
    second.close()
    assert not share_path(endpoint).exists()


def test_one_process_only_serves_an_endpoint_and_its_end_leaves_the_next_ones_socket() -> None:
    endpoint = parse_endpoint("udp:14550")
    first = ShareServer.open(endpoint)
    assert first is not None
    assert ShareServer.open(endpoint) is None
    first.close()
    second = ShareServer.open(endpoint)
    assert second is not None
    client = open_shared(endpoint)
    assert client is not None
    client.close()
    second.close()


def test_server_drops_a_client_that_disconnected() -> None:
    endpoint = parse_endpoint("udp:14550")
    server = ShareServer.open(endpoint)
    assert server is not None
    client = open_shared(endpoint)
    assert client is not None
    assert list(server.receive(0.0)) == []
    client.close()
    server.forward(b"data")  # fails, and loses the connection
    assert list(server.receive(1.0)) == []
    assert len(list(server.interests())) == 1
    server.close()


def test_client_waits_while_another_process_has_the_port(monkeypatch: pytest.MonkeyPatch) -> None:
    endpoint = parse_endpoint("udp:14550")
    server = ShareServer.open(endpoint)
    assert server is not None
    client = open_shared(endpoint)
    assert client is not None
    list(server.receive(0.0))
    server.close()

    def busy(_endpoint: VehicleEndpoint) -> Line:
        raise CliError("the port is in use")

    monkeypatch.setattr("gcs_cli.link.share.open_line", busy)
    assert [list(client.receive(now_s)) for now_s in (0.0, 1.0, 2.0)] == [[], [], []]
    assert client.due_s() == 2.0 + RETRY_S
    next_server = ShareServer.open(endpoint)
    assert next_server is not None
    list(client.receive(3.0))
    list(next_server.receive(3.0))
    next_server.forward(b"data")
    assert [data for data, _ in client.receive(4.0)] == [b"data"]
    client.close()
    next_server.close()
