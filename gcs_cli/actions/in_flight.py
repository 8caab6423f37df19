"""Actions in flight: takeoff, landing, return, hold, goto, turn, speed, start of the mission. Pure."""

from __future__ import annotations

import math

from gcs_cli.actions.action import Action, ActionError, Condition, NotReadyError, Step
from gcs_cli.actions.on_vehicle import arm_step
from gcs_cli.actions.progress import horizontal_m
from gcs_cli.autopilots import common_commands
from gcs_cli.autopilots.autopilot import Phase, Role
from gcs_cli.vehicle.view_types import (
    MISSION_ACTIVE,
    MISSION_COMPLETE,
    NO_MISSION,
    GeoPosition,
    VehicleView,
)

ALTITUDE_TOLERANCE_M = 0.5
POSITION_TOLERANCE_M = 1.0
"""Largest distances from the target at which it counts as reached: less than what PX4 and ArduPilot accept."""
HEADING_TOLERANCE_DEG = 3.0
STANDING_M_S = 0.5
"""Speed, horizontal and vertical, below which a vehicle holds its position."""
TAKEOFF_STILL_S = 15.0
"""Longest time without movement; ArduCopter spins up for 5 s."""
TRAVEL_STILL_S = 20.0
LANDING_STILL_S = 30.0
"""Longest time without movement before the disarm: ArduCopter waits up to 10 s at home and as long on the ground."""
HOLD_LIMIT_S = 30.0
TURN_LIMIT_S = 30.0
_NO_POSITION = "the vehicle does not send its position"


def takeoff(altitude_m: float | None = None) -> Action:
    """Take off to an altitude, and arm for it; None: the vehicle's own altitude.

    It counts from the ground on which the vehicle stands, wherever its home is, as MAVSDK's does. ArduPilot counts it
    from home.
    """

    def plan(view: VehicleView) -> tuple[Step, ...]:
        if view.armed and view.on_ground is False:
            raise NotReadyError("the vehicle is in the air: give the new altitude to goto")
        if altitude_m is None and not view.autopilot.has_takeoff_altitude:
            raise ActionError(f"{view.autopilot.title} has no default altitude: give one with --alt")
        steps = [_phase_step(view, phase, altitude_m) for phase in view.autopilot.takeoff_phases]
        return _ending(
            steps,
            Step(
                "",
                common_commands.ARM,
                _climbed(view, altitude_m),
                "is not at that altitude" if altitude_m is not None else "has not taken off",
                TAKEOFF_STILL_S,
                is_flight=True,
                modes=_modes(view, Role.TAKEOFF, Role.HOLD),
                needs_armed=True,
            ),
        )

    to = "" if altitude_m is None else f" to {altitude_m:g} m"
    return Action(
        "takeoff",
        plan,
        f"taking off{to}",
        "took off" if altitude_m is None else f"at {altitude_m:g} m",
        {"altitude_m": altitude_m},
        _knows_ground if altitude_m is not None else None,
        f"{_NO_POSITION}, which --alt needs",
    )


def _knows_ground(view: VehicleView) -> bool:
    """Return True if the position is known, and of an armed vehicle whether it stands on the ground."""
    return view.geo is not None and not (view.armed and view.on_ground is None)


def _climbed(view: VehicleView, altitude_m: float | None) -> Condition:
    """Return the condition that the vehicle is at the altitude, in the frame in which the autopilot flies there."""
    if altitude_m is None:
        mode = view.autopilot.roles.get(Role.TAKEOFF)
        return lambda view: view.armed and view.on_ground is False and view.mode not in (None, mode)
    is_relative = view.autopilot.takeoff_frame is not None
    least_m = (altitude_m if is_relative else _takeoff_amsl_m(view, altitude_m)) - ALTITUDE_TOLERANCE_M

    def is_there(view: VehicleView) -> bool:
        if view.geo is None or view.on_ground:  # the ground may be above home
            return False
        return (view.geo.relative_altitude_m if is_relative else view.geo.altitude_m) > least_m

    return is_there


def _amsl_m(view: VehicleView, altitude_m: float) -> float:
    home_m = view.home_altitude_m
    assert home_m is not None  # needed by the action
    return home_m + altitude_m


def _takeoff_amsl_m(view: VehicleView, altitude_m: float) -> float:
    """Return the altitude above mean sea level of one above the ground on which the vehicle stands."""
    assert view.geo is not None  # needed by the action
    return view.geo.altitude_m + altitude_m


