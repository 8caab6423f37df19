"""A running flight stack and a simulator whose clock is not the loops'."""

from __future__ import annotations

import socket
from collections.abc import Callable, Iterator
from pathlib import Path
from threading import Thread

import pytest

from flightstack.simulator_link.hot_frames import ActuatorsFrame, PlantStateFrame
from flightstack.testing.instances import free_instance
from tests.support.commands import gcs
from tests.support.process import BOUND_S, Process
from tests.support.vehicle_processes import wait_until_healthy

MISSIONS = Path(__file__).parents[2] / "missions"


class StandingVehicle:
    """A simulator that sends a vehicle at rest, each state at the answer to the one before."""

    def __init__(self, instance: int, stamp: Callable[[int], int]) -> None:
        self._server = socket.create_server(("127.0.0.1", 4560 + instance))
        self._server.settimeout(BOUND_S)
        self._stamp = stamp
        self._thread = Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        state, answer = PlantStateFrame(1, 51), ActuatorsFrame()
        state.state[6] = 1.0
        state.set_rotor_count(4)
        client, _ = self._server.accept()
        client.settimeout(BOUND_S)
        with client:
            client.recv(4096)  # its request
            for number in range(10**9):
                try:
                    client.sendall(state.seal(self._stamp(number), 0))
                    data = b""
                    while not answer.open(data[-answer.size :]):
                        piece = client.recv(4096)
                        if not piece:
                            return
                        data += piece
                except OSError:
                    return

    def close(self) -> None:
        self._server.close()
        self._thread.join(BOUND_S)


@pytest.fixture
def start() -> Iterator[Callable[..., Process]]:
    ends: list[Callable[[], object]] = []

    def begin(stamp: Callable[[int], int], *options: str) -> Process:
        instance = free_instance()
        simulator = StandingVehicle(instance, stamp)
        process = Process(
            "flightstack", "--instance", str(instance), "--gcs-port", "9", "--api-port", "9", "--state", "truth",
            "--log", "none", "--params", "none", *options,
        )  # fmt: skip
        ends.extend((process.kill, simulator.close))
        process.link = f"udpout:127.0.0.1:{18570 + instance}"
        return process

    yield begin
    for end in ends:
        end()


def test_a_step_that_differs_is_told_on_the_terminal(start) -> None:
    start(lambda number: 4000 * number).wait_for(
        "simulator sends a state every 4 ms; the loops run every 2 ms"
    )


def test_a_step_too_long_is_told_on_the_terminal(start) -> None:
    stack = start(lambda number: 20_000 * number)
    stack.wait_for("not to be flown: the simulator sends a state every 20 ms")


def test_a_step_too_long_ends_a_stack_that_was_to_start_a_mission(start) -> None:
    stack = start(lambda number: 20_000 * number, "--wait-for-start")
    stack.wait_for("flightstack: paper_quad")
    wait_until_healthy(stack.link)
    for words in (["mission", "upload", str(MISSIONS / "square.plan")], ["arm"], ["mission", "start"]):
        assert gcs("--connect", stack.link, "--timeout", 60, *words).returncode == 0
    assert stack.end() == 2
    assert "flightstack: the simulator sends a state every 20 ms" in stack.output


@pytest.mark.parametrize("clock", ["lockstep", "realtime"])
def test_a_constant_time_is_told_on_the_terminal(start, clock: str) -> None:
    start(lambda number: 7_000_000, "--clock", clock).wait_for("simulator clock stands still")


def test_a_clock_of_unix_time_is_served(start) -> None:
    stack = start(lambda number: 1_790_000_000_000_000 + 2000 * number if number < 5000 else 0)
    stack.wait_for("simulator time went back by 1.79e+09 s")
