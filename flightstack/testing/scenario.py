"""Scenario files: a plan, a vehicle and its conditions, events, and what is expected of the flight."""

from __future__ import annotations

import shlex
import sys
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from importlib import invalidate_caches
from pathlib import Path
from typing import Any

from flightstack.commander.failsafe import Failsafe
from flightstack.control.controller_loading import entry_points_of_controllers, load_controller
from flightstack.core.enums import Mode
from flightstack.core.errors import ConfigError
from flightstack.params.config import (
    DEFAULT_CONTROLLER,
    DEFAULT_HOME,
    DEFAULT_STATE,
    ESTIMATED,
    STATES,
    parse_home,
)
from flightstack.params.gains_file import DEFAULT_GAINS
from flightstack.params.store import read_assignment
from flightstack.params.toml_file import read_toml
from flightstack.params.vehicle import DEFAULT_VEHICLE
from flightstack.testing.events import check_event
from flightstack.testing.expression import Expression
from flightstack.testing.faults import DIRECTIONS, LINK_FAULTS, FaultCheck, check_link
from flightstack.testing.orders import check_command
from flightstack.testing.properties import parse_window
from flightstack.testing.setup import OPTION_KEYS, Setup
from flightstack.testing.toml_record import key, read_record
from gcs_cli.report.flight_outcome import Code
from gcs_cli.transfers.plan_files import example_plans
from sim_bridge.plant.faults.checks import Flight

SEVERITIES = ("emergency", "alert", "critical", "error", "warning", "notice", "info", "debug")
OUTCOMES = ("any", *Code, *Mode.__members__, *Failsafe.__members__)
_TRIGGERS = ("at_s", "at_item", "when", "after")
_EFFECTS = ("fault", "link", "command", "param", "upload", "power")


@dataclass(frozen=True)
class Wind:
    """``[wind]``."""

    mean_m_s: tuple[float, ...] = key((0.0, 0.0), "mean wind north, east and, optionally, down",
                                      low=-200.0, high=200.0, lengths=(2, 3))  # fmt: skip
    gust_m_s: float = key(0.0, "standard deviation of the gusts", low=0.0, high=50.0)


@dataclass(frozen=True)
class ClientKey:
    """``[[client]]``."""

    name: str = key("", "name of a further client, for `client` of events")
    companion: bool = key(False, "a companion computer, whose heartbeats do not count as data link")
    system_id: int | None = key(None, "MAVLink system id; otherwise the largest free one: 254, 253 …",
                                low=1, high=255)  # fmt: skip


@dataclass(frozen=True)
class Event:
    """``[[event]]``: one trigger and one effect."""

    at_s: float | None = key(None, "trigger: simulated time", low=0.0)
    at_item: int | None = key(None, "trigger: this mission item is the current one", low=0, high=65535)
    when: str | None = key(None, "trigger: an expression comes true")
    after: str | None = key(None, "trigger: an event of the world happens, such as `link_cut`")
    delay_s: float = key(0.0, "time from the trigger to the effect", low=0.0)
    fault: str | None = key(None, "effect: a fault, such as `rotor:2:off`")
    link: str | None = key(None, "effect: a change of a link, such as `cut` or `to_vehicle loss 0.3`")
    command: str | None = key(None, "effect: a request, such as `land`, `goto 5 0 10` or `mode HOLD`")
    param: str | None = key(None, "effect: a parameter, `NAME=VALUE`")
    upload: str | None = key(None, "effect: another plan")
    power: str | None = key(None, "effect: the vehicle is switched off and on", choices=("cycle",))
    for_s: float | None = key(None, "duration of a fault, a change of a link, or a power failure", low=1e-3)
    client: str | None = key(None, "client whose link changes, or that sends the command")
    refused: str | None = key(None, "the vehicle is expected to refuse, with a reason that has this text")


