"""Flights by simulators whose clock is not the loops': other epochs, other steps, repeated and odd times."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import pytest

from flightstack.core.geodesy import LocalFrame
from flightstack.mavlink.link import Link
from flightstack.simulator_link.hot_frames import PlantStateFrame
from flightstack.testing.engine import Engine
from sim_bridge.server.hil import HilControls, hil_state
from tests.support.refusals import refused
from tests.support.truth import World

UNIX_US = 1_790_000_000_000_000
ALL_ITEMS = [0, 1, 2, 3, 4, 5]
FLIGHT_S = 24.87
"""Simulated time of the square with states every 2 ms."""


class OtherClock(Engine):
    """``stamp`` makes the time of a state from the simulated one [µs]; ``step_us`` is between two states."""

    def __init__(self, *parts, stamp: Callable[[int], int], step_us: int, speaks_hil: bool) -> None:
        self.stamp = stamp
        self._speaks_hil = speaks_hil
        self._state = PlantStateFrame()
        self._hil_codec = Link(1, 51)
        super().__init__(*parts)
        self.simulator.set_interval_us(step_us)

    def states(self) -> bytes | memoryview:
        if self._speaks_hil:
            message = hil_state(self.simulator, LocalFrame(self.config.home))
            message.time_usec = self.stamp(self.simulator.time_us)
            return self._hil_codec.encode(message)
        data = bytes(self.simulator.outgoing())
        before, state = data[: -self._state.size], data[-self._state.size :]
        assert self._state.open(state)
        return before + bytes(self._state.seal(self.stamp(self._state.time_us), self._state.flags))

    def take_answer(self, answer: bytes | memoryview) -> None:
        if not self._speaks_hil:
            super().take_answer(answer)
            return
        for message in self._hil_codec.decode(bytes(answer)):
            HilControls(self.stack.vehicle).write(message, self.actuators)


def other_clock(
    stamp: Callable[[int], int] = lambda t: t,
    step_us: int = 2000,
    speaks_hil: bool = False,
    engine: type[OtherClock] = OtherClock,
    **conditions: object,
) -> World:
    make_engine = partial(engine, stamp=stamp, step_us=step_us, speaks_hil=speaks_hil)
    return World(make_engine=make_engine, **conditions)


def fly_the_square(world: World) -> None:
    world.upload("square.plan")
    world.arm()
    world.start_mission()
    engine = world.engine
    slower = engine.stack.rates.interval_us / min(engine.simulator.interval_us, 2000)
    world.run_until("not armed", 60.0 * slower)
    assert world.reached == ALL_ITEMS


def hover(world: World) -> None:
    world.arm()
    world.takeoff(5.0)
    world.run_until("mode == 'HOLD'")


def told(world: World, words: str) -> bool:
    return any(words in text for text in world.texts)


def test_a_clock_of_unix_time_flies_the_same_flight() -> None:
    plain, other = other_clock(), other_clock(lambda t: t + UNIX_US)
    for world in (plain, other):
        fly_the_square(world)
    assert other.flight().log.content == plain.flight().log.content
    assert other.gcs.received["ATTITUDE"].time_boot_ms < 60_000


def test_clocks_beyond_their_fields_fly_on() -> None:
    """A vehicle that runs for years: every 32-bit clock and counter has wrapped."""
    world = World()
    world.engine.stack.simulator.time_us = UNIX_US
    world.run_for(0.1)
    world.upload("square.plan")
    world.arm()
    world.start_mission()
    world.run_until("not armed", 60.0)
    assert world.reached == ALL_ITEMS
    assert world.gcs.received["ATTITUDE"].time_boot_ms == pytest.approx(UNIX_US // 1000 % 2**32, abs=60_000)


# measured: 24.86 s to 24.92 s and 0.025 m to 0.104 m, against 24.87 s and 0.025 m
@pytest.mark.parametrize("step_us", [500, 1000, 3000, 4000, 8000, 10_000])
def test_other_steps_fly_the_square_in_its_time(step_us: int) -> None:
    world = other_clock(step_us=step_us)
    fly_the_square(world)
    assert world.engine.simulator.time_us * 1e-6 == pytest.approx(FLIGHT_S, abs=0.25)
    assert world.time_s == pytest.approx(world.engine.simulator.time_us * 1e-6, abs=0.02)
    assert world.flight().max_error_m < 0.15
    assert told(world, f"every {step_us / 1000:g} ms; the loops run every 2 ms")


def test_steps_of_the_hil_link_fly_the_square_in_its_time() -> None:
    world = other_clock(step_us=4000, speaks_hil=True, vehicle="x_quad")
    fly_the_square(world)
    assert world.engine.simulator.time_us * 1e-6 == pytest.approx(FLIGHT_S, abs=0.4)
    assert told(world, "every 4 ms")


def test_the_loops_own_step_is_not_told() -> None:
    world = other_clock(step_us=8000, inner_hz=125.0, outer_hz=125.0)
    world.run_for(1.0)
    assert not told(world, "Simulator")


def test_the_c_loops_fly_other_steps_too() -> None:
    world = other_clock(step_us=4000, loops="c")
    fly_the_square(world)
    assert world.engine.simulator.time_us * 1e-6 == pytest.approx(FLIGHT_S, abs=0.25)


def test_steps_too_long_to_fly_keep_it_from_arming() -> None:
    world = other_clock(step_us=20_000)
    world.run_for(2.0)
    reason = "the simulator sends a state every 20 ms, the loops need one every 10 ms, or --inner-hz 50"
    with refused(reason=reason):
        world.arm()
    world.engine.simulator.set_interval_us(2000)
    world.run_for(0.5)
    world.arm()


def test_a_step_that_changes_in_flight_is_told_and_flown() -> None:
    world = other_clock()
    hover(world)
    world.engine.simulator.set_interval_us(5000)
    world.run_for(2.0)
    assert told(world, "every 5 ms")
    world.rtl()
    world.run_until("not armed", 60.0)


class SentTwice(OtherClock):
    """Sends each state again after its answer."""

    def take_answer(self, answer: bytes | memoryview) -> None:
        first = bytes(answer)
        super().take_answer(answer)
        link = self.stack.simulator
        assert link.receive(memoryview(bytes(self._state.frame)))
        again = bytes(link.answer(self.lockstep.tick(0), self.stack.now.status.armed))
        assert again[10:-2] == first[10:-2]  # but for the sequence number and the checksum


def test_a_state_that_comes_twice_ticks_the_loops_once() -> None:
    plain, twice = other_clock(), other_clock(engine=SentTwice)
    for world in (plain, twice):
        fly_the_square(world)
    assert twice.flight().log.content == plain.flight().log.content


@pytest.mark.parametrize(
    "stamp",
    [lambda t: 3_000_000, lambda t: 10**9 - t, lambda t: t * 10**4],
    ids=["constant", "backwards", "leaping"],
)
def test_a_clock_that_cannot_be_followed_leads_to_the_failsafe(stamp: Callable[[int], int]) -> None:
    world = other_clock()
    hover(world)
    began_us = world.engine.stack.now.time_us
    world.engine.stamp = stamp
    for _ in range(2000):  # four seconds of the machine's clock
        world.tick()
    assert told(world, "Simulator clock stands still")
    assert told(world, "State is frozen or missing: rotors hold their speeds")
    passed_s = (world.engine.stack.now.time_us - began_us) * 1e-6
    assert passed_s == pytest.approx(3.0, abs=0.1)  # all but the second in which the stall was found


def test_one_step_back_is_told_and_flown_on() -> None:
    world = other_clock()
    hover(world)
    reset_us = world.engine.simulator.time_us
    world.engine.stamp = lambda t: t - reset_us
    world.run_for(2.0)
    assert told(world, "Simulator time went back by")
    assert world.engine.stack.simulator.time_jumps == 1
    world.land()
    world.run_until("not armed", 60.0)


def test_a_gap_is_flown_as_time_without_states() -> None:
    world = other_clock()
    hover(world)
    gap_us = world.engine.simulator.time_us
    world.engine.stamp = lambda t: t if t < gap_us else t + 400_000
    world.run_for(2.0)
    assert told(world, "Simulator time jumped ahead by 0.402 s")
    world.land()
    world.run_until("not armed", 60.0)
