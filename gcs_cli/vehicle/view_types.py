"""State of a vehicle as received by a ground station: immutable values, None if unknown."""

from __future__ import annotations

import math
from typing import Any, NamedTuple, TypeAlias

from gcs_cli.autopilots.autopilot import Autopilot, Role
from gcs_cli.autopilots.registry import autopilot_of
from gcs_cli.vehicle.link_counts import LinkCounts

TEXTS_KEPT = 100
LOST_AFTER_S = 5.0
"""Heartbeat timeout of a vehicle: five missed heartbeats."""
_SMALLEST_USE = 0.02
"""Consumption from which the remaining time is computed; charge is reported in steps of 0.01."""
_POWEROFF, _TERMINATED = 7, 8  # MAV_STATE
_FAILSAFE = (5, 6, _TERMINATED)  # MAV_STATE_CRITICAL, EMERGENCY and FLIGHT_TERMINATION
ON_GROUND, IN_AIR, TAKING_OFF, LANDING = 1, 2, 3, 4
"""MAV_LANDED_STATE."""
_FIXES = {2: "2D fix", 3: "3D fix", 4: "DGPS", 5: "RTK float", 6: "RTK fixed", 7: "static", 8: "PPP"}
"""Names of GPS_FIX_TYPE; smaller numbers are no fix."""
_KINDS = {
    2: ("quadrotor", 4),
    13: ("hexarotor", 6),
    14: ("octorotor", 8),
    15: ("tricopter", 3),
    43: ("multirotor", 0),
}
"""Name and number of rotors by MAV_TYPE."""
NO_MISSION, MISSION_ACTIVE, MISSION_COMPLETE = 1, 3, 5
"""MISSION_STATE."""


class Vector(NamedTuple):
    """A vector; frame and unit are in the name of its field."""

    x: float
    y: float
    z: float


class Identity(NamedTuple):
    """MAVLink address and type of the vehicle."""

    system_id: int
    component_id: int
    vehicle_type: int
    autopilot: int

    @property
    def kind(self) -> str:
        """Name of the type of vehicle."""
        return _KINDS.get(self.vehicle_type, ("vehicle", 0))[0]

    @property
    def rotors(self) -> int | None:
        """Number of rotors of the type of vehicle; None if unknown."""
        return _KINDS.get(self.vehicle_type, ("", 0))[1] or None


class Euler(NamedTuple):
    """Attitude as angles [rad], yaw-pitch-roll order."""

    roll_rad: float
    pitch_rad: float
    yaw_rad: float


class GeoPosition(NamedTuple):
    """WGS 84 position; altitude above mean sea level and above home."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    relative_altitude_m: float


class Setpoint(NamedTuple):
    """Setpoint of the vehicle's guidance; None for values that it does not control."""

    position_ned_m: Vector | None = None
    velocity_ned_m_s: Vector | None = None
    yaw_rad: float | None = None
    is_global: bool = False
    """True if the vehicle sent it as latitude and longitude; the message then ends with the mode."""


class Mission(NamedTuple):
    """Mission progress, in numbers of the plan. ``reached`` is the last item reached, ``state`` a MISSION_STATE."""

    current: int | None = None
    total: int | None = None
    reached: int | None = None
    state: int | None = None
    """None if the vehicle does not report it, as PX4."""
    has_begun: bool = False
    """True once the vehicle was in its mission mode, in this flight."""
    has_ended: bool = False
    """True once the vehicle has reported the mission as complete, or without a state, the last item of it as reached
    in a flight that was observed; False when it begins again."""
    has_returned: bool = False
    """True once the vehicle has changed from its mission mode at the last item to its return mode; False if it leaves
    that mode, or disarms, in the air."""
    return_item: int | None = None
    """The last return among the items that the vehicle has sent."""
    items_id: int | None = None
    """The id of the mission whose items the vehicle has sent: MISSION_COUNT.opaque_id, 0 without ids."""
    mission_id: int | None = None
    """MISSION_CURRENT.mission_id, 0 without ids."""

    @property
    def is_at_last(self) -> bool:
        """True if the last item is the current one."""
        return self.current is not None and bool(self.total) and self.current + 1 == self.total

    @property
    def ends_with_return(self) -> bool:
        """True if the vehicle has sent the items of this mission, and the last one is a return to launch."""
        is_last = self.return_item is not None and self.return_item + 1 == self.total
        return is_last and self.items_id == self.mission_id

    @property
    def is_flown(self) -> bool:
        """True once the mission was flown to its end, or to an unreported final return, until it begins again."""
        return self.has_ended or (self.state is None and self.has_returned and self.ends_with_return)

    @property
    def complete(self) -> bool:
        """True if the vehicle reports the mission as complete, or, if it reports no state, has flown its last item."""
        return self.state == MISSION_COMPLETE or (self.state is None and self.is_flown and self.is_at_last)

    @property
    def is_end_unknown(self) -> bool:
        """True at the last item of a vehicle that reports no state and was not observed to fly it."""
        return self.state is None and self.is_at_last and not self.is_flown

    @property
    def item_text(self) -> str:
        """The current item and the last one, numbered from 0 as in MAVLink; empty if unknown."""
        if self.current is None or not self.total:
            return ""
        return f"item {self.current} (last {self.total - 1})"


