"""Messages between a vehicle and its clients in simulated time, and the ticks between two exchanges of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from flightstack.core.port_numbers import API, GROUND
from flightstack.mavlink.dialect import mavlink
from flightstack.process.quiet_outer import PassedTicks
from flightstack.services.routing.hub import GroundHub
from flightstack.services.routing.peer import PeerAddress
from flightstack.services.telemetry.streams import Streams
from flightstack.testing.client import Client
from flightstack.testing.engine import MARGIN_S, Engine
from flightstack.testing.link import Link
from gcs_cli.link.wire import SYSTEM_ID

_ROUNDING = 1e-6
"""Share of a period that is no further period."""
_SETTLES = 10_000
"""Most rounds of messages at one instant; a mission upload takes two for each item."""

_SLOW_RATES_HZ: dict[int, float] = {
    mavlink.MAVLINK_MSG_ID_ATTITUDE: 1.0,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 1.0,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 1.0,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 1.0,
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: 1.0,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: 1.0,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: 1.0,
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: 0.5,
    mavlink.MAVLINK_MSG_ID_HOME_POSITION: 0.5,
}
"""Telemetry without ``telemetry=True``: a ground station in the same process takes a third of a flight at 4 Hz."""
RATES_HZ: dict[bool | None, dict[int, float] | None] = {True: None, False: _SLOW_RATES_HZ, None: {}}
"""Streams by the ``telemetry`` of a world. Nobody reads those of a scenario: heartbeats, texts and answers suffice."""


class Network:
    """Carries datagrams between the vehicle's hub and its clients."""

    def __init__(self, seed: int) -> None:
        self._seed = seed
        self.clients: dict[str, Client] = {}
        self._by_address: dict[PeerAddress, Client] = {}
        self.has_settled = False
        """True after ``settle``, which may have changed the vehicle between two ticks; the runner resets it."""

    def add(
        self,
        name: str,
        hub: GroundHub,
        rates_hz: Mapping[int, float] | None,
        is_companion: bool = False,
        system_id: int | None = None,
    ) -> Client:
        """Connect a client; its link has a seed of its own. Raise ValueError for a name in use or a bad system id."""
        if name in self.clients:
            raise ValueError(f"a client named {name!r} is there already")
        if system_id is None:
            system_id = self._free_system_id()
        elif not 1 <= system_id <= SYSTEM_ID:
            raise ValueError(f"system_id must be 1 to {SYSTEM_ID}, not {system_id}")
        number = len(self.clients)
        address = PeerAddress(API if is_companion else GROUND, "memory", number)
        client = Client(name, address, Link(self._seed * 1000 + number), is_companion, system_id)
        self.clients[name] = self._by_address[address] = client
        self.connect(client, hub, rates_hz)
        return client

    def _free_system_id(self) -> int:
        """Return the largest system id that no client has."""
        taken = {client.system_id for client in self.clients.values()}
        return next(number for number in range(SYSTEM_ID, 0, -1) if number not in taken)

    def connect(self, client: Client, hub: GroundHub, rates_hz: Mapping[int, float] | None) -> None:
        """Add a client to a hub, that of a vehicle after a power cycle too; ``rates_hz`` None: PX4's rates."""
        peer = hub.add_peer(client.address, permanent=True)
        if rates_hz is not None:
            peer.streams = Streams(dict(rates_hz), peer.streams.available)

    def exchange(self, hub: GroundHub, now_s: float) -> bool:
        """Exchange the messages of this instant once; return True if any arrived."""
        arrived = False
        for client in self.clients.values():
            for data in client.poll(now_s):
                client.link.to_vehicle.send(data, now_s)
            for data in client.link.to_vehicle.receive(now_s):
                hub.receive(client.address, data, now_s)
                arrived = True
        for address, data in hub.poll(now_s):
            receiver = self._by_address.get(address)
            if receiver is not None:  # a test may add peers of its own
                receiver.link.from_vehicle.send(data, now_s)
        for client in self.clients.values():
            if datagrams := client.link.from_vehicle.receive(now_s):
                client.receive_all(datagrams, now_s)
                arrived = True
        return arrived

    def idle_s(self, hub: GroundHub, now_s: float, motion: bool = True) -> float:
        """Return the time for which ``exchange`` does nothing, unless the vehicle has an event [s].

        Without ``motion``, nothing but what ``exchange_motion`` does afterwards.
        """
        clients = self.clients.values()
        motion = motion or not all(map(_is_passive, clients))
        return min(hub.idle_s(now_s, motion), *(client.idle_s(now_s) for client in clients))

    def exchange_motion(self, hub: GroundHub, now_s: float) -> None:
        """Pass on streams of the motion as of ``now_s``, at which nothing else was due: the clients are passive."""
        for address, frames in hub.poll_motion(now_s):
            receiver = self._by_address.get(address)
            if receiver is not None:
                receiver.receive_all(receiver.link.from_vehicle.passed(frames), now_s)

    def settle(self, hub: GroundHub, now_s: float) -> None:
        """Exchange messages until none is left at this instant."""
        self.has_settled = True
        for _ in range(_SETTLES):
            if not self.exchange(hub, now_s):
                return
        raise AssertionError(f"clients and vehicle exchange messages without end at t = {now_s:.3f} s")


