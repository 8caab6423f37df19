"""The fixture ``sitl_server``: real processes, which end with their test however pytest ends."""

from __future__ import annotations

import json
import os
import re
import select
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from pyulog import ULog

from flightstack.core.port_numbers import simulator_port
from flightstack.testing import server
from flightstack.testing.instances import ServerError, free_instance
from flightstack.testing.server import Server
from flightstack.testing.setup import Setup
from tests.support.plugin_run import PLUGIN, load, prepare, run, section
from tests.support.process import children_of, ends_of

pytest_plugins = ["pytester"]

PROGRAMS = {"sim_bridge", "flightstack"}
LONG_S = 180.0
"""Hang guard [s]; on a busy machine the start of pytest, guard, simulator and flight stack takes more than a minute."""
FLYING = """
    import json
    from pathlib import Path
    from gcs_cli.link import calls
    from gcs_cli.link.connection import Connection
    from gcs_cli.link.endpoint import parse_endpoint

    def test_flies(sitl_server):
        server = sitl_server(vehicle="x_quad", state="truth", speed=5.0)
        with Connection(parse_endpoint(server.gcs_url)) as connection:
            connection.wait_for_vehicle(60.0)
            connection.command(calls.ARM, "arming")
            Path("told").write_text(json.dumps([server.instance, str(server.log), server.guard.pid]))
            while True:
                connection.step(connection.now_s + 1.0)
"""


@pytest.fixture(scope="module", autouse=True)
def _loaded() -> None:
    load()


