"""QGroundControl's guided actions and plans at ten times real time, over UDP and over TCP."""

from __future__ import annotations

import math
from collections.abc import Iterator

import pytest

from flightstack.mavlink.dialect import mavlink
from tests.interop.qgc_actions import HOLD, LAND, MISSION, RETURN, TAKEOFF, Actions
from tests.interop.qgc_commands import ACCEPTED, Commands
from tests.interop.qgc_link import Station, TcpPort, UdpPort
from tests.interop.qgc_plans import (
    FENCE,
    MISSION_FRAME,
    RALLY,
    RELATIVE,
    Fence,
    FenceCircle,
    FencePolygon,
    Item,
    PlanManager,
    fence_items,
    rally_items,
    read_fence,
    read_rally,
    resume_items,
    same_item,
    without_home,
)
from tests.interop.qgc_plans import (
    MISSION as MISSION_PLAN,
)
from tests.interop.stack import RealVehicle
from tests.support.tools import NIGHTLY

HOME = (47.397742, 8.545594)
NORTH_DEG, EAST_DEG = 6.0 / 111_195.0, 6.0 / 75_265.0
"""Six metres of latitude, and of longitude at home's latitude."""
NORTH = (HOME[0] + NORTH_DEG, HOME[1])
EAST = (HOME[0], HOME[1] + EAST_DEG)
NAN = math.nan
CORNERS = ((47.397, 8.545), (47.3985, 8.545), (47.3985, 8.5465), (47.397, 8.5465))
FENCE_DRAWN = Fence(
    (FencePolygon(CORNERS), FencePolygon(((47.3981, 8.5461), (47.3983, 8.5461), (47.3982, 8.5463)), False)),
    (FenceCircle((47.39775, 8.5456), 80.0), FenceCircle((47.3973, 8.5452), 4.5, False)),
    (47.39774, 8.54559, 12.0),
)
PLAN = [
    Item(16, 0, (0, 0, 0, 0, *HOME, 488.0)),  # the planned home, as MissionSettingsItem.cc puts it first
    Item(22, RELATIVE, (0, 0, 0, NAN, *HOME, 4.0)),
    Item(178, MISSION_FRAME, (1, 3.0, -1, 0, 0, 0, 0)),  # SpeedSection.cc
    Item(16, RELATIVE, (0, 0, 0, NAN, *NORTH, 4.0)),
    Item(16, RELATIVE, (0, 0, 0, NAN, *EAST, 4.0)),
    Item(177, MISSION_FRAME, (3, 1, 0, 0, 0, 0, 0)),  # once again from the item shown as 3
    Item(20, MISSION_FRAME, (0, 0, 0, 0, 0, 0, 0)),
]


class Ground:
    """QGroundControl after it has connected, on one kind of link."""

    def __init__(self, port: UdpPort | TcpPort, vehicle: RealVehicle) -> None:
        self.station = Station(port, 1 + vehicle.instance)
        self.commands = Commands(self.station)
        self.fly = Actions(self.station, self.commands)
        self.mission, self.fence, self.rally = (
            PlanManager(self.station, kind) for kind in (MISSION_PLAN, FENCE, RALLY)
        )
        for kind in ("ALTITUDE", "HOME_POSITION", "EXTENDED_SYS_STATE", "GLOBAL_POSITION_INT"):
            self.station.until(kind)

    def until_altitude(self, relative_m: float) -> None:
        self.station.until(
            "GLOBAL_POSITION_INT", holds=lambda at: abs(at.relative_alt * 1e-3 - relative_m) < 0.2
        )
        self.station.until("ALTITUDE")  # by which QGroundControl reckons, once a second

    def until_mode(self, custom_mode: int) -> None:
        self.station.until("HEARTBEAT", holds=lambda beat: beat.custom_mode == custom_mode)

    def until_disarmed(self) -> None:
        self.station.until("HEARTBEAT", holds=lambda beat: not self.station.armed)
        if self.station.flying:
            self.station.until("EXTENDED_SYS_STATE", holds=lambda state: not self.station.flying)


