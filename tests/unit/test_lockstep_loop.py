"""The loop in lockstep with another process: runs of many ticks, a tick alone, the end of the connection."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from typing import Any, NamedTuple

import pytest

from flightstack.core.compiled import IS_DISABLED
from flightstack.process.connections import MOST_NS
from flightstack.process.lockstep_loop import LockstepLoop
from flightstack.process.quiet_block import QuietBlock
from flightstack.testing import World
from flightstack.transports.compiled_socket import IS_AVAILABLE
from flightstack.transports.tcp import LinkClosedError
from tests.support.bytes_engine import BytesEngine
from tests.support.message_sockets import messages, socket_pair

pytestmark = pytest.mark.skipif(IS_DISABLED or not IS_AVAILABLE, reason="needs compiled code on Linux")

LATER_NS = 1 << 62


@pytest.fixture
def sockets() -> Iterator[tuple[socket.socket, socket.socket]]:
    """The end of the loop, and that of the test."""
    with socket_pair() as pair:
        yield pair


class Peer(NamedTuple):
    """The simulator's socket, for the loop."""

    socket: socket.socket

    def send(self, data: bytes | memoryview) -> None:
        self.socket.send(data)


def test_ticks_in_lockstep_run_on_up_to_the_deadline(sockets: Any) -> None:
    """A vehicle on the ground: each call runs an outer period, whose answers are those of ticks in Python."""
    ours, others = sockets
    with World(make_engine=BytesEngine, state="truth") as world, World(state="truth") as other:
        stack, simulator, engine = world.engine.stack, world.engine.simulator, world.engine
        loop = LockstepLoop(stack, Peer(ours))
        for period in range(4):
            for _ in range(4):
                simulator.apply(engine.actuators)
                others.send(bytes(simulator.outgoing()))
            assert loop.run(LATER_NS, 0, may_run_on=True) is None
            assert loop.serves_ground
            assert loop.ends_period
            answers = messages(others)
            assert len(answers) == 5
            assert engine.actuators.open(answers[-1])
            assert stack.now.time_us == (5 * period + 4) * 2000
            simulator.apply(engine.actuators)
            assert stack.simulator.receive(memoryview(bytes(simulator.outgoing())))
        other.run_for(0.04)
        assert other.engine.stack.now.time_us == stack.now.time_us
        assert other.engine.stack.now.row.tolist() == stack.now.row.tolist()


def test_the_deadline_ends_ticks_after_one_call_of_the_kernel(
    sockets: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    ours, others = sockets
    ran: list[int] = []
    run = QuietBlock.run

    def counted(block: QuietBlock, count: int, is_taken: bool = False) -> int:
        ran.append(run(block, count, is_taken))
        return ran[-1]

    monkeypatch.setattr(QuietBlock, "run", counted)
    with World(make_engine=BytesEngine, state="truth") as world:
        stack, simulator, engine = world.engine.stack, world.engine.simulator, world.engine
        loop = LockstepLoop(stack, Peer(ours))
        for _ in range(3):
            for _ in range(4):
                simulator.apply(engine.actuators)
                others.send(bytes(simulator.outgoing()))
            assert loop.run(0, 10**9, may_run_on=True) is None  # within a period ticks run on
            assert loop.ends_period
            messages(others)
            simulator.apply(engine.actuators)
            assert stack.simulator.receive(memoryview(bytes(simulator.outgoing())))
    assert ran == [4, 5, 5]  # the first tick of all is run in Python


def test_ticks_run_on_where_a_pause_is_expected(sockets: Any) -> None:
    """As after each time slice of another program on the processor of the simulator."""
    ours, others = sockets
    with World(make_engine=BytesEngine, state="truth") as world:
        stack, simulator, engine = world.engine.stack, world.engine.simulator, world.engine
        loop = LockstepLoop(stack, Peer(ours))
        loop.pace.note_wait(LATER_NS, MOST_NS)
        for _ in range(4):
            simulator.apply(engine.actuators)
            others.send(bytes(simulator.outgoing()))
        assert loop.run(LATER_NS, 0, may_run_on=True, serves_pauses=True) is None
        assert loop.pace.may_pause()
        assert len(messages(others)) == 5


def test_a_tick_alone_is_run_where_more_may_not(sockets: Any) -> None:
    ours, others = sockets
    with World(make_engine=BytesEngine, state="truth") as world:
        loop = LockstepLoop(world.engine.stack, Peer(ours))
        assert loop.run(LATER_NS, 0, may_run_on=False) is None
        assert (len(messages(others)), loop.ends_period, loop.serves_ground) == (1, False, False)


def test_the_end_of_the_connection_ends_the_loop(sockets: Any) -> None:
    ours, others = sockets
    with World(make_engine=BytesEngine, state="truth") as world:
        loop = LockstepLoop(world.engine.stack, Peer(ours))
        others.shutdown(socket.SHUT_WR)
        with pytest.raises(LinkClosedError):
            loop.run(LATER_NS, 0, may_run_on=True)