@dataclass(frozen=True)
class Expect:
    """``[expect]``."""

    outcome: str = key("", "a code of summary.json, the mode of the last landing, or a failsafe that was active; "
                           "`any` for none", choices=OUTCOMES)  # fmt: skip
    refusal: str | None = key(None, "text of the reason with which the vehicle refuses to start")
    reached: tuple[int, ...] | None = key(None, "mission items in the order in which they are reached", low=0)
    corridor_m: float | None = key(None, "largest distance of the true path from that of the plan", low=0.0)
    max_error_m: float | None = key(None, "largest distance between true position and setpoint", low=0.0)
    rms_error_m: float | None = key(None, "root mean square of that distance", low=0.0)
    landing_error_m: float | None = key(None, "largest distance of the touchdown from its place", low=0.0)
    duration_s: tuple[float, ...] | None = key(None, "least and largest duration", low=0.0, lengths=(2,))
    always: tuple[str, ...] = key((), "expressions that hold at every time")
    eventually: tuple[str, ...] = key((), "expressions that hold once, also `… within 20 s of EVENT`")
    at_end: tuple[str, ...] = key((), "expressions that hold in the last state")
    no_text_above: str | None = key(None, "no status text is more severe than this", choices=SEVERITIES)
    texts: tuple[str, ...] = key((), "texts of which each is part of a status text")


@dataclass(frozen=True)
class Scenario:
    """A scenario. The keys are those of the file; ``path`` is where it was read."""

    description: str = key("", "one sentence for the report")
    plan: str | None = key(None, "a plan file beside the scenario, or the name of an example")
    vehicle: str = key(DEFAULT_VEHICLE, "a built-in vehicle, or a vehicle file")
    controller: str = key(DEFAULT_CONTROLLER, "an attitude controller")
    gains: str = key(DEFAULT_GAINS, "a built-in set of gains, or a gains file")
    loops: str = key("python", "`python`, `c`, `host` or `emulated`")
    state: str = key(
        DEFAULT_STATE, "`estimated` to fly on the sensors, `truth` on the simulator's state", choices=STATES
    )
    plant: str = key("rigid", "the simulated vehicle", choices=("rigid", "multibody", "paper"))
    drag: bool = key(False, "give the vehicle the optional drag of its file")
    ideal_rotors: bool = key(False, "rotors without lag and limits")
    inner_hz: float = key(500.0, "rate of the inner loop", low=10.0, high=20000.0)
    outer_hz: float | None = key(None, "rate of the outer loop", low=1.0, high=20000.0)
    home: str | None = key(None, "LATITUDE,LONGITUDE,ALTITUDE of the start; otherwise the plan's")
    seed: int = key(1, "seed of the first flight", low=0, high=2**31 - 1)
    repeat: int = key(1, "number of flights, with the following seeds", low=1, high=1_000_000)
    limit_s: float | None = key(
        None, "longest flight; otherwise three times what the plan needs, and 60 s", low=1.0
    )
    duration_s: float | None = key(None, "end the flight after this time", low=0.1)
    params: dict[str, float] | None = key(None, "parameters of the vehicle")  # noqa: RUF009
    simulated: dict[str, float] | None = key(  # noqa: RUF009
        None, 'numbers of the simulated vehicle that differ from its file, by path such as `"body.mass_kg"`'
    )
    wind: Wind = key(Wind(), "wind")  # noqa: RUF009
    force_n: tuple[float, ...] = key((0.0, 0.0, 0.0), "constant force NED", lengths=(3,))
    torque_n_m: tuple[float, ...] = key((0.0, 0.0, 0.0), "constant torque FRD", lengths=(3,))
    torque_gust_n_m: float = key(0.0, "standard deviation of the gusty torque", low=0.0, high=100.0)
    slope_deg: float = key(0.0, "slope of the ground, which rises to the north", low=-30.0, high=30.0)
    boat_m_s: tuple[float, ...] = key((0.0, 0.0), "velocity of the ground north and east", lengths=(2,))
    battery_percent: float | None = key(None, "charge at the start", low=0.0, high=100.0)
    battery_capacity_mah: float | None = key(None, "capacity of the battery", low=1.0)
    battery_drain: float | None = key(None, "factor on the discharge", low=0.0, high=1e4)
    client: tuple[ClientKey, ...] = key((), "further clients")
    event: tuple[Event, ...] = key((), "events")
    expect: Expect = key(Expect(), "what is expected")  # noqa: RUF009
    path: Path = Path()

    @property
    def name(self) -> str:
        """The name of the file without its ending."""
        return self.path.stem

    @property
    def seeds(self) -> tuple[int, ...]:
        """A seed for each flight."""
        return tuple(range(self.seed, self.seed + self.repeat))

    def files(self) -> tuple[Path, ...]:
        """Return the files on which the flights depend."""
        return (self.path, *self.own_files(), *self.installed_files())

    def own_files(self) -> tuple[Path, ...]:
        """Return the scenario's files that are read in each flight: plans, those of vehicle and gains."""
        records = (_beside(name, self.path.parent) for name in (self.vehicle, self.gains))
        examples = example_plans().values()
        return (
            *(path for path in self._plans() if path not in examples),
            *(Path(name) for name in records if name.endswith(".toml")),
        )

    def installed_files(self) -> tuple[Path, ...]:
        """Return the files of the installation that flights depend on besides flightstack: example plans, a plug-in."""
        controller, examples = load_controller(self.controller), example_plans().values()
        return (
            *(path for path in self._plans() if path in examples),
            *(source for law in controller.own_laws.values() for source in law.sources),
        )

    def _plans(self) -> list[Path]:
        setup = Setup(folder=self.path.parent)
        plans = (self.plan, *(event.upload for event in self.event))
        return [setup.plan_path(plan) for plan in plans if plan is not None]

    def setup(self, seed: int) -> Setup:
        """Return the vehicle and conditions of the flight with ``seed``."""
        same = (
            "vehicle", "controller", "gains", "loops", "state", "plant", "drag", "ideal_rotors", "inner_hz", "outer_hz",
            "battery_percent", "battery_capacity_mah", "battery_drain", "slope_deg",
        )  # fmt: skip
        folder = self.path.parent
        made = Setup(
            **{name: getattr(self, name) for name in same},
            params=self.params or {},
            simulated=self.simulated or {},
            wind=self.wind.mean_m_s,
            gust=self.wind.gust_m_s,
            force=self.force_n,
            torque=self.torque_n_m,
            boat=self.boat_m_s,
            torque_gust=self.torque_gust_n_m,
            seed=seed,
            folder=folder,
        )
        home = None if self.plan is None else made.load_plan(self.plan).home
        home = home if self.home is None else parse_home(self.home)
        return replace(
            made,
            home=home or DEFAULT_HOME,
            vehicle=_beside(self.vehicle, folder),
            gains=_beside(self.gains, folder),
        )