def _phase_step(view: VehicleView, phase: Phase, altitude_m: float | None) -> Step | None:
    """Return the step of one phase, accepted without waiting for its effect; None if there is nothing to do."""
    autopilot = view.autopilot
    if phase is Phase.GUIDED:
        mode = autopilot.role_mode(Role.GUIDED, view.vehicle_type)
        if mode is None or view.custom_mode == mode:
            return None
        name = autopilot.roles[Role.GUIDED]
        return Step(f"mode {name.lower()}", autopilot.select_mode(mode), None)
    if phase is Phase.ARM:
        return None if view.armed else arm_step()._replace(effect=None)
    if phase is Phase.START:
        return Step("mission start", common_commands.START_MISSION, None)
    frame = autopilot.takeoff_frame
    if altitude_m is None:
        return Step("takeoff", common_commands.takeoff(frame, math.nan), None)
    altitude = _takeoff_amsl_m(view, altitude_m) if frame is None else altitude_m
    return Step("takeoff", common_commands.takeoff(frame, altitude), None)


def _ending(steps: list[Step | None], end: Step) -> tuple[Step, ...]:
    """Return the steps that have something to do; the last one waits for the effect of ``end``."""
    present = [step for step in steps if step is not None]
    return (*present[:-1], end._replace(name=present[-1].name, command=present[-1].command))


def _modes(view: VehicleView, *roles: Role) -> frozenset[str]:
    names = view.autopilot.roles
    return frozenset(names[role] for role in roles if role in names)


def land() -> Action:
    """Land at the present position; done when the vehicle has disarmed on the ground."""

    def plan(view: VehicleView) -> tuple[Step, ...]:
        return (_descent(view, "landing", Role.LAND),)

    return Action("land", plan, "landing", "landed and disarmed")


def return_to_launch() -> Action:
    """Return to launch and land; done when the vehicle has disarmed on the ground."""

    def plan(view: VehicleView) -> tuple[Step, ...]:
        return (_descent(view, "return", Role.RETURN),)

    return Action("rtl", plan, "returning to launch", "returned, landed and disarmed")


def _descent(view: VehicleView, name: str, role: Role) -> Step:
    return Step(
        name,
        common_commands.LAND if role is Role.LAND else common_commands.RETURN,
        lambda view: not view.armed and view.on_ground is not False,
        "is still armed or in the air",
        LANDING_STILL_S,
        is_flight=True,
        modes=_modes(view, role, Role.LAND),
        needs_armed=True,
    )


def hold() -> Action:
    """Stop and hold the position."""

    def plan(view: VehicleView) -> tuple[Step, ...]:
        autopilot = view.autopilot
        mode = autopilot.role_mode(Role.HOLD, view.vehicle_type)
        command = common_commands.PAUSE if mode is None else autopilot.select_mode(mode)

        def is_holding(view: VehicleView) -> bool:
            return (mode is None or view.custom_mode == mode) and _stands(view)

        return (Step("hold", command, is_holding, "does not hold its position", HOLD_LIMIT_S),)

    return Action("hold", plan, "stopping", "holding the position")


def _require_flight(view: VehicleView) -> None:
    """Raise if the vehicle is disarmed: it would accept the command, and fly there after the next takeoff."""
    if not view.armed:
        raise NotReadyError("the vehicle is disarmed: take off first")


def _stands(view: VehicleView) -> bool:
    velocity = view.velocity_ned_m_s
    return velocity is not None and math.hypot(*velocity) < STANDING_M_S


def _stands_at(view: VehicleView, target: GeoPosition, is_relative: bool) -> bool:
    """Return True if the vehicle stands at ``target``; a target whose altitude is NaN has any altitude."""
    if view.geo is None or horizontal_m(view.geo, target) > POSITION_TOLERANCE_M:
        return False
    height_m = view.geo.relative_altitude_m if is_relative else view.geo.altitude_m
    is_off = abs(height_m - target.altitude_m) > ALTITUDE_TOLERANCE_M  # False for NaN
    return not is_off and _stands(view)


