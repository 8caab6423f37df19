"""The quiet ticks of a world, which exchange no bytes, fly and record what ticks with bytes do."""

from collections import Counter
from pathlib import Path

import pytest

from flightstack.commander.estimate_checks import estimate_failsafes
from flightstack.commander.failsafe import Failsafe
from flightstack.core.contract import FloatArray
from flightstack.estimation.health import EstimateHealth
from flightstack.process.quiet_block import QuietBlock
from flightstack.services.routing.hub import GroundHub
from flightstack.testing import World
from flightstack.testing.engine import Engine
from flightstack.testing.network import Network
from flightstack.vehicle.autopilot import Autopilot
from sim_bridge.errors import PlantDivergedError
from tests.support.bytes_engine import BytesEngine
from tests.support.inertial_sensors import x_quad_with_imus

CONDITIONS = (
    {"state": "truth", "loops": "c"},
    {"state": "truth", "controller": "backstepping", "plant": "paper"},
    {"state": "truth", "vehicle": "x_quad", "gust": 1.0, "torque_gust": 0.01, "inner_hz": 1000.0},
    {"state": "estimated", "vehicle": "x_quad", "wind": (3.0, -1.0), "gust": 1.0, "seed": 3},
)


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


@pytest.mark.parametrize(
    "conditions", CONDITIONS, ids=lambda conditions: "-".join(map(str, conditions.values()))
)
def test_quiet_ticks_fly_as_ticks_with_bytes(conditions: dict) -> None:
    with World(**conditions) as quiet, World(make_engine=BytesEngine, **conditions) as exchanged:
        assert flown(quiet) == flown(exchanged)


def test_quiet_ticks_of_two_inertial_sensors_fly_as_ticks_with_bytes(tmp_path: Path) -> None:
    conditions = {"state": "estimated", "vehicle": x_quad_with_imus(tmp_path), "seed": 2}
    with World(**conditions) as quiet, World(make_engine=BytesEngine, **conditions) as exchanged:
        assert flown(quiet) == flown(exchanged)


@pytest.mark.parametrize("fault", ["imu1:off", "gyro1:bias=3,0,0"])
def test_another_inertial_sensor_is_followed_as_in_ticks_with_bytes(fault: str, tmp_path: Path) -> None:
    """The reset that its selection makes comes after the filters have run, not within their tick."""
    conditions = {"state": "estimated", "vehicle": x_quad_with_imus(tmp_path), "seed": 1}
    logs = []
    for options in ({}, {"make_engine": BytesEngine}):
        with World(**conditions, **options) as world:
            world.wait_until_ready()
            world.upload("square.plan")
            world.arm()
            world.start_mission()
            world.run_for(7.0)
            world.fault(f"sensor:{fault}")
            world.run_until("landed", 60.0)
            assert any("flying on" in text for text in world.texts)
            assert any("Estimate reset" in text for text in world.texts)
            logs.append(world.engine.newest_log())
    assert logs[0] == logs[1]


def test_a_reset_of_the_estimate_ends_a_compiled_call(monkeypatch: pytest.MonkeyPatch) -> None:
    """GNSS jumps and, much later, back, when no fault acts. Guidance follows a reset before the loops run."""
    resets: list[int] = []
    run = QuietBlock.run

    def counted(block: QuietBlock, count: int, is_taken: bool = False) -> int:
        done = run(block, count, is_taken)
        texts = world.engine.stack.journal.texts
        if block.waited and texts and texts[-1].text.startswith("Estimate reset"):
            resets.append(texts[-1].time_us)
        return done

    monkeypatch.setattr(QuietBlock, "run", counted)

    def jump(world: World) -> tuple[bytes, list[str]]:
        world.wait_until_ready()
        world.takeoff(2.0)
        world.fault("sensor:gnss:bias=30,0,0", for_s=15.0)
        world.run_until(lambda _: sum("Estimate reset" in text for text in world.texts) == 1, 60.0)
        # the log's rows of the position count from the first reset: the second one is to be between two of them
        world.param_set("EKF2_BARO_DELAY", 114)
        world.run_until(lambda _: sum("Estimate reset" in text for text in world.texts) == 2, 60.0)
        world.run_for(0.5)
        return world.engine.newest_log(), world.texts

    conditions = {"state": "estimated", "seed": 4}
    with World(**conditions) as world:
        quiet = jump(world)
    assert resets
    with World(make_engine=BytesEngine, **conditions) as exchanged:
        assert jump(exchanged) == quiet


