"""A plan beside the one that a vehicle holds: what its storage makes of a value is no damage."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from flightstack.mavlink.dialect import mavlink
from flightstack.plan import Frame, MissionItem, MissionType
from gcs_cli.autopilots.ardupilot import ARDUPILOT
from gcs_cli.autopilots.registry import GENERIC
from gcs_cli.errors import CliError
from gcs_cli.output import Output
from gcs_cli.plans.compare import EXACT, PACKED_ITEMS, Tolerance, differences
from gcs_cli.transfers.plan_parts import PlanPart
from gcs_cli.transfers.plan_transfers import say_verified

PLACE = MissionItem(
    command=mavlink.MAV_CMD_NAV_WAYPOINT,
    frame=Frame.GLOBAL_RELATIVE_ALT,
    param1=2.5,
    param2=1.5,
    x=473977420,
    y=85455940,
    z=10.0,
)
LOITER = replace(PLACE, command=mavlink.MAV_CMD_NAV_LOITER_TIME, param1=10.0, param2=0.0, param3=-8.0)

TURNS = replace(PLACE, command=mavlink.MAV_CMD_NAV_LOITER_TURNS, param1=0.2519, param2=0.0, param3=1234.0)
SPEED = replace(PLACE, command=mavlink.MAV_CMD_DO_CHANGE_SPEED, param1=0.0, param2=5.5)
TRIGGER = replace(PLACE, command=mavlink.MAV_CMD_DO_SET_CAM_TRIGG_DIST, param1=12.5, param2=40.0, param3=1.0)
PLACING = replace(PLACE, command=mavlink.MAV_CMD_NAV_PAYLOAD_PLACE, param1=2.345, param2=0.0)
CIRCLE = replace(PLACE, command=mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, param1=50.9, param2=0.0)
LAND = replace(PLACE, command=mavlink.MAV_CMD_NAV_LAND, param1=0.0, param2=0.0, param4=math.nan)

COPTER = PACKED_ITEMS._replace(packing=ARDUPILOT.packing(mavlink.MAV_TYPE_QUADROTOR))


def with_params(item: MissionItem, *params: float) -> MissionItem:
    return replace(item, **{f"param{number}": value for number, value in enumerate(params, start=1)})


@pytest.mark.parametrize(
    ("item", "stored", "held"),
    [
        (PLACE, (2.0, 0.0, 0.0, 0.0), [True, True]),  # whole seconds of a hold, no acceptance radius
        (PLACE, (25.0, 1.5, 0.0, 0.0), [False]),
        (PLACE, (0.0, 0.0, 0.0, 0.0), [False, True]),
        (PLACE, (2.5, 1.5, 1.0, 0.0), [False]),
        (LOITER, (10.0, 0.0, -1.0, 0.0), [True]),
        (LOITER, (10.0, 0.0, 1.0, 0.0), [False]),
        (LAND, (0.0, 0.0, 0.0, 1.0), [True]),
        (LAND, (0.0, 0.0, 0.0, 5.0), [False]),
        (TURNS, (0.25, 0.0, 1230.0, 0.0), [True, True]),
        (TURNS, (0.0, 0.0, 1234.0, 0.0), [False]),
        (SPEED, (0.0, 5.0, 0.0, 0.0), [False]),
        (CIRCLE, (50.0, 0.0, 0.0, 0.0), [False]),
        (TRIGGER, (12.5, 0.0, 1.0, 0.0), [True]),
        (TRIGGER, (12.0, 0.0, 1.0, 0.0), [False, True]),
        (PLACING, (2.34, 0.0, 0.0, 0.0), [True]),
    ],
)
def test_what_ardupilot_keeps_of_parameters_is_told_from_damage(
    item: MissionItem, stored: tuple[float, float, float, float], held: list[bool]
) -> None:
    found = [with_params(item, *stored)]
    assert [each.cannot_be_held for each in differences([item], found, COPTER)] == held
    for tolerance in (EXACT, PACKED_ITEMS._replace(packing=GENERIC.packing(mavlink.MAV_TYPE_QUADROTOR))):
        assert not any(each.cannot_be_held for each in differences([item], found, tolerance))


def test_planes_keep_whole_metres_of_a_radius_and_no_hold() -> None:
    plane = PACKED_ITEMS._replace(packing=ARDUPILOT.packing(mavlink.MAV_TYPE_FIXED_WING))
    for stored, held in (((0.0, 1.0), [True, True]), ((2.0, 0.0), [False, False])):
        found = [with_params(PLACE, *stored, 0.0, 0.0)]
        assert [each.cannot_be_held for each in differences([PLACE], found, plane)] == held


@pytest.mark.parametrize(("tolerance", "equal"), [(COPTER, True), (EXACT, False)])
def test_verify_names_each_value_that_the_vehicle_cannot_hold(
    tolerance: Tolerance, equal: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    part = PlanPart(MissionType.MISSION, "mission", (PLACE,))
    found = list(differences(part.items, [with_params(PLACE, 2.0, 0.0, 0.0, 0.0)], tolerance))
    if equal:
        say_verified(Output(as_json=False), [(part, found)], Path("a.plan"))
        assert capsys.readouterr().out.splitlines() == [
            "mission: item 0: parameter 1 is 2, expected 2.5, which the vehicle cannot hold",
            "mission: item 0: parameter 2 is 0, expected 1.5, which the vehicle cannot hold",
            "mission of 1 items: equal except for 2 values that the vehicle cannot hold",
        ]
    else:
        with pytest.raises(CliError, match="2 differences"):
            say_verified(Output(as_json=False), [(part, found)], Path("a.plan"))
