"""Actions on our vehicle in one process: an action is done when the vehicle reports its effect."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from flightstack.testing import World
from gcs_cli.actions import in_flight, on_vehicle
from gcs_cli.actions.action import Action
from gcs_cli.actions.run import ActionRun, Outcome, Result

LIMIT_S = 200.0


@pytest.fixture
def world() -> Iterator[World]:
    with World(telemetry=True) as made:
        made.run_for(2.0)
        yield made


def perform(world: World, action: Action, *, waits: bool = True) -> Result:
    session = world.sender.session
    run = ActionRun(action, lambda: session.view, world.time_s, session.own, waits=waits)
    session.use(run)
    end_s = world.time_s + LIMIT_S
    while run.result is None and world.time_s < end_s:
        world.step()
    session.use(None)
    assert run.result is not None
    return run.result


def test_arm_ends_when_the_vehicle_reports_armed(world: World) -> None:
    assert perform(world, on_vehicle.arm())[:2] == (Outcome.DONE, "armed")
    assert world.sender.session.view.armed
    assert perform(world, on_vehicle.disarm())[:2] == (Outcome.DONE, "disarmed")
    assert not world.sender.session.view.armed


def test_takeoff_ends_at_the_altitude(world: World) -> None:
    result = perform(world, in_flight.takeoff(5.0))
    assert result[:2] == (Outcome.DONE, "at 5 m")
    assert world.state.altitude_m == pytest.approx(5.0, abs=0.6)
