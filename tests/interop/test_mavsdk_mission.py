"""MAVSDK uploads missions, reads them back, flies them, and does so with fences and rally points."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from mavsdk.plugins.action import ActionError
from mavsdk.plugins.geofence import Circle, FenceType, GeofenceData, Point, Polygon
from mavsdk.plugins.mission import MissionError, MissionItem, MissionPlan
from mavsdk.plugins.mission_raw import MissionItem as RawItem

from tests.interop.client import GROUND, TCP, story
from tests.interop.drone import Drone

METRES_A_DEGREE = 111_195.0
SQUARE = Path(__file__).resolve().parents[2] / "missions" / "square.plan"


async def square(drone: Drone, side_m: float = 6.0) -> MissionPlan:
    """Return a plan around home as MAVSDK's users write them: north, east, south, west, three metres up."""
    home = await drone.until("home", drone.telemetry.subscribe_home())
    north = side_m / METRES_A_DEGREE
    east = north / math.cos(math.radians(home.latitude_deg))
    return MissionPlan([
        MissionItem(
            latitude_deg=home.latitude_deg + corner_north * north,
            longitude_deg=home.longitude_deg + corner_east * east,
            relative_altitude_m=3.0, speed_m_s=3.0, is_fly_through=corner_north == corner_east,
            yaw_deg=90.0, loiter_time_s=math.nan if corner_north == corner_east else 0.5,
        )
        for corner_north, corner_east in ((1, 0), (1, 1), (0, 1), (0, 0))
    ])  # fmt: skip


async def until_reached(drone: Drone, count: int) -> None:
    """Wait until ``count`` items of MAVSDK's are done."""
    await drone.until(
        f"item {count}",
        drone.mission.subscribe_mission_progress(),
        lambda progress: progress.current >= count,
    )


@story(by_night=(GROUND, TCP))
async def test_a_mission_comes_back_as_it_went(drone: Drone) -> None:
    plan = await square(drone)
    await drone.mission.upload_mission(plan)
    back = await drone.mission.download_mission()
    assert len(back.mission_items) == 4
    for sent, got in zip(plan.mission_items, back.mission_items, strict=True):
        assert got.latitude_deg == pytest.approx(sent.latitude_deg, abs=1e-7)
        assert got.longitude_deg == pytest.approx(sent.longitude_deg, abs=1e-7)
        assert got.relative_altitude_m == sent.relative_altitude_m
        assert got.speed_m_s == sent.speed_m_s
        assert got.yaw_deg == sent.yaw_deg
        assert got.is_fly_through == sent.is_fly_through
    await drone.mission.clear_mission()
    assert (await drone.mission.download_mission()).mission_items == []


@story(speeds=(1, 10))
async def test_a_mission_is_flown_to_its_end(drone: Drone) -> None:
    await drone.mission.set_return_to_launch_after_mission(False)
    await drone.mission.upload_mission(await square(drone))
    await drone.arm()
    await drone.mission.start_mission()
    await until_reached(drone, 4)
    assert await drone.mission.is_mission_finished()
    await drone.until_mode("HOLD")
    await drone.land()
    await drone.mission.clear_mission()


@story(links=(TCP,))
async def test_a_mission_is_paused_continued_and_jumped_in(drone: Drone) -> None:
    await drone.mission.set_return_to_launch_after_mission(False)
    await drone.mission.upload_mission(await square(drone, side_m=12.0))
    await drone.arm()
    await drone.mission.start_mission()
    await until_reached(drone, 1)
    await drone.mission.pause_mission()
    await drone.until_mode("HOLD")
    assert not await drone.mission.is_mission_finished()
    await drone.mission.set_current_mission_item(3)
    await drone.mission.start_mission()
    await until_reached(drone, 4)
    assert await drone.mission.is_mission_finished()
    await drone.land()
    await drone.mission.clear_mission()


