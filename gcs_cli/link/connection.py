"""The session on a real socket and the real clock."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol

from flightstack.mavlink.signing import LinkSigning
from flightstack.plan import MissionResult
from flightstack.transports.udp import Address, PortBusyError, UdpSocket, resolve
from gcs_cli.errors import FAILED, NO_ANSWER, USAGE, CliError, PortInUseError, VehicleLostError
from gcs_cli.link import calls
from gcs_cli.link.calls import Answer, Command, Request
from gcs_cli.link.endpoint import VEHICLE_CONNECTION, VehicleEndpoint
from gcs_cli.link.session import Service, Session

_LONGEST_WAIT_S = 0.25
"""Longest time until Ctrl-C, the end of a child or a resized terminal is noticed."""

_PROGRESS_S = 0.1
"""Longest time between two updates of a progress bar."""


class TransferClient(Service, Protocol):
    """A service that transfers data until it has a result."""

    @property
    def result(self) -> object | None:
        """Result of the transfer; None before its end."""

    @property
    def progress(self) -> tuple[int, int]:
        """Transferred units and their total (0 before it is known)."""


class Connection:
    """Runs a ``Session`` over UDP. Raises CliError if the port is busy.

    ``signing``: sign all messages, and accept only messages signed with the same key. ``vehicle``: accept only
    datagrams from this address, although the vehicle sends first. ``system_id``: accept only this vehicle.
    """

    def __init__(
        self,
        endpoint: VehicleEndpoint,
        record: Callable[[bytes], None] | None = None,
        signing: LinkSigning | None = None,
        *,
        vehicle: Address | None = None,
        system_id: int | None = None,
    ) -> None:
        self.endpoint = endpoint
        self._system_id = system_id
        self._signing = signing
        try:
            if endpoint.listens:
                self._socket = UdpSocket(endpoint.host, endpoint.port)
                self.session = Session(vehicle, record, signing, system_id)
            else:
                host = resolve(endpoint.host)
                # bound to the loopback interface, the socket cannot be reached from the network
                self._socket = UdpSocket("127.0.0.1" if host.startswith("127.") else "0.0.0.0")
                self.session = Session((host, endpoint.port), record, signing, system_id)
        except PortBusyError as error:
            sentence = f"{error}: end the other ground station, or use --connect {VEHICLE_CONNECTION}"
            if error.is_in_use:
                raise PortInUseError(endpoint, sentence) from None
            raise CliError(sentence, USAGE) from None
        except OSError:
            raise CliError(f"--connect: no host named {endpoint.host}", USAGE) from None

    @property
    def local_port(self) -> int:
        """The local UDP port."""
        return self._socket.address[1]

    @property
    def now_s(self) -> float:
        """The clock of the session [s]."""
        return time.monotonic()

    def step(self, until_s: float) -> None:
        """Send due messages, wait for datagrams until ``until_s`` at most, and receive them."""
        self._send(self.session.poll(self.now_s))
        deadline_s = self.session.next_deadline()
        wait_s = min(until_s, until_s if deadline_s is None else deadline_s) - self.now_s
        if self._socket.wait(min(_LONGEST_WAIT_S, wait_s)):
            now_s = self.now_s
            for data, peer in self._socket.receive():
                self.session.receive(data, peer, now_s)
        self._send(self.session.poll(self.now_s))

    def wait_for(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        """Run until ``condition`` holds; return False after ``timeout_s``."""
        end_s = self.now_s + timeout_s
        while not condition():
            if self.now_s >= end_s:
                return False
            self.step(end_s)
        return True

    def wait_for_vehicle(self, timeout_s: float) -> None:
        """Wait for a vehicle's heartbeat, and accept only that vehicle from then on; raise CliError (no answer)."""
        if not self.wait_for(lambda: self.session.view.identity is not None, timeout_s):
            if self._signing is not None and self._signing.signing.counts.refused:
                raise CliError(
                    f"the vehicle at {self.endpoint} does not sign with this key: check --signing-key on both sides",
                    NO_ANSWER,
                )
            raise CliError(self._no_vehicle_text(timeout_s), NO_ANSWER)
        self.session.keep_vehicle()

    def _no_vehicle_text(self, timeout_s: float) -> str:
        way = "sent to" if self.endpoint.listens else "answered at"
        foreign = ", ".join(str(number) for number in sorted(self.session.foreign_systems))
        if foreign:
            return (
                f"no vehicle with system id {self._system_id} {way} {self.endpoint} within {timeout_s:g} s, only "
                f"system {foreign}: leave --instance out and give its address with --connect"
            )
        return (
            f"no vehicle {way} {self.endpoint} within {timeout_s:g} s: start `sim-bridge` and "
            "`flightstack`, or give its address with --connect"
        )

    def command(self, command: Command, name: str) -> None:
        """Send a command and wait for its answer; raise CliError with the vehicle's reason if it is refused."""
        self.complete(calls.command(self.session, *command, self.now_s), name)

    def complete(self, call: Request, name: str | Callable[[], str], *, may_lack: bool = False) -> Answer:
        """Run a request to its end; raise CliError if the vehicle refuses ``name`` or does not answer.

        With ``may_lack``, a type of plan that the vehicle does not support counts as empty.
        """
        while (answer := call.answer(self.now_s)) is None:
            self._check_vehicle(name)
            self.step(self.now_s + _LONGEST_WAIT_S)
        if may_lack and answer.result == MissionResult.UNSUPPORTED:
            return Answer(True)
        if not answer.accepted:
            what = name() if callable(name) else name
            said = what if answer.silent or answer.cancelled else f"{what} refused"
            raise CliError(f"{said}: {answer.reason}", NO_ANSWER if answer.silent else FAILED)
        return answer

    def run(
        self,
        client: TransferClient,
        name: str,
        timeout_s: float | None = None,
        show: Callable[[int, int], None] | None = None,
    ) -> None:
        """Run ``client`` until it has a result, or for ``timeout_s``; raise CliError if the vehicle is lost.

        ``show`` is called with the transferred units and their total.
        """
        self.session.use(client)
        end_s = None if timeout_s is None else self.now_s + timeout_s
        while client.result is None and (end_s is None or self.now_s < end_s):
            self._check_vehicle(name)
            self.step(self.now_s + _PROGRESS_S)
            if show is not None:
                show(*client.progress)
        self.session.use(None)

    def _check_vehicle(self, name: str | Callable[[], str]) -> None:
        view = self.session.view
        if view.powered_off or view.lost(self.now_s):
            how = "shut down" if view.powered_off else "was lost"
            raise VehicleLostError(f"{name() if callable(name) else name}: the vehicle {how}")

    def _send(self, frames: list[bytes]) -> None:
        peer = self.session.peer
        if peer is not None:
            for frame in frames:
                self._socket.send(frame, peer)

    def close(self) -> None:
        """Send the remaining messages, for example of a cancelled transfer, then POWEROFF, and close the socket."""
        self._send(self.session.poll(self.now_s))
        self._send(self.session.farewell())
        self._socket.close()
        if self._signing is not None:
            self._signing.signing.close()

    def __enter__(self) -> Connection:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
