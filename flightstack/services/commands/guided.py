"""Guided flight: takeoff, land, return, reposition, change of speed, pause; and guided mission items.

Older clients of ArduPilot reposition the vehicle by mission items: current 2 gives a position (dronekit's
``simple_goto``), current 3 an altitude. Each is answered with MISSION_ACK. Newer clients use DO_REPOSITION.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping

from flightstack.commander.transitions import Event, Need
from flightstack.core.enums import Mode, Severity
from flightstack.core.geodesy import GeoPoint
from flightstack.core.portable_math import distance
from flightstack.guidance.safe_places import plan_limits
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address, Message, is_for, sender
from flightstack.mavlink.mission_messages import CHANGES_ALTITUDE, GOES_THERE, ack_message
from flightstack.plan.commands import MissionResult, MissionType
from flightstack.services.commands.context import (
    ACCEPTED,
    DENIED,
    REJECTED,
    RELATIVE_FRAMES,
    UNSUPPORTED_FRAME,
    Answer,
    Command,
    Handler,
    VehicleContext,
    answer_to,
    frame_answer,
)

CHANGE_MODE, RELATIVE_YAW = 1, 2
"""Bits of parameter 2 of DO_REPOSITION."""
GROUND_TOLERANCE_M = 0.05
"""Covers the rounding of an altitude AMSL in a 32-bit float and the compression of the ground contact."""
NO_CHANGE, DEFAULT = -1.0, -2.0
"""Special values of the speed in DO_CHANGE_SPEED."""
_SPEED_TYPES = {0.0: "cruise_m_s", 1.0: "cruise_m_s", 2.0: "climb_m_s", 3.0: "descent_m_s"}
_RESULTS: Mapping[int, MissionResult] = {
    ACCEPTED: MissionResult.ACCEPTED,
    DENIED: MissionResult.DENIED,
    UNSUPPORTED_FRAME: MissionResult.UNSUPPORTED_FRAME,
}
DEGREES = 1e-7
"""Unit of latitude and longitude in MISSION_ITEM_INT [deg]."""


def above_home_m(vehicle: VehicleContext, command: Command) -> float:
    """Return parameter 7 as altitude above home [m]; NaN stays NaN.

    As in PX4, the parameter is AMSL, unless the frame of a COMMAND_INT is relative to home.
    """
    altitude_m = command.params[6]
    return altitude_m if command.frame in RELATIVE_FRAMES else altitude_m - vehicle.area.home.altitude_m


def take_off(vehicle: VehicleContext, command: Command) -> Answer:
    """NAV_TAKEOFF: parameter 7 is the altitude; NaN stands for MIS_TAKEOFF_ALT. The position is ignored.

    For a generic autopilot a COMMAND_LONG's altitude is above home, as clients of other stacks than PX4 send it.
    """
    unsupported = frame_answer(command)
    if unsupported is not None:
        return unsupported
    altitude_m = command.params[6]
    is_above_home = vehicle.is_generic and command.frame is None
    if not is_above_home and command.frame not in RELATIVE_FRAMES:
        altitude_m -= vehicle.takeoff.home_altitude_m
    if math.isinf(altitude_m):
        return Answer(DENIED, "the takeoff altitude is not a number")
    altitude = None if math.isnan(altitude_m) else altitude_m
    return answer_to(vehicle.requests.request(Event.SELECT_TAKEOFF, altitude))


def request_if_armed(event: Event) -> Handler:
    """Return the handler of a command that requests ``event`` and, unlike a mode change, needs an armed vehicle."""

    def handle(vehicle: VehicleContext, command: Command) -> Answer:
        armed = vehicle.now.status.armed
        return answer_to(vehicle.requests.request(event) if armed else Need.ARMED.value)

    return handle


def reposition(vehicle: VehicleContext, command: Command) -> Answer:
    """DO_REPOSITION: fly to a position and hold there, as PX4 does; NaN keeps a value, all NaN is a pause.

    Parameters: ground speed [m/s] or −1, flags, –, heading [rad], latitude, longitude, altitude. Without the flag
    CHANGE_MODE the vehicle must be in hold mode.
    """
    speed, flags, _, yaw_rad, latitude, longitude, _ = command.params
    unsupported = frame_answer(command)
    if unsupported is not None:
        return unsupported
    bits = int(flags) if math.isfinite(flags) and 0.0 <= flags < 256.0 else 0
    if not bits & CHANGE_MODE and vehicle.now.status.mode is not Mode.HOLD:
        return Answer(REJECTED, "the vehicle is not in hold mode")
    altitude_m = above_home_m(vehicle, command)
    refusal = _position_fault(latitude, longitude, altitude_m, yaw_rad)
    if refusal is not None:
        return Answer(DENIED, refusal)
    home_m = vehicle.area.home.altitude_m
    place = vehicle.frame.to_ned(GeoPoint(latitude, longitude, home_m + altitude_m))
    is_pause = math.isnan(latitude) and math.isnan(altitude_m)
    refusal = None if is_pause else _position_refusal(vehicle, place.x, place.y, altitude_m)
    if refusal is not None:
        return Answer(DENIED, refusal)
    if bits & RELATIVE_YAW:
        yaw_rad += float(vehicle.now.setpoint[9])
    return answer_to(vehicle.requests.go_to(*place, yaw_rad, speed if math.isfinite(speed) else math.nan))


def _position_fault(latitude: float, longitude: float, altitude_m: float, yaw_rad: float) -> str | None:
    """Return the fault in the numbers of a position, or None. NaN keeps a value."""
    if math.isnan(latitude) != math.isnan(longitude):
        return "latitude and longitude are given together or not at all"
    if abs(latitude) > 90.0 or abs(longitude) > 180.0:
        return "the position is not on earth"
    if math.isinf(altitude_m) or abs(yaw_rad) > 1e3:
        return "altitude or heading is not a number"
    return None


def _position_refusal(
    vehicle: VehicleContext, north_m: float, east_m: float, altitude_m: float
) -> str | None:
    """Return the reason that the vehicle refuses a position (mission limits, ground, geofence), or None."""
    area, limits = vehicle.area, plan_limits(vehicle.now.behaviour)
    home_m = area.home_above_origin_m
    x, y, z = vehicle.now.state[:3].tolist()
    if 0.0 < limits.max_altitude_m < altitude_m:
        return f"altitude {altitude_m:.6g} m is above {limits.max_altitude_m:g} m"
    away_m = distance(north_m - x, east_m - y)
    if 0.0 < limits.max_distance_m < away_m:
        return f"the place is {away_m / 1e3:.1f} km away, farther than MIS_DIST_WPS allows"
    here = (x, y, -z - home_m)
    if math.isnan(north_m):
        north_m, east_m = x, y
    if math.isnan(altitude_m):
        altitude_m = here[2]
    ground_m = area.ground_m(north_m, east_m) - home_m
    below_m = max(0.0, area.ground_m(x, y) - home_m - here[2])  # of the vehicle, under the estimated ground
    if altitude_m < ground_m - below_m - GROUND_TOLERANCE_M:
        return f"altitude {altitude_m:.6g} m above home is below the ground, which is at {ground_m:z.4g} m"
    refusal = area.way_refusal(here, (north_m, east_m, altitude_m))
    return None if refusal is None else f"the place {refusal}"


def change_speed(vehicle: VehicleContext, command: Command) -> Answer:
    """DO_CHANGE_SPEED: parameter 1 is the type (0 and 1 horizontal, 2 climb, 3 descent), 2 the speed [m/s].

    A speed of −1 changes nothing, −2 restores the default.
    """
    speed_type, speed = command.params[0], command.params[1]
    field = _SPEED_TYPES.get(speed_type)
    if field is None:
        return Answer(DENIED, "the type of speed is not 0 to 3")
    if speed == NO_CHANGE:
        return Answer(ACCEPTED)
    if speed != DEFAULT and not 0.0 < speed < math.inf:
        return Answer(DENIED, "the speed is not positive")
    vehicle.requests.set_speeds(**{field: math.nan if speed == DEFAULT else speed})
    return Answer(ACCEPTED)


def pause_or_continue(vehicle: VehicleContext, command: Command) -> Answer:
    """DO_PAUSE_CONTINUE: parameter 1 is 0 to hold, 1 to continue the mission."""
    action = command.params[0]
    if action not in (0.0, 1.0):
        return Answer(DENIED, "parameter 1 must be 0 (pause) or 1 (continue)")
    event = Event.SELECT_MISSION if action else Event.SELECT_HOLD
    return answer_to(vehicle.requests.request(event))


HANDLERS: dict[int, Handler] = {
    mavlink.MAV_CMD_NAV_TAKEOFF: take_off,
    mavlink.MAV_CMD_NAV_LAND: request_if_armed(Event.SELECT_LAND),
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: request_if_armed(Event.SELECT_RETURN),
    mavlink.MAV_CMD_DO_REPOSITION: reposition,
    mavlink.MAV_CMD_DO_CHANGE_SPEED: change_speed,
    mavlink.MAV_CMD_DO_PAUSE_CONTINUE: pause_or_continue,
}


class GuidedItems:
    """Executes guided items as DO_REPOSITION."""

    handles = frozenset({"MISSION_ITEM", "MISSION_ITEM_INT"})

    def __init__(self, own: Address, vehicle: VehicleContext) -> None:
        self._own = own
        self._vehicle = vehicle
        self._outbox: list[tuple[Hashable | None, Message]] = []

    def receive(self, message: Message, peer: Hashable, now_s: float) -> None:
        """Execute a guided item; ignore other items."""
        if message.current not in (GOES_THERE, CHANGES_ALTITUDE) or not is_for(message, self._own):
            return
        result = MissionResult.UNSUPPORTED
        if message.command == mavlink.MAV_CMD_NAV_WAYPOINT and message.mission_type == MissionType.MISSION:
            answer = self._go(message, peer)
            result = _RESULTS.get(answer.result, MissionResult.ERROR)
            if answer.reason:
                self._vehicle.journal.say(Severity.WARNING, f"Goto refused: {answer.reason}")
        ack = ack_message(sender(message), result, message.mission_type, 0)
        self._outbox.append((peer, ack))

    def _go(self, message: Message, peer: Hashable) -> Answer:
        """Execute DO_REPOSITION with the position of the item. As in ArduPilot, its heading is ignored."""
        scale = DEGREES if message.get_type() == "MISSION_ITEM_INT" else 1.0
        place = (message.x * scale, message.y * scale)
        if message.current == CHANGES_ALTITUDE:
            place = (math.nan, math.nan)
        params = (-1.0, float(CHANGE_MODE), 0.0, math.nan, *place, float(message.z))
        number = mavlink.MAV_CMD_DO_REPOSITION
        return reposition(
            self._vehicle, Command(number, params, True, message.frame, peer, sender(message), 0)
        )

    def poll(self, now_s: float) -> list[tuple[Hashable | None, Message]]:
        """Return the acknowledgements."""
        outbox, self._outbox = self._outbox, []
        return outbox

    def next_deadline(self) -> float | None:
        """Return −inf while an acknowledgement is queued, else None."""
        return -math.inf if self._outbox else None
