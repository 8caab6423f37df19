"""A link on real transports and the real clock."""

from __future__ import annotations

import math
import select
import time
from collections.abc import Callable
from typing import Protocol

from flightstack.mavlink.link import Message
from flightstack.mavlink.signing import LinkSigning
from flightstack.plan import MissionResult
from flightstack.transports.udp import Address
from gcs_cli.errors import FAILED, NO_ANSWER, USAGE, CliError, VehicleLostError
from gcs_cli.link import calls
from gcs_cli.link.calls import Answer, Command, Request
from gcs_cli.link.endpoint import LOOPBACK, RECORDING, VehicleEndpoint
from gcs_cli.link.fleet import Fleet
from gcs_cli.link.lines import Line
from gcs_cli.link.opening import SeveralLines, instances_text, open_line
from gcs_cli.link.playback import PlaybackLine
from gcs_cli.link.session import Service, Session
from gcs_cli.link.share import SharedLine, ShareServer

_LONGEST_WAIT_S = 0.25
"""Longest time until Ctrl-C, the end of a child or a resized terminal is noticed."""

_PROGRESS_S = 0.1
"""Longest time between two updates of a progress bar."""

_SETTLE_S = 0.1
"""Time after the first heartbeat in which further vehicles are noticed by their telemetry or TIMESYNC answers."""

_SHARE_PERIOD_S = 1.0


class TransferClient(Service, Protocol):
    """A service that transfers data until it has a result."""

    @property
    def result(self) -> object | None:
        """Result of the transfer; None before its end."""

    @property
    def progress(self) -> tuple[int, int]:
        """Transferred units and their total (0 before it is known)."""


class WallClock:
    """The monotonic clock of the machine."""

    @staticmethod
    def now_s() -> float:
        """Return the time [s]."""
        return time.monotonic()

    @staticmethod
    def wait(poll: select.poll, wait_s: float) -> None:
        """Wait until a descriptor is ready, ``wait_s`` at most."""
        poll.poll(max(0.0, wait_s) * 1e3)

    @staticmethod
    def unix_s() -> float:
        """Return the time since the Unix epoch [s]."""
        return time.time()


class Clock(Protocol):
    """Clock of a connection: that of the machine, or that of a recording."""

    def now_s(self) -> float:
        """Return the time [s]."""

    def wait(self, poll: select.poll, wait_s: float) -> None:
        """Wait until a descriptor is ready, ``wait_s`` at most."""

    def unix_s(self) -> float:
        """Return the time since the Unix epoch [s]."""


