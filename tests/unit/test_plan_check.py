"""The missions that the vehicle takes, and the reason and result for each that it refuses."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flightstack.core.float32 import as_float32
from flightstack.core.geodesy import GeoPoint
from flightstack.params.behaviour import Behaviour
from flightstack.plan import (
    UNSET_E7,
    Command,
    Frame,
    Limits,
    MissionItem,
    MissionResult,
    check_mission,
    mission_rejections,
)
from flightstack.plan.fence import fence_shape
from flightstack.plan.item import integer_coordinate
from tests.support.plan_items import circle, item

NAN = float("nan")
INF = math.inf
HOME = GeoPoint(47.397742, 8.545594, 488.0)
RELATIVE, ABSOLUTE, PLAIN = Frame.GLOBAL_RELATIVE_ALT_INT, Frame.GLOBAL_INT, Frame.MISSION

WAYPOINT = MissionItem(Command.NAV_WAYPOINT, RELATIVE, 0.0, 0.0, 0.0, NAN, 473977420, 85455940, 5.0)
OPEN_TAKEOFF = MissionItem(Command.NAV_TAKEOFF, RELATIVE, NAN, NAN, NAN, NAN, UNSET_E7, UNSET_E7, NAN)
OPEN_LAND = replace(OPEN_TAKEOFF, command=Command.NAV_LAND)
RETURN = MissionItem(Command.NAV_RETURN_TO_LAUNCH, PLAIN)
SPEED = MissionItem(Command.DO_CHANGE_SPEED, PLAIN, 1.0, 5.0, -1.0)
YAW = MissionItem(Command.CONDITION_YAW, PLAIN, 90.0, 0.0, 0.0, 0.0)
DELAY = MissionItem(Command.NAV_DELAY, PLAIN, 1.0)
LOITER = replace(WAYPOINT, command=Command.NAV_LOITER_TIME)


def jump(target: float, repeat: float = 1.0) -> MissionItem:
    return MissionItem(Command.DO_JUMP, PLAIN, target, repeat)


def test_a_mission_of_everything_is_taken() -> None:
    items = (OPEN_TAKEOFF, SPEED, WAYPOINT, YAW, DELAY, LOITER, jump(2), jump(2, -1.0), OPEN_LAND, RETURN)
    assert check_mission(items, HOME) is None


@pytest.mark.parametrize(
    "item",
    [
        replace(OPEN_TAKEOFF, x=-(2**31), y=-(2**31)),  # a NaN cast to an integer on x86
        replace(OPEN_TAKEOFF, x=0, y=0, z=3.0),
        replace(OPEN_LAND, x=0, y=0, z=-100.0),
        replace(WAYPOINT, frame=ABSOLUTE, z=488.0),
        replace(WAYPOINT, frame=Frame.GLOBAL, z=as_float32(488.0001)),
        replace(WAYPOINT, param1=NAN, param2=NAN, param3=NAN, param4=-720.0),
        replace(RETURN, frame=Frame.GLOBAL_RELATIVE_ALT, x=5, y=5, z=NAN),
    ],
)
def test_forms_that_clients_send_are_taken(item: MissionItem) -> None:
    assert check_mission((item, WAYPOINT), HOME) is None


R = MissionResult
REFUSED: list[tuple[MissionItem, MissionResult, str]] = [
    (replace(WAYPOINT, command=17), R.UNSUPPORTED, "item 1 (command 17): is not supported"),
    (replace(WAYPOINT, command=65535), R.UNSUPPORTED, "command 65535"),
    (replace(WAYPOINT, frame=10), R.UNSUPPORTED_FRAME, "frame 10 is not one of"),
    (replace(WAYPOINT, frame=PLAIN), R.UNSUPPORTED_FRAME, "needs a global frame"),
    (replace(OPEN_TAKEOFF, frame=PLAIN), R.UNSUPPORTED_FRAME, "needs a global frame"),
    (replace(WAYPOINT, param1=-1.0), R.INVALID_PARAM1, "hold time -1 (parameter 1) must be 0 s or more"),
    (replace(WAYPOINT, param1=INF), R.INVALID_PARAM1, "parameter 1 is infinite"),
    (replace(WAYPOINT, param2=-0.1), R.INVALID_PARAM2, "acceptance radius"),
    (replace(WAYPOINT, param3=-INF), R.INVALID_PARAM3, "parameter 3 is infinite"),
    (replace(WAYPOINT, param4=INF), R.INVALID_PARAM4, "parameter 4 is infinite"),
    (replace(WAYPOINT, x=UNSET_E7), R.INVALID_PARAM5_X, "latitude and longitude must be given"),
    (replace(LOITER, y=UNSET_E7), R.INVALID_PARAM5_X, "latitude and longitude must be given"),
    (replace(WAYPOINT, x=900000001), R.INVALID_PARAM5_X, "latitude 90.0000001 is outside"),
    (replace(OPEN_LAND, x=2**31 - 2, y=0), R.INVALID_PARAM5_X, "latitude 214"),
    (replace(WAYPOINT, y=-1800000001), R.INVALID_PARAM6_Y, "longitude -180.0000001 is outside"),
    (replace(WAYPOINT, z=NAN), R.INVALID_PARAM7, "altitude must be given"),
    (replace(WAYPOINT, z=INF), R.INVALID_PARAM7, "parameter 7 is infinite"),
    (replace(WAYPOINT, z=-1.0), R.INVALID_PARAM7, "altitude -1 m above home is outside 0 to 500 m"),
    (replace(WAYPOINT, z=501.0), R.INVALID_PARAM7, "altitude 501 m above home"),
    (replace(WAYPOINT, frame=ABSOLUTE, z=480.0), R.INVALID_PARAM7, "altitude -8 m above home"),
    (replace(OPEN_TAKEOFF, z=0.0), R.INVALID_PARAM7, "altitude 0 m above home is outside 0.3 to 500 m"),
    (replace(WAYPOINT, x=474977420), R.INVALID, "m from the position before it, and at most 10000 m"),
    (replace(LOITER, param1=-2.0), R.INVALID_PARAM1, "hold time"),
    (replace(DELAY, param1=-1.0), R.INVALID_PARAM1, "a time of day (-1) is not supported"),
    (replace(DELAY, param1=NAN), R.INVALID_PARAM1, "delay nan"),
    (replace(SPEED, param1=2.0), R.INVALID_PARAM1, "speed type"),
    (replace(SPEED, param2=0.0), R.INVALID_PARAM2, "speed 0 (parameter 2) must be above 0 m/s"),
    (replace(SPEED, param2=NAN), R.INVALID_PARAM2, "speed nan"),
    (replace(YAW, param1=361.0), R.INVALID_PARAM1, "angle"),
    (replace(YAW, param2=-1.0), R.INVALID_PARAM2, "yaw rate"),
    (replace(YAW, param3=2.0), R.INVALID_PARAM3, "direction"),
    (replace(YAW, param4=2.0), R.INVALID_PARAM4, "reference"),
    (jump(1.0), R.INVALID_PARAM1, "jumps to itself"),
    (jump(3.0), R.INVALID_PARAM1, "jumps to item 3, and the mission's items are 0 to 2"),
    (jump(-1.0), R.INVALID_PARAM1, "jumps to item -1"),
    (jump(0.5), R.INVALID_PARAM1, "jumps to item 0.5"),
    (jump(NAN), R.INVALID_PARAM1, "jumps to item nan"),
    (jump(0.0, -2.0), R.INVALID_PARAM2, "repeat count -2"),
    (jump(0.0, 1.5), R.INVALID_PARAM2, "repeat count 1.5"),
    (jump(0.0, NAN), R.INVALID_PARAM2, "repeat count nan"),
]


@pytest.mark.parametrize(("item", "result", "reason"), REFUSED, ids=[row[2] for row in REFUSED])
def test_a_refused_item_is_named_with_its_result(
    item: MissionItem, result: MissionResult, reason: str
) -> None:
    rejection = check_mission((WAYPOINT, item, WAYPOINT), HOME)
    assert rejection is not None
    assert (rejection.result, rejection.seq) == (result, 1)
    assert reason in rejection.reason


def test_the_mission_as_a_whole() -> None:
    rejection = check_mission([WAYPOINT] * 2001, HOME)
    assert rejection is not None
    assert (rejection.result, rejection.seq) == (MissionResult.NO_SPACE, None)
    for items in ((), (SPEED, YAW)):
        rejection = check_mission(items, HOME)
        assert rejection is not None
        assert (rejection.result, rejection.seq) == (MissionResult.INVALID, None)


def test_the_limits_are_those_of_the_vehicle_unless_its_parameters_say_otherwise() -> None:
    vehicle = Behaviour()
    limits = Limits()
    assert limits.max_first_distance_m == vehicle.first_waypoint_distance_m
    assert limits.max_distance_m == vehicle.waypoint_distance_m


def test_limits_are_parameters_and_zero_lifts_them() -> None:
    far = replace(WAYPOINT, x=WAYPOINT.x + 1_000_000)  # 11.1 km north
    rejection = check_mission((far,), HOME)
    assert rejection is not None
    assert "from home, and at most 10000 m" in rejection.reason
    assert check_mission((far,), HOME, Limits(max_first_distance_m=12_000.0)) is None
    assert check_mission((WAYPOINT, far), HOME, Limits(max_distance_m=0.0)) is None
    high = replace(WAYPOINT, z=9000.0)
    assert check_mission((high,), HOME, Limits(max_altitude_m=0.0)) is None


@pytest.mark.parametrize(
    ("items", "loop"),
    [
        ((WAYPOINT, SPEED, jump(1.0)), 2),
        ((WAYPOINT, SPEED, jump(1.0, -1.0)), 2),
        ((jump(2.0), WAYPOINT, SPEED, jump(2.0)), 3),
        ((WAYPOINT, jump(3.0), SPEED, YAW, jump(2.0), RETURN), 4),
        ((WAYPOINT, jump(2.0), jump(1.0)), 2),
        ((WAYPOINT, jump(0.0, -1.0), SPEED), None),
        ((WAYPOINT, SPEED, jump(1.0, 0.0)), None),  # a jump made no times
        ((SPEED, DELAY, jump(0.0, -1.0)), None),  # a delay takes time
        ((jump(2.0, -1.0), SPEED, RETURN), None),
        ((WAYPOINT, jump(3.0, -1.0), OPEN_LAND, RETURN), None),
    ],
)
def test_loops_without_an_item_to_fly_are_refused(items: tuple[MissionItem, ...], loop: int | None) -> None:
    rejection = check_mission(items, HOME)
    assert (rejection.seq if rejection else None) == loop


def test_a_mission_of_jumps_only_between_two_waypoints_is_checked_fast_and_deep() -> None:
    forward = [WAYPOINT, *[jump(min(seq + 2.0, 1999.0)) for seq in range(1, 1999)], WAYPOINT]
    assert check_mission(forward, HOME) is None
    forward[1998] = jump(1.0)
    assert check_mission(forward, HOME) is not None


def idle_loop_by_brute_force(items: tuple[MissionItem, ...]) -> bool:
    """Tell whether some item can be reached from itself with no time passing: by closing the relation."""
    count = len(items)
    timed = (Command.NAV_WAYPOINT, Command.NAV_DELAY)
    reach = [[False] * count for _ in items]
    for seq, each in enumerate(items):
        if each.command in timed:
            continue
        if each.command == Command.DO_JUMP and each.param2 != 0.0:
            reach[seq][int(each.param1)] = True
        if seq + 1 < count and not (each.command == Command.DO_JUMP and each.param2 < 0.0):
            reach[seq][seq + 1] = True
    for via in range(count):
        for start in range(count):
            for end in range(count):
                reach[start][end] |= reach[start][via] and reach[via][end]
    return any(reach[seq][seq] for seq in range(count))


@settings(max_examples=300)
@given(data=st.data(), count=st.integers(2, 9))
def test_idle_loops_are_found_as_by_brute_force(data: st.DataObject, count: int) -> None:
    items: list[MissionItem] = []
    for seq in range(count):
        target = data.draw(st.integers(0, count - 1).filter(lambda value, own=seq: value != own))
        repeat = data.draw(st.sampled_from([-1.0, 0.0, 1.0]))
        items.append(data.draw(st.sampled_from([WAYPOINT, DELAY, SPEED, YAW, jump(target, repeat)])))
    mission = (*items, WAYPOINT)
    rejection = check_mission(mission, HOME)
    assert (rejection is not None) == idle_loop_by_brute_force(mission)
    if rejection is not None:
        assert rejection.seq is not None
        assert mission[rejection.seq].command == Command.DO_JUMP


ANY_FLOAT = st.floats(width=32)


@settings(max_examples=300)
@given(
    st.lists(
        st.builds(
            MissionItem,
            st.sampled_from([*Command, 0, 65535]),
            st.sampled_from([*Frame, 1, 255]),
            ANY_FLOAT,
            ANY_FLOAT,
            ANY_FLOAT,
            ANY_FLOAT,
            st.integers(-(2**31), 2**31 - 1),
            st.integers(-(2**31), 2**31 - 1),
            ANY_FLOAT,
        ),
        max_size=4,
    )
)
def test_any_mission_gets_an_answer(items: list[MissionItem]) -> None:
    rejection = check_mission(items, HOME)
    assert rejection is None or rejection.reason


def test_items_compare_by_meaning() -> None:
    one, other = replace(WAYPOINT, param4=float("nan")), replace(WAYPOINT, param4=-float("nan"))
    assert one == other
    assert hash(one) == hash(other)
    assert one != replace(WAYPOINT, param4=0.0)
    assert one != "waypoint"


@pytest.mark.parametrize("value", [NAN, INF, -INF, 1e300, -1e300, 214.8, 0.0, -90.0, 47.3977421])
def test_a_coordinate_of_any_float_is_an_integer_that_fits(value: float) -> None:
    result = integer_coordinate(value, True)
    assert -(2**31) < result <= 2**31 - 1
    assert (result == UNSET_E7) == math.isnan(value)
    if abs(value) <= 180.0:
        assert result == round(value * 1e7)
    elif not math.isnan(value):
        assert abs(result) > 1_800_000_000


def test_mission_rejections_name_every_faulty_item() -> None:
    bad = replace(WAYPOINT, command=17)
    found = list(mission_rejections((WAYPOINT, bad, WAYPOINT, replace(WAYPOINT, z=-50.0)), HOME))
    assert [rejection.seq for rejection in found] == [1, 3]


def test_mission_rejections_name_every_item_outside_the_fence() -> None:
    fence = fence_shape([circle((0.0, 0.0), 50.0)], HOME)
    items = [item(Command.NAV_WAYPOINT, north, 0.0, 5.0) for north in (10.0, 80.0, 20.0, 90.0)]
    found = list(mission_rejections(items, HOME, fence=fence))
    assert {rejection.seq for rejection in found} == {1, 2, 3}  # 2: the way back from outside