@pytest.fixture(scope="module", params=["udp", "tcp"] if NIGHTLY else ["udp"])
def ground(request: pytest.FixtureRequest, station_vehicle: RealVehicle) -> Iterator[Ground]:
    port = UdpPort(station_vehicle.gcs_port) if request.param == "udp" else TcpPort(station_vehicle.tcp_port)
    ground = Ground(port, station_vehicle)
    yield ground
    ground.station.close()


def test_guided_actions(ground: Ground) -> None:
    """Takeoff, change of altitude, heading and speed, goto, pause, return: one flight of its user."""
    fly, station = ground.fly, ground.station
    station.until("ALTITUDE")
    begin_m, home = station.altitude_relative_m, station.coordinate  # home is where it arms
    north, east = (home[0] + NORTH_DEG, home[1]), (home[0], home[1] + EAST_DEG)
    assert fly.take_off(4.0) == ACCEPTED
    assert station.armed or station.wait("HEARTBEAT", within_s=1.5, holds=lambda beat: station.armed)
    ground.until_mode(HOLD)  # "takeoff complete"
    ground.until_altitude(begin_m + 4.0)
    assert station.flying
    assert fly.change_altitude(2.0) == ACCEPTED
    ground.until_altitude(begin_m + 6.0)
    assert fly.change_heading(math.pi / 2) == ACCEPTED
    station.until("VFR_HUD", holds=lambda hud: abs(hud.heading - 90) <= 2)
    assert fly.change_speed(2.0) == ACCEPTED
    assert fly.go_to(*north) == ACCEPTED
    fastest_m_s = 0.0
    while abs(station.coordinate[0] - north[0]) > 4e-6:
        place = station.until("GLOBAL_POSITION_INT")
        fastest_m_s = max(fastest_m_s, math.hypot(place.vx, place.vy) * 1e-2)
    assert fastest_m_s == pytest.approx(2.0, abs=0.3)
    assert station.latest["GLOBAL_POSITION_INT"].relative_alt * 1e-3 == pytest.approx(begin_m + 6.0, abs=0.3)
    assert fly.go_to(*east) == ACCEPTED
    assert fly.pause() == ACCEPTED
    station.until("GLOBAL_POSITION_INT", holds=lambda at: math.hypot(at.vx, at.vy) < 10.0)
    assert abs(station.coordinate[1] - east[1]) > 1e-5, "it stopped on its way"
    assert fly.return_home()
    assert station.custom_mode == RETURN
    ground.until_disarmed()
    assert station.coordinate == pytest.approx(home, abs=6e-6)


def test_land_where_it_is(ground: Ground) -> None:
    """startTakeoff, which a joystick button or a custom page calls; then land."""
    assert ground.fly.start_takeoff()
    ground.until_mode(HOLD)
    assert ground.fly.land()
    assert ground.station.custom_mode == LAND
    ground.until_disarmed()


def test_disarming_in_the_air_is_refused_and_the_emergency_stop_is_not(ground: Ground) -> None:
    fly, station = ground.fly, ground.station
    assert fly.set_flight_mode(TAKEOFF)
    assert fly.arm_and_validate()
    station.until(
        "EXTENDED_SYS_STATE", holds=lambda state: state.landed_state == mavlink.MAV_LANDED_STATE_IN_AIR
    )
    station.texts.clear()
    assert fly.arm(False) == mavlink.MAV_RESULT_TEMPORARILY_REJECTED
    station.until_text("Command refused: ")
    assert fly.emergency_stop() == ACCEPTED
    ground.until_disarmed()


