"""The parameters of guidance and commander, declared once, named as PX4 names them."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import Any

from flightstack.params.errors import ConfigError
from flightstack.params.spec import ParamSpec, group_of
from flightstack.params.store import read_assignment


def _param(
    name: str,
    default: float,
    low: float,
    high: float,
    unit: str,
    text: str,
    *,
    integer: bool = False,
    choices: tuple[tuple[int, str], ...] = (),
    decimals: int = 2,
    group: str = "",
    reboot: bool = False,
) -> Any:
    """Declare a parameter. With ``choices`` it is an integer that has only these values, each with its meaning.

    The group follows from the name's first part (``spec.GROUPS``) unless it is given.
    """
    whole = integer or bool(choices)
    spec = ParamSpec(
        name, default, low, high, unit, text, whole, group or group_of(name), 0 if whole else decimals, choices, reboot
    )  # fmt: skip
    return field(default=spec.number(default), metadata={"spec": spec})


@dataclass(frozen=True)
class Behaviour:
    """How the vehicle flies its modes."""

    takeoff_altitude_m: float = _param("MIS_TAKEOFF_ALT", 2.5, 0.2, 100, "m", "Takeoff altitude above home")
    cruise_speed_m_s: float = _param("MPC_XY_CRUISE", 4.0, 0.1, 20, "m/s", "Horizontal speed in auto modes")
    max_speed_m_s: float = _param("MPC_XY_VEL_MAX", 12.0, 0.1, 20, "m/s", "Largest horizontal speed")
    climb_speed_m_s: float = _param("MPC_Z_VEL_MAX_UP", 2.5, 0.1, 8, "m/s", "Largest climb speed")
    descent_speed_m_s: float = _param("MPC_Z_VEL_MAX_DN", 1.5, 0.1, 4, "m/s", "Largest descent speed")
    takeoff_speed_m_s: float = _param("MPC_TKO_SPEED", 1.5, 0.1, 5, "m/s", "Climb speed of a takeoff")
    land_speed_m_s: float = _param("MPC_LAND_SPEED", 0.7, 0.1, 2, "m/s", "Descent speed near the ground")
    land_slow_altitude_m: float = _param(
        "MPC_LAND_ALT2", 3.0, 0, 100, "m", "Altitude below which landing is slow"
    )
    acceleration_m_s2: float = _param(
        "MPC_ACC_HOR", 3.0, 0.5, 4.5, "m/s^2", "Horizontal acceleration of the reference"
    )
    vertical_acceleration_m_s2: float = _param(
        "MPC_ACC_UP_MAX", 3.0, 0.5, 5, "m/s^2", "Vertical acceleration of the reference"
    )
    jerk_m_s3: float = _param("MPC_JERK_AUTO", 20.0, 1, 80, "m/s^3", "Jerk of the reference")
    max_tilt_deg: float = _param("MPC_TILTMAX_AIR", 45, 5, 70, "deg", "Largest tilt")
    yaw_rate_deg_s: float = _param("MPC_YAWRAUTO_MAX", 60, 5, 180, "deg/s", "Largest yaw rate in auto modes")
    yaw_mode: int = _param(
        "MPC_YAW_MODE", 0, 0, 1, "", "Heading where none is given",
        choices=((0, "Towards the waypoint"), (1, "As it is")),
    )  # fmt: skip
    acceptance_radius_m: float = _param(
        "NAV_ACC_RAD", 0.5, 0.05, 200, "m", "Acceptance radius where none is given"
    )
    altitude_acceptance_m: float = _param("NAV_MC_ALT_RAD", 0.4, 0.05, 200, "m", "Altitude acceptance")
    yaw_acceptance_deg: float = _param(
        "MIS_YAW_ERR", 12, 1, 90, "deg", "Heading error at which a heading is reached"
    )
    return_altitude_m: float = _param("RTL_RETURN_ALT", 15, 0, 150, "m", "Altitude above home of a return")
    return_min_distance_m: float = _param(
        "RTL_MIN_DIST", 10, 0.5, 100, "m", "Nearer to home a return does not climb"
    )
    return_type: float = _param(
        "RTL_TYPE", 0, 0, 1, "", "Return to the nearest of 0 home and rally points, 1 rally points, else home"
    )
    fence_action: float = _param(
        "GF_ACTION", 2, 0, 5, "", "Geofence breach: 0 none, 1 warning, 2 hold, 3 return, 4 terminate, 5 land"
    )
    fence_max_distance_m: float = _param(
        "GF_MAX_HOR_DIST", 0, 0, 10000, "m", "Geofence: farthest horizontal distance from home; 0 no limit"
    )
    fence_max_altitude_m: float = _param(
        "GF_MAX_VER_DIST", 0, 0, 10000, "m", "Geofence: greatest altitude above home; 0 no limit"
    )
    fence_predicts: float = _param(
        "GF_PREDICT", 0, 0, 1, "", "Geofence: 1 to act where the vehicle could no longer stop inside"
    )
    first_waypoint_distance_m: float = _param(
        "MIS_DIST_1WP", 10000, -1, 100000, "m", "Farthest first waypoint from home; -1 for no limit"
    )
    waypoint_distance_m: float = _param(
        "MIS_DIST_WPS", 10000, -1, 100000, "m", "Farthest waypoint from the one before; -1 for no limit"
    )
    disarm_after_landing_s: float = _param(
        "COM_DISARM_LAND", 1.0, -1, 20, "s", "Disarm after landing; -1 never"
    )
    disarm_without_takeoff_s: float = _param(
        "COM_DISARM_PRFLT", 30, -1, 300, "s", "Disarm without takeoff; -1 never"
    )

    def updated(self, name: str, value: float) -> Behaviour:
        """Return a copy with the parameter ``name`` changed; raise ConfigError."""
        spec = SPECS.get(name)
        if spec is None:
            raise ConfigError("parameter", name, "is not known")
        accepted = spec.accepted(value)
        if isinstance(accepted, str):
            raise ConfigError("parameter", name, accepted)
        change: dict[str, Any] = {FIELDS[name]: accepted}
        return replace(self, **change)

    def by_name(self) -> dict[str, float]:
        """Return all parameters under their MAVLink names."""
        return {name: getattr(self, attribute) for name, attribute in FIELDS.items()}


SPECS: dict[str, ParamSpec] = {
    item.metadata["spec"].name: item.metadata["spec"] for item in fields(Behaviour) if "spec" in item.metadata
}
"""Declarations by name."""

FIELDS: dict[str, str] = {
    item.metadata["spec"].name: item.name for item in fields(Behaviour) if "spec" in item.metadata
}
"""The field of ``Behaviour`` that holds a parameter, by the parameter's name."""


def with_assignments(behaviour: Behaviour, assignments: list[str]) -> Behaviour:
    """Apply ``NAME=VALUE`` texts; raise ConfigError."""
    for text in assignments:
        behaviour = behaviour.updated(*read_assignment(text))
    return behaviour
