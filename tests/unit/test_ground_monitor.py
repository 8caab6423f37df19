"""A vehicle is disarmed by time only where it stands, and arms only where it is at rest."""

from __future__ import annotations

import pytest

from flightstack.commander.ground_monitor import GroundMonitor, Standing
from flightstack.commander.transitions import Event
from flightstack.params.behaviour import Behaviour

STEP_US = 10_000
BEHAVIOUR = Behaviour(disarm_without_takeoff_s=2.0, disarm_after_landing_s=2.0)


def first_event(
    watch: GroundMonitor, goes_on: bool, lifts: bool, from_m: float, down_m_s: float
) -> Event | None:
    """The first event in 10 s of a vehicle that the land detector has on the ground."""
    for step in range(1000):
        down_m = from_m + down_m_s * step * STEP_US * 1e-6
        standing = Standing(goes_on, lifts, down_m, down_m_s, 1.0)
        event = watch.due_event(step * STEP_US, standing, BEHAVIOUR)
        if event is not None:
            return event
    return None


@pytest.mark.parametrize("down_m_s", [0.02, 0.3, 1.0, -0.3])
def test_a_descent_from_a_ledge_is_not_disarmed(down_m_s: float) -> None:
    watch = GroundMonitor()
    watch.armed(0)
    assert first_event(watch, goes_on=True, lifts=True, from_m=-10.0, down_m_s=down_m_s) is None


def test_a_hover_below_a_ledge_is_not_disarmed() -> None:
    watch = GroundMonitor()
    watch.armed(0)
    watch.due_event(0, Standing(True, True, -10.0, 0.0, 1.0), BEHAVIOUR)
    assert first_event(watch, goes_on=True, lifts=True, from_m=-9.0, down_m_s=0.0) is None


def test_a_descent_after_a_landing_was_detected_is_not_disarmed() -> None:
    watch = GroundMonitor()
    watch.armed(0)
    watch.took_off_or_landed(0)
    assert first_event(watch, goes_on=False, lifts=True, from_m=-10.0, down_m_s=0.5) is None


@pytest.mark.parametrize(
    ("has_flown", "event"), [(False, Event.NO_TAKEOFF), (True, Event.LANDED_LONG_ENOUGH)]
)
def test_a_vehicle_that_stands_is_disarmed(has_flown: bool, event: Event) -> None:
    watch = GroundMonitor()
    watch.armed(0)
    if has_flown:
        watch.took_off_or_landed(0)
    assert first_event(watch, goes_on=False, lifts=False, from_m=-10.0, down_m_s=0.1) is event


def test_a_vehicle_is_at_rest_half_a_second_after_its_fall() -> None:
    watch = GroundMonitor()
    assert watch.is_at_rest(0)
    watch.update(1_000_000, -0.9)
    assert watch.is_at_rest(1_000_000)
    watch.update(1_010_000, 1.1)
    watch.update(1_200_000, 0.0)  # the top of a bounce
    assert not watch.is_at_rest(1_500_000)
    assert watch.is_at_rest(1_510_000)
    watch.note_fall(2_000_000)
    assert not watch.is_at_rest(2_000_000)
