"""A vehicle in a simulated world, with a ground station: one process, simulated time, no ports."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from flightstack.commander.failsafe import Failsafe
from flightstack.core.contract import Vector3
from flightstack.core.enums import Mode
from flightstack.core.geodesy import LocalFrame
from flightstack.plan import MissionItem, MissionType, Plan
from flightstack.testing.client import Client, ConditionTimeoutError, ParamRequest, RefusedError
from flightstack.testing.engine import Engine
from flightstack.testing.faults import apply_fault
from flightstack.testing.flight import Event, Flight
from flightstack.testing.link import Link
from flightstack.testing.log import Log
from flightstack.testing.mission_flight import await_first_state, fly_plan
from flightstack.testing.network import RATES_HZ, EngineRunner, Network
from flightstack.testing.setup import Setup, built
from flightstack.testing.state import State, condition_of, reported_by, state_of
from gcs_cli.link import calls
from gcs_cli.link.calls import Request
from gcs_cli.report.flight_outcome import Outcome, with_log

GROUND = "gcs"
"""Name of the ground station that each world has."""
_REQUEST_LIMIT_S = 120.0
_CONNECT_LIMIT_S = 10.0
"""Longest wait for the first heartbeat, which a bad link may delay or lose."""


class World:
    """One vehicle, its simulator and a ground station. Use it as a context manager or call ``close``.

    Time is simulated everywhere, links and telemetry included: no call waits for the machine's clock. A request such
    as ``arm`` advances time only if its answer needs time, as over a link with a delay.

    Requests and time:

    >>> world = World(vehicle="x_quad", seed=2)
    >>> world.param_set("MIS_TAKEOFF_ALT", 3.0)
    >>> world.takeoff()
    >>> world.run_until("altitude_m > 2.5", timeout_s=10.0).armed
    True
    >>> world.goto(2.0, 0.0)
    >>> world.run_on(0.5)
    >>> world.run_for(3.0)
    >>> abs(world.state.north_m - 2.0) < 1.0, world.state.mode, world.texts
    (True, 'HOLD', ['Armed', 'Takeoff detected'])

    Links, faults and other clients:

    >>> tablet = world.add_client("tablet")
    >>> world.link.delay_s(0.1)
    >>> world.fault("link loss 0.3", for_s=1.0)
    >>> world.rtl()
    >>> world.run_until("not armed").landed, tablet.texts[-1]
    (True, 'Disarmed')
    >>> [event.name for event in world.events]
    ['link_loss', 'link_loss_end']

    Missions:

    >>> world.link.restore()
    >>> world.upload("hop")
    >>> len(world.download())
    2
    >>> world.fly().completed
    True
    >>> world.close()
    """

    def __init__(
        self,
        setup: Setup | None = None,
        *,
        telemetry: bool | None = False,
        make_engine: Callable[[Setup], Engine] = Engine,
        **conditions: Any,
    ) -> None:
        """Build the world of ``setup``, or of ``conditions`` with the names of ``Setup``; raise ConfigError.

        ``telemetry``: stream to ``gcs.received`` at PX4's default rates, or nothing if None, else once a second.
        """
        if setup is not None and conditions:
            raise TypeError(f"give a setup or conditions, not both: {', '.join(conditions)}")
        self.setup = setup or Setup.of(conditions)
        self._rates_hz = RATES_HZ[telemetry]
        self.engine = built(self.setup, make_engine)
        """Flight stack and simulator; not part of the public interface."""
        self.events: list[Event] = []
        """Faults and changes of links, oldest first."""
        self.plan = Plan(())
        """The plan that was uploaded last."""
        self._network = Network(self.setup.seed)
        self._failsafes: tuple[Failsafe, ...] = ()
        self._runner = EngineRunner(self.engine, self._network, self._note_failsafes)
        self.gcs: Client = self.add_client(GROUND)
        """The ground station."""
        self.sender = self.gcs
        """The client that sends requests without another one, such as a companion while the ground station is cut."""

    # ------------------------------------------------------------------ parts

    @property
    def link(self) -> Link:
        """The link of the ground station."""
        return self.gcs.link

    @property
    def clients(self) -> dict[str, Client]:
        """All clients by name."""
        return self._network.clients

    def add_client(self, name: str, *, is_companion: bool = False, system_id: int | None = None) -> Client:
        """Connect another ground station, or a companion computer, whose heartbeats do not count as data link.

        ``system_id`` is by default the largest free one: 255 for the world's ground station, then 254, 253 and so on.
        """
        return self._network.add(name, self.engine.stack.ground, self._rates_hz, is_companion, system_id)

    @property
    def state(self) -> State:
        """The present state."""
        return state_of(self.engine.stack, self.engine.simulator, self.setup.home, self.time_s)

    @property
    def texts(self) -> list[str]:
        """Status texts that the ground station received, oldest first."""
        return self.gcs.texts

    @property
    def reached(self) -> list[int]:
        """Mission items that the ground station saw reached, in order."""
        return self.gcs.reached

    @property
    def time_s(self) -> float:
        """Simulated time since the start of the world [s]; a power cycle does not change it."""
        return self.engine.time_s

    # ------------------------------------------------------------------ time

    def tick(self) -> None:
        """Run one inner tick, and exchange messages after an outer tick."""
        self._runner.run(1)

    def step(self) -> None:
        """Run for one period of the outer loop: the shortest time between two exchanges of messages."""
        self._runner.run(self.engine.stack.rates.divisor)

    def run_for(self, seconds: float) -> None:
        """Run for ``seconds`` of simulated time."""
        self._runner.run(round(seconds * self.engine.stack.rates.inner_hz))

    def run_on(self, most_s: float) -> None:
        """Run as ``step``, and on until there are messages to exchange, for ``most_s`` at most.

        What the vehicle does by events, such as to disarm or to reach an item, ends it too, and so does a period that
        is not compiled: with a watch, or on loops in C. The time is of whole periods, at least one.
        """
        self._runner.run_on(most_s)

    def run_until(self, condition: Callable[[State], object] | str, timeout_s: float = 120.0) -> State:
        """Run until ``condition`` of the state is true; return that state.

        ``condition`` is a function, or an expression such as ``"altitude_m > 2.5"``. Raise ConditionTimeoutError with
        the state after ``timeout_s`` of simulated time.
        """
        is_true, is_of_events = condition_of(
            condition, lambda: self.state, lambda: reported_by(self.engine.stack)
        )
        rates = self.engine.stack.rates
        left = round(timeout_s * rates.outer_hz) * rates.divisor
        while not is_true():
            if left <= 0:
                break
            if is_of_events:
                left -= self._runner.run_on_ticks(left)
            else:
                self.step()
                left -= rates.divisor
        else:
            return self.state
        self.step()  # the limit itself counts
        what = f"{condition!r}" if isinstance(condition, str) else "the condition"
        raise ConditionTimeoutError(
            f"{what} did not come true within {timeout_s:g} s of simulated time; {self.state}{self._last_texts()}"
        )

    def wait_until_ready(self, timeout_s: float = 60.0) -> None:
        """Run until the vehicle may fly on its state, as one on sensors does after seconds."""
        self.run_until(lambda _: self.engine.stack.is_ready, timeout_s)

    def watch(self, callback: Callable[[], None], each_tick: Callable[[], bool] = lambda: True) -> None:
        """Call ``callback`` after every outer tick; while ``each_tick`` is False, after those with an event."""
        self._runner.watch(callback, each_tick)

    def after(self, seconds: float, callback: Callable[[], None]) -> None:
        """Call ``callback`` once, ``seconds`` of simulated time from now."""
        self._runner.after(seconds, callback)

    def _note_failsafes(self) -> None:
        active = self.engine.stack.parts.failsafes.active
        if active != self._failsafes:
            for failsafe in active:
                if failsafe not in self._failsafes:
                    self.happened(f"failsafe_{failsafe.name}")
            self._failsafes = active

    def _last_texts(self) -> str:
        return f"; texts: {'; '.join(self.texts[-3:])}" if self.texts else ""

    # ------------------------------------------------------------------ requests

    def wait_for(self, request: Request, what: str) -> None:
        """Wait for the answer of a request; raise RefusedError."""
        self.engine.settle()
        hub, end_s = self.engine.stack.ground, self.time_s + _REQUEST_LIMIT_S
        while True:
            self._network.settle(hub, self.time_s)
            answer = request.answer(self.time_s)
            if answer is not None:
                break
            if self._network.exchange(hub, self.time_s):
                continue  # the request has another step
            self.step()
            if self.time_s > end_s:
                late = f"{what} had no result within {_REQUEST_LIMIT_S:g} s"
                raise ConditionTimeoutError(f"{late}; {self.state}")
        if not answer.accepted:
            raise RefusedError(what, answer)

    def command(self, number: int, *params: float, client: Client | None = None) -> None:
        """Send a MAV_CMD as COMMAND_LONG; raise RefusedError with the vehicle's reason."""
        self.request(f"command {number}", (number, params), client)

    def command_int(
        self, number: int, params: Sequence[float], x: int, y: int, z: float, *, frame: int
    ) -> None:
        """Send a MAV_CMD as COMMAND_INT: four parameters and a position, x and y in 1e-7 degrees."""
        call = calls.command_int(self._connected().session, number, params, x, y, z, frame, self.time_s)
        self.wait_for(call, f"command {number}")

    def request(self, what: str, command: calls.Command, client: Client | None = None) -> None:
        """Send a MAV_CMD with its parameters; ``what`` names it in the RefusedError."""
        self.wait_for(self._connected(client).command(*command, self.time_s), what)

    def _connected(self, client: Client | None = None) -> Client:
        """Return a client, by default ``sender``, once it knows the vehicle."""
        self.engine.settle()
        client, end_s = client or self.sender, self.time_s + _CONNECT_LIMIT_S
        if client.session.view.identity is None:
            self._network.settle(self.engine.stack.ground, self.time_s)
        while client.session.view.identity is None and self.time_s < end_s:
            self.step()
        return client

    def upload(
        self, plan: str | Path | Plan | Sequence[MissionItem], kind: MissionType = MissionType.MISSION
    ) -> None:
        """Upload a plan: a file, the name of a bundled one, a Plan, or items of one ``kind``; raise RefusedError."""
        sender = self._connected()
        if isinstance(plan, (str, Path)):
            plan = self.setup.load_plan(plan)
        if isinstance(plan, Plan):
            self.plan = plan
            self.wait_for(sender.upload(plan), "the plan")
        else:
            if kind is MissionType.MISSION:
                self.plan = Plan(tuple(plan))
            self.wait_for(sender.upload_items(plan, kind), f"the {kind.name.lower()}")

    def download(self, kind: MissionType = MissionType.MISSION) -> tuple[MissionItem, ...]:
        """Download a plan of one kind; raise RefusedError."""
        self.wait_for(call := self._connected().download(kind), f"the {kind.name.lower()}")
        answer = call.answer(self.time_s)
        assert answer is not None
        return answer.items

    def arm(self) -> None:
        """Arm, once the vehicle is first ready after its boot; raise RefusedError with its reason."""
        await_first_state(self)
        self.request("arming", calls.ARM)

    def disarm(self, *, force: bool = False) -> None:
        """Disarm; with ``force`` in the air too."""
        self.request("disarming", calls.FORCE_DISARM if force else calls.DISARM)

    def takeoff(self, alt_m: float = math.nan) -> None:
        """Take off to an altitude above home, by default MIS_TAKEOFF_ALT; arm first if disarmed, as ``arm`` does."""
        await_first_state(self)
        self.request("takeoff", self.takeoff_command(alt_m))
        if not self.engine.stack.now.status.armed:
            self.arm()

    def start_mission(self) -> None:
        """Start the mission, which arms; wait before as ``arm`` does; raise RefusedError."""
        await_first_state(self)
        self.request("the start of the mission", calls.START_MISSION)

    def goto(self, north_m: float, east_m: float, alt_m: float = math.nan) -> None:
        """Fly to a position north and east of home at the start, and hold there; NaN keeps the altitude."""
        self.request("goto", self.goto_command(north_m, east_m, alt_m))

    def takeoff_command(self, alt_m: float = math.nan) -> calls.Command:
        """Return the command to take off to an altitude above home, to where it moves if the vehicle arms now."""
        return calls.takeoff_command(self.engine.stack.parts.takeoff.home_altitude_m + alt_m)

    def goto_command(self, north_m: float, east_m: float, alt_m: float = math.nan) -> calls.Command:
        """Return the command to fly to a position relative to home at the start."""
        place = LocalFrame(self.setup.home).to_geo(Vector3(north_m, east_m, 0.0))
        amsl_m = self.engine.stack.area.home.altitude_m + alt_m
        return calls.goto_command(place.latitude_deg, place.longitude_deg, amsl_m)

    def land(self) -> None:
        """Land at the present position."""
        self.request("landing", calls.LAND)

    def rtl(self) -> None:
        """Return to launch."""
        self.request("the return", calls.RETURN)

    def set_mode(self, mode: str | Mode, client: Client | None = None) -> None:
        """Select a mode by its name, as in ``State.mode``; raise ValueError for an unknown one."""
        if isinstance(mode, str):
            names = [known.name for known in Mode]
            if mode not in names:
                raise ValueError(f"no mode {mode!r}; the modes are {', '.join(names)}")
            mode = Mode[mode]
        self.request(f"mode {mode.name}", self.gcs.mode_command(mode), client)

    def param_set(self, name: str, value: float) -> None:
        """Set a parameter; raise RefusedError."""
        self.wait_for(self._parameter(name, value), f"{name} = {value:g}")

    def param_get(self, name: str) -> float:
        """Return a parameter; raise RefusedError."""
        self.wait_for(request := self._parameter(name, None), name)
        return request.value

    def _parameter(self, name: str, value: float | None) -> ParamRequest:
        return self._connected().parameter(name, value, tuple(self.engine.stack.params.specs))

    # ------------------------------------------------------------------ faults

    def fault(self, text: str, *, for_s: float | None = None) -> None:
        """Begin a fault now, such as ``"rotor:2:off"`` or ``"link loss 0.3"``; docs/how-to/faults.md lists them.

        With ``for_s`` it ends after that simulated time. Raise ConfigError for an unknown fault.
        """
        apply_fault(self, text, for_s)

    def happened(self, name: str) -> None:
        """Record an event, to which properties may refer."""
        self.events.append(Event(self.time_s, name))

    def power_cycle(self, off_s: float = 1.0) -> None:
        """Switch the vehicle off for ``off_s`` and on again; in the air it falls. Plans and parameters survive.

        The vehicle's time since boot, in its messages and in the bytes of its logs, begins at 0 again.
        """
        self.engine.power_cycle(off_s)
        for client in self.clients.values():
            self._network.connect(client, self.engine.stack.ground, self._rates_hz)
        self.happened("power_cycle")

    # ------------------------------------------------------------------ flights

    def fly(self, plan: str | Path | Plan | None = None, limit_s: float | None = None) -> Flight:
        """Upload, arm, start, and fly to the end as ``gcs fly`` does; return the flight, whatever its outcome.

        ``limit_s`` is the longest flight, by default 60 s more than three times the time that the plan needs.
        """
        if plan is not None:
            self.plan = plan if isinstance(plan, Plan) else self.setup.load_plan(plan)
        return self.flight(fly_plan(self, self.plan, limit_s))

    def flight(self, outcome: Outcome | None = None) -> Flight:
        """Return the newest flight from its log, up to now if it is not over; ``outcome`` is that of its mission."""
        log = Log(self.engine.newest_log(), self.engine.newest_boot_s)
        flight = Flight(log, outcome, self.plan, self.setup, tuple(self.events))
        if outcome is None or not log:
            return flight
        return replace(flight, result=with_log(outcome, flight.data, self.plan.items))

    def close(self) -> None:
        """Release the loops, which may run in a process."""
        self.engine.close()

    def __enter__(self) -> World:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
