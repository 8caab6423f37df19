"""QGroundControl's plans: mission, geofence and rally points, up and down."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from flightstack.mavlink.dialect import mavlink
from tests.interop.qgc_link import AUTOPILOT, Station

ACK_TIMEOUT_S, ITEM_TIMEOUT_S, MOST_RETRIES = 1.5, 0.25, 5
"""MissionManager/PlanManager.h."""
MISSION, FENCE, RALLY = 0, 1, 2
GLOBAL, MISSION_FRAME, RELATIVE = 0, 2, 3
_REQUESTS = ("MISSION_REQUEST", "MISSION_REQUEST_INT")


class Item(NamedTuple):
    """MissionManager/MissionItem.h; places in degrees and metres."""

    command: int
    frame: int
    params: tuple[float, ...]
    autocontinue: bool = True


class PlanManager:
    """MissionManager/PlanManager.cc for one type of plan."""

    def __init__(self, station: Station, plan_type: int) -> None:
        self._station = station
        self._type = plan_type
        self.items: list[Item] = []

    # ------------------------------------------------------------------ reading

    def load(self) -> list[Item]:
        """Return the vehicle's plan: loadFromVehicle, _handleMissionCount, _handleMissionItem."""
        to = self._station.system, AUTOPILOT
        count = self._ask(
            mavlink.MAVLink_mission_request_list_message(*to, self._type), "MISSION_COUNT", ACK_TIMEOUT_S
        ).count
        self.items = []
        for seq in range(count):
            request = mavlink.MAVLink_mission_request_int_message(*to, seq, self._type)
            message = self._ask(request, "MISSION_ITEM_INT", ITEM_TIMEOUT_S, seq)
            self.items.append(read_item(message))
        accepted = mavlink.MAV_MISSION_ACCEPTED  # _readTransactionComplete
        self._station.send(mavlink.MAVLink_mission_ack_message(*to, accepted, self._type))
        return self.items

    def _ask(self, request: Any, kind: str, timeout_s: float, seq: int | None = None) -> Any:
        """Send until it is answered (_ackTimeout); an acknowledgement instead is an error (_handleMissionAck)."""
        for _ in range(2 + MOST_RETRIES):
            self._station.send(request)
            answer = self._station.wait(
                kind, "MISSION_ACK", within_s=timeout_s, holds=lambda answer: self._is_next(answer, seq)
            )
            if answer is not None:
                assert answer.get_type() == kind, f"refused: {answer}"
                return answer
        raise AssertionError(f"no {kind} of plan {self._type}, item {seq}: maximum retries exceeded")

    def _is_next(self, answer: Any, seq: int | None) -> bool:
        return answer.mission_type == self._type and seq in (None, getattr(answer, "seq", seq))

    # ------------------------------------------------------------------ writing

    def write(self, items: Sequence[Item], lost: Sequence[int] = ()) -> int:
        """Send a plan and return the result: _writeMissionItemsWorker, _handleMissionRequest, _handleMissionAck.

        MISSION_COUNT is repeated until the first item was asked for. From then on nothing is: an item that
        is lost comes again only when the vehicle asks again. ``lost``: items that the link loses once.
        """
        self.items = list(items)
        to_lose = set(lost)
        unsent = set(range(len(items)))
        retries = 0
        self._write_count()
        while True:
            message = self._station.wait(
                *_REQUESTS,
                "MISSION_ACK",
                within_s=ACK_TIMEOUT_S,
                holds=lambda m: m.mission_type == self._type,
            )
            if message is None:
                assert unsent == set(range(len(items))), f"the vehicle did not request all: {unsent}"
                assert unsent, "the vehicle failed to send the final acknowledgement"
                retries += 1
                assert retries <= MOST_RETRIES + 1, "mission count failed, maximum retries exceeded"
                self._write_count()
            elif message.get_type() == "MISSION_ACK":
                assert message.type != mavlink.MAV_MISSION_ACCEPTED or not unsent, "accepted before its end"
                return int(message.type)
            else:
                assert message.seq < len(items), "item requested outside range"
                unsent.discard(message.seq)
                if message.seq in to_lose:
                    to_lose.discard(message.seq)
                    continue
                self._station.send(self._message(message.seq, self.items[message.seq]))

    def _write_count(self) -> None:
        to = self._station.system, AUTOPILOT
        self._station.send(mavlink.MAVLink_mission_count_message(*to, len(self.items), self._type))

    def _message(self, seq: int, item: Item) -> Any:
        scale = 1.0 if item.frame == MISSION_FRAME else 1e7
        x, y = (int(value * scale) for value in item.params[4:6])
        return mavlink.MAVLink_mission_item_int_message(
            self._station.system, AUTOPILOT, seq, item.frame, item.command, seq == 0, item.autocontinue,
            *item.params[:4], x, y, item.params[6], self._type,
        )  # fmt: skip

    def remove_all(self) -> int:
        """Clear the vehicle's plan: removeAll, _removeAllWorker."""
        self.items = []
        for _ in range(2 + MOST_RETRIES):
            self._station.send(
                mavlink.MAVLink_mission_clear_all_message(self._station.system, AUTOPILOT, self._type)
            )
            ack = self._station.wait(
                "MISSION_ACK", within_s=ACK_TIMEOUT_S, holds=lambda ack: ack.mission_type == self._type
            )
            if ack is not None:
                return int(ack.type)
        raise AssertionError("mission remove all: maximum retries exceeded")


