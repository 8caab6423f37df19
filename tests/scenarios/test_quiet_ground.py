"""Outer periods of a vehicle that stands are flown in one call; events come at the same tick as without."""

from __future__ import annotations

import contextlib
from collections.abc import Callable

import pytest

from flightstack.testing import RefusedError, World
from flightstack.vehicle.autopilot import Autopilot
from tests.support.equal_flights import assert_flies_equally
from tests.support.tools import NIGHTLY


def no_takeoff(world: World) -> None:
    """Stand armed until the vehicle disarms itself, and arm again."""
    world.param_set("COM_DISARM_PRFLT", 3.0)
    world.arm()
    world.run_for(2.0)
    assert world.state.armed
    world.run_for(3.0)
    assert not world.state.armed
    world.run_for(1.0)
    world.arm()
    world.run_for(1.0)
    world.takeoff(2.0)
    world.run_for(5.0)
    assert world.state.altitude_m > 1.5


def lands(world: World) -> None:
    """Land, stand until the vehicle disarms itself and after that, and take off again."""
    world.param_set("COM_DISARM_LAND", 2.5)
    world.takeoff(1.0)
    world.run_for(3.0)
    world.land()
    world.run_until("not armed")
    world.run_for(3.0)
    world.takeoff(1.5)
    world.run_for(4.0)
    assert world.state.altitude_m > 1.0


def never_disarms(world: World) -> None:
    """Stay armed on the ground."""
    world.param_set("COM_DISARM_LAND", -1.0)
    world.takeoff(1.0)
    world.run_for(3.0)
    world.land()
    world.run_for(12.0)
    assert world.state.armed
    assert world.state.landed


def loses_link(world: World) -> None:
    """Lose the ground station while the vehicle stands armed, and find it again."""
    world.param_set("NAV_DLL_ACT", 2)
    world.param_set("COM_DISARM_PRFLT", 40.0)
    world.arm()
    world.run_for(2.0)
    world.link.cut()
    world.run_for(15.0)
    world.link.restore()
    world.run_for(3.0)


def battery(world: World) -> None:
    """Empty the battery while the vehicle stands armed."""
    world.arm()
    world.run_for(1.0)
    world.fault("battery:level=0.09")
    world.run_for(4.0)


def fence(world: World) -> None:
    """Land, and move the fence so that the vehicle is outside, disarmed and armed."""
    world.takeoff(2.0)
    world.run_for(3.0)
    world.goto(6.0, 0.0)
    world.run_for(8.0)
    world.land()
    world.run_until("landed")
    world.param_set("GF_MAX_HOR_DIST", 3.0)
    world.run_until("not armed")
    world.run_for(2.0)
    world.param_set("GF_MAX_HOR_DIST", 0.0)
    world.run_for(1.0)


def blown_away(world: World) -> None:
    """An updraft lifts the vehicle that stands, which counts as a movement: it is disarmed later."""
    world.param_set("COM_DISARM_PRFLT", 2.5)
    world.arm()
    world.run_for(1.0)
    world.fault("wind step 0,0,-150", for_s=0.3)
    world.run_for(2.0)
    assert world.state.armed
    world.run_for(3.0)
    assert not world.state.armed


def freezes(world: World) -> None:
    """States are missing while the vehicle stands armed, then come again."""
    world.arm()
    world.run_for(1.0)
    world.engine.loses_states = True
    world.run_for(0.3)
    world.engine.loses_states = False
    world.run_for(2.0)


def stops_rotors(world: World) -> None:
    """The measured speed of a rotor is lost, then the rotor."""
    world.arm()
    world.run_for(1.0)
    world.fault("rotor:1:off")
    world.run_for(3.0)


def changes_modes(world: World) -> None:
    """Select modes on the ground, with a mission too."""
    world.upload("square")
    world.arm()
    for mode in ("MISSION", "HOLD", "POSITION", "ALTITUDE", "HOLD", "RETURN"):
        with contextlib.suppress(RefusedError):
            world.set_mode(mode)
        world.run_for(0.7)


