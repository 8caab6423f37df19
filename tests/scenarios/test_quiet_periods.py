"""Outer periods of a world in which nothing happens are flown in one call; events come at the same tick as without."""

from collections.abc import Callable
from pathlib import Path
from random import Random

import pytest

from flightstack.params import vehicle
from flightstack.process.quiet_block import QuietBlock
from flightstack.testing import ConditionTimeoutError, World
from flightstack.testing.network import Network
from flightstack.testing.state import State
from sim_bridge.sensors.gnss import GnssReceiver
from sim_bridge.sensors.magnetometer import Magnetometer
from tests.support.bytes_engine import BytesEngine
from tests.support.equal_flights import assert_flies_equally
from tests.support.tools import NIGHTLY


def mission(world: World) -> None:
    """Fly a mission to its end."""
    world.upload("square")
    assert world.fly().completed


def fence(world: World) -> None:
    """Fly out of a fence that became smaller on the way."""
    world.param_set("GF_PREDICT", 0)
    world.param_set("GF_ACTION", 3)
    world.takeoff(3.0)
    world.run_for(5.0)
    world.goto(9.0, 0.0)
    world.run_for(0.5)
    world.param_set("GF_MAX_HOR_DIST", 4.0)
    world.run_for(10.0)
    assert "failsafe_FENCE" in [event.name for event in world.events]
    assert world.state.north_m < 4.0


def lost_link(world: World) -> None:
    """Lose the ground station, and find it again."""
    world.param_set("NAV_DLL_ACT", 2)
    world.takeoff(3.0)
    world.run_for(3.0)
    world.link.cut()
    world.run_for(20.0)
    world.link.restore()
    world.run_for(3.0)
    assert "failsafe_GCS_LOST" in [event.name for event in world.events]


def bad_link(world: World) -> None:
    """Order over a link with delay, loss and duplicates."""
    world.takeoff(3.0)
    world.run_for(2.0)
    world.link.delay_s(0.0731)
    world.link.loss(0.2)
    world.link.duplication(0.2)
    world.goto(1.0, 1.0)
    world.run_for(2.0)
    world.rtl()
    world.run_for(8.0)


def empty_battery(world: World) -> None:
    """Fly until the charge is low."""
    world.takeoff(3.0)
    world.run_for(2.0)
    world.fault("battery:level=0.1")
    world.run_for(8.0)
    assert any(event.name.startswith("failsafe_BATTERY") for event in world.events)


def timer(world: World) -> None:
    """Act at a time between two exchanges."""
    world.takeoff(3.0)
    world.after(3.333, lambda: world.fault("rotor:1:weak=0.8"))
    world.run_for(5.5)


def power_cycle(world: World) -> None:
    """Fly after a power cycle: the vehicle's clock begins anew, the simulator's runs on."""
    world.run_for(3.0)
    world.power_cycle(1.0)
    world.wait_until_ready()
    world.takeoff(2.0)
    world.run_for(4.0)


def clock_jumps(world: World) -> None:
    """Fly after two jumps of the simulator's clock that cancel: the vehicle's clock stays ahead."""
    world.takeoff(2.0)
    world.run_for(2.0)
    world.fault("clock jump 0.4")
    world.run_for(1.0)
    world.fault("clock jump -0.4")
    world.run_for(3.0)


def levels_of_charge(world: World) -> None:
    """Hold with a low battery, then with a critical one: the conditions of a failsafe that goes on change."""
    world.param_set("COM_LOW_BAT_ACT", 2)
    world.takeoff(3.0)
    world.run_for(2.0)
    world.fault("battery:level=0.14")
    world.run_for(3.0)
    world.goto(5.0, 3.0)
    world.run_for(4.0)
    world.set_mode("HOLD")
    world.run_for(2.0)
    world.fault("battery:level=0.06")
    world.run_for(8.0)
    assert "failsafe_BATTERY_CRITICAL" in [event.name for event in world.events]


def overridden(world: World) -> None:
    """Override the failsafe of a lost link, change its parameters, and find the link again."""
    world.param_set("NAV_DLL_ACT", 2)
    second = world.add_client("second", is_companion=True)
    world.takeoff(6.0)
    world.run_for(4.0)
    world.link.cut()
    world.run_for(16.0)
    world.set_mode("HOLD", second)
    world.run_for(3.0)
    world.link.restore()
    world.run_for(3.0)
    assert world.state.mode == "HOLD"


def long_silence(world: World) -> None:
    """Hover without a link until the ground station is forgotten, and find it again."""
    world.takeoff(2.0)
    world.run_for(3.0)
    world.link.cut()
    world.run_for(45.0)
    world.link.restore()
    world.run_for(3.0)


