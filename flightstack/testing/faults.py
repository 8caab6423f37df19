"""Faults of a world by their text: those of the simulator, of links, and of the vehicle's power."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

from flightstack.core.errors import ConfigError
from flightstack.testing.link import Channel
from flightstack.testing.setup import with_keys
from sim_bridge.errors import UsageProblemError
from sim_bridge.plant.faults.checks import Flight, check_faults
from sim_bridge.plant.faults.schedule import parse_fault
from sim_bridge.plant.faults.table import STATE_KINDS, Fault, Kind

if TYPE_CHECKING:
    from flightstack.testing.world import World

DIRECTIONS = ("to_vehicle", "from_vehicle")


class LinkFault(NamedTuple):
    """A change of a link: a word, the condition that it sets, and the largest value; 0 for none."""

    condition: str
    largest: float
    meaning: str


LINK_FAULTS: dict[str, LinkFault] = {
    "cut": LinkFault("is_cut", 0.0, "nothing arrives"),
    "restore": LinkFault("", 0.0, "the link is perfect again"),
    "loss": LinkFault("loss", 1.0, "this share of the datagrams is lost"),
    "delay": LinkFault("delay_s", 60.0, "each datagram arrives this time later [s]"),
    "duplication": LinkFault("duplication", 1.0, "this share arrives twice"),
    "reordering": LinkFault("reordering", 1.0, "this share is held back by up to 0.1 s"),
    "garbage": LinkFault("garbage", 1.0, "this share is damaged, with random bytes before it"),
}
_LINK_FORM = "[to_vehicle|from_vehicle] " + "|".join(
    f"{word} VALUE" if fault.largest else word for word, fault in LINK_FAULTS.items()
)


def apply_fault(world: World, text: str, for_s: float | None) -> None:
    """Begin a fault now, and end it after ``for_s`` of simulated time; raise ConfigError."""
    if for_s is not None and not 0.0 < for_s < math.inf:
        raise ConfigError("fault", text, f"lasts {for_s:g} s: the time must be positive")
    words = text.split()
    if words[:1] == ["link"]:
        _change_link(world, words[1:], for_s)
    elif words == ["power", "cycle"]:
        world.power_cycle(1.0 if for_s is None else for_s)
    else:
        _simulator_fault(world, text, for_s)


class FaultCheck:
    """Checks the faults of a scenario before it is flown."""

    def __init__(self, flight: Flight, texts: Sequence[str], has_sensors: bool) -> None:
        """``texts``: all faults of the scenario, on which others may depend, as a cut on a payload."""
        self._has_sensors = has_sensors
        self._rotors = len(flight.vehicle.rotors)
        known = []
        for text in texts:
            with contextlib.suppress(UsageProblemError):
                known.append(parse_fault(text, self._rotors))
        self._flight = flight._replace(faults=known)

    def check(self, text: str, for_s: float | None, *, may_act: bool = True) -> None:
        """Raise ConfigError for a fault that the vehicle cannot have or, with ``may_act``, that cannot act."""
        words = text.split()
        if words[:1] == ["link"]:
            check_link(text.removeprefix("link "))
        elif words != ["power", "cycle"]:
            fault = _parsed(text, self._rotors)
            if not may_act:
                return
            _check_state(fault, text, self._has_sensors)
            if for_s is not None:
                fault = fault._replace(end_us=fault.begin_us + round(for_s * 1e6))
            try:
                check_faults((fault,), self._flight)
            except UsageProblemError as error:
                raise ConfigError("fault", text, _reason(error)) from None


def _reason(error: UsageProblemError) -> str:
    """Return why a fault cannot act, with the keys of a scenario for the options of a remedy."""
    return with_keys(str(error).partition(": ")[2])


def _parsed(text: str, rotors: int) -> Fault:
    try:
        return parse_fault(text, rotors)
    except UsageProblemError as error:
        raise ConfigError("fault", text, str(error).partition(": ")[2]) from None


def _check_state(fault: Fault, text: str, has_sensors: bool) -> None:
    """Raise ConfigError for a fault of a state or sensor on which the vehicle does not fly."""
    if fault.kind in STATE_KINDS and has_sensors:
        raise ConfigError(
            "fault",
            text,
            'cannot act: the vehicle flies on its sensors; name a sensor, or set state to "truth"',
        )
    if fault.kind is Kind.STATE_DROP:
        raise ConfigError("fault", text, "is impossible in lockstep: both sides would wait for each other")
    if fault.sensor and not has_sensors:
        raise ConfigError(
            "fault", text, 'cannot act: the vehicle flies on the true state; set state to "estimated"'
        )


def _simulator_fault(world: World, text: str, for_s: float | None) -> None:
    simulator = world.engine.simulator
    fault = _parsed(text, len(world.engine.stack.vehicle.rotors))
    _check_state(fault, text, simulator.sensors is not None)
    begin_us = simulator.time_us + fault.begin_us
    end_us = None if fault.end_us is None else simulator.time_us + fault.end_us
    if for_s is not None:
        end_us = begin_us + round(for_s * 1e6)
    try:
        simulator.inject(fault._replace(begin_us=begin_us, end_us=end_us))
    except UsageProblemError as error:
        raise ConfigError("fault", text, _reason(error)) from None
    begin_s = (begin_us - simulator.time_us) * 1e-6
    if begin_s > 0.0:
        world.after(begin_s, partial(world.happened, "fault"))
    else:
        world.happened("fault")


def check_link(text: str) -> tuple[tuple[str, ...], str, Callable[[Channel], None]]:
    """Return directions, word and function of a change of a link; raise ConfigError."""
    words = text.split()
    directions = (words.pop(0),) if words[:1] and words[0] in DIRECTIONS else DIRECTIONS
    fault = LINK_FAULTS.get(words[0]) if words else None
    if fault is None or len(words) != (2 if fault.largest else 1):
        raise ConfigError("link", "", f"{text} is no change of a link, which is {_LINK_FORM}")
    return directions, words[0], _change(text, words, fault)


def _change_link(world: World, words: list[str], for_s: float | None) -> None:
    client = world.clients[words.pop(0)] if words[:1] and words[0] in world.clients else world.gcs
    directions, name, change = check_link(" ".join(words))
    for direction in directions:
        channel: Channel = getattr(client.link, direction)
        change(channel)
        condition = LINK_FAULTS[name].condition
        if for_s is not None and condition:
            world.after(for_s, partial(channel.end, condition, getattr(channel.conditions, condition)))
    world.happened(f"link_{name}")
    if for_s is not None:
        world.after(for_s, partial(world.happened, f"link_{name}_end"))


def _change(text: str, words: list[str], fault: LinkFault) -> Callable[[Channel], None]:
    if not fault.largest:
        return Channel.cut if words[0] == "cut" else Channel.restore
    try:
        value = float(words[1])
    except ValueError:
        value = math.nan
    if not 0.0 <= value <= fault.largest:
        raise ConfigError("link", text, f"{words[0]} must be 0 to {fault.largest:g}")
    return lambda channel: channel.set(**{fault.condition: value})