class Battery(NamedTuple):
    """State of the battery; None for values that the vehicle does not measure."""

    remaining: float | None
    voltage_v: float | None
    current_a: float | None

    time_remaining_s: float | None = None


class Gnss(NamedTuple):
    """State of the satellite receiver; None for values that it does not report."""

    fix_type: int
    satellites: int | None = None
    hdop: float | None = None
    horizontal_accuracy_m: float | None = None

    @property
    def has_position(self) -> bool:
        """True if the receiver has a position in three dimensions."""
        return self.fix_type >= 3

    @property
    def fix_name(self) -> str:
        """Name of the type of fix."""
        return _FIXES.get(self.fix_type, "no fix")


class Estimator(NamedTuple):
    """Health of the vehicle's state estimator, of ESTIMATOR_STATUS or ArduPilot's EKF_STATUS_REPORT."""

    has_attitude: bool
    has_velocity: bool
    has_position: bool
    """True if the horizontal position is known absolutely."""
    has_altitude: bool
    worst_ratio: float | None = None
    """Largest innovation test ratio; from 1 on the estimator rejects that measurement."""
    horizontal_m: float | None = None
    """Accuracy of the position [1σ]; None if it is not reported."""
    vertical_m: float | None = None

    @property
    def healthy(self) -> bool:
        """True if attitude, velocity and position are known and no measurement is rejected."""
        known = self.has_attitude and self.has_velocity and self.has_position and self.has_altitude
        return known and (self.worst_ratio is None or self.worst_ratio < 1.0)


class AvailableMode(NamedTuple):
    """A mode of the vehicle as it lists it in AVAILABLE_MODES."""

    number: int
    """The custom mode."""
    label: str
    """The vehicle's own name of it, else that of MAVLink's standard mode."""
    is_selectable: bool
    standard_mode: int
    """MAV_STANDARD_MODE; 0: none."""


class LoopTiming(NamedTuple):
    """One FS_LOOP_TIMING: times over the last 4096 ticks, counts since start; in lockstep no tick can be late."""

    time_s: float
    ticks: int
    overruns: int | None
    missed: int | None
    inner_hz: float | None
    outer_hz: float | None
    real_time_factor: float | None
    execution_mean_us: float | None
    execution_p99_us: float | None
    execution_max_us: float | None
    lateness_mean_us: float | None
    lateness_p99_us: float | None
    lateness_max_us: float | None
    lockstep: bool


class StatusText(NamedTuple):
    """A STATUSTEXT. ``number`` counts all texts."""

    number: int
    severity: int
    text: str
    received_s: float
    vehicle_time_s: float | None


class PartialText(NamedTuple):
    """The first ``pieces`` of a long text; all of them carry the same ``message_id``."""

    message_id: int
    severity: int
    octets: bytes
    pieces: int
    received_s: float
    vehicle_time_s: float | None


