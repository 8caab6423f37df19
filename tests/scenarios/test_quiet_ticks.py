"""The quiet ticks of a world, which exchange no bytes, fly and record what ticks with bytes do."""

from pathlib import Path

import pytest

from flightstack.testing import World
from flightstack.testing.engine import Engine
from tests.support.inertial_sensors import x_quad_with_imus

CONDITIONS = (
    {"state": "truth", "loops": "c"},
    {"state": "estimated", "vehicle": "x_quad", "wind": (3.0, -1.0), "gust": 1.0, "seed": 3},
)


class BytesEngine(Engine):
    """Exchanges the bytes of every state and every answer."""

    def states(self) -> bytes | memoryview:
        return super().states()


def flown(world: World) -> tuple[bytes, list[str], int]:
    """Take off, move, fly through a fault of a sensor or a rotor, and return log, texts and messages."""
    world.wait_until_ready()
    world.takeoff(1.5)
    world.run_for(1.3)
    world.goto(1.0, 0.5)
    world.fault("rotor:2:weak=0.9", for_s=0.5)
    if world.setup.state == "estimated":
        world.fault("sensor:mag:freeze", for_s=0.31)
    world.run_for(1.777)
    world.land()
    world.run_until("landed", 30.0)
    version = world.engine.stack.loops.version.encode()
    return world.engine.newest_log().replace(version, b""), world.texts, sum(world.gcs.counts.values())


@pytest.mark.parametrize("conditions", CONDITIONS, ids=lambda conditions: conditions["state"])
def test_quiet_ticks_fly_as_ticks_with_bytes(conditions: dict) -> None:
    with World(**conditions) as quiet, World(make_engine=BytesEngine, **conditions) as exchanged:
        assert flown(quiet) == flown(exchanged)


def test_quiet_ticks_of_two_inertial_sensors_fly_as_ticks_with_bytes(tmp_path: Path) -> None:
    conditions = {"state": "estimated", "vehicle": x_quad_with_imus(tmp_path), "seed": 2}
    with World(**conditions) as quiet, World(make_engine=BytesEngine, **conditions) as exchanged:
        assert flown(quiet) == flown(exchanged)


@pytest.mark.parametrize("state", ["truth", "estimated"])
def test_most_ticks_in_flight_are_quiet(state: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with World(state=state) as world:
        world.wait_until_ready()
        world.takeoff(2.0)
        world.run_for(2.0)
        calls: list[bool] = []
        tick = Engine.tick
        monkeypatch.setattr(Engine, "tick", lambda engine: calls.append(True) or tick(engine))
        world.run_for(1.0)
    assert len(calls) <= 0.22 * 500  # one in five is that of the outer loop
