"""How the process finds its simulator: the connection, and the wait for the first state."""

from __future__ import annotations

import time
from collections.abc import Callable

from flightstack.core.severity import Severity
from flightstack.process.assembly import Stack
from flightstack.process.process_config import EXIT_LOST, EXIT_TIMEOUT, Ended, ProcessConfig, complain
from flightstack.transports.tcp import TcpClient

SECOND_HELLO_S = 1.0
"""Silence after which a simulator is asked for the standard message."""
SIMULATOR_NOTICE_S = 10.0
"""Silence of a connected simulator after which the user is told; it is waited for longer: it may be compiling."""


def connect(process: ProcessConfig, between_tries: Callable[[], None]) -> TcpClient:
    """Connect to the simulator, and call ``between_tries`` meanwhile; raise Ended if there is none in time."""
    p = process
    try:
        return TcpClient.connect(p.simulator_host, p.simulator_port, p.simulator_timeout_s, between_tries)
    except (TimeoutError, OSError):
        raise Ended(
            EXIT_TIMEOUT,
            f"no simulator at {p.simulator_host}:{p.simulator_port} within {p.simulator_timeout_s:g} s: "
            "start sim-bridge, or name its port with --sim-port",
        ) from None


def wait_for_state(
    simulator: TcpClient, stack: Stack, process: ProcessConfig, meanwhile: Callable[[], None]
) -> None:
    """Wait for the first state, and call ``meanwhile`` between looks; raise Ended when it takes too long."""
    link, interval_us = stack.simulator, stack.rates.interval_us
    began_s = time.monotonic()
    asked_again = told = False
    while True:
        meanwhile()
        data = simulator.receive()
        if data is not None and link.receive(data):
            break
        silent = time.monotonic() - began_s > SECOND_HELLO_S
        if not asked_again and (silent or link.request_refused):
            asked_again = True
            simulator.send(link.second_hello(interval_us))
        if not told and time.monotonic() - began_s > SIMULATOR_NOTICE_S:
            told = True
            _tell_silent(stack, process)
        check_deadline(began_s + process.simulator_timeout_s, stack, process)
    stack.now.has_state = True


def _tell_silent(stack: Stack, process: ProcessConfig) -> None:
    where = f"{process.simulator_host}:{process.simulator_port}"
    sentence = f"the simulator at {where} is connected but sends no state"
    stack.journal.say(Severity.WARNING, f"Waiting: {sentence}")
    complain(
        f"warning: {sentence} for {SIMULATOR_NOTICE_S:g} s; it hangs, or compiles; waiting up to "
        f"{process.simulator_timeout_s:g} s"
    )


def check_deadline(deadline_s: float, stack: Stack, process: ProcessConfig) -> None:
    """Raise Ended when the simulator has been silent past ``deadline_s`` of the machine's clock."""
    if time.monotonic() > deadline_s:
        at = f"t={stack.now.time_us * 1e-6:.3f} s"
        timeout_s = process.simulator_timeout_s
        raise Ended(EXIT_LOST, f"simulator lost at {at}: no state for {timeout_s:g} s")
