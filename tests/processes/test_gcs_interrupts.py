"""Ctrl-C ends every command of ``gcs`` that waits, with an exit code and at most one sentence."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from flightstack.transports.udp import UdpSocket
from tests.support.fake_links import tcp_server
from tests.support.fake_vehicle import FakeVehicle

LONG_S = 60.0
"""Hang guard [s]."""


@pytest.mark.parametrize(
    "words",
    [["arm"], ["status"], ["listen", "ATTITUDE"], ["messages"], ["record", "x.tlog"], ["shell", "-c", "arm"]],
    ids=" ".join,
)
def test_interrupted_search_ends_without_a_file(words: list[str], tmp_path: Path) -> None:
    with UdpSocket("127.0.0.1") as silent:
        link = f"--connect=udpout:127.0.0.1:{silent.address[1]}"
        command = [sys.executable, "-m", "gcs_cli", "--timeout=600", link, *words]
        with subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path
        ) as process:
            assert silent.wait(LONG_S)  # the heartbeat to a vehicle that does not answer
            process.send_signal(signal.SIGINT)
            said, complaint = process.communicate(timeout=LONG_S)
    assert (said, complaint, process.returncode) == ("", "gcs: interrupted\n", 1)
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
