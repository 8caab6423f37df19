"""Every failsafe in every phase of flight: a table of what must come of it, and all of its cells flown."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest

from flightstack.commander.failsafe import Failsafe, Phase
from flightstack.core.contract import Vector3
from flightstack.core.geodesy import LocalFrame
from flightstack.core.modes import CUSTOM_MODE, Mode
from flightstack.guidance.fence import Fence
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Message
from tests.support.world import World, item

F, P = Failsafe, Phase
QUICK = (
    "MPC_Z_VEL_MAX_UP=5",
    "MPC_Z_VEL_MAX_DN=3",
    "MPC_LAND_SPEED=1.5",
    "MPC_LAND_ALT2=2",
    "MPC_TKO_SPEED=3",
    "RTL_RETURN_ALT=8",
    "RTL_MIN_DIST=1",
    "COM_FAIL_ACT_T=0.5",
)
HEIGHT = 6.0

# ---------------------------------------------------------------------- phases


def _select(world: World, mode: Mode) -> None:
    number = CUSTOM_MODE[mode]
    result = world.command(mavlink.MAV_CMD_DO_SET_MODE, 1, number >> 16 & 0xFF, number >> 24)
    assert result == 0, (mode, world.texts)
    assert world.mode is mode


def _hover(world: World) -> None:
    """Hover at ``HEIGHT``, some metres north of home."""
    world.upload([item(22, z=HEIGHT), item(16, north=8.0, z=HEIGHT)])
    assert world.start_mission() == 0, world.texts
    world.until(lambda: world.mode is Mode.HOLD, 30.0)


def sticks(climb: int = 500) -> Message:
    return mavlink.MAVLink_manual_control_message(1, 0, 0, climb, 0, 0)


def setpoint(world: World) -> Callable[[], Message]:
    """Stay where the vehicle is now."""
    north, east, down = world.position.tolist()
    stay = mavlink.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, 1, 0b110111111000, north, east, down, 0, 0, 0, 0, 0, 0, 0, 0
    )
    return lambda: stay


def disarmed(world: World, before: Callable[[], None]) -> None:
    world.run(0.1)
    before()


def standing(world: World, before: Callable[[], None]) -> None:
    before()
    assert world.arm() == 0, world.texts
    world.run(0.1)


def takeoff(world: World, before: Callable[[], None]) -> None:
    assert world.arm() == 0, world.texts
    assert world.takeoff(30.0) == 0
    world.until(lambda: world.altitude > 1.0, 5.0)
    before()


def mission(world: World, before: Callable[[], None]) -> None:
    world.upload([item(22, z=HEIGHT), item(16, north=200.0, z=HEIGHT)])
    assert world.start_mission() == 0, world.texts
    world.until(lambda: world.position[0] > 1.0, 20.0)
    before()


def hold(world: World, before: Callable[[], None]) -> None:
    _hover(world)
    before()
    world.run(0.2)


def goto(world: World, before: Callable[[], None]) -> None:
    _hover(world)
    before()
    place = LocalFrame(world.config.home).to_geo(Vector3(200.0, 0.0, -HEIGHT))
    reposition = mavlink.MAV_CMD_DO_REPOSITION
    assert world.command(reposition, -1, 1, 0, math.nan, *place) == 0, world.texts
    world.run(0.3)
    assert world.velocity[0] > 0.1


def manual(world: World, before: Callable[[], None]) -> None:
    _hover(world)
    world.streams["sticks"] = sticks
    world.run(0.1)
    before()
    _select(world, Mode.POSITION)
    world.run(0.3)


def offboard(world: World, before: Callable[[], None]) -> None:
    _hover(world)
    world.streams["setpoint"] = setpoint(world)
    world.run(0.1)
    before()
    _select(world, Mode.OFFBOARD)
    world.run(0.3)


def returning(world: World, before: Callable[[], None]) -> None:
    _hover(world)
    before()
    assert world.return_home() == 0
    world.run(0.3)


def landing(world: World, before: Callable[[], None]) -> None:
    _hover(world)
    before()
    assert world.land() == 0
    world.run(0.3)


ENTER: dict[Phase, Callable[[World, Callable[[], None]], None]] = {
    P.DISARMED: disarmed,
    P.STANDING: standing,
    P.TAKEOFF: takeoff,
    P.MISSION: mission,
    P.HOLD: hold,
    P.GOTO: goto,
    P.MANUAL: manual,
    P.OFFBOARD: offboard,
    P.RETURN: returning,
    P.LAND: landing,
}
MODE_IN: dict[Phase, Mode] = {
    P.TAKEOFF: Mode.TAKEOFF,
    P.MISSION: Mode.MISSION,
    P.HOLD: Mode.HOLD,
    P.GOTO: Mode.HOLD,
    P.MANUAL: Mode.POSITION,
    P.OFFBOARD: Mode.OFFBOARD,
    P.RETURN: Mode.RETURN,
    P.LAND: Mode.LAND,
}

# ---------------------------------------------------------------------- faults


def nothing(world: World) -> None:
    """Nothing is to be done before the phase, or at the fault."""


def stop_heartbeats(world: World) -> None:
    world.run(0.1)
    world.sends_heartbeats = False
    world.run(4.5)  # of the 5 s that a ground station may be silent


def stop_stream(name: str) -> Callable[[World], None]:
    return lambda world: world.streams.pop(name) and None


def begin_setpoints(world: World) -> None:
    """Let setpoints come in every phase; on the ground the mode must be selected for them to matter."""
    world.streams["setpoint"] = setpoint(world)
    world.run(0.1)
    if world.altitude < 0.1:
        _select(world, Mode.OFFBOARD)


def begin_sticks(world: World) -> None:
    world.streams["sticks"] = sticks
    world.run(0.1)
    if world.altitude < 0.1:
        _select(world, Mode.POSITION)


def breach_fence(world: World) -> None:
    """Fence in a place where the vehicle is not; home is inside, unless the vehicle is there."""
    north = float(world.position[0]) - 20.5 if world.position[0] > 0.9 else -100.0
    far = item(mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, north=north, p1=20.0)
    frame = LocalFrame(world.config.home)
    world.stack.autopilot.supervisor.set_fence(Fence.from_items([far], frame))


def lose_states(world: World) -> None:
    world.loses_states = True
    world.run(0.1)


def tip_over(world: World) -> None:
    """Turn the vehicle by 100° about its roll axis, at once."""
    world.simulator.plant._memory[0]["body"][6:10] = math.cos(0.87), math.sin(0.87), 0.0, 0.0  # type: ignore[attr-defined]
    world.run(0.004)


def blow_away(world: World) -> None:
    """Put the vehicle 30 m to the east, at once."""
    world.simulator.plant._memory[0]["body"][1] += 30.0  # type: ignore[attr-defined]


def inject(fault: str) -> Callable[[World], None]:
    def begin(world: World) -> None:
        world.inject(fault)
        world.run(0.2)

    return begin


class Case(NamedTuple):
    """How a failsafe is provoked: parameters, what is done before the phase and in it, and what is said."""

    params: tuple[str, ...]
    before: Callable[[World], None]
    fault: Callable[[World], None]
    says: str
    refusal: str


CASES: dict[Failsafe, Case] = {
    F.GCS_LOST: Case(
        ("NAV_DLL_ACT=2", "COM_DL_LOSS_T=5"),
        stop_heartbeats,
        nothing,
        "Ground station lost",
        "ground station",
    ),
    F.OFFBOARD_LOST: Case(
        ("COM_OBL_RC_ACT=4", "COM_OF_LOSS_T=0.3"),
        begin_setpoints,
        stop_stream("setpoint"),
        "Offboard setpoints lost",
        "no offboard setpoints",
    ),
    F.MANUAL_LOST: Case(
        ("NAV_RCL_ACT=3",), begin_sticks, stop_stream("sticks"), "Manual control lost", "no manual control"
    ),
    F.BATTERY_LOW: Case((), nothing, inject("battery:level=0.13"), "Battery level is low", "battery is low"),
    F.BATTERY_CRITICAL: Case(
        ("COM_LOW_BAT_ACT=3",),
        nothing,
        inject("battery:level=0.068"),
        "Battery level is critical",
        "battery is low",
    ),
    F.BATTERY_EMERGENCY: Case(
        ("COM_LOW_BAT_ACT=3",),
        nothing,
        inject("battery:level=0.04"),
        "Battery level is dangerously low",
        "battery is low",
    ),
    F.FENCE: Case(("GF_ACTION=3",), nothing, breach_fence, "Geofence breached", "outside the geofence"),
    F.POSITION_ERROR: Case(
        ("FS_POS_ERR_T=0.1",), nothing, blow_away, "Position is far from its setpoint", ""
    ),
    F.ATTITUDE: Case(
        ("FD_FAIL_R_TTRI=0.02",), nothing, tip_over, "Attitude is beyond its limits", "tilted by more than"
    ),
    F.ROTOR: Case(
        ("COM_ACT_FAIL_ACT=4",), nothing, inject("rotor:1:off"), "A rotor does not follow its command", ""
    ),
    F.STATE_STALE: Case(
        ("FS_STALE_T=0.05", "FS_BLIND_T=0.3"),
        nothing,
        lose_states,
        "State is frozen or missing",
        "the state is frozen or missing",
    ),
    F.NOT_FINITE: Case(
        ("FS_BLIND_T=0.3",),
        nothing,
        inject("state:nan"),
        "State or controller output",
        "no valid position and attitude",
    ),
}

# ---------------------------------------------------------------------- ends


def refused(world: World, case: Case, phase: Phase) -> None:
    """Arming is refused, with the reason."""
    world.run(0.6)
    assert world.arm() == 1
    world.run(0.02)
    assert any(case.refusal in text for text in world.texts), world.texts
    assert not world.armed


def arms(world: World, case: Case, phase: Phase) -> None:
    """There is nothing to see on the ground: the vehicle arms."""
    assert world.arm() == 0, world.texts


def disarms(world: World, case: Case, phase: Phase) -> None:
    """The vehicle never leaves the ground and disarms."""
    world.until_disarmed(3.0)
    assert world.altitude < 0.05
    assert said(world, case)


def returns(world: World, case: Case, phase: Phase) -> None:
    """Home, on the ground, disarmed."""
    world.until(lambda: world.mode is Mode.RETURN, 5.0)
    assert said(world, case)
    world.until_disarmed(40.0)
    assert world.altitude < 0.05
    assert np.linalg.norm(world.position[:2]) < 0.6


def lands(world: World, case: Case, phase: Phase) -> None:
    """On the ground near where it was, disarmed."""
    world.until(lambda: world.mode is Mode.LAND, 5.0)
    assert said(world, case)
    here = world.position
    world.until_disarmed(25.0)
    assert world.altitude < 0.05
    assert np.linalg.norm(world.position[:2] - here[:2]) < 3.0


def ends(world: World, case: Case, phase: Phase) -> None:
    """Rotors off for good."""
    world.until(lambda: world.mode is Mode.TERMINATION, 3.0)
    assert said(world, case)
    assert not world.armed
    assert float(np.abs(world.stack.autopilot.now.row[31:39]).max()) == 0.0
    assert world.arm() == 1
    assert world.hold() == 1


def goes_on(world: World, case: Case, phase: Phase) -> None:
    """A warning at most: the phase is not disturbed."""
    before = world.mode
    world.run(1.0)
    assert world.armed
    assert world.mode is before
    assert phase is P.STANDING or world.mode is MODE_IN[phase]


def warns(world: World, case: Case, phase: Phase) -> None:
    """The phase goes on, and the operator knows."""
    goes_on(world, case, phase)
    assert said(world, case)


def said(world: World, case: Case) -> bool:
    """Tell whether the failsafe was announced, once."""
    world.run(0.02)
    return sum(case.says in text and "again" not in text for text in world.texts) == 1


PHASES = (
    P.DISARMED,
    P.STANDING,
    P.TAKEOFF,
    P.MISSION,
    P.HOLD,
    P.GOTO,
    P.MANUAL,
    P.OFFBOARD,
    P.RETURN,
    P.LAND,
)
# fmt: off
TABLE = {
    #                     disarmed standing takeoff  mission  hold     goto     manual   offboard return   land
    F.NOT_FINITE:        (refused, disarms, ends,    ends,    ends,    ends,    ends,    ends,    ends,    ends),
    F.STATE_STALE:       (refused, disarms, ends,    ends,    ends,    ends,    ends,    ends,    ends,    ends),
    F.ATTITUDE:          (refused, disarms, ends,    ends,    ends,    ends,    ends,    ends,    ends,    ends),
    F.ROTOR:             (arms,    disarms, ends,    ends,    ends,    ends,    ends,    ends,    ends,    ends),
    F.BATTERY_EMERGENCY: (refused, disarms, lands,   lands,   lands,   lands,   lands,   lands,   lands,   warns),
    F.FENCE:             (refused, disarms, lands,   returns, returns, returns, returns, returns, warns,   warns),
    F.POSITION_ERROR:    (arms,    goes_on, lands,   lands,   lands,   lands,   goes_on, lands,   lands,   warns),
    F.BATTERY_CRITICAL:  (refused, disarms, returns, returns, returns, returns, returns, returns, warns,   warns),
    F.MANUAL_LOST:       (refused, disarms, goes_on, goes_on, goes_on, goes_on, lands,   goes_on, goes_on, goes_on),
    F.OFFBOARD_LOST:     (refused, disarms, goes_on, goes_on, goes_on, goes_on, goes_on, lands,   goes_on, goes_on),
    F.GCS_LOST:          (refused, disarms, returns, returns, returns, returns, returns, returns, warns,   goes_on),
    F.BATTERY_LOW:       (refused, warns,   warns,   warns,   warns,   warns,   warns,   warns,   warns,   warns),
}
# fmt: on


def test_the_table_has_every_failsafe_in_every_phase() -> None:
    assert set(TABLE) == set(CASES) == set(Failsafe)
    assert set(PHASES) == set(ENTER) == set(Phase)
    assert all(len(row) == len(PHASES) for row in TABLE.values())


@pytest.mark.parametrize("phase", PHASES, ids=lambda phase: phase.name.lower())
@pytest.mark.parametrize("failsafe", list(TABLE), ids=lambda failsafe: failsafe.name.lower())
def test_each_failsafe_in_each_phase(failsafe: Failsafe, phase: Phase) -> None:
    case = CASES[failsafe]
    world = World(vehicle="x_quad", params=[*QUICK, *case.params])
    ENTER[phase](world, lambda: case.before(world))
    case.fault(world)
    TABLE[failsafe][PHASES.index(phase)](world, case, phase)