def read_item(message: Any) -> Item:
    """PlanManager.cc, _handleMissionItem: INT frames become those without."""
    scale = 1.0 if message.frame == MISSION_FRAME else 1e-7
    frame = {5: GLOBAL, 6: RELATIVE}.get(message.frame, message.frame)
    first = (message.param1, message.param2, message.param3, message.param4)
    place = (message.x * scale, message.y * scale, message.z)
    return Item(message.command, frame, (*first, *place), bool(message.autocontinue))


def without_home(items: Sequence[Item]) -> list[Item]:
    """PlanManager.cc, writeMissionItems: PX4 gets no home (item 0), so that the targets of jumps move too."""
    return [
        item._replace(params=(item.params[0] - 1.0, *item.params[1:]))
        if item.command == mavlink.MAV_CMD_DO_JUMP
        else item
        for item in items[1:]
    ]


def resume_items(items: Sequence[Item], resume: int) -> list[Item]:
    """MissionManager.cc, generateResumeMission: takeoff and speeds of before, then all from ``resume`` on."""
    assert all(item.command != mavlink.MAV_CMD_DO_JUMP for item in items)
    kept = (mavlink.MAV_CMD_NAV_TAKEOFF, mavlink.MAV_CMD_DO_CHANGE_SPEED)
    return [item for index, item in enumerate(items) if index >= resume or item.command in kept]


# ---------------------------------------------------------------------- geofence and rally points


class FencePolygon(NamedTuple):
    """Corners in degrees."""

    corners: tuple[tuple[float, float], ...]
    inclusion: bool = True


class FenceCircle(NamedTuple):
    """Centre in degrees, radius in metres."""

    centre: tuple[float, float]
    radius_m: float
    inclusion: bool = True


class Fence(NamedTuple):
    """MissionManager/GeoFenceManager.h; the return point is latitude, longitude, altitude above home."""

    polygons: tuple[FencePolygon, ...] = ()
    circles: tuple[FenceCircle, ...] = ()
    return_point: tuple[float, float, float] | None = None


_POLYGON = {
    True: mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION,
    False: mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION,
}
_CIRCLE = {
    True: mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION,
    False: mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION,
}


def fence_items(fence: Fence) -> list[Item]:
    """GeoFenceManager.cc, sendToVehicle: corners and circles in frame GLOBAL, no continuing."""
    items = []
    for polygon in fence.polygons:
        count = float(len(polygon.corners))
        for corner in polygon.corners:
            items.append(Item(_POLYGON[polygon.inclusion], GLOBAL, (count, 0, 0, 0, *corner, 0), False))
    for circle in fence.circles:
        params = (circle.radius_m, 0, 0, 0, *circle.centre, 0)
        items.append(Item(_CIRCLE[circle.inclusion], GLOBAL, params, False))
    if fence.return_point is not None:
        point = (0, 0, 0, 0, *fence.return_point)
        items.append(Item(mavlink.MAV_CMD_NAV_FENCE_RETURN_POINT, RELATIVE, point, False))
    return items


def read_fence(items: Sequence[Item]) -> Fence:
    """GeoFenceManager.cc, _planManagerLoadComplete: what it cannot read it calls an error."""
    fence = Fence()
    corners: list[tuple[float, float]] = []
    for item in items:
        place = (item.params[4], item.params[5])
        if item.command in _POLYGON.values():
            corners.append(place)
            if len(corners) == int(item.params[0]):
                inclusion = item.command == _POLYGON[True]
                fence = fence._replace(polygons=(*fence.polygons, FencePolygon(tuple(corners), inclusion)))
                corners = []
            continue
        assert not corners, "incomplete polygon loaded"
        if item.command in _CIRCLE.values():
            circle = FenceCircle(place, item.params[0], item.command == _CIRCLE[True])
            fence = fence._replace(circles=(*fence.circles, circle))
        else:
            assert item.command == mavlink.MAV_CMD_NAV_FENCE_RETURN_POINT, f"unsupported command {item}"
            fence = fence._replace(return_point=(*place, item.params[6]))
    return fence


def rally_items(points: Sequence[tuple[float, float, float]]) -> list[Item]:
    """RallyPointManager.cc, sendToVehicle."""
    return [Item(mavlink.MAV_CMD_NAV_RALLY_POINT, RELATIVE, (0, 0, 0, 0, *point), False) for point in points]


def read_rally(items: Sequence[Item]) -> list[tuple[float, ...]]:
    """RallyPointManager.cc, _planManagerLoadComplete."""
    assert all(item.command == mavlink.MAV_CMD_NAV_RALLY_POINT for item in items)
    return [item.params[4:7] for item in items]


def same_item(one: Item, other: Item) -> bool:
    """Tell whether an item came back as it went: places to 1e-7 degrees, the rest as floats, NaN as NaN."""
    if one[:2] != other[:2]:
        return False
    return all(
        (math.isnan(mine) and math.isnan(theirs))
        or math.isclose(mine, theirs, rel_tol=0.0 if index in (4, 5) else 1e-6, abs_tol=1.5e-7)
        for index, (mine, theirs) in enumerate(zip(one.params, other.params, strict=True))
    )
