"""Flights by simulators whose clock is not the loops': other epochs, other steps, repeated and odd times."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from flightstack.core.enums import Mode
from flightstack.core.geodesy import LocalFrame
from flightstack.mavlink.link import Link
from flightstack.simulator_link.hot_frames import PlantStateFrame
from sim_bridge.server.hil import HilControls, hil_state
from tests.support.world import World

UNIX_US = 1_790_000_000_000_000
ALL_ITEMS = [0, 1, 2, 3, 4, 5]
FLIGHT_S = 24.72
"""Simulated time of the square with states every 2 ms."""


class OtherClock(World):
    """``stamp`` makes the time of a state from the simulated one [µs]; ``step_us`` is between two states."""

    def __init__(
        self,
        stamp: Callable[[int], int] = lambda t: t,
        step_us: int = 2000,
        speaks_hil: bool = False,
        **config,
    ) -> None:
        self.stamp = stamp
        self._speaks_hil = speaks_hil
        self._state = PlantStateFrame()
        self._codec = Link(1, 51)
        super().__init__(**config)
        self.simulator.set_interval_us(step_us)
        self.largest_error_m = 0.0

    def states(self) -> bytes | memoryview:
        if self._speaks_hil:
            message = hil_state(self.simulator, LocalFrame(self.config.home))
            message.time_usec = self.stamp(self.simulator.time_us)
            return self._codec.encode(message)
        data = bytes(self.simulator.outgoing())
        before, state = data[: -self._state.size], data[-self._state.size :]
        assert self._state.open(state)
        return before + bytes(self._state.seal(self.stamp(self._state.time_us), self._state.flags))

    def take_answer(self, answer: bytes | memoryview) -> None:
        if not self._speaks_hil:
            super().take_answer(answer)
            return
        for message in self._codec.decode(bytes(answer)):
            HilControls(self.stack.vehicle).write(message, self.actuators)

    def tick(self) -> None:
        super().tick()
        if self.armed and not self.landed and self.altitude > 0.1:  # after touchdown the setpoint waits below
            error = self.stack.now.state[:3] - self.stack.now.setpoint[:3]
            self.largest_error_m = max(self.largest_error_m, float(np.linalg.norm(error)))

    def fly_the_square(self) -> None:
        self.upload("square.plan")
        assert self.start_mission() == 0
        self.until_disarmed(60.0 * self.stack.rates.interval_us / min(self.simulator.interval_us, 2000))
        assert self.reached == ALL_ITEMS

    def hover(self) -> None:
        assert self.arm() == 0
        assert self.takeoff(5.0) == 0
        self.until(lambda: self.mode is Mode.HOLD)

    def told(self, words: str) -> bool:
        return any(words in text for text in self.texts)


def test_a_clock_of_unix_time_flies_the_same_flight() -> None:
    plain, other = OtherClock(), OtherClock(lambda t: t + UNIX_US)
    for world in (plain, other):
        world.fly_the_square()
    assert other.log == plain.log
    assert other.received["ATTITUDE"].time_boot_ms < 60_000


def test_clocks_beyond_their_fields_fly_on() -> None:
    """A vehicle that runs for years: every 32-bit clock and counter has wrapped."""
    world = World()
    world.stack.simulator.time_us = UNIX_US
    world.run(0.1)
    world.upload("square.plan")
    assert world.start_mission() == 0
    world.until_disarmed(60.0)
    assert world.reached == ALL_ITEMS
    assert world.received["ATTITUDE"].time_boot_ms == pytest.approx(UNIX_US // 1000 % 2**32, abs=60_000)


# measured: 24.67 s to 24.84 s and 0.420 m to 0.426 m, against 24.72 s and 0.422 m
@pytest.mark.parametrize("step_us", [500, 1000, 3000, 4000, 8000, 10_000])
def test_other_steps_fly_the_square_in_its_time(step_us: int) -> None:
    world = OtherClock(step_us=step_us)
    world.fly_the_square()
    assert world.simulator.time_us * 1e-6 == pytest.approx(FLIGHT_S, abs=0.25)
    assert world.time_s == pytest.approx(world.simulator.time_us * 1e-6, abs=0.02)
    assert world.largest_error_m < 0.45
    assert world.told(f"every {step_us / 1000:g} ms; the loops run every 2 ms")


def test_steps_of_the_hil_link_fly_the_square_in_its_time() -> None:
    world = OtherClock(step_us=4000, speaks_hil=True, vehicle="x_quad")
    world.fly_the_square()
    assert world.simulator.time_us * 1e-6 == pytest.approx(FLIGHT_S, abs=0.4)
    assert world.told("every 4 ms")


def test_the_loops_own_step_is_not_told() -> None:
    world = OtherClock(step_us=8000, inner_hz=125.0, outer_hz=125.0)
    world.run(1.0)
    assert not world.told("Simulator")


def test_the_c_loops_fly_other_steps_too() -> None:
    world = OtherClock(step_us=4000, loops="c")
    world.fly_the_square()
    assert world.simulator.time_us * 1e-6 == pytest.approx(FLIGHT_S, abs=0.25)


def test_steps_too_long_to_fly_keep_it_from_arming() -> None:
    world = OtherClock(step_us=20_000)
    world.run(2.0)
    assert world.arm() != 0
    assert world.told(
        "the simulator sends a state every 20 ms, the loops need one every 10 ms, or --inner-hz 50"
    )
    world.simulator.set_interval_us(2000)
    world.run(0.5)
    assert world.arm() == 0


def test_a_step_that_changes_in_flight_is_told_and_flown() -> None:
    world = OtherClock()
    world.hover()
    world.simulator.set_interval_us(5000)
    world.run(2.0)
    assert world.told("every 5 ms")
    assert world.return_home() == 0
    world.until_disarmed(60.0)


class SentTwice(OtherClock):
    """Sends each state again after its answer."""

    def take_answer(self, answer: bytes | memoryview) -> None:
        first = bytes(answer)
        super().take_answer(answer)
        link = self.stack.simulator
        assert link.receive(memoryview(bytes(self._state.frame)))
        again = bytes(link.answer(self._lockstep.tick(0), self.armed))
        assert again[10:-2] == first[10:-2]  # but for the sequence number and the checksum


def test_a_state_that_comes_twice_ticks_the_loops_once() -> None:
    plain, twice = OtherClock(), SentTwice()
    for world in (plain, twice):
        world.fly_the_square()
    assert twice.log == plain.log


@pytest.mark.parametrize(
    "stamp",
    [lambda t: 3_000_000, lambda t: 10**9 - t, lambda t: t * 10**4],
    ids=["constant", "backwards", "leaping"],
)
def test_a_clock_that_cannot_be_followed_leads_to_the_failsafe(stamp: Callable[[int], int]) -> None:
    world = OtherClock()
    world.hover()
    began_us = world.stack.now.time_us
    world.stamp = stamp
    for _ in range(2000):  # four seconds of the machine's clock
        world.machine_ns += 2_000_000
        world.tick()
    assert world.told("Simulator clock stands still")
    assert world.told("State is frozen or missing: rotors hold their speeds")
    passed_s = (world.stack.now.time_us - began_us) * 1e-6
    assert passed_s == pytest.approx(3.0, abs=0.1)  # all but the second in which the stall was found


def test_one_step_back_is_told_and_flown_on() -> None:
    world = OtherClock()
    world.hover()
    reset_us = world.simulator.time_us
    world.stamp = lambda t: t - reset_us
    world.run(2.0)
    assert world.told("Simulator time went back by")
    assert world.stack.simulator.time_jumps == 1
    assert world.land() == 0
    world.until_disarmed(60.0)


def test_a_gap_is_flown_as_time_without_states() -> None:
    world = OtherClock()
    world.hover()
    gap_us = world.simulator.time_us
    world.stamp = lambda t: t if t < gap_us else t + 400_000
    world.run(2.0)
    assert world.told("Simulator time jumped ahead by 0.402 s")
    assert world.land() == 0
    world.until_disarmed(60.0)