def _is_passive(client: Client) -> bool:
    """Return True if messages arrive at once, and nothing follows from one but what the client shows."""
    observes_itself = getattr(client.session.observe, "__self__", None) is client
    return observes_itself and client.session.is_passive and client.link.from_vehicle.is_instant


class EngineRunner:
    """Runs the engine, with an exchange of messages whenever some may be due."""

    def __init__(self, engine: Engine, network: Network, after_outer: Callable[[], None]) -> None:
        """Call ``after_outer`` before watches and timers, after each outer tick that may have had an event."""
        self._engine, self._network, self._after_outer = engine, network, after_outer
        self._watches: list[tuple[Callable[[], None], Callable[[], bool]]] = []
        self._timers: list[tuple[float, Callable[[], None]]] = []
        self._messages_wait = True
        """True if messages may wait that were sent since the last exchange."""
        self._due_s = math.inf
        """Time from which messages are due, as of the begin of the period."""
        self._until_s = -math.inf  # up to which the motion is passed on after compiled calls

    def watch(self, callback: Callable[[], None], each_tick: Callable[[], bool]) -> None:
        """Call ``callback`` after every outer tick, or while ``each_tick`` returns False, after those with an event."""
        self._watches.append((callback, each_tick))

    def after(self, seconds: float, callback: Callable[[], None]) -> None:
        """Call ``callback`` once, ``seconds`` from now."""
        self._timers.append((self._engine.time_s + seconds, callback))

    def run(self, ticks: int) -> None:
        """Run inner ticks, and exchange messages when some are due, at the end of an outer period."""
        until_s, self._messages_wait = -math.inf, True
        while ticks > 0:
            ticks -= self._run_period(ticks, until_s)
            until_s = self._idle_until_s() if ticks > 0 else until_s
        self._engine.settle()

    def run_on(self, most_s: float) -> None:
        """Run one period, and on until messages are due or something happens, for ``most_s`` at most.

        The time is a number of whole periods, at least one.
        """
        rates = self._engine.stack.rates
        periods = max(1, math.ceil(most_s * rates.outer_hz - _ROUNDING))
        self.run_on_ticks(periods * rates.divisor)

    def run_on_ticks(self, most: int) -> int:
        """Run as ``run_on``, for ``most`` inner ticks at most; return their number."""
        return self._run_period(most, self._idle_until_s())

    def _run_period(self, most: int, until_s: float) -> int:
        """Run up to the end of a period, and on until ``until_s`` if nothing happens; ``most`` inner ticks at most."""
        left, engine, self._until_s = most, self._engine, until_s
        engine.on_passed(self._pass_motion if self._is_streamed else None)
        while left > 0:
            count, is_outer = engine.run(left, until_s)
            left -= count
            if is_outer:
                engine.pass_requests()
                if self._may_exchange():
                    self._network.exchange(engine.stack.ground, engine.time_s)
                self._call_due()
            engine.step_is_pending = True
            if is_outer:
                break
        return most - left

    def _may_exchange(self) -> bool:
        """Return True if messages may be due."""
        waits, self._messages_wait = self._messages_wait, False
        now_s = self._engine.time_s
        if waits or now_s >= self._due_s - MARGIN_S:
            return True
        return self._network.idle_s(self._engine.stack.ground, now_s) <= MARGIN_S

    @property
    def _is_streamed(self) -> bool:
        """True if streams of the motion are due before anything else."""
        hub, now_s = self._engine.stack.ground, self._engine.time_s
        return now_s + hub.motion_idle_s(now_s) < self._until_s - MARGIN_S

    def _pass_motion(self, ticks: PassedTicks) -> None:
        """Pass on the streams of the motion that were due in a compiled call, as of their times.

        After an event they wait for its messages, up to the end of the period.
        """
        engine, hub = self._engine, self._engine.stack.ground
        due_s = engine.time_s + hub.motion_idle_s(engine.time_s)
        if not engine.is_idle or due_s >= self._until_s - MARGIN_S:
            return
        for time_us in ticks.from_time(math.floor((due_s - engine.time_at_s(0) - MARGIN_S) * 1e6)):
            now_s = engine.time_at_s(time_us)
            if due_s - MARGIN_S <= now_s < self._until_s - MARGIN_S:
                self._network.exchange_motion(hub, now_s)
                due_s = now_s + hub.motion_idle_s(now_s)

    def _idle_until_s(self) -> float:
        """Return the time from which messages, a watch, a timer or readiness are due; −inf if it may be now."""
        engine, self._due_s = self._engine, math.inf
        self._messages_wait, self._network.has_settled = self._network.has_settled, False
        if self._messages_wait or any(each_tick() for _, each_tick in self._watches):
            return -math.inf
        now_s = engine.time_s
        idle_s = self._network.idle_s(engine.stack.ground, now_s, motion=not engine.is_aligned)
        self._due_s = now_s + idle_s
        until_s = min(self._due_s, engine.ready_from_s)
        return min(until_s, *(at_s for at_s, _ in self._timers)) if self._timers else until_s

    def _call_due(self) -> None:
        self._engine.note_readiness()
        self._after_outer()
        for watch, _ in self._watches:
            watch()
        if self._timers:
            now_s = self._engine.time_s + 1e-9
            due = [call for at_s, call in self._timers if at_s <= now_s]
            self._timers = [timer for timer in self._timers if timer[0] > now_s]
            for call in due:
                call()
