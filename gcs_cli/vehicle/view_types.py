"""State of a vehicle as received by a ground station: immutable values, None if unknown."""

from __future__ import annotations

from typing import NamedTuple

TEXTS_KEPT = 100
LOST_AFTER_S = 5.0
"""Heartbeat timeout of a vehicle: five missed heartbeats."""

_POWEROFF = 7  # MAV_STATE_POWEROFF
_KINDS = {
    2: ("quadrotor", 4),
    13: ("hexarotor", 6),
    14: ("octorotor", 8),
    15: ("tricopter", 3),
    43: ("multirotor", 0),
}
"""Name and number of rotors by MAV_TYPE."""
MISSION_COMPLETE = 5  # MISSION_STATE_COMPLETE


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


class Mission(NamedTuple):
    """Mission progress. ``reached`` is the last item reached; ``state`` is a MISSION_STATE."""

    current: int | None = None
    total: int | None = None
    reached: int | None = None
    state: int | None = None

    @property
    def complete(self) -> bool:
        """True if the vehicle reports the mission as complete."""
        return self.state == MISSION_COMPLETE

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


class LoopTiming(NamedTuple):
    """One FS_LOOP_TIMING: times over the last 4096 ticks, counts since start."""

    time_s: float
    ticks: int
    overruns: int
    missed: int
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


class LinkCounts(NamedTuple):
    """Messages from the vehicle: received, missing in the sequence, and the recent rate [1/s]."""

    received: int = 0
    lost: int = 0
    last_sequence: int | None = None
    last_received_s: float | None = None
    rate_hz: float | None = None
    window_start_s: float | None = None
    window_count: int = 0

    @property
    def quality(self) -> float | None:
        """Share of the vehicle's messages that arrived, 0 to 1."""
        total = self.received + self.lost
        return self.received / total if total else None


class VehicleView(NamedTuple):
    """State of a vehicle, folded from its messages. Times ``_s`` are on the receiver's clock."""

    identity: Identity | None = None
    last_heartbeat_s: float | None = None
    mode: str | None = None
    armed: bool = False
    ever_armed: bool = False
    system_status: int = 0
    landed_state: int = 0
    healthy: bool | None = None
    """True if all sensors are healthy; in a simulation: if the simulator's state is received."""
    attitude: Euler | None = None
    rates_frd_rad_s: Vector | None = None
    attitude_target: Euler | None = None
    position_ned_m: Vector | None = None
    velocity_ned_m_s: Vector | None = None
    geo: GeoPosition | None = None
    home: GeoPosition | None = None
    heading_deg: float | None = None
    throttle: float | None = None
    setpoint: Setpoint | None = None
    mission: Mission = Mission()
    battery: Battery | None = None
    rotor_rpm: tuple[float, ...] = ()
    rotor_peak_rpm: float = 0.0
    timing: LoopTiming | None = None
    texts: tuple[StatusText, ...] = ()
    text_count: int = 0
    partial_text: PartialText | None = None
    time_s: float | None = None
    link: LinkCounts = LinkCounts()

    @property
    def powered_off(self) -> bool:
        """True if the vehicle has reported that it shuts down."""
        return self.system_status == _POWEROFF

    def silent_s(self, now_s: float) -> float | None:
        """Seconds since the last heartbeat; None before the first."""
        return None if self.last_heartbeat_s is None else max(0.0, now_s - self.last_heartbeat_s)

    def lost(self, now_s: float) -> bool:
        """True if the heartbeat has timed out."""
        silent = self.silent_s(now_s)
        return silent is not None and silent > LOST_AFTER_S

    def texts_since(self, count: int) -> tuple[StatusText, ...]:
        """Return the kept status texts after the first ``count``."""
        return tuple(text for text in self.texts if text.number >= count)