def _beside(name: str, folder: Path) -> str:
    """Return a built-in name as it is, and a file's path relative to the scenario."""
    return str(folder / name) if name.endswith(".toml") else name


def forget_controllers() -> None:
    """Forget the modules of plug-in controllers: the next use imports them as they are then."""
    tops = {point.module.partition(".")[0] for point in entry_points_of_controllers()}
    plugins = tops - {__name__.partition(".")[0]}
    for name in [name for name in sys.modules if name.partition(".")[0] in plugins]:
        del sys.modules[name]
    invalidate_caches()


def is_scenario(path: Path) -> bool:
    """Return True for a TOML file with a table ``[expect]``, also for one that has errors in its syntax.

    A campaign, which has a table ``[campaign]`` too, is none.
    """
    if path.suffix != ".toml":
        return False
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, ValueError):
        return False
    try:
        document = tomllib.loads(text)
        return "expect" in document and "campaign" not in document
    except (ValueError, RecursionError):
        return any(line.strip() == "[expect]" for line in text.splitlines())


def load_scenario(path: Path) -> Scenario:
    """Read a scenario file; raise ConfigError, which names the key and what is allowed."""
    values = read_toml(path).values()
    if "campaign" in values:
        raise ConfigError(path, "", "is a campaign: fly it with gcs campaign")
    return check_scenario(read_scenario(path, values))


def read_scenario(path: Path, values: Mapping[str, Any]) -> Scenario:
    """Return the scenario that has the content ``values`` in place of its file at ``path``; raise ConfigError.

    Types and ranges are checked here, all else by ``check_scenario``.
    """
    return replace(read_record(Scenario, path, values), path=path)


