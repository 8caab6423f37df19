"""Fly a scenario: start it, let its events happen, and evaluate the flight. Simulated time, one process."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from flightstack.core.errors import ConfigError
from flightstack.testing.client import Client, RefusedError
from flightstack.testing.expectations import Check, evaluate
from flightstack.testing.expression import Expression
from flightstack.testing.flight import Flight
from flightstack.testing.mission_flight import fly_plan
from flightstack.testing.orders import order
from flightstack.testing.scenario import Event, Scenario, repeat_command
from flightstack.testing.state import State
from flightstack.testing.world import World
from gcs_cli.report.flight_outcome import Outcome

_DEFAULT_LIMIT_S = 600.0


@dataclass(frozen=True)
class Verdict:
    """The result of one flight of a scenario."""

    scenario: Scenario
    seed: int
    flight: Flight
    last: State
    checks: tuple[Check, ...]

    @property
    def passed(self) -> bool:
        """True if every expectation holds."""
        return all(check.passed for check in self.checks)

    @property
    def failures(self) -> list[str]:
        """The expectations that do not hold, each with its values."""
        return [str(check) for check in self.checks if not check.passed]

    @property
    def closest(self) -> Check | None:
        """The check with the smallest finite margin relative to its limit."""
        finite = [check for check in self.checks if check.share is not None]
        return min(finite, key=lambda check: check.share or 0.0, default=None)

    @property
    def command(self) -> str:
        """The command that repeats this flight."""
        return repeat_command(self.scenario, self.seed)


def run_scenario(scenario: Scenario, seed: int | None = None) -> Verdict:
    """Fly a scenario with a seed, by default its first; raise ConfigError if it cannot begin.

    >>> from pathlib import Path
    >>> from flightstack.testing import is_scenario, load_scenario
    >>> path = Path("low.toml")
    >>> size = path.write_text('plan = "hop"\\n[expect]\\nalways = ["altitude_m < 2"]\\n')
    >>> is_scenario(path), load_scenario(path).seeds
    (True, (1,))
    >>> run_scenario(load_scenario(path)).passed
    True
    """
    seed = scenario.seed if seed is None else seed
    with World(scenario.setup(seed), telemetry=None) as world:
        for client in scenario.client:
            world.add_client(client.name, is_companion=client.companion, system_id=client.system_id)
        run = _Run(world, scenario)
        flight = world.flight(run.fly())
        last = world.state
        checks = evaluate(scenario.expect, flight, last, world.events)
        missed = run.missed() if scenario.expect.refusal is None else ()
        return Verdict(scenario, seed, flight, last, (*checks, *missed))


class _Run:
    """Flies one scenario and fires its events."""

    def __init__(self, world: World, scenario: Scenario) -> None:
        self._world = world
        self._scenario = scenario
        self._waiting = [(event, _trigger(world, event)) for event in scenario.event]
        self._of_numbers = [event for event in scenario.event if _depends_on_numbers(event)]
        self._due: list[tuple[float, Event]] = []
        self._requests: list[Event] = []
        if self._waiting:  # time goes on while a request waits for its answer
            world.watch(self._fire, lambda: bool(self._of_numbers))
        for event in scenario.event:
            if event.at_s is not None:
                world.after(event.at_s - world.time_s, self._fire)

    def fly(self) -> Outcome | None:
        world, scenario = self._world, self._scenario
        limit_s = scenario.limit_s
        if scenario.plan is not None:
            return fly_plan(world, world.setup.load_plan(scenario.plan), limit_s, self._step)
        end_s = scenario.duration_s or limit_s or _DEFAULT_LIMIT_S
        flew = False
        while world.time_s < end_s and (world.engine.stack.now.status.armed or not flew):
            flew = flew or world.engine.stack.now.status.armed
            if self._step(end_s - world.time_s):
                break
        return None

    def missed(self) -> tuple[Check, ...]:
        """Return a failed check for each event that did not happen: what it was to test was not flown."""
        pending = [event for event, _ in self._waiting] + [event for _, event in self._due] + self._requests
        missed = [index for index, event in enumerate(self._scenario.event) if event in pending]
        return tuple(Check(f"event[{index}]", False, "did not happen in this flight") for index in missed)

    def _fire(self) -> None:
        """Find the events that are due: faults act at once, requests wait for the next step."""
        world = self._world
        if not (self._waiting or self._due):
            return
        now_s, state = world.time_s, world.state
        fired = [event for event, is_due in self._waiting if is_due(state)]
        self._waiting = [(event, is_due) for event, is_due in self._waiting if event not in fired]
        self._due += [(now_s + event.delay_s, event) for event in fired]
        for event in fired:
            if event in self._of_numbers:
                self._of_numbers.remove(event)
            if event.delay_s > 0.0:
                world.after(event.delay_s, self._fire)
        due = [event for at_s, event in self._due if at_s <= now_s + 1e-9]
        self._due = [entry for entry in self._due if entry[0] > now_s + 1e-9]
        for event in due:
            if event.fault is not None or event.link is not None:
                _carry_out(world, event)
            else:
                self._requests.append(event)

    def _step(self, most_s: float) -> bool:
        """Make the requests that are due, and run on; return True at the end of the scenario's duration."""
        world = self._world
        self._fire()
        while self._requests:
            _carry_out(world, self._requests.pop(0))
        duration_s = self._scenario.duration_s
        if duration_s is None:
            world.run_on(most_s)
            return False
        world.run_on(min(most_s, duration_s - world.time_s))
        return world.time_s >= duration_s


def _depends_on_numbers(event: Event) -> bool:
    """Return True if the event may be due after any outer tick, not only at a time or after another event."""
    return event.when is not None and not Expression(event.when).has_no_numbers


def _trigger(world: World, event: Event) -> Callable[[State], bool]:
    """Return the function that tells from the state whether an event is triggered."""
    if event.at_s is not None:
        at_s = event.at_s - 1e-9
        return lambda state: state.time_s >= at_s
    if event.at_item is not None:
        item = event.at_item
        return lambda state: state.item == item
    if event.when is not None:
        return Expression(event.when).of_state
    name = event.after
    return lambda _state: any(happened.name == name for happened in world.events)


def _set_param(world: World, text: str) -> None:
    name, _, value = text.partition("=")
    world.param_set(name.strip(), float(value))


_EFFECTS: dict[str, Callable[[World, Event, Client], None]] = {
    "fault": lambda world, event, _: world.fault(event.fault or "", for_s=event.for_s),
    "link": lambda world, event, client: world.fault(f"link {client.name} {event.link}", for_s=event.for_s),
    "power": lambda world, event, _: world.fault("power cycle", for_s=event.for_s),
    "param": lambda world, event, _: _set_param(world, event.param or ""),
    "upload": lambda world, event, _: world.upload(event.upload or ""),
    "command": lambda world, event, client: order(world, event.command or "", client),
}
"""What the effect of an event does, by its key."""


def _carry_out(world: World, event: Event) -> None:
    """Carry out the effect of an event, and record an answer that was not expected."""
    effect = next(name for name in _EFFECTS if getattr(event, name) is not None)
    try:
        _EFFECTS[effect](world, event, world.clients[event.client or "gcs"])
    except RefusedError as error:
        if event.refused is None:
            world.happened(f"unexpected refusal: {error}")
        elif event.refused not in error.reason:
            world.happened(f"unexpected reason: {error}, expected {event.refused!r}")
    except ConfigError as error:
        if event.refused is None or event.refused not in str(error):
            world.happened(f"unexpected: {error}")
    else:
        if event.refused is not None:
            world.happened(f"not refused: {getattr(event, effect)}")