def test_other_facts_of_the_estimate_end_a_compiled_call(monkeypatch: pytest.MonkeyPatch) -> None:
    """A limit of the position becomes smaller than its deviation, and large again."""
    found: list[frozenset[Failsafe]] = []
    run = QuietBlock.run

    def counted(block: QuietBlock, count: int, is_taken: bool = False) -> int:
        before = world.engine.stack.estimation.health
        done = run(block, count, is_taken)
        health, behaviour = world.engine.stack.estimation.health, world.engine.stack.now.behaviour
        facts = estimate_failsafes(health, behaviour)
        if block.waited and facts != estimate_failsafes(before, behaviour):
            found.append(facts)
        return done

    def limited(world: World) -> tuple[bytes, list[str], EstimateHealth]:
        world.wait_until_ready()
        world.takeoff(2.0)
        world.run_for(2.0)
        for limit_m in (0.1, 5.0):
            world.param_set("COM_POS_FS_EPH", limit_m)
            world.run_for(3.0)
        assert "failsafe_POSITION_LOST" in [event.name for event in world.events]
        return world.engine.newest_log(), world.texts, world.engine.stack.estimation.health

    conditions = {"state": "estimated", "seed": 5}
    with monkeypatch.context() as patch:
        patch.setattr(QuietBlock, "run", counted)
        with World(**conditions) as world:
            quiet = limited(world)
    assert found[0] == {Failsafe.POSITION_LOST}
    with World(make_engine=BytesEngine, **conditions) as exchanged:
        assert limited(exchanged) == quiet


@pytest.mark.parametrize("state", ["truth", "estimated"])
def test_a_plant_that_diverges_is_logged_as_in_ticks_with_bytes(state: str) -> None:
    logs = []
    for make in (Engine, BytesEngine):
        with World(state=state, make_engine=make) as world:
            world.wait_until_ready()
            world.arm()
            world.engine.simulator.plant.memory[0]["body"][10:13] = 1e9
            with pytest.raises(PlantDivergedError):
                world.run_for(1.0)
            logs.append(world.engine.newest_log())
    assert logs[0] == logs[1]


@pytest.mark.parametrize("state", ["truth", "estimated"])
def test_most_ticks_in_flight_are_quiet(state: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with World(state=state) as world:
        world.wait_until_ready()
        world.takeoff(2.0)
        world.run_for(2.0)
        calls: list[int] = []
        tick = Autopilot.tick

        def counted(autopilot: Autopilot, time_us: int) -> FloatArray:
            calls.append(time_us)
            return tick(autopilot, time_us)

        monkeypatch.setattr(Autopilot, "tick", counted)
        world.run_for(1.0)
    assert len(calls) <= 2  # of 500


def test_the_simulator_advances_in_compiled_calls_after_telemetry(monkeypatch: pytest.MonkeyPatch) -> None:
    with World(telemetry=True, state="truth") as world:
        world.wait_until_ready()
        world.takeoff(2.0)
        world.run_for(2.0)
        advance, exchanges, calls = Engine.advance, Network.exchange, Counter[str]()

        def advanced(engine: Engine) -> None:
            calls["advance"] += 1
            advance(engine)

        def exchanged(network: Network, hub: GroundHub, now_s: float) -> bool:
            calls["exchange"] += 1
            return exchanges(network, hub, now_s)

        monkeypatch.setattr(Engine, "advance", advanced)
        monkeypatch.setattr(Network, "exchange", exchanged)
        received = world.gcs.counts["ATTITUDE"]
        world.run_for(1.0)
        received = world.gcs.counts["ATTITUDE"] - received
    assert received == 50
    assert calls["exchange"] <= 8  # measured 6: for messages besides those of the motion
    assert calls["advance"] <= 1  # after the last tick


def test_what_is_read_after_run_on_is_that_of_the_simulator_after_the_newest_tick() -> None:
    seen = []
    for run in (World.run_on, lambda world, seconds: world.run_for(seconds)):
        with World(state="truth") as world:
            world.takeoff(2.0)
            world.run_for(2.0)
            end_s = world.time_s + 0.5
            while world.time_s < end_s - 1e-6:
                run(world, end_s - world.time_s)
            seen.append((world.engine.simulator.time_us, world.engine.stack.simulator.state.tobytes()))
    assert seen[0] == seen[1]