class VehicleView(NamedTuple):
    """State of a vehicle, folded from its messages. Times ``_s`` are on the receiver's clock."""

    identity: Identity | None = None
    last_heartbeat_s: float | None = None
    mode: str | None = None
    """Name of the flight mode: the autopilot's, else that in AVAILABLE_MODES, else the number."""
    custom_mode: int = 0
    modes: tuple[AvailableMode, ...] = ()
    """The modes that the vehicle lists; empty until it is asked."""
    mode_total: int = 0
    """Number of modes that the vehicle has, as AVAILABLE_MODES says."""
    armed: bool = False
    ever_armed: bool = False
    system_status: int = 0
    is_own: bool | None = None
    """True for the vehicle of this project, False for others; None until AUTOPILOT_VERSION is received."""
    landed_state: int = 0
    healthy: bool | None = None
    """True if all sensors are healthy; in a simulation: if the simulator's state is received."""
    can_arm: bool | None = None
    """Result of the vehicle's pre-arm check; None if it reports none."""
    gnss: Gnss | None = None
    estimator: Estimator | None = None
    wind_ned_m_s: Vector | None = None
    """Velocity of the air."""
    unhealthy: tuple[str, ...] = ()
    """Names of the enabled sensors that the vehicle reports as unhealthy."""
    fence_breached: bool = False
    attitude: Euler | None = None
    rates_frd_rad_s: Vector | None = None
    attitude_target: Euler | None = None
    position_ned_m: Vector | None = None
    velocity_ned_m_s: Vector | None = None
    geo: GeoPosition | None = None
    home: GeoPosition | None = None
    home_count: int = 0
    """Number of received home positions."""
    heading_deg: float | None = None
    throttle: float | None = None
    setpoint: Setpoint | None = None
    mission: Mission = Mission()
    battery: Battery | None = None
    charge_at_arming: tuple[float, float] | None = None
    """Vehicle time [s] and remaining charge, 0 to 1, when the vehicle armed."""
    rotor_rpm: tuple[float, ...] = ()
    rotor_peak_rpm: float = 0.0
    timing: LoopTiming | None = None
    texts: tuple[StatusText, ...] = ()
    text_count: int = 0
    partial_text: PartialText | None = None
    time_s: float | None = None
    restarts: int = 0
    """Number of restarts of the vehicle's clock."""
    link: LinkCounts = LinkCounts()

    @property
    def autopilot(self) -> Autopilot:
        """Facts about the vehicle's autopilot."""
        return autopilot_of(0 if self.identity is None else self.identity.autopilot)

    @property
    def vehicle_type(self) -> int:
        """The MAV_TYPE; 0 if unknown."""
        return 0 if self.identity is None else self.identity.vehicle_type

    @property
    def in_failsafe(self) -> bool:
        """True if the vehicle reports a critical state, an emergency or a termination."""
        return self.system_status in _FAILSAFE

    @property
    def terminated(self) -> bool:
        """True if the vehicle has terminated the flight, or its rotors are switched off: PX4's kill switch."""
        return self.system_status == _TERMINATED

    @property
    def terminated_for_good(self) -> bool:
        """True if the flight has ended until a reboot; by the mode, if the autopilot has one for it."""
        mode = self.autopilot.role_mode(Role.TERMINATION, self.vehicle_type)
        return self.terminated and mode in (None, self.custom_mode)

    @property
    def has_position(self) -> bool:
        """True if the position is known and the estimator, if the autopilot reports it, holds it for valid."""
        if self.estimator is None:
            return self.geo is not None and not self.autopilot.reports_estimator
        return self.geo is not None and self.estimator.has_position

    @property
    def on_ground(self) -> bool | None:
        """True if the vehicle reports that it stands on the ground; None if it does not report that."""
        return None if self.landed_state == 0 else self.landed_state == ON_GROUND

    @property
    def relative_altitude_m(self) -> float | None:
        """Altitude above home."""
        return None if self.geo is None else self.geo.relative_altitude_m

    @property
    def ground_speed_m_s(self) -> float | None:
        """Horizontal speed."""
        velocity = self.velocity_ned_m_s
        return None if velocity is None else math.hypot(velocity.x, velocity.y)

    @property
    def home_altitude_m(self) -> float | None:
        """Altitude of home above mean sea level."""
        if self.home is not None:
            return self.home.altitude_m
        return None if self.geo is None else self.geo.altitude_m - self.geo.relative_altitude_m

    @property
    def powered_off(self) -> bool:
        """True if the vehicle has reported that it shuts down."""
        return self.system_status == _POWEROFF

    @property
    def battery_time_s(self) -> float | None:
        """Remaining time of the battery: the vehicle's, else from the mean consumption since arming."""
        if self.battery is None or self.battery.time_remaining_s is not None:
            return None if self.battery is None else self.battery.time_remaining_s
        left = self.battery.remaining
        if left is None or self.charge_at_arming is None or self.time_s is None:
            return None
        armed_s, charge = self.charge_at_arming
        used, elapsed_s = charge - left, self.time_s - armed_s
        return left / used * elapsed_s if used >= _SMALLEST_USE and elapsed_s > 0.0 else None

    def silent_s(self, now_s: float) -> float | None:
        """Seconds since the last heartbeat; None before the first."""
        return None if self.last_heartbeat_s is None else max(0.0, now_s - self.last_heartbeat_s)

    def lost(self, now_s: float) -> bool:
        """True if the heartbeat has timed out."""
        return self.last_heartbeat_s is not None and now_s - self.last_heartbeat_s > LOST_AFTER_S

    def texts_since(self, count: int) -> tuple[StatusText, ...]:
        """Return the kept status texts after the first ``count``."""
        return tuple(text for text in self.texts if text.number >= count)


Changes: TypeAlias = dict[str, Any]
"""New values of a view by field: an argument of ``view_with``."""
_PLACES = {name: place for place, name in enumerate(VehicleView._fields)}


def view_with(view: VehicleView, changes: Changes) -> VehicleView:
    """Return ``view`` with other values; ``_replace`` looks up all fields, not only the changed ones."""
    values = list(view)
    for name, value in changes.items():
        values[_PLACES[name]] = value
    return tuple.__new__(VehicleView, values)
