"""Actions on a mission in flight: pause, resume, jump. The start is in ``in_flight``. Pure."""

from __future__ import annotations

from flightstack.mavlink.dialect import mavlink
from gcs_cli.actions.action import Action, NotReadyError, Step
from gcs_cli.actions.in_flight import hold, start_mission
from gcs_cli.autopilots import common_commands
from gcs_cli.autopilots.autopilot import Role
from gcs_cli.vehicle.view_types import VehicleView


def pause() -> Action:
    """Hold the position; the mission keeps its current item."""

    def plan(view: VehicleView) -> tuple[Step, ...]:
        name = view.autopilot.roles.get(Role.MISSION)
        if not view.armed or name not in (None, view.mode):
            state = f"in mode {view.mode}" if view.armed else "disarmed"
            raise NotReadyError(f"the vehicle does not fly a mission: it is {state}")
        return hold().plan(view)

    return Action("mission pause", plan, "pausing the mission", "mission paused: holding the position")


def resume() -> Action:
    """Fly the mission from its current item."""

    def plan(view: VehicleView) -> tuple[Step, ...]:
        if not view.armed:
            raise NotReadyError("the vehicle is disarmed: use `gcs mission start`")
        if view.mission.complete:
            raise NotReadyError("the mission is complete: `gcs mission start` flies it again")
        mode = view.autopilot.role_mode(Role.MISSION, view.vehicle_type)
        if mode is None:
            return start_mission().plan(view)

        def runs(view: VehicleView) -> bool:
            return view.armed and view.custom_mode == mode

        command = view.autopilot.select_mode(mode)
        return (Step("mission resume", command, runs, "does not fly the mission"),)

    return Action("mission resume", plan, "resuming the mission", "mission resumed")


def jump(seq: int) -> Action:
    """Make item ``seq`` of the plan the current one; a mission in flight continues there."""

    def plan(view: VehicleView) -> tuple[Step, ...]:
        number = seq + view.autopilot.mission_begins_with_home
        return (
            Step(
                "mission jump",
                common_commands.set_mission_current(number),
                lambda view: view.mission.current == seq,
                f"does not report item {seq} as the current one",
                instead=lambda *target: mavlink.MAVLink_mission_set_current_message(*target, number),
            ),
        )

    text = f"item {seq} is the current one"
    return Action("mission jump", plan, f"making item {seq} the current one", text, {"seq": seq})
