"""Fly a plan from its upload to the end, as ``gcs fly`` does, and evaluate it."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import TYPE_CHECKING, TypeAlias

from flightstack.core.enums import Mode
from flightstack.mavlink.dialect import mavlink
from flightstack.plan import Plan
from flightstack.testing.client import RefusedError
from gcs_cli.fly.flight_limit import flight_limit_s
from gcs_cli.report.flight_outcome import Code, Outcome, ends_in_air, outcome_of, too_late
from gcs_cli.vehicle.view_types import MISSION_COMPLETE, Mission, VehicleView

if TYPE_CHECKING:
    from flightstack.testing.world import World

Step: TypeAlias = Callable[[float], bool | None]
"""Runs for a time at most [s]; may return True to end the flight."""
READY_S = 60.0
"""Longest wait for the state, after which the vehicle refuses to arm."""


def fly_plan(world: World, plan: Plan, limit_s: float | None = None, step: Step | None = None) -> Outcome:
    """Fly a plan with ``step`` in place of ``World.run_on``; it may return True to end the flight early."""
    world.plan = plan
    try:
        world.upload(plan)
        if limit_s is None:  # of an accepted plan: one with an idle loop never ends
            limit_s = flight_limit_s(plan.items, world.setup.home, world.engine.stack.now.behaviour)
        await_state(world, step or world.run_on)
        world.arm()
        world.start_mission()
    except RefusedError as error:
        return Outcome(Code.VEHICLE_LOST if error.is_silent else Code.REFUSED, str(error))
    return _flown(world, limit_s, step or world.run_on)


def await_state(world: World, step: Step) -> None:
    """Run until the vehicle may fly on its state, as one on sensors does after seconds, or for ``READY_S``."""
    end_s = world.time_s + READY_S
    while not world.engine.stack.is_ready and world.time_s < end_s and not step(end_s - world.time_s):
        pass


def await_first_state(world: World) -> None:
    """Run until the vehicle is ready for the first time since its boot, at the longest until ``READY_S`` after that."""
    engine = world.engine
    while not engine.was_ready and engine.stack.now.time_us < READY_S * 1e6:
        world.step()


def _flown(world: World, limit_s: float, step: Step) -> Outcome:
    """Fly to the end, and return to launch after a mission that ends in the air."""
    end_s = world.time_s + limit_s
    items, is_returning = world.plan.items, not ends_in_air(world.plan.items)
    while (now := world.engine.stack.now).status.armed:
        if world.time_s > end_s:
            return too_late(_view(world), items, limit_s)
        if not is_returning and now.mission_complete and now.status.mode is Mode.HOLD:
            is_returning = True
            with contextlib.suppress(RefusedError):  # it hovers until the limit
                world.rtl()
        if step(end_s - world.time_s):
            break
    return outcome_of(_view(world), items)


def _view(world: World) -> VehicleView:
    """Return the ground station's view with the true progress, which messages on a bad link may lack."""
    now = world.engine.stack.now
    progress = Mission(
        now.progress.current, now.mission_count, now.progress.reached,
        MISSION_COMPLETE if now.mission_complete else None,
    )  # fmt: skip
    landed = mavlink.MAV_LANDED_STATE_ON_GROUND if now.landed else mavlink.MAV_LANDED_STATE_IN_AIR
    return world.gcs.session.view._replace(mission=progress, landed_state=landed)
