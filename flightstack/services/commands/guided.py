"""Commands that fly the vehicle directly: takeoff, landing, return, another place, another speed."""

from __future__ import annotations

import math

from flightstack.commander.transitions import Event, Need
from flightstack.core.enums import Mode
from flightstack.core.geodesy import GeoPoint
from flightstack.core.portable_math import distance
from flightstack.guidance.safe_places import plan_limits
from flightstack.mavlink.dialect import mavlink
from flightstack.services.commands.command_server import Command
from flightstack.services.commands.context import (
    ACCEPTED,
    DENIED,
    REJECTED,
    RELATIVE_FRAMES,
    Answer,
    Handler,
    VehicleContext,
    answer_to,
    frame_answer,
)

CHANGE_MODE, RELATIVE_YAW = 1, 2
"""Bits of DO_REPOSITION's second parameter."""
GROUND_TOLERANCE_M = 0.05
"""An altitude above sea level comes as a 32-bit float; and the ground gives way by less than this."""
NO_CHANGE, DEFAULT = -1.0, -2.0
"""Speeds of DO_CHANGE_SPEED that are none."""
_SPEED_TYPES = {0.0: "cruise_m_s", 1.0: "cruise_m_s", 2.0: "climb_m_s", 3.0: "descent_m_s"}


def above_home_m(vehicle: VehicleContext, command: Command) -> float:
    """Return parameter 7 as altitude above home; NaN stays NaN.

    It is above sea level, as PX4 takes it, unless a COMMAND_INT's frame says that it is above home.
    """
    altitude_m = command.params[6]
    return altitude_m if command.frame in RELATIVE_FRAMES else altitude_m - vehicle.area.home.altitude_m


def take_off(vehicle: VehicleContext, command: Command) -> Answer:
    """NAV_TAKEOFF: parameter 7 is the altitude; NaN means MIS_TAKEOFF_ALT. The place is where the vehicle stands.

    A generic autopilot's is above home, as clients that do not know PX4 mean it, unless a frame says otherwise.
    """
    unsupported = frame_answer(command)
    if unsupported is not None:
        return unsupported
    altitude_m = command.params[6]
    is_plain = vehicle.is_generic and command.frame is None
    if not is_plain and command.frame not in RELATIVE_FRAMES:
        altitude_m -= vehicle.takeoff.home_altitude_m
    if math.isinf(altitude_m):
        return Answer(DENIED, "the takeoff altitude is not a number")
    wanted = None if math.isnan(altitude_m) else altitude_m
    return answer_to(vehicle.requests.request(Event.SELECT_TAKEOFF, wanted))


def brings_down(event: Event) -> Handler:
    """Return the handler of a command that ends a flight: unlike the choice of its mode, it needs one."""

    def handle(vehicle: VehicleContext, command: Command) -> Answer:
        armed = vehicle.now.status.armed
        return answer_to(vehicle.requests.request(event) if armed else Need.ARMED.value)

    return handle


def reposition(vehicle: VehicleContext, command: Command) -> Answer:
    """DO_REPOSITION: hold at another place, as PX4 does; NaN leaves a number as it is, all NaN is a pause.

    Ground speed [m/s] or −1, flags, –, heading [rad], latitude, longitude, altitude. Without the flag that changes
    the mode the vehicle must hold already.
    """
    speed, flags, _, yaw_rad, latitude, longitude, _ = command.params
    unsupported = frame_answer(command)
    if unsupported is not None:
        return unsupported
    bits = int(flags) if math.isfinite(flags) and 0.0 <= flags < 256.0 else 0
    if not bits & CHANGE_MODE and vehicle.now.status.mode is not Mode.HOLD:
        return Answer(REJECTED, "the vehicle is not in hold mode")
    altitude_m = above_home_m(vehicle, command)
    refusal = _not_a_place(latitude, longitude, altitude_m, yaw_rad)
    if refusal is not None:
        return Answer(DENIED, refusal)
    home_m = vehicle.area.home.altitude_m
    place = vehicle.frame.to_ned(GeoPoint(latitude, longitude, home_m + altitude_m))
    is_pause = math.isnan(latitude) and math.isnan(altitude_m)
    refusal = None if is_pause else _out_of_reach(vehicle, place.x, place.y, altitude_m)
    if refusal is not None:
        return Answer(DENIED, refusal)
    if bits & RELATIVE_YAW:
        yaw_rad += float(vehicle.now.setpoint[9])
    return answer_to(vehicle.requests.go_to(*place, yaw_rad, speed if math.isfinite(speed) else math.nan))


def _not_a_place(latitude: float, longitude: float, altitude_m: float, yaw_rad: float) -> str | None:
    """Tell what is wrong with the numbers of a place; NaN is not, where it may stand."""
    if math.isnan(latitude) != math.isnan(longitude):
        return "latitude and longitude are given together or not at all"
    if abs(latitude) > 90.0 or abs(longitude) > 180.0:
        return "the position is not on earth"
    if math.isinf(altitude_m) or abs(yaw_rad) > 1e3:
        return "altitude or heading is not a number"
    return None


def _out_of_reach(vehicle: VehicleContext, north_m: float, east_m: float, altitude_m: float) -> str | None:
    """Tell why the vehicle does not go to a place: the limits of a mission, the ground and the geofence."""
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
    valley_m = max(0.0, area.ground_m(x, y) - home_m - here[2])  # the vehicle is below what counts as ground
    if altitude_m < ground_m - valley_m - GROUND_TOLERANCE_M:
        return f"altitude {altitude_m:.6g} m above home is below the ground, which is at {ground_m:.4g} m"
    refusal = area.way_refusal(here, (north_m, east_m, altitude_m))
    return None if refusal is None else f"the place {refusal}"


def change_speed(vehicle: VehicleContext, command: Command) -> Answer:
    """DO_CHANGE_SPEED: which (0 and 1 horizontal, 2 climb, 3 descent), then m/s, −1 no change, −2 the default."""
    which, speed = command.params[0], command.params[1]
    field = _SPEED_TYPES.get(which)
    if field is None:
        return Answer(DENIED, "the type of speed is not 0 to 3")
    if speed == NO_CHANGE:
        return Answer(ACCEPTED)
    if speed != DEFAULT and not 0.0 < speed < math.inf:
        return Answer(DENIED, "the speed is not positive")
    wanted = math.nan if speed == DEFAULT else speed
    vehicle.requests.set_speeds(**{field: wanted})
    return Answer(ACCEPTED)


def pause_or_continue(vehicle: VehicleContext, command: Command) -> Answer:
    """DO_PAUSE_CONTINUE: 0 holds, 1 goes on with the mission."""
    wanted = command.params[0]
    if wanted not in (0.0, 1.0):
        return Answer(DENIED, "parameter 1 must be 0 (pause) or 1 (continue)")
    event = Event.SELECT_MISSION if wanted else Event.SELECT_HOLD
    return answer_to(vehicle.requests.request(event))


HANDLERS: dict[int, Handler] = {
    mavlink.MAV_CMD_NAV_TAKEOFF: take_off,
    mavlink.MAV_CMD_NAV_LAND: brings_down(Event.SELECT_LAND),
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: brings_down(Event.SELECT_RETURN),
    mavlink.MAV_CMD_DO_REPOSITION: reposition,
    mavlink.MAV_CMD_DO_CHANGE_SPEED: change_speed,
    mavlink.MAV_CMD_DO_PAUSE_CONTINUE: pause_or_continue,
}