def too_heavy(world: World) -> None:
    """Run the loops without a takeoff until the vehicle disarms itself, with progress of the thrust in between."""
    world.param_set("COM_DISARM_PRFLT", 2.5)
    world.fault("payload 2 at 0,0,0")
    world.takeoff(2.0)
    world.run_for(2.0)
    assert world.state.armed
    world.run_until("not armed", timeout_s=30.0)
    assert "Disarmed: no takeoff" in world.texts


def bounces(world: World) -> None:
    """Touch the ground in gusts, climb from the ground contact, and land again."""
    world.takeoff(1.5)
    world.run_for(4.0)
    world.land()
    world.run_until("altitude_m < 0.06")
    world.run_until(lambda _: world.engine.stack.parts.navigator.touches_ground)
    world.run_for(0.1)
    world.goto(0.0, 0.0, 2.0)
    world.run_for(4.0)
    assert world.state.altitude_m > 1.0
    world.fault("wind step 3,2,1")
    world.land()
    world.run_until("not armed")


FLIGHTS = (
    no_takeoff, lands, never_disarms, loses_link, battery, fence, blown_away, freezes, stops_rotors,
    changes_modes, too_heavy, bounces,
)  # fmt: skip


ON_SENSORS = FLIGHTS if NIGHTLY else (lands, loses_link, blown_away, bounces)
"""Those that are flown on sensors too."""


@pytest.mark.parametrize(
    ("state", "fly"), [*(("truth", fly) for fly in FLIGHTS), *(("estimated", fly) for fly in ON_SENSORS)]
)
def test_a_vehicle_on_the_ground_is_the_same_as_by_single_ticks_with_bytes(
    fly: Callable[[World], None], state: str
) -> None:
    assert_flies_equally(fly, state=state, vehicle="x_quad", seed=6)


@pytest.mark.parametrize("state", ["truth", "estimated"])
@pytest.mark.parametrize("ticks", [1, 2])
def test_messages_of_an_event_are_exchanged_at_the_end_of_its_period(ticks: int, state: str) -> None:
    """Periods of messages and of the outer loop fall apart after a number of ticks that is none of whole periods."""

    def fly(world: World) -> None:
        world.run_for(0.002 * ticks)
        world.arm()
        world.run_for(0.002 * ticks)
        world.takeoff(1.0)
        world.run_for(0.4)
        world.run_for(3.0)
        world.land()
        world.run_for(6.0)

    assert_flies_equally(fly, state=state, seed=3)


@pytest.fixture
def python_ticks(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Times of the ticks that are run in Python [µs]."""
    ticks: list[int] = []
    tick = Autopilot.tick

    def counted(self: Autopilot, time_us: int) -> object:
        ticks.append(time_us)
        return tick(self, time_us)

    monkeypatch.setattr(Autopilot, "tick", counted)
    return ticks


@pytest.mark.parametrize("state", ["truth", "estimated"])
@pytest.mark.parametrize("armed", [False, True])
def test_most_outer_ticks_on_the_ground_are_compiled(
    armed: bool, state: str, python_ticks: list[int]
) -> None:
    with World(state=state) as world:
        world.wait_until_ready()
        if armed:
            world.arm()
        world.run_for(1.0)
        python_ticks.clear()
        world.run_for(3.0)
        assert world.state.armed is armed
    assert len(python_ticks) <= 2  # of 1500; measured 0


@pytest.mark.parametrize("state", ["truth", "estimated"])
def test_most_outer_ticks_of_takeoff_and_landing_are_compiled(state: str, python_ticks: list[int]) -> None:
    with World(state=state) as world:
        world.wait_until_ready()
        python_ticks.clear()
        world.takeoff(1.0)
        world.run_for(2.0)
        world.land()
        world.run_until("not armed")
        began_us, ended_us = python_ticks[0], python_ticks[-1]
    assert ended_us - began_us > 5_000_000
    assert len(python_ticks) <= 20  # measured 9 and 12