class Connection:
    """Runs the vehicles of a link, ``fleet``, over a transport; ``session`` is the selected vehicle.

    Raises CliError if a port is busy or a file cannot be read. ``signing``: sign all messages, and accept only messages
    signed with the same key. ``vehicle``: accept only datagrams from this address, although the vehicle sends first.
    ``system_id``: select only this vehicle. ``line``: a transport to use instead of that of ``endpoint``. A recording
    is played as a vehicle that takes no commands, at the speed of the recording if ``in_real_time``, else at once.

    All exchange happens in ``step``. A program with an event loop of its own calls ``step(now_s)``, which does not
    wait, from a timer, or runs ``step(now_s + 0.1)`` in a thread; only one thread may use a connection.
    """

    def __init__(
        self,
        endpoint: VehicleEndpoint,
        record: Callable[[bytes], None] | None = None,
        signing: LinkSigning | None = None,
        *,
        vehicle: Address | None = None,
        system_id: int | None = None,
        line: Line | None = None,
        in_real_time: bool = True,
    ) -> None:
        self.endpoint = endpoint
        self._signing = signing
        self._clock: Clock = WallClock()
        if endpoint.kind == RECORDING:
            playback = PlaybackLine(endpoint.host, self._clock.now_s if in_real_time else None)
            self._clock = self._clock if in_real_time else playback.clock
            line = playback
        self._line = open_line(endpoint) if line is None else line
        if line is None and vehicle is None and not endpoint.listens:
            (vehicle,) = self._line.peers
        self.fleet = Fleet(self._line.peers, vehicle, record, signing, system_id)
        self.on_step: Callable[[], None] | None = None
        """Called in every step after the messages were received."""
        self._is_lent = False
        self._server: ShareServer | None = None
        self._share_due_s = math.inf

    @property
    def session(self) -> Session:
        """The selected vehicle."""
        return self.fleet.selected

    @property
    def local_port(self) -> int:
        """The local port of a transport that listens."""
        return int(getattr(self._line, "local_port", 0))

    @property
    def now_s(self) -> float:
        """The clock of the sessions [s]."""
        return self._clock.now_s()

    @property
    def unix_s(self) -> float:
        """Time of the newest message since the Unix epoch [s]: now, or that of the recording."""
        return self._clock.unix_s()

    @property
    def is_recording(self) -> bool:
        """True if the vehicle is a recording, which takes no commands."""
        return self.endpoint.kind == RECORDING

    @property
    def ended(self) -> bool:
        """True after the end of a recording."""
        return isinstance(self._line, PlaybackLine) and self._line.ended

    def step(self, until_s: float) -> None:
        """Send due messages, wait for data until ``until_s`` at most, and receive it."""
        self._send()
        line, server = self._line, self._server
        poll = select.poll()
        for descriptor, events in [*line.interests(), *(server.interests() if server else ())]:
            poll.register(descriptor, events)
        due_s = min(_time(self.fleet.next_deadline()), _time(line.due_s()), until_s)
        self._clock.wait(poll, min(_LONGEST_WAIT_S, due_s - self.now_s))
        now_s = self.now_s
        for data, peer in line.receive(now_s):
            if server is not None:
                server.forward(data)
            self.fleet.receive(data, peer, now_s)
        for peer in line.closed_peers():
            self.fleet.disconnect(peer)
        self.fleet.peers = line.peers
        if isinstance(line, SeveralLines) and self.session.peer is not None:
            self.endpoint = line.keep(self.session.peer) or self.endpoint
        self._serve(now_s)
        if self.on_step is not None:
            self.on_step()
        self._send()

    def share(self) -> None:
        """Serve this link to other ``gcs`` processes of this user, until the connection is closed.

        A connection that began on the link of another process does so by itself once it has opened the endpoint.
        """
        if not (self.is_recording or isinstance(self._line, SharedLine)):
            self._share_due_s = -math.inf

    @property
    def serves_others(self) -> bool:
        """True while other processes use this link: what is received late here is late there."""
        return self._server is not None and self._server.has_clients

    def _serve(self, now_s: float) -> None:
        if self._server is None and isinstance(self._line, SharedLine):
            self._server = self._line.server
        if self._server is not None:
            for frame in self._server.receive(now_s):
                self._forward(frame)
        elif now_s >= self._share_due_s:  # another process may serve it, and end
            self._share_due_s = now_s + _SHARE_PERIOD_S
            self._server = ShareServer.open(self.endpoint)

    def _forward(self, frame: bytes) -> None:
        """Send a frame of another process to all vehicles."""
        if self.fleet.wire.record is not None:
            self.fleet.wire.record(frame)
        for peer in self.fleet.receivers():
            self._line.send(frame, peer)

    def wait_for(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        """Run until ``condition`` holds; return False after ``timeout_s``, and at the end of a recording."""
        end_s = self.now_s + timeout_s
        while not condition():
            if self.now_s >= end_s or self.ended:
                return False
            self.step(end_s)
        return True

    def wait_for_vehicle(self, timeout_s: float, *, several: bool = False) -> None:
        """Wait for a vehicle's heartbeat, and accept only that vehicle from then on.

        Raise CliError if there is none, or, without ``several``, if there are several and none was chosen by its
        system id.
        """
        if not self.wait_for(lambda: self.session.is_heard(self.now_s), timeout_s):
            raise self.no_vehicle_error(timeout_s)
        if not (several or self.fleet.is_kept):
            self._check_alone()
        self.fleet.keep()

    def _check_alone(self) -> None:
        """Raise CliError if there are other vehicles on the link."""
        if not self.is_recording:
            self.wait_for(lambda: len(self.fleet.systems) > 1, _SETTLE_S)
        if len(self.fleet.systems) > 1:
            known = ", ".join(str(number) for number in sorted(self.fleet.systems))
            raise CliError(f"several vehicles at {self.endpoint}: choose one of {known} with --system", USAGE)

    def no_vehicle_error(self, timeout_s: float) -> CliError:
        """Return the error of a wait for the vehicle that ended after ``timeout_s``."""
        if self._signing is not None and self._signing.signing.counts.refused:
            return CliError(
                f"the vehicle at {self.endpoint} does not sign with this key: check --signing-key on both sides",
                NO_ANSWER,
            )
        return CliError(self._no_vehicle_text(timeout_s), NO_ANSWER)

    def _no_vehicle_text(self, timeout_s: float) -> str:
        if self.is_recording:
            return f"{self.endpoint}: the recording has no vehicle's heartbeat"
        way = "sent to" if self.endpoint.listens else "answered at"
        foreign = ", ".join(str(number) for number in sorted(self.fleet.sessions))
        if foreign and self.fleet.chosen is not None:
            return (
                f"no vehicle with system id {self.fleet.chosen} {way} {self.endpoint} within {timeout_s:g} s, only "
                f"system {foreign}: choose it with --system, or give another address with --connect"
            )
        reason = f" ({self._line.problem})" if self._line.problem else ""
        others = instances_text() if self.endpoint.host == LOOPBACK else ""
        advice = others or "start one with `gcs sim`, or give its address with --connect"
        return f"no vehicle {way} {self.endpoint} within {timeout_s:g} s{reason}: {advice}"

    def command(self, command: Command, name: str) -> None:
        """Send a command and wait for its answer; raise CliError with the vehicle's reason if it is refused."""
        self.complete(calls.command(self.session, *command, self.now_s), name)

    def complete(self, call: Request, name: str | Callable[[], str], *, may_lack: bool = False) -> Answer:
        """Run a request to its end; raise CliError if the vehicle refuses ``name`` or does not answer.

        With ``may_lack``, a type of plan that the vehicle does not support counts as empty.
        """
        session = self.session
        while (answer := call.answer(self.now_s)) is None:
            self._check_vehicle(session, name)
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
        session = self.session
        session.use(client)
        end_s = None if timeout_s is None else self.now_s + timeout_s
        while client.result is None and (end_s is None or self.now_s < end_s):
            self._check_vehicle(session, name)
            self.step(self.now_s + _PROGRESS_S)
            if show is not None:
                show(*client.progress)
        session.use(None)

    def _check_vehicle(self, session: Session, name: str | Callable[[], str]) -> None:
        view = session.view
        if view.powered_off or view.lost(self.now_s):
            how = "shut down" if view.powered_off else "was lost"
            raise VehicleLostError(f"{name() if callable(name) else name}: the vehicle {how}")

    def _send(self) -> None:
        for data, peer in self.fleet.poll(self.now_s):
            self._line.send(data, peer)

    def send(self, message: Message) -> None:
        """Send a message to the selected vehicle; nothing is sent before its first heartbeat."""
        peer = self.session.peer
        if peer is not None:
            self._line.send(self.session.encode(message), peer)

    def close(self) -> None:
        """Send the remaining messages, for example of a cancelled transfer, then POWEROFF, and close the transport."""
        self._send()
        for data, peer in self.fleet.farewell():
            self._line.send(data, peer)
        self._line.close()
        if self._server is not None:
            self._server.close()
        if self._signing is not None:
            self._signing.signing.close()

    def __enter__(self) -> Connection:
        return self

    def lend(self) -> None:
        """Keep the link open at the end of ``with`` blocks, for the next command of a shell."""
        self._is_lent = True

    def __exit__(self, *_: object) -> None:
        if not self._is_lent:
            self.close()
            return
        self.fleet.observe = self.fleet.wire.record = self.on_step = None
        self.session.use(None)
        self.fleet.subscribe({})


def _time(time_s: float | None) -> float:
    return math.inf if time_s is None else time_s