@pytest.fixture
def outside(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> pytest.Pytester:
    return prepare(pytester, monkeypatch)


def assert_free(port: int) -> None:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        probe.bind(("127.0.0.1", port))


def test_vehicle_that_cannot_start_names_the_reason(tmp_path: Path) -> None:
    with pytest.raises(ServerError, match="no_such_quad"):
        Server(Setup(vehicle="no_such_quad"), tmp_path)


def test_fault_that_the_vehicle_cannot_have_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(ServerError, match=r"^faults: rotor 5 dead: .* rotors 1 to 4$"):
        Server(Setup(vehicle="x_quad", state="truth"), tmp_path, faults=["rotor 5 dead"])


def test_condition_that_the_vehicle_cannot_have_is_one_sentence(pytester: pytest.Pytester) -> None:
    pytester.makepyfile("def test_a(sitl_server):\n    sitl_server(wind=(3.0, 0.0))\n")
    result = pytester.runpytest_subprocess()
    sentence = "wind: wind cannot act: the vehicle paper_quad has no drag; set drag to true"
    shown = [line for line in result.outlines if line.startswith("E ")]
    assert shown == [f"E       flightstack.testing.instances.ServerRefusalError: {sentence}"]
    assert "server.py" not in result.stdout.str()
    assert "sitl.py" not in result.stdout.str()


def test_port_taken_after_the_search_means_the_next_instance(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, last = free_instance(), 0
    with socket.socket() as other:
        other.setsockopt(
            socket.SOL_SOCKET, socket.SO_REUSEADDR, 1
        )  # an earlier vehicle's connection may linger
        other.bind(("127.0.0.1", simulator_port(first)))
        other.listen()
        last = free_instance({first})
        found = iter((first, last))
        monkeypatch.setattr(server, "free_instance", lambda _taken: next(found))
        with Server(Setup(vehicle="x_quad", state="truth"), tmp_path, speed=10.0) as started:
            assert started.instance == last


def test_failed_test_keeps_the_output_of_the_processes(outside: pytest.Pytester) -> None:
    outside.makepyfile("""
        def test_fails(sitl_server):
            server = sitl_server(vehicle="x_quad", state="truth", speed=10.0)
            assert server.log is None
    """)
    result = run(outside, "--sitl-artifacts", "kept")
    result.assert_outcomes(failed=1)
    shown = section(result)
    assert shown["server"].startswith("instance ")
    assert shown["repeat"] == "pytest test_failed_test_keeps_the_output_of_the_processes.py::test_fails"
    folder = Path(shown["files"].removesuffix(" (after the test)"))
    assert (folder / "flightstack.log").read_text().startswith("flightstack: x_quad")
    assert (folder / "sim-bridge.log").read_text().startswith("sim-bridge: x_quad")


def test_failed_test_keeps_the_logs_of_each_stopped_server(outside: pytest.Pytester) -> None:
    outside.makepyfile("""
        def test_fails(sitl_server):
            for seed in (5, 6):
                server = sitl_server(vehicle="x_quad", state="truth", speed=10.0, seed=seed)
                server.stop()
            assert server.log is None
    """)
    run(outside, "--sitl-artifacts", "kept").assert_outcomes(failed=1)
    logs = sorted(outside.path.glob("kept/*/*/sim-bridge.log"))
    assert [re.findall(r"seed (\d)", log.read_text()) for log in logs] == [["5"], ["6"]]


def test_servers_end_with_their_fixture(outside: pytest.Pytester) -> None:
    outside.makepyfile("""
        import pytest
        from pathlib import Path

        @pytest.fixture(scope="module")
        def vehicle(sitl_server):
            return sitl_server(vehicle="x_quad", state="truth", speed=10.0)

        def test_first(vehicle):
            Path("first").write_text(f"{vehicle.instance} {vehicle.guard.pid}")

        def test_second(vehicle):
            assert Path("first").read_text() == f"{vehicle.instance} {vehicle.guard.pid}"
            assert vehicle.guard.poll() is None
    """)
    run(outside).assert_outcomes(passed=2)
    instance, guard = map(int, Path("first").read_text().split())
    assert not Path(f"/proc/{guard}").exists()
    assert_free(simulator_port(instance))


def test_parallel_workers_start_different_instances(outside: pytest.Pytester) -> None:
    outside.makepyfile("""
        import pytest
        from pathlib import Path

        @pytest.mark.parametrize("number", range(2))
        def test_runs(sitl_server, number):
            servers = [sitl_server(vehicle="x_quad", state="truth", speed=10.0) for _ in range(1 + number)]
            Path(f"instances-{number}").write_text(" ".join(str(server.instance) for server in servers))
    """)
    outside.runpytest_subprocess(*PLUGIN, "-n", "2", "-W", "error").assert_outcomes(passed=2)
    instances = [word for number in range(2) for word in Path(f"instances-{number}").read_text().split()]
    assert len(set(instances)) == 3


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT], ids=lambda n: n.name)
def test_killed_run_leaves_no_process_and_a_readable_log(
    outside: pytest.Pytester, number: signal.Signals
) -> None:
    outside.makepyfile(FLYING)
    output, told = outside.path / "output", outside.path / "told"
    os.mkfifo(told)
    with output.open("wb") as file:
        run_of_user = subprocess.Popen(
            [sys.executable, "-m", "pytest", *PLUGIN, "-s"], stdout=file, stderr=file, start_new_session=True
        )
    with open(told, opener=lambda path, _flags: os.open(path, os.O_RDONLY | os.O_NONBLOCK)) as pipe:
        assert select.select([pipe], [], [], LONG_S)[0], output.read_text()
        instance, log, guard = json.loads(pipe.read())
    programs = children_of(guard)
    assert set(programs) == PROGRAMS
    with ends_of(guard, *programs.values()):
        run_of_user.send_signal(number)
        assert run_of_user.wait(LONG_S) != 0
    assert ULog(log).get_dataset("vehicle_status") is not None
    assert_free(simulator_port(instance))


def test_killed_guard_ends_simulator_and_flight_stack(tmp_path: Path) -> None:
    started = Server(Setup(vehicle="x_quad", state="truth"), tmp_path, speed=10.0)
    assert started.guard is not None
    guard = started.guard.pid
    programs = children_of(guard)
    assert set(programs) == PROGRAMS
    with ends_of(*programs.values()):
        os.kill(guard, signal.SIGKILL)
    assert_free(simulator_port(started.instance))
    started.stop()