def test_plans_go_up_and_come_back(ground: Ground) -> None:
    """PlanMasterController.cc, sendToVehicle: mission, geofence, rally points, one after the other."""
    points = [(47.3978, 8.5457, 8.0), (47.3976, 8.5454, 10.0)]
    plans = (
        (ground.mission, without_home(PLAN)),
        (ground.fence, fence_items(FENCE_DRAWN)),
        (ground.rally, rally_items(points)),
    )
    for manager, items in plans:
        assert manager.write(items) == ACCEPTED, ground.station.texts[-3:]
    for manager, items in plans:
        back = manager.load()
        assert len(back) == len(items)
        assert [pair for pair in zip(items, back, strict=True) if not same_item(*pair)] == []
    assert_same_fence(read_fence(ground.fence.items), FENCE_DRAWN)
    assert [list(point) for point in read_rally(ground.rally.items)] == [
        pytest.approx(point, abs=2e-7) for point in points
    ]
    for manager in (ground.fence, ground.rally):
        assert manager.remove_all() == ACCEPTED
        assert manager.load() == []
    assert len(ground.mission.load()) == len(PLAN) - 1, "the mission is a plan of its own"


def assert_same_fence(one: Fence, other: Fence) -> None:
    for mine, theirs in zip(one.polygons, other.polygons, strict=True):
        assert mine.inclusion == theirs.inclusion
        assert [list(corner) for corner in mine.corners] == [
            pytest.approx(corner, abs=2e-7) for corner in theirs.corners
        ]
    for circle, drawn in zip(one.circles, other.circles, strict=True):
        assert (circle.inclusion, circle.radius_m) == (drawn.inclusion, drawn.radius_m)
        assert circle.centre == pytest.approx(drawn.centre, abs=2e-7)
    assert one.return_point == pytest.approx(other.return_point, abs=2e-7)


def test_items_lost_on_the_way_are_asked_for_again(ground: Ground) -> None:
    """PlanManager.cc, _ackTimeout: by itself it sends no item but the first ever again, and gives up."""
    assert ground.mission.write(without_home(PLAN), lost=(0, 2, len(PLAN) - 2)) == ACCEPTED
    assert len(ground.mission.load()) == len(PLAN) - 1


def test_a_plan_that_is_refused_leaves_the_one_before(ground: Ground) -> None:
    """An unknown command: QGroundControl shows the result, and the vehicle keeps what it had."""
    assert ground.mission.write(without_home(PLAN)) == ACCEPTED
    unknown = [*without_home(PLAN)[:2], Item(31_999, RELATIVE, (0, 0, 0, 0, *HOME, 4.0))]
    assert ground.mission.write(unknown) == mavlink.MAV_MISSION_UNSUPPORTED
    assert len(ground.mission.load()) == len(PLAN) - 1


def test_a_mission_is_started_paused_continued_and_resumed(ground: Ground) -> None:
    """GuidedActionsController.qml: start, pause, continue; after it landed early, resume from where it was."""
    fly, station = ground.fly, ground.station
    items = [item for item in without_home(PLAN) if item.command != mavlink.MAV_CMD_DO_JUMP]
    assert ground.mission.write(items) == ACCEPTED
    assert fly.set_current_item(1) == ACCEPTED
    station.until("MISSION_CURRENT", holds=lambda current: current.seq == 0)
    assert fly.start_mission()
    assert station.until("MISSION_ITEM_REACHED").seq == 0
    assert fly.pause() == ACCEPTED
    ground.until_mode(HOLD)
    assert fly.continue_mission()
    assert station.custom_mode == MISSION
    station.until("MISSION_CURRENT", holds=lambda current: current.seq == 3)
    resume = station.latest[
        "MISSION_CURRENT"
    ].seq  # MissionManager.cc, _handleMissionCurrent: in mission mode
    assert fly.land()
    ground.until_disarmed()
    assert ground.mission.write(resume_items(ground.mission.load(), resume)) == ACCEPTED
    station.texts.clear()
    assert fly.start_mission()
    station.until("MISSION_CURRENT", holds=lambda at: at.mission_state == mavlink.MISSION_STATE_COMPLETE)
    ground.until_disarmed()
    assert [text for text in station.texts if text.startswith("Mission item")] == [
        f"Mission item {seq} reached" for seq in range(4)
    ], "takeoff, speed, the place that was left out, return"
    assert ground.mission.remove_all() == ACCEPTED
