"""The session on a real socket and the real clock."""

from __future__ import annotations

import time
from collections.abc import Callable

from flightstack.mavlink.signing import LinkSigning
from flightstack.plan import MissionResult
from flightstack.transports.udp import Address, PortBusyError, UdpSocket, resolve
from gcs_cli.errors import FAILED, NO_ANSWER, USAGE, CliError, PortInUseError, VehicleLostError
from gcs_cli.link.calls import Answer, Request
from gcs_cli.link.endpoint import VEHICLE_CONNECTION, Endpoint
from gcs_cli.link.session import Session

_LONGEST_WAIT_S = 0.25
"""So that Ctrl-C, a dead child or a resized terminal is never noticed late."""


class Connection:
    """Runs a ``Session`` over UDP. Raises CliError when the port is busy.

    ``signing``: sign what is sent, and take what is signed with the same key. ``vehicle``: take only what comes
    from this address, although the vehicle sends first. ``system_id``: take only this vehicle for ours.
    """

    def __init__(
        self,
        endpoint: Endpoint,
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
                # the loopback interface reaches nobody else, so that nobody else reaches us
                self._socket = UdpSocket("127.0.0.1" if host.startswith("127.") else "0.0.0.0")
                self.session = Session((host, endpoint.port), record, signing, system_id)
        except PortBusyError as error:
            sentence = f"{error}: end the other ground station, or use --connect {VEHICLE_CONNECTION}"
            if error.is_in_use:
                raise PortInUseError(endpoint, sentence) from None
            raise CliError(sentence, USAGE) from None
        except OSError:
            raise CliError(f"--connect: there is no host named {endpoint.host}", USAGE) from None

    @property
    def local_port(self) -> int:
        """The UDP port that we use."""
        return self._socket.address[1]

    @property
    def now_s(self) -> float:
        """The clock that the session counts on."""
        return time.monotonic()

    def step(self, until_s: float) -> None:
        """Send what is due, wait for datagrams until ``until_s`` at most, and take them."""
        self._send(self.session.poll(self.now_s))
        deadline_s = self.session.next_deadline()
        wait_s = min(until_s, until_s if deadline_s is None else deadline_s) - self.now_s
        if self._socket.wait(min(_LONGEST_WAIT_S, wait_s)):
            now_s = self.now_s
            for data, peer in self._socket.receive():
                self.session.receive(data, peer, now_s)
        self._send(self.session.poll(self.now_s))

    def wait_for(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        """Run until ``condition`` holds; return False when it does not within ``timeout_s``."""
        end_s = self.now_s + timeout_s
        while not condition():
            if self.now_s >= end_s:
                return False
            self.step(end_s)
        return True

    def meet(self, timeout_s: float) -> None:
        """Wait for the vehicle's heartbeat, and keep to that vehicle; raise CliError (no answer)."""
        if not self.wait_for(lambda: self.session.view.identity is not None, timeout_s):
            if self._signing is not None and self._signing.signing.counts.refused:
                raise CliError(
                    f"the vehicle at {self.endpoint} does not sign with this key: check --signing-key on both sides",
                    NO_ANSWER,
                )
            raise CliError(self._no_vehicle(timeout_s), NO_ANSWER)
        self.session.keep_vehicle()

    def _no_vehicle(self, timeout_s: float) -> str:
        way = "sent to" if self.endpoint.listens else "answered at"
        foreign = ", ".join(str(number) for number in sorted(self.session.foreign_systems))
        if foreign:
            return (
                f"no vehicle with system id {self._system_id} {way} {self.endpoint} within {timeout_s:g} s, only "
                f"system {foreign}: leave --instance out and name its link with --connect"
            )
        return (
            f"no vehicle {way} {self.endpoint} within {timeout_s:g} s: start `sim-bridge` and "
            "`flightstack`, or name its link with --connect"
        )

    def complete(self, call: Request, name: str | Callable[[], str], *, may_lack: bool = False) -> Answer:
        """Run a request to its end; raise CliError when the vehicle refuses ``name`` or does not answer.

        With ``may_lack``, a vehicle that knows no such type of plan has an empty one.
        """
        session = self.session
        while (answer := call.answer(self.now_s)) is None:
            if session.view.powered_off or session.view.lost(self.now_s):
                how = "shut down" if session.view.powered_off else "was lost"
                raise VehicleLostError(f"{name() if callable(name) else name}: the vehicle {how}")
            self.step(self.now_s + _LONGEST_WAIT_S)
        if may_lack and answer.result == MissionResult.UNSUPPORTED:
            return Answer(True)
        if not answer.accepted:
            what = name() if callable(name) else name
            said = what if answer.silent or answer.cancelled else f"{what} refused"
            raise CliError(f"{said}: {answer.reason}", NO_ANSWER if answer.silent else FAILED)
        return answer

    def _send(self, frames: list[bytes]) -> None:
        peer = self.session.peer
        if peer is not None:
            for frame in frames:
                self._socket.send(frame, peer)

    def close(self) -> None:
        """Send what still waits, a cancelled transfer's end say, then the farewell, and close the socket."""
        self._send(self.session.poll(self.now_s))
        self._send(self.session.farewell())
        self._socket.close()
        if self._signing is not None:
            self._signing.signing.close()

    def __enter__(self) -> Connection:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