FLIGHTS = (
    mission, fence, lost_link, bad_link, empty_battery, timer, power_cycle, clock_jumps, levels_of_charge,
    overridden, long_silence,
)  # fmt: skip


@pytest.mark.parametrize(
    ("state", "fly"),
    [("estimated", fly) for fly in FLIGHTS] + NIGHTLY * [("truth", fly) for fly in FLIGHTS],
)
def test_a_flight_is_the_same_as_by_single_ticks_with_bytes(fly: Callable[[World], None], state: str) -> None:
    assert_flies_equally(fly, state=state, vehicle="x_quad", seed=5)


def test_a_battery_that_becomes_low_in_flight_acts_at_the_same_tick() -> None:
    """Between two stops of the compiled call."""

    def fly(world: World) -> None:
        world.takeoff(3.0)
        world.run_for(20.0)
        assert {"failsafe_BATTERY_LOW", "failsafe_BATTERY_CRITICAL"} <= {event.name for event in world.events}

    assert_flies_equally(fly, state="truth", vehicle="x_quad", battery_percent=25.0, battery_drain=20.0)


@pytest.mark.parametrize("state", ["truth", "estimated"])
def test_one_call_flies_many_periods(state: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with World(state=state) as world:
        world.wait_until_ready()
        world.takeoff(2.0)
        world.run_for(4.0)
        calls = _calls_of_a_second(world, monkeypatch)
    assert sum(calls) >= 0.99 * 500
    assert len(calls) <= 12  # measured 8


@pytest.mark.parametrize("lost_s", [16.0, 45.0])
def test_one_call_flies_many_periods_once_the_failsafe_of_a_lost_ground_station_has_acted(
    lost_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is forgotten after 30 s."""
    with World(state="truth") as world:
        world.param_set("NAV_DLL_ACT", 2)
        world.param_set("MPC_XY_CRUISE", 3.0)
        world.takeoff(2.0)
        world.run_for(4.0)
        world.goto(150.0, 0.0)
        world.run_for(60.0)
        world.link.cut()
        world.run_for(lost_s)
        assert (world.state.mode, world.state.failsafes) == ("RETURN", ("GCS_LOST",))
        calls = _calls_of_a_second(world, monkeypatch)
    assert sum(calls) >= 0.99 * 500
    assert len(calls) <= 500 / 20


def _calls_of_a_second(world: World, monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return the ticks of each compiled call in the next second of the flight."""
    calls: list[int] = []
    run = QuietBlock.run

    def counted(block: QuietBlock, count: int, is_taken: bool = False) -> int:
        calls.append(run(block, count, is_taken))
        return calls[-1]

    monkeypatch.setattr(QuietBlock, "run", counted)
    world.run_for(1.0)
    return calls


_GNSS = "[sensors.gnss]\nrate_hz = 33\nlatency_s = 0.137\n"


def test_sensors_of_uneven_rates_measure_at_the_same_ticks(tmp_path: Path) -> None:
    """Periods of 30.303 and 13.333 ms are no multiples of a tick."""
    text = (Path(vehicle.__file__).parent / "vehicles" / "x_quad.toml").read_text()
    path = tmp_path / "uneven.toml"
    path.write_text(f"{text}\n[sensors.mag]\nrate_hz = 33\n[sensors.baro]\nrate_hz = 75\n{_GNSS}")
    logs = []
    for engine in ({}, {"make_engine": BytesEngine}):
        with World(state="estimated", vehicle=str(path), seed=5, **engine) as world:
            world.wait_until_ready()
            world.takeoff(2.0)
            world.run_for(3.0)
            logs.append(world.engine.newest_log())
    assert logs[0] == logs[1]


@pytest.mark.parametrize(("sensor", "name"), [(Magnetometer, "measure"), (GnssReceiver, "receive")])
def test_most_measurements_are_compiled(sensor: type, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[object] = []
    measure = getattr(sensor, name)

    def counted(*arguments: object) -> object:
        calls.append(arguments)
        return measure(*arguments)

    with World(state="estimated") as world:
        world.wait_until_ready()
        world.takeoff(2.0)
        world.run_for(4.0)
        monkeypatch.setattr(sensor, name, counted)
        world.run_for(1.0)
    assert len(calls) <= 3  # of 100 and 10; measured: 1 and 0, in ticks with work for Python


def test_health_before_a_reset_has_the_conditions_of_its_time(tmp_path: Path) -> None:
    """The filter gives up the compass in the tick of a reset of the yaw: the next health reports it, not the last."""
    text = (Path(vehicle.__file__).parent / "vehicles" / "x_quad.toml").read_text()
    path = tmp_path / "slow_gnss.toml"
    path.write_text(f"{text}\n[sensors.gnss]\nrate_hz = 33\nlatency_s = 1.3\nfirst_fix_s = 0.0\n")
    logs = []
    for engine in ({}, {"make_engine": BytesEngine}):
        with World(state="estimated", vehicle=str(path), seed=28, **engine) as world:
            random = Random(78)
            world.wait_until_ready()
            world.takeoff(2.0)
            for wait_s, fault, for_s in _DISTURBANCES:
                world.run_for(wait_s)
                if fault:
                    world.fault(fault, for_s=for_s)
                else:
                    world.goto(random.uniform(-3.0, 3.0), 1.0)
            world.run_for(2.0)
            logs.append(world.engine.newest_log())
    assert b"Compass disagrees with GNSS and is no longer used" in logs[0]
    assert logs[0] == logs[1]


_DISTURBANCES = (
    (1.0488, "sensor:baro:off", 1.4996), (0.1686, "sensor:gnss:loss=0.5", 0.9534), (0.0126, "", 0.0),
    (0.1982, "sensor:baro:off", 1.2238), (1.0975, "", 0.0),
)  # fmt: skip


def _signals(state: State) -> dict[str, object]:
    return {name: getattr(state, name) for name in ("mode", "armed", "landed", "failsafe")}


@pytest.mark.parametrize(
    "condition", ["mode == 'HOLD'", "landed", "not armed", "not failsafe and mode == 'RETURN'"]
)
def test_a_condition_of_flags_is_met_in_the_same_period_as_a_function(condition: str) -> None:
    times = []
    for function in (None, lambda state: eval(condition, {}, _signals(state))):
        with World(state="truth") as world:
            world.takeoff(2.0)
            world.run_until("not landed")
            world.after(6.0, world.rtl)
            world.run_until(function or condition)
            times.append(world.time_s)
    assert times[0] == times[1]


@pytest.mark.parametrize("engine", [{}, {"make_engine": BytesEngine}])
@pytest.mark.parametrize("condition", ["landed", lambda state: state.landed])
def test_a_condition_times_out_after_whole_periods(engine: dict, condition: object) -> None:
    """From the middle of a period as well."""
    with World(state="truth", **engine) as world:
        world.takeoff(2.0)
        world.run_for(1.004)
        began_s = world.time_s
        with pytest.raises(ConditionTimeoutError):
            world.run_until(condition, 0.344)
        assert world.time_s - began_s == pytest.approx(0.35, abs=1e-9)  # one more: the limit itself counts


@pytest.mark.parametrize("telemetry", [None, False, True])
@pytest.mark.parametrize("start_s", [0.07, 0.08, 0.29])
def test_messages_come_as_with_an_exchange_in_each_period(
    start_s: float, telemetry: bool | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A client that connects at any time has streams whose times are rounded in other ways."""

    def received() -> list[tuple[float, str]]:
        found: list[tuple[float, str]] = []
        with World(telemetry=telemetry) as world:
            world.run_for(start_s)
            world.power_cycle(0.37)
            tablet = world.add_client("tablet")
            tablet.session.observe = lambda message: found.append((world.time_s, str(message)))
            world.takeoff(2.0)
            world.run_for(8.0)
        return found

    quiet = received()
    monkeypatch.setattr(Network, "idle_s", lambda *_, **__: 0.0)
    assert quiet == received()
    assert len(quiet) > 20


def test_disarming_is_at_the_same_tick_if_records_are_between_outer_ticks() -> None:
    def stands(world: World) -> None:
        world.param_set("COM_DISARM_PRFLT", 1.501)
        world.wait_until_ready()
        world.arm()
        world.run_for(3.0)
        assert not world.state.armed

    assert_flies_equally(stands, state="estimated", inner_hz=625.0, outer_hz=312.5)


def test_a_limit_of_the_battery_above_that_of_a_low_one_acts_at_the_same_tick() -> None:
    def fly(world: World) -> None:
        world.param_set("COM_LOW_BAT_ACT", 2)
        world.takeoff(3.0)
        world.run_for(2.3)
        world.param_set("BAT_CRIT_THR", 0.4)
        world.run_for(9.0)
        assert "failsafe_BATTERY_CRITICAL" in {event.name for event in world.events}

    assert_flies_equally(fly, state="truth", vehicle="x_quad", battery_percent=42.0, battery_drain=40.0)