def goto(latitude_deg: float, longitude_deg: float, altitude_m: float | None = None) -> Action:
    """Fly to a position and hold there; the altitude is above home, None keeps it."""

    def plan(view: VehicleView) -> tuple[Step, ...]:
        _require_flight(view)
        autopilot, geo = view.autopilot, view.geo
        assert geo is not None  # needed by the action
        is_relative = autopilot.goto_frame != common_commands.GLOBAL
        if altitude_m is not None:
            wanted_m = altitude_m if is_relative else _amsl_m(view, altitude_m)
        elif autopilot.goto_keeps_altitude:
            wanted_m = math.nan
        else:
            wanted_m = geo.relative_altitude_m
        target = GeoPosition(latitude_deg, longitude_deg, wanted_m, wanted_m)

        return (
            Step(
                "goto",
                common_commands.reposition(autopilot.goto_frame, latitude_deg, longitude_deg, wanted_m),
                lambda view: _stands_at(view, target, is_relative),
                "is not at that position",
                TRAVEL_STILL_S,
                is_flight=True,
                modes=_modes(view, Role.GUIDED),
                needs_armed=True,
            ),
        )

    place = f"{latitude_deg:.7f} {longitude_deg:.7f}" + (
        "" if altitude_m is None else f" at {altitude_m:g} m"
    )
    facts = {"latitude_deg": latitude_deg, "longitude_deg": longitude_deg, "altitude_m": altitude_m}
    return Action(
        "goto", plan, f"flying to {place}", f"at {place}" if altitude_m is None else f"reached {place}", facts,
        lambda view: view.geo is not None, _NO_POSITION,
    )  # fmt: skip


def yaw(heading_deg: float) -> Action:
    """Turn to a heading, clockwise from north, and hold the position."""

    def plan(view: VehicleView) -> tuple[Step, ...]:
        _require_flight(view)
        steps = [_phase_step(view, phase, None) for phase in view.autopilot.yaw_phases]
        turn = Step(
            "yaw",
            view.autopilot.yaw(heading_deg),
            lambda view: _is_heading(view, heading_deg),
            "does not point there",
            TURN_LIMIT_S,
            needs_armed=True,
        )
        return (*(step for step in steps if step is not None), turn)

    to = f"{heading_deg:g} degrees"
    return Action(
        "yaw", plan, f"turning to {to}", f"pointing to {to}", {"heading_deg": heading_deg},
    )  # fmt: skip


def _is_heading(view: VehicleView, heading_deg: float) -> bool:
    if view.attitude is not None:
        now_deg = math.degrees(view.attitude.yaw_rad)
    elif view.heading_deg is not None:
        now_deg = view.heading_deg
    else:
        return False
    return abs((now_deg - heading_deg + 180.0) % 360.0 - 180.0) <= HEADING_TOLERANCE_DEG


def speed(speed_m_s: float | None) -> Action:
    """Set the ground speed; None restores the default. Vehicles do not report it."""

    def plan(view: VehicleView) -> tuple[Step, ...]:
        wanted = view.autopilot.default_speed if speed_m_s is None else speed_m_s
        if wanted is None:
            raise ActionError(f"{view.autopilot.title} has no command for its default speed: give a speed")
        modes = view.autopilot.speed_modes(view.vehicle_type)
        is_possible = not modes or view.mode in modes
        reason = "" if is_possible else f"not possible in mode {view.mode}, only in {', '.join(modes)}"
        return (Step("speed", common_commands.speed(wanted), None, refusal=reason),)

    text = "default speed" if speed_m_s is None else f"speed {speed_m_s:g} m/s"
    facts = {"speed_m_s": speed_m_s}
    return Action("speed", plan, text, text, facts, unseen="the vehicle does not report its speed setting")


def start_mission() -> Action:
    """Start the mission, or continue it in the air; done when the vehicle is armed and in its mission mode."""

    def plan(view: VehicleView) -> tuple[Step, ...]:
        phases = (Phase.START,) if view.armed else view.autopilot.start_phases
        if Phase.ARM in phases and view.mission.state == NO_MISSION:
            raise NotReadyError("the vehicle has no mission")
        name = view.autopilot.roles.get(Role.MISSION)

        def runs(view: VehicleView) -> bool:
            is_active = view.mission.state in (None, MISSION_ACTIVE, MISSION_COMPLETE)
            return view.armed and name in (None, view.mode) and is_active

        end = Step(
            "", common_commands.START_MISSION, runs, "does not fly the mission", advice=_start_advice(view)
        )
        return _ending([_phase_step(view, phase, None) for phase in phases], end)

    return Action(
        "mission start",
        plan,
        "starting the mission",
        "mission started",
        needs=lambda view: view.mission.current is not None,
        needs_text="the vehicle does not report its mission",
    )


def _start_advice(view: VehicleView) -> str:
    """Return what to do if a vehicle on the ground refuses to start at its current item; empty if that is the first."""
    mission = view.mission
    if view.armed or view.can_arm is False or mission.complete or not (mission.current and mission.total):
        return ""
    return f"the mission is at {mission.item_text}: `gcs mission jump 0`, then start, flies it from its first item"
