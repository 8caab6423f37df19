"""Ctrl-C ends every command of ``gcs``, with an exit code and at most one sentence."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer

from flightstack.transports.udp import UdpSocket
from gcs_cli.program import app
from tests.support.commands import gcs
from tests.support.fake_links import tcp_server
from tests.support.fake_vehicle import FakeVehicle
from tests.support.gcs_commands import ON_VEHICLE
from tests.support.programs import Program

LONG_S = 60.0
"""Hang guard [s]."""
ELSEWHERE = {
    "fly": "test_gcs_fly", "sim": "test_gcs_sim", "paper": "test_paper_run", "test": "test_gcs_test",
    "campaign": "test_gcs_campaign",
    "replay": "test_gcs_logs", "report": "test_gcs_logs", "compare": "test_compare",
    "estimate": "test_estimate", "mission new": "test_gcs_missions",
    "mission convert": "test_gcs_missions", "log info": "test_gcs_logs", "log plot": "test_gcs_logs",
    "log export": "test_log_export", "log draw": "test_render", "pil fly": "test_gcs_pil",
    "pil doctor": "test_gcs_pil", "pil replay": "test_gcs_pil", "pil generate": "test_law_tree",
    "pil free-run": "test_gcs_pil",
    "pil build": "test_board_images",
    "pil vectors": "test_gcs_pil",
}  # fmt: skip
"""Commands on files, or with a vehicle of their own, and the file that tests them."""


_TRANSFERS = {
    "FILE_TRANSFER_PROTOCOL", "LOG_ERASE", "LOG_REQUEST_LIST", "MISSION_REQUEST_LIST", "PARAM_REQUEST_LIST",
    "PARAM_REQUEST_READ",
}  # fmt: skip


def names_of(command: Any, words: tuple[str, ...] = ()) -> Iterator[str]:
    """Yield the names of all commands that the help shows."""
    if not hasattr(command, "list_commands"):
        yield " ".join(words)
        return
    context = typer.Context(command)
    for name in command.list_commands(context):
        inner = command.get_command(context, name)
        if not inner.hidden:
            yield from names_of(inner, (*words, name))


def test_every_command_is_interrupted_here_or_tested_elsewhere() -> None:
    names = set(names_of(typer.main.get_command(app)))
    assert names == {*ON_VEHICLE, *ELSEWHERE}
    here = Path(__file__).parent
    for name, file in ELSEWHERE.items():
        (found,) = here.parent.glob(f"*/{file}.py")
        assert name.split()[-1] in found.read_text()


@pytest.mark.parametrize("name", ON_VEHICLE)
def test_interrupted_search_ends_without_a_file(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Within the test: a process of its own takes a second."""
    monkeypatch.chdir(tmp_path)
    Path("given.params").write_text("1\t1\tMPC_XY_CRUISE\t4.0\t9\n")
    with UdpSocket("127.0.0.1") as silent:

        def interrupt() -> None:
            silent.wait(LONG_S)  # the heartbeat to a vehicle that does not answer
            os.kill(os.getpid(), signal.SIGINT)

        thread = threading.Thread(target=interrupt)
        thread.start()
        link = f"--connect=udpout:127.0.0.1:{silent.address[1]}"
        ended = gcs("--timeout=600", link, *name.split(), *ON_VEHICLE[name])
        thread.join()
    assert ended == ("", "gcs: interrupted\n", 130)
    assert [path.name for path in tmp_path.iterdir()] == ["given.params"]


class InterruptingVehicle(FakeVehicle):
    """Interrupts this process at the first message of a transfer, and does not answer it."""

    def receive(self, data: bytes, now_s: float = 0.0) -> None:
        before = len(self.heard)
        super().receive(data, now_s)
        if _TRANSFERS.intersection(self.heard[before:]) and not _TRANSFERS.intersection(self.heard[:before]):
            os.kill(os.getpid(), signal.SIGINT)

    def poll(self, now_s: float) -> list[bytes]:
        return [] if _TRANSFERS.intersection(self.heard) else super().poll(now_s)


@pytest.mark.parametrize(
    "name",
    ["mission download", "mission verify", "fence show", "rally download", "param list", "param get", "param save",
     "param load", "param diff", "log list", "log download", "log erase"],
)  # fmt: skip
def test_interrupted_transfer_ends_without_a_file(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("given.params").write_text("1\t1\tMPC_XY_CRUISE\t4.0\t9\n")
    with tcp_server(InterruptingVehicle()) as port:
        said, complaint, code = gcs(f"--connect=tcp:127.0.0.1:{port}", *name.split(), *ON_VEHICLE[name])
    assert (said, code) == ("", 130)
    assert "interrupted" in complaint
    assert complaint.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["given.params"]


@pytest.mark.parametrize("name", ["arm", "record", "mission upload"])
def test_interrupted_process_ends_with_a_known_code(name: str, tmp_path: Path) -> None:
    with UdpSocket("127.0.0.1") as silent:
        link = f"--connect=udpout:127.0.0.1:{silent.address[1]}"
        process = Program("gcs_cli", ["--timeout=600", link, *name.split(), *ON_VEHICLE[name]], tmp_path)
        assert silent.wait(LONG_S)
        process.send_signal(signal.SIGINT)
        said, complaint = process.communicate(LONG_S)
    assert (said, complaint, process.returncode) == ("", "gcs: interrupted\n", 130)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("words", [["listen", "HEARTBEAT"], ["messages", "--level", "info"]], ids=" ".join)
def test_interrupted_output_ends_with_zero(words: list[str]) -> None:
    vehicle = FakeVehicle()
    with tcp_server(vehicle) as port:
        command = [sys.executable, "-m", "gcs_cli", f"--connect=tcp:127.0.0.1:{port}", *words]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None
            if words[0] == "messages":
                while "HEARTBEAT" not in vehicle.heard:
                    assert process.poll() is None
                vehicle.say("ready", severity=6)
            assert process.stdout.readline()
            process.send_signal(signal.SIGINT)
            complaint = process.communicate(timeout=LONG_S)[1]
    assert (complaint, process.returncode) == ("", 0)