@story()
async def test_a_mission_ends_with_a_return_if_asked_to(drone: Drone) -> None:
    await drone.mission.set_return_to_launch_after_mission(True)
    await drone.action.set_return_to_launch_altitude(4.0)
    await drone.mission.upload_mission(await square(drone))
    await drone.arm()
    returning = drone.later_mode("RETURN_TO_LAUNCH")
    await drone.mission.start_mission()
    await until_reached(drone, 4)
    await returning
    await drone.until_disarmed()
    await drone.mission.set_return_to_launch_after_mission(False)
    await drone.mission.clear_mission()


@story()
async def test_a_plan_of_qgroundcontrol_is_flown_raw(drone: Drone) -> None:
    raw = drone.mission_raw
    plan = await raw.import_qgroundcontrol_mission(str(SQUARE))
    await raw.upload_mission(plan.mission_items)
    back = await raw.download_mission()
    wire = ("seq", "command", "x", "y", "z", "param1", "param2", "param3", "param4")
    for sent, got in zip(plan.mission_items, back, strict=True):
        for name in wire:
            value = getattr(sent, name)
            assert getattr(got, name) == pytest.approx(value, nan_ok=True), (sent.seq, name)
    await drone.arm()
    await raw.start_mission()
    await drone.until(
        "the last item",
        raw.subscribe_mission_progress(),
        lambda progress: progress.current >= progress.total - 1,
    )
    await drone.until_disarmed()
    await raw.clear_mission()


@story()
async def test_a_mission_that_cannot_be_flown_is_refused_and_the_old_one_stays(drone: Drone) -> None:
    good = await square(drone)
    await drone.mission.upload_mission(good)
    far = await square(drone, side_m=100_000.0)
    with pytest.raises(MissionError):
        await drone.mission.upload_mission(far)
    back = await drone.mission.download_mission()
    assert back.mission_items[0].latitude_deg == pytest.approx(good.mission_items[0].latitude_deg, abs=1e-7)
    await drone.mission.clear_mission()


@story(by_night=(TCP,))
async def test_places_beyond_the_geofence_are_denied(drone: Drone) -> None:
    home = await drone.until("home", drone.telemetry.subscribe_home())
    north, east = home.latitude_deg, home.longitude_deg
    corner = 40.0 / METRES_A_DEGREE
    fence = GeofenceData(
        [
            Polygon(
                [
                    Point(north + a * corner, east + b * corner)
                    for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))
                ],
                FenceType.INCLUSION,
            )
        ],
        [Circle(Point(north + corner, east), 20.0, FenceType.EXCLUSION)],
    )
    await drone.geofence.upload_geofence(fence)
    await drone.take_off()
    for away in (corner, -2 * corner):
        with pytest.raises(ActionError) as refused:
            await drone.action.goto_location(north + away, east, home.absolute_altitude_m + 3.0, 0.0)
        assert refused.value.result.name == "COMMAND_DENIED"
    await drone.action.goto_location(north - corner / 4, east, home.absolute_altitude_m + 3.0, 0.0)
    await drone.land()
    await drone.geofence.clear_geofence()


@story()
async def test_fence_and_rally_points_come_back(drone: Drone) -> None:
    home = await drone.until("home", drone.telemetry.subscribe_home())
    x, y = round(home.latitude_deg * 1e7), round(home.longitude_deg * 1e7)
    # at home: MAVSDK cannot clear rally points, and later flights return to the nearest place
    rally = [RawItem(0, 3, 5100, 1, 1, 0.0, 0.0, 0.0, 0.0, x, y, 10.0, 2)]
    fence = [RawItem(0, 0, 5003, 1, 1, 100.0, 0.0, 0.0, 0.0, x, y, 0.0, 1)]
    await drone.mission_raw.upload_rally_points(rally)
    await drone.mission_raw.upload_geofence(fence)
    for sent, back in (
        (rally, await drone.mission_raw.download_rallypoints()),
        (fence, await drone.mission_raw.download_geofence()),
    ):
        assert [(item.command, item.x, item.y, item.param1) for item in back] == [
            (item.command, item.x, item.y, item.param1) for item in sent
        ]
    await drone.geofence.clear_geofence()
