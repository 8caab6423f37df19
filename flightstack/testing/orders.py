"""Requests that an event of a scenario makes, by their text."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from flightstack.core.enums import Mode
from flightstack.core.errors import ConfigError
from gcs_cli.link import calls

if TYPE_CHECKING:
    from flightstack.testing.client import Client
    from flightstack.testing.world import World


class Order(NamedTuple):
    """A request in an event: how many numbers it takes, and its command."""

    fewest: int
    most: int
    make: Callable[[World, list[float]], calls.Command]
    form: str


ORDERS: dict[str, Order] = {
    "arm": Order(0, 0, lambda _w, _v: calls.ARM, "arm"),
    "disarm": Order(0, 0, lambda _w, _v: calls.DISARM, "disarm"),
    "kill": Order(0, 0, lambda _w, _v: calls.FORCE_DISARM, "kill"),
    "takeoff": Order(0, 1, lambda w, v: w.takeoff_command(*v), "takeoff [ALT_M]"),
    "land": Order(0, 0, lambda _w, _v: calls.LAND, "land"),
    "rtl": Order(0, 0, lambda _w, _v: calls.RETURN, "rtl"),
    "goto": Order(2, 3, lambda w, v: w.goto_command(*v), "goto NORTH_M EAST_M [ALT_M]"),
    "speed": Order(1, 1, lambda _w, v: calls.speed_command(v[0]), "speed M_S"),
    "start_mission": Order(0, 0, lambda _w, _v: calls.START_MISSION, "start_mission"),
    "reboot": Order(0, 0, lambda _w, _v: calls.REBOOT, "reboot"),
}
"""Requests that an event may make, besides ``mode NAME``."""


def order(world: World, text: str, client: Client) -> None:
    """Make the request of ``text`` from a client; raise RefusedError, or ConfigError for an unknown one."""
    check_command(text)
    word, *rest = text.split()
    if word in ("mode", "hold"):
        world.set_mode(Mode.HOLD if word == "hold" else rest[0], client)
        return
    world.request(word, ORDERS[word].make(world, [float(value) for value in rest]), client)


def check_command(text: str) -> None:
    """Raise ConfigError for a request that no event can make."""
    word, *rest = text.split() or [""]
    forms = ", ".join([*(order.form for order in ORDERS.values()), "hold", "mode NAME"])
    if word == "hold" and not rest:
        return
    if word == "mode" and len(rest) == 1:
        if rest[0] not in Mode.__members__:
            raise ConfigError(
                "command", text, f"has no mode {rest[0]!r}; modes are {', '.join(Mode.__members__)}"
            )
        return
    request = ORDERS.get(word)
    try:
        numbers = [float(value) for value in rest]
    except ValueError:
        numbers = [math.nan]
    fits = request is not None and request.fewest <= len(numbers) <= request.most
    if not fits or not all(map(math.isfinite, numbers)):
        raise ConfigError("command", text, f"is none of {forms}")
