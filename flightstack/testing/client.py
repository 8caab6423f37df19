"""Ground stations and companions in memory: the session of ``gcs`` on simulated links."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence

from flightstack.core.enums import CUSTOM_MODE, Mode
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Message
from flightstack.plan import MissionItem, MissionType, Plan
from flightstack.services.routing.peer import PeerAddress
from flightstack.testing.link import Link
from gcs_cli.clients.param_client import ParamClient, ParamDone, ParamFailed
from gcs_cli.link import calls
from gcs_cli.link.calls import Answer, Call
from gcs_cli.link.session import Session
from gcs_cli.link.wire import SYSTEM_ID
from gcs_cli.transfers.plan_parts import Uploads
from gcs_cli.vehicle.param_search import suggestion

STREAM_STEP_S = 0.05
"""Interval of the messages of ``Client.streams``: 20 Hz."""


class RefusedError(AssertionError):
    """The vehicle refused a request, or did not answer it.

    >>> from flightstack.testing import RefusedError, World
    >>> try:
    ...     World(state="truth").start_mission()
    ... except RefusedError as error:
    ...     print(error.is_silent, error.reason)
    False no mission is loaded
    """

    def __init__(self, what: str, answer: Answer) -> None:
        super().__init__(f"{what} {'not answered' if answer.silent else 'refused'}: {answer.reason}")
        self.reason = answer.reason
        self.is_silent = answer.silent
        self.result = answer.result
        """The MAV_RESULT of a command, or the MAV_MISSION_RESULT of a transfer."""


class ConditionTimeoutError(AssertionError):
    """A condition did not come true within its limit of simulated time.

    >>> from flightstack.testing import World
    >>> try:
    ...     World().run_until("armed", timeout_s=1.0)
    ... except ConditionTimeoutError as error:
    ...     print(str(error).partition(";")[0])
    'armed' did not come true within 1 s of simulated time
    """


class Client:
    """One client of the vehicle. ``name`` also names its link in scenario files.

    >>> from flightstack.testing import World
    >>> world = World(telemetry=True)
    >>> tablet = world.add_client("tablet")
    >>> world.run_for(1.0)
    >>> abs(tablet.received["ATTITUDE"].roll) < 0.1, tablet.counts["ATTITUDE"] > 10
    (True, True)
    """

    def __init__(
        self, name: str, address: PeerAddress, link: Link, is_companion: bool, system_id: int = SYSTEM_ID
    ) -> None:
        self.name = name
        self.address = address
        self._peer = address[1:]
        self.link = link
        """The link to the vehicle."""
        kind = mavlink.MAV_TYPE_ONBOARD_CONTROLLER if is_companion else mavlink.MAV_TYPE_GCS
        self.session = Session(
            self._peer, heartbeat_type=kind, own_system=system_id, counts_vehicle_time=False
        )
        self.session.observe = self._take
        self.received: dict[str, Message] = {}
        """The newest message of each type."""
        self.counts: dict[str, int] = {}
        """The number of received messages of each type."""
        self.texts: list[str] = []
        """Status texts, oldest first."""
        self._next_piece = (0, 0)
        self.reached: list[int] = []
        """Mission items that the vehicle reported as reached, in order."""
        self.streams: dict[str, Callable[[], Message]] = {}
        """Makers of messages that are sent at 20 Hz, such as offboard setpoints and stick positions."""
        self._stream_due_s = -math.inf
        self._outbox: list[bytes] = []

    @property
    def system_id(self) -> int:
        """MAVLink system id of its messages."""
        return self.session.own.system

    # ------------------------------------------------------------------ traffic

    def send(self, message: Message) -> None:
        """Send a message at the next exchange."""
        self._outbox.append(self.session.encode(message))

    def poll(self, now_s: float) -> list[bytes]:
        """Return the datagrams to send now."""
        if self.streams and now_s >= self._stream_due_s:
            self._stream_due_s = now_s + STREAM_STEP_S
            for make in self.streams.values():
                self.send(make())
        outbox, self._outbox = self._outbox, []
        return outbox + self.session.poll(now_s)

    def idle_s(self, now_s: float) -> float:
        """Return the time for which it sends and receives nothing, if the vehicle sends nothing [s]."""
        if self._outbox or self.streams or self.session.heartbeat_is_due(now_s):
            return 0.0
        deadline_s = self.session.next_deadline()
        arrival_s = min(self.link.to_vehicle.next_arrival_s, self.link.from_vehicle.next_arrival_s)
        return (arrival_s if deadline_s is None else min(arrival_s, deadline_s)) - now_s

    def receive(self, data: bytes, now_s: float) -> None:
        """Process a datagram from the vehicle."""
        self.receive_all((data,), now_s)

    def receive_all(self, datagrams: Iterable[bytes], now_s: float) -> None:
        """Process datagrams from the vehicle that have arrived together."""
        self.session.receive_all(datagrams, self._peer, now_s)

    def _take(self, message: Message) -> None:
        kind = message.get_type()
        self.received[kind] = message
        self.counts[kind] = self.counts.get(kind, 0) + 1
        if kind == "STATUSTEXT":
            self._take_text(message)
        elif kind == "MISSION_ITEM_REACHED":
            self.reached.append(message.seq)

    def _take_text(self, message: Message) -> None:
        """Take a text or a piece of one; a piece after a lost one is dropped."""
        piece = (message.id, message.chunk_seq)
        if not message.id or not message.chunk_seq:
            self.texts.append(message.text)
        elif piece == self._next_piece and self.texts:
            self.texts[-1] += message.text
        else:
            return
        self._next_piece = (message.id, message.chunk_seq + 1)

    # ------------------------------------------------------------------ requests

    def command(self, number: int, params: Sequence[float], now_s: float) -> Call:
        """Begin a MAV_CMD."""
        return calls.command(self.session, number, params, now_s)

    def upload(self, plan: Plan) -> Uploads:
        """Begin to upload mission, geofence and rally points."""
        return Uploads(self.session, plan, restores=False)

    def upload_items(self, items: Sequence[MissionItem], kind: MissionType) -> Call:
        """Begin to upload one type of plan."""
        return calls.upload(self.session, items, kind)

    def download(self, kind: MissionType) -> Call:
        """Begin to download one type of plan."""
        return calls.download(self.session, kind)

    def mode_command(self, mode: Mode) -> tuple[int, Sequence[float]]:
        """Return the command that selects ``mode``."""
        custom = CUSTOM_MODE[mode]
        return calls.mode_command(custom >> 16 & 0xFF, custom >> 24)

    def parameter(self, name: str, value: float | None, known: Sequence[str] = ()) -> ParamRequest:
        """Begin to read a parameter, or to set it to ``value``; the refusal of a name suggests those of ``known``."""
        return ParamRequest(self.session, name, value, known)


class ParamRequest:
    """A pending read or change of one parameter."""

    def __init__(self, session: Session, name: str, value: float | None, known: Sequence[str]) -> None:
        self._hint = "" if name in known else suggestion(name, known)
        self._client = ParamClient(calls.vehicle_address(session), session.own)
        if value is None:
            self._client.start_get(name)
        else:
            self._client.start_set(name, value)
        self.value = math.nan
        """The parameter's value on the vehicle, once answered."""
        session.use(self._client)

    def answer(self, _now_s: float) -> Answer | None:
        """Return the answer once it is known."""
        result = self._client.result
        if isinstance(result, ParamDone):
            self.value = float(result.parameters[0].value)
            return Answer(True)
        if isinstance(result, ParamFailed):
            return Answer(False, result.reason + self._hint, silent=result.silent)
        return None
