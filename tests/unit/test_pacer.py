"""The simulator's wait for the wall clock."""

from __future__ import annotations

import pytest

from flightstack.params.config import DEFAULT_HOME
from gcs_cli.fly.fly_flags import FlyOptions
from gcs_cli.fly.fly_options import simulator_arguments
from sim_bridge.server import session
from sim_bridge.server.session import LEAD_NS, Lateness, Pacer

TICK_US = 2000


class Clock:
    """A clock that only sleeping advances; it stands in for the module ``time``."""

    def __init__(self) -> None:
        self.now_ns = 0
        self.sleeps_ms: list[float] = []

    def monotonic_ns(self) -> int:
        return self.now_ns

    def sleep(self, duration_s: float) -> None:
        self.sleeps_ms.append(round(duration_s * 1e3, 6))
        self.now_ns += round(duration_s * 1e9)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(session, "time", clock)
    return clock


def pace(speed: float, ticks: int, lead_ns: int) -> Pacer:
    pacer = Pacer(speed, lambda: False)
    for tick in range(ticks + 1):
        pacer.wait_until(tick * TICK_US, lead_ns)
    return pacer


def test_pacer_accumulates_its_lead_and_keeps_the_mean_speed(clock: Clock) -> None:
    pace(1.0, 500, LEAD_NS)
    assert clock.sleeps_ms == [10.0] * 100
    assert clock.now_ns == 500 * TICK_US * 1000


def test_pacer_without_lead_sleeps_in_each_tick(clock: Clock) -> None:
    pacer = pace(1.0, 5, 0)
    assert clock.sleeps_ms == [2.0] * 5
    assert pacer.lateness.count == 5


def test_pacer_in_slow_motion_sleeps_in_each_tick(clock: Clock) -> None:
    pace(0.1, 3, LEAD_NS)
    assert clock.sleeps_ms == [20.0] * 3


def test_pacer_with_a_head_start_counts_from_its_end(clock: Clock) -> None:
    pacer = Pacer(1.0, lambda: False, from_us=100 * TICK_US)
    for tick in range(105):
        pacer.wait_until(tick * TICK_US, lead_ns=0)
    assert clock.sleeps_ms == [2.0] * 4
    pacer = Pacer(1.0, lambda: False, from_us=100 * TICK_US)
    pacer.end_head_start()
    for tick in range(3):
        pacer.wait_until(tick * TICK_US, lead_ns=0)
    assert clock.sleeps_ms == [2.0] * 6


def test_late_pacer_counts_lateness_and_does_not_sleep(clock: Clock) -> None:
    pacer = Pacer(1.0, lambda: False)
    pacer.wait_until(0, LEAD_NS)
    clock.now_ns = 3_000_000
    pacer.wait_until(TICK_US, LEAD_NS)
    assert (clock.sleeps_ms, pacer.lateness.max_us) == ([], 1000.0)


def test_lateness_above_the_bins_is_not_printed_as_their_end() -> None:
    late = Lateness()
    late.add(99_999_000)
    assert late.percentile_text(99.0) == "100000 µs"
    for _ in range(99):
        late.add(250_000_000)
    assert late.percentile_text(99.0) == "> 100 ms"
    assert late.max_us == 250_000.0


@pytest.mark.parametrize(
    ("state", "loops", "starts_ahead"),
    [("estimated", "host", True), ("truth", "host", False), ("estimated", "host,free", False)],
)
def test_only_a_vehicle_that_estimates_in_lockstep_starts_ahead(
    state: str, loops: str, starts_ahead: bool
) -> None:
    """The state of the simulator is known at once; a target on its own timer takes the newest state only."""
    options = FlyOptions(speed="1", state=state, loops=loops)
    told = simulator_arguments(options, DEFAULT_HOME)
    assert any(argument.startswith("--head-start") for argument in told) is starts_ahead
