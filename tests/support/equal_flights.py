"""The same flight by compiled ticks and by single ticks with bytes: equal logs, messages and events."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flightstack.testing import World
from tests.support.bytes_engine import BytesEngine


class _Flown:
    """A flight, and what the ground station received in it."""

    def __init__(self, world: World, fly: Callable[[World], None]) -> None:
        self.received: list[tuple[float, bytes]] = []
        receive = world.gcs.receive

        def recorded(data: bytes, now_s: float) -> None:
            self.received.append((now_s, data))
            receive(data, now_s)

        world.gcs.receive = recorded  # type: ignore[method-assign]
        world.wait_until_ready()
        fly(world)
        self.log, self.events, self.end_s = world.engine.newest_log(), list(world.events), world.time_s


def assert_flies_equally(fly: Callable[[World], None], **conditions: Any) -> None:
    """Fly twice under the same conditions; fail unless both flights are equal."""
    with World(**conditions) as quiet, World(make_engine=BytesEngine, **conditions) as exchanged:
        one, other = _Flown(quiet, fly), _Flown(exchanged, fly)
        assert one.end_s == other.end_s
        assert one.events == other.events
        assert one.received == other.received
        assert one.log == other.log