def check_scenario(scenario: Scenario) -> Scenario:
    """Return a scenario that can be flown; raise ConfigError otherwise."""
    path = scenario.path
    names = [client.name for client in scenario.client]
    for index, name in enumerate(names):
        if not name.isidentifier() or name in ("gcs", *DIRECTIONS, *LINK_FAULTS) or name in names[:index]:
            raise ConfigError(
                path, f"client[{index}].name", f"{name!r} is no name of a further client, or taken"
            )
    for index, event in enumerate(scenario.event):
        _check_event(path, f"event[{index}]", event, set(names))
    _check_texts(scenario)
    if scenario.plan is None and scenario.duration_s is None and scenario.limit_s is None:
        raise ConfigError(path, "plan", "is missing; without a plan give duration_s or limit_s")
    return scenario


def _check_event(path: Path, name: str, event: Event, clients: set[str]) -> None:
    for what, keys in (("trigger", _TRIGGERS), ("effect", _EFFECTS)):
        given = [key for key in keys if getattr(event, key) is not None]
        if len(given) != 1:
            has = f"has {' and '.join(given)}" if given else "has none"
            raise ConfigError(path, name, f"needs one {what} of {', '.join(keys)}, and {has}")
    if event.client is not None and event.client not in clients | {"gcs"}:
        raise ConfigError(
            path, f"{name}.client", f"{event.client!r} is not one of {', '.join(sorted(clients | {'gcs'}))}"
        )
    if event.client is not None and event.link is event.command is None:
        raise ConfigError(path, f"{name}.client", "is for link and command")
    if event.for_s is not None and event.fault is event.link is event.power is None:
        raise ConfigError(path, f"{name}.for_s", "is for fault, link and power")
    if event.refused is not None and event.command is event.upload is event.param is event.fault is None:
        raise ConfigError(path, f"{name}.refused", "is for command, fault, param and upload")


def _check_texts(scenario: Scenario) -> None:
    """Check everything that can be checked before a flight: plan, conditions, expressions, requests, faults."""
    try:
        setup = scenario.setup(scenario.seed)
        flown, options = setup.plant_options(setup.check())
    except ConfigError as error:
        raise error.within(scenario.path, OPTION_KEYS) from None
    texts = [event.fault for event in scenario.event if event.fault is not None]
    faults = FaultCheck(Flight(flown, setup.plant, options), texts, setup.state == ESTIMATED)
    expect = scenario.expect
    checks: list[tuple[str, str, Callable[[str], object]]] = [
        (f"expect.{name}[{index}]", text, check)
        for name, check in (
            ("always", _check_property),
            ("eventually", _check_property),
            ("at_end", Expression),
        )
        for index, text in enumerate(getattr(expect, name))
    ]
    by_key: dict[str, Callable[[str], object]] = {
        "when": Expression,
        "after": lambda text: check_event(text, is_live=True),
        "command": check_command,
        "link": check_link,
        "param": read_assignment,
        "upload": setup.load_plan,
    }
    for index, event in enumerate(scenario.event):
        if event.fault is not None:
            fault_check = partial(faults.check, for_s=event.for_s, may_act=event.refused is None)
            checks.append((f"event[{index}].fault", event.fault, fault_check))
        given = ((name, getattr(event, name)) for name in by_key)
        checks += [(f"event[{index}].{name}", text, by_key[name]) for name, text in given if text is not None]
    for name, text, check in checks:
        try:
            check(text)
        except ConfigError as error:
            raise ConfigError(scenario.path, name, str(error).partition(": ")[2]) from None


def _check_property(text: str) -> None:
    expression, window = parse_window(text)
    Expression(expression)
    if window.event is not None:
        check_event(window.event)


def repeat_command(scenario: Scenario, seed: int) -> str:
    """Return the command that flies this scenario alone with this seed."""
    seeds = "" if scenario.repeat == 1 and seed == scenario.seed else f" --seed {seed} --repeat 1"
    return f"gcs test {shlex.quote(str(scenario.path))}{seeds}"
