"""Requests that an event of a scenario makes, by their text."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

from flightstack.core.enums import Mode
from flightstack.core.errors import ConfigError
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Message
from flightstack.testing.mission_flight import await_first_state
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
    "mav_cmd": Order(1, 8, lambda _w, v: (int(v[0]), v[1:]), "mav_cmd NUMBER [PARAM1 … PARAM7]"),
}
"""Requests that an event may make, besides ``mode NAME``."""
_NEED_STATE = ("arm", "takeoff")
"""Requests that give a vehicle on its sensors the time until it is ready after its boot."""


_POSITION, _VELOCITY = 0b1101_1111_1000, 0b1101_1100_0111
"""Type masks of SET_POSITION_TARGET_LOCAL_NED: the bits of the fields to ignore."""


class Stream(NamedTuple):
    """Messages that a client sends at 20 Hz: how many numbers they have, and the message."""

    numbers: int
    message: Callable[[list[float]], Message]
    form: str


STREAMS: dict[str, Stream] = {
    "sticks": Stream(4, lambda v: _sticks(*v), "sticks FORWARD RIGHT UP YAW"),
    "setpoint": Stream(3, lambda v: _target(_POSITION, v[0], v[1], -v[2]), "setpoint NORTH_M EAST_M ALT_M"),
    "velocity": Stream(3, lambda v: _target(_VELOCITY, v[0], v[1], -v[2]), "velocity NORTH EAST UP"),
}
"""What a client streams until the next of them, or ``silence``: sticks from −1 to 1, offboard setpoints [m, m/s]."""


def _sticks(forward: float, right: float, up: float, yaw: float) -> Message:
    x, y, z, r = 1000.0 * forward, 1000.0 * right, 500.0 + 500.0 * up, 1000.0 * yaw
    return mavlink.MAVLink_manual_control_message(1, round(x), round(y), round(z), round(r), 0)


def _target(ignored: int, x: float, y: float, z: float) -> Message:
    return mavlink.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, mavlink.MAV_FRAME_LOCAL_NED, ignored, x, y, z, x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0
    )


def order(world: World, text: str, client: Client) -> None:
    """Make the request of ``text`` from a client; raise RefusedError, or ConfigError for an unknown one."""
    check_command(text)
    word, *rest = text.split()
    if word in ("mode", "hold"):
        world.set_mode(Mode.HOLD if word == "hold" else rest[0], client)
        return
    values = [float(value) for value in rest]
    if word == "silence":
        client.streams.clear()
    elif word in STREAMS:
        client.streams = {word: partial(STREAMS[word].message, values)}
    else:
        if word in _NEED_STATE:
            await_first_state(world)
        world.request(word, ORDERS[word].make(world, values), client)


def check_command(text: str) -> None:
    """Raise ConfigError for a request that no event can make."""
    word, *rest = text.split() or [""]
    forms = [order.form for order in ORDERS.values()] + [stream.form for stream in STREAMS.values()]
    if word in ("silence", "hold") and not rest:
        return
    if word == "mode" and len(rest) == 1:
        if rest[0] not in Mode.__members__:
            raise ConfigError(
                "command", text, f"has no mode {rest[0]!r}; modes are {', '.join(Mode.__members__)}"
            )
        return
    fewest, most = _counts(word)
    try:
        numbers = [float(value) for value in rest]
    except ValueError:
        numbers = [math.nan]
    if not fewest <= len(numbers) <= most or not all(map(math.isfinite, numbers)):
        raise ConfigError("command", "", f"{text} is none of {', '.join(forms)}, silence, hold, mode NAME")


def _counts(word: str) -> tuple[float, float]:
    """Return how many numbers at least and at most follow a word; none for an unknown word."""
    if word in STREAMS:
        return STREAMS[word].numbers, STREAMS[word].numbers
    return (ORDERS[word].fewest, ORDERS[word].most) if word in ORDERS else (math.inf, 0)
