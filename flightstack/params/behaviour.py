"""Parameters of guidance and commander, with PX4's names."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import Any

from flightstack.core.errors import ConfigError
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
    """Declare a parameter. With ``choices`` it is an integer limited to these values, each with its meaning.

    The default group follows from the prefix of the name (``spec.GROUPS``).
    """
    whole = integer or bool(choices)
    spec = ParamSpec(
        name, default, low, high, unit, text, whole, group or group_of(name), 0 if whole else decimals, choices, reboot
    )  # fmt: skip
    return field(default=spec.number(default), metadata={"spec": spec})


_LINK_LOSS = ((0, "Disabled"), (1, "Hold"), (2, "Return"), (3, "Land"), (5, "Terminate"), (6, "Disarm"))


@dataclass(frozen=True)
class Behaviour:
    """Parameters of flight modes and failsafes."""

    takeoff_altitude_m: float = _param("MIS_TAKEOFF_ALT", 2.5, 0.2, 100, "m", "Takeoff altitude above home")
    cruise_speed_m_s: float = _param("MPC_XY_CRUISE", 4.0, 0.1, 20, "m/s", "Horizontal speed in auto modes")
    max_speed_m_s: float = _param("MPC_XY_VEL_MAX", 12.0, 0.1, 20, "m/s", "Maximum horizontal speed")
    climb_speed_m_s: float = _param("MPC_Z_VEL_MAX_UP", 2.5, 0.1, 8, "m/s", "Maximum climb speed")
    descent_speed_m_s: float = _param("MPC_Z_VEL_MAX_DN", 1.5, 0.1, 4, "m/s", "Maximum descent speed")
    takeoff_speed_m_s: float = _param("MPC_TKO_SPEED", 1.5, 0.1, 5, "m/s", "Climb speed during takeoff")
    land_speed_m_s: float = _param("MPC_LAND_SPEED", 0.7, 0.1, 2, "m/s", "Descent speed near the ground")
    land_slow_altitude_m: float = _param(
        "MPC_LAND_ALT2", 3.0, 0, 100, "m", "Altitude below which landing is slow"
    )
    acceleration_m_s2: float = _param(
        "MPC_ACC_HOR", 3.0, 0.5, 4.5, "m/s^2", "Maximum horizontal acceleration of the trajectory"
    )
    vertical_acceleration_m_s2: float = _param(
        "MPC_ACC_UP_MAX", 3.0, 0.5, 5, "m/s^2", "Maximum vertical acceleration of the trajectory"
    )
    jerk_m_s3: float = _param("MPC_JERK_AUTO", 20.0, 1, 80, "m/s^3", "Maximum jerk of the trajectory")
    max_tilt_deg: float = _param("MPC_TILTMAX_AIR", 45, 5, 70, "deg", "Maximum tilt")
    yaw_rate_deg_s: float = _param("MPC_YAWRAUTO_MAX", 60, 5, 180, "deg/s", "Maximum yaw rate in auto modes")
    manual_speed_m_s: float = _param(
        "MPC_VEL_MANUAL", 10.0, 0.5, 20, "m/s", "Horizontal speed at full stick in Position mode"
    )
    manual_tilt_deg: float = _param(
        "MPC_MAN_TILT_MAX", 35, 1, 70, "deg", "Tilt at full stick in Altitude mode"
    )
    manual_yaw_rate_deg_s: float = _param("MPC_MAN_Y_MAX", 150, 0, 400, "deg/s", "Yaw rate at full stick")
    stick_deadzone: float = _param("MPC_HOLD_DZ", 0.1, 0, 0.9, "", "Dead zone around stick centre")
    stick_xy_expo: float = _param("MPC_XY_MAN_EXPO", 0.6, 0, 1, "", "Expo of the horizontal sticks")
    stick_z_expo: float = _param("MPC_Z_MAN_EXPO", 0.6, 0, 1, "", "Expo of the throttle stick")
    stick_yaw_expo: float = _param("MPC_YAW_EXPO", 0.6, 0, 1, "", "Expo of the yaw stick")
    yaw_mode: int = _param(
        "MPC_YAW_MODE", 0, 0, 5, "", "Heading of waypoints without yaw",
        choices=((0, "Towards the waypoint"), (5, "Unchanged")),
    )  # fmt: skip
    acceptance_radius_m: float = _param(
        "NAV_ACC_RAD", 0.5, 0.05, 200, "m", "Acceptance radius of waypoints without one"
    )
    altitude_acceptance_m: float = _param("NAV_MC_ALT_RAD", 0.4, 0.05, 200, "m", "Altitude acceptance radius")
    yaw_acceptance_deg: float = _param(
        "MIS_YAW_ERR", 12, 1, 90, "deg", "Maximum heading error at which a heading is reached"
    )
    return_altitude_m: float = _param("RTL_RETURN_ALT", 15, 0, 150, "m", "Return altitude above home")
    return_min_distance_m: float = _param(
        "RTL_MIN_DIST", 10, 0.5, 100, "m", "Distance from home below which a return does not climb"
    )
    return_type: int = _param(
        "RTL_TYPE", 0, 0, 1, "", "Destination of a return",
        choices=((0, "Nearest of home and rally points"), (1, "Nearest rally point, else home")),
    )  # fmt: skip
    fence_action: int = _param(
        "GF_ACTION", 2, 0, 5, "", "Geofence breach action",
        choices=((0, "None"), (1, "Warning"), (2, "Hold"), (3, "Return"), (4, "Terminate"), (5, "Land")),
    )  # fmt: skip
    fence_max_distance_m: float = _param(
        "GF_MAX_HOR_DIST", 0, 0, 10000, "m", "Geofence: maximum horizontal distance from home; 0 for no limit"
    )
    fence_max_altitude_m: float = _param(
        "GF_MAX_VER_DIST", 0, 0, 10000, "m", "Geofence: maximum altitude above home; 0 for no limit"
    )
    fence_predicts: int = _param(
        "GF_PREDICT", 0, 0, 1, "", "Geofence prediction",
        choices=((0, "Act at a breach"), (1, "Act where the vehicle can just stop inside")),
    )  # fmt: skip
    first_waypoint_distance_m: float = _param(
        "MIS_DIST_1WP",
        10000,
        -1,
        100000,
        "m",
        "Maximum distance of the first waypoint from home; -1 for no limit",
    )
    waypoint_distance_m: float = _param(
        "MIS_DIST_WPS", 10000, -1, 100000, "m", "Maximum distance between waypoints; -1 for no limit"
    )
    home_follows: int = _param(
        "COM_HOME_EN", 1, 0, 1, "", "Set home at arming, unless a command set it",
        choices=((0, "Off"), (1, "On")),
    )  # fmt: skip
    disarm_after_landing_s: float = _param(
        "COM_DISARM_LAND", 1.0, -1, 20, "s", "Delay of disarming after landing; 0 or less disables it"
    )
    disarm_without_takeoff_s: float = _param(
        "COM_DISARM_PRFLT", 30, -1, 300, "s", "Delay of disarming without takeoff; 0 or less disables it"
    )
    # failsafes, used by the table in commander/failsafe.py
    failsafe_delay_s: float = _param(
        "COM_FAIL_ACT_T", 5.0, 0, 25, "s", "Hold time before a failsafe returns or lands"
    )
    gcs_loss_s: float = _param("COM_DL_LOSS_T", 10, 5, 300, "s", "Ground station loss timeout", integer=True)
    gcs_loss_action: int = _param(
        "NAV_DLL_ACT", 0, 0, 6, "", "Ground station loss action", choices=_LINK_LOSS,
    )  # fmt: skip
    manual_loss_s: float = _param("COM_RC_LOSS_T", 0.5, 0, 35, "s", "Manual control loss timeout")
    manual_loss_action: int = _param(
        "NAV_RCL_ACT", 2, 1, 6, "", "Manual control loss action in Position and Altitude mode", choices=_LINK_LOSS[1:],
    )  # fmt: skip
    offboard_loss_s: float = _param("COM_OF_LOSS_T", 1.0, 0, 60, "s", "Offboard setpoint loss timeout")
    offboard_loss_action: int = _param(
        "COM_OBL_RC_ACT", 0, 0, 7, "", "Offboard loss action; 0 and 1 act as NAV_RCL_ACT without manual control",
        choices=((0, "Position mode"), (1, "Altitude mode"), (3, "Return"), (4, "Land"), (5, "Hold"),
                 (6, "Terminate"), (7, "Disarm")),
    )  # fmt: skip
    battery_low: float = _param(
        "BAT_LOW_THR", 0.15, 0.12, 0.5, "norm", "Low battery level: warning, no arming"
    )
    battery_critical: float = _param("BAT_CRIT_THR", 0.07, 0.05, 0.5, "norm", "Critical battery level")
    battery_emergency: float = _param("BAT_EMERGEN_THR", 0.05, 0.03, 0.5, "norm", "Emergency battery level")
    low_battery_action: int = _param(
        "COM_LOW_BAT_ACT", 0, 0, 3, "", "Critical and emergency battery level",
        choices=((0, "Warning"), (2, "Land"), (3, "Return at critical, land at emergency level")),
    )  # fmt: skip
    max_roll_deg: float = _param(
        "FD_FAIL_R", 60, 0, 180, "deg", "Roll of lost control, at least 15 above MPC_TILTMAX_AIR; 0 off",
        integer=True,
    )  # fmt: skip
    max_pitch_deg: float = _param(
        "FD_FAIL_P", 60, 0, 180, "deg", "Pitch of lost control, at least 15 above MPC_TILTMAX_AIR; 0 off",
        integer=True,
    )  # fmt: skip
    max_roll_s: float = _param(
        "FD_FAIL_R_TTRI", 0.3, 0.02, 5, "s", "Time for which roll must exceed FD_FAIL_R"
    )
    max_pitch_s: float = _param(
        "FD_FAIL_P_TTRI", 0.3, 0.02, 5, "s", "Time for which pitch must exceed FD_FAIL_P"
    )
    max_tilt_error_deg: float = _param(
        "FS_ATT_ERR", 30, 0, 180, "deg", "Loss of control: angle between thrust axis and its reference; 0 off",
        group="Failure Detector",
    )  # fmt: skip
    max_tilt_error_s: float = _param(
        "FS_ATT_ERR_T",
        0.5,
        0.02,
        5,
        "s",
        "Time for which it must exceed FS_ATT_ERR",
        group="Failure Detector",
    )
    attitude_failure_action: int = _param(
        "FS_ATT_ACT", 4, 0, 4, "", "Attitude failure action",
        choices=((0, "Warning"), (2, "Land"), (4, "Terminate")), group="Failure Detector",
    )  # fmt: skip
    max_position_error_m: float = _param(
        "FS_POS_ERR", 10, 0, 1000, "m", "Loss of control: distance from the position setpoint; 0 off",
        group="Failure Detector",
    )  # fmt: skip
    max_position_error_s: float = _param(
        "FS_POS_ERR_T",
        1.0,
        0.02,
        30,
        "s",
        "Time for which it must exceed FS_POS_ERR",
        group="Failure Detector",
    )
    position_error_action: int = _param(
        "FS_POS_ACT", 2, 0, 4, "", "Position error action",
        choices=((0, "Warning"), (2, "Land"), (4, "Terminate")), group="Failure Detector",
    )  # fmt: skip
    dead_reckoning_s: float = _param(
        "FS_DEAD_RECK_T", 5, 0.5, 60, "s", "Dead reckoning after which the position is lost",
        group="Failure Detector",
    )  # fmt: skip
    position_accuracy_m: float = _param(
        "COM_POS_FS_EPH", 5, -1, 400, "m", "Standard deviation at which the position is lost; -1 off"
    )
    velocity_accuracy_m_s: float = _param(
        "COM_VEL_FS_EVH",
        1,
        0,
        20,
        "m/s",
        "Standard deviation above which a descent without position does not brake",
    )
    position_loss_action: int = _param(
        "COM_POSCTL_NAVL", 0, 0, 1, "", "Position loss action; without manual control the vehicle lands",
        choices=((0, "Altitude mode"), (1, "Land")),
    )  # fmt: skip
    tilt_accuracy_deg: float = _param(
        "FS_TILT_DEV", 10, 0, 45, "deg", "Standard deviation at which the attitude is doubtful; 0 off",
        group="Failure Detector",
    )  # fmt: skip
    attitude_doubt_action: int = _param(
        "FS_TILT_ACT", 2, 0, 4, "", "Doubtful attitude action",
        choices=((0, "Warning"), (2, "Land"), (4, "Terminate")), group="Failure Detector",
    )  # fmt: skip
    gnss_doubt_action: int = _param(
        "FS_GNSS_ACT", 0, 0, 3, "", "Refused GNSS action",
        choices=((0, "Warning"), (1, "Hold"), (2, "Land"), (3, "Return")), group="Failure Detector",
    )  # fmt: skip
    rotor_check: int = _param(
        "FD_ACT_EN", 1, 0, 1, "", "Compare commanded and measured rotor speeds", choices=((0, "Off"), (1, "On")),
    )  # fmt: skip
    rotor_error: float = _param(
        "FS_ROT_ERR", 0.3, 0.05, 1, "norm", "Maximum relative difference between rotor speed and command",
        group="Failure Detector",
    )  # fmt: skip
    rotor_error_ms: float = _param(
        "FD_ACT_MOT_TOUT", 100, 10, 10000, "ms", "Time for which it must exceed FS_ROT_ERR", integer=True,
    )  # fmt: skip
    rotor_failure_action: int = _param(
        "COM_ACT_FAIL_ACT", 2, 0, 4, "", "Rotor failure action",
        choices=((0, "Warning"), (1, "Hold"), (2, "Land"), (3, "Return"), (4, "Terminate")),
    )  # fmt: skip
    failures_allowed: int = _param(
        "SYS_FAILURE_EN", 0, 0, 1, "", "Allow failure injection by ground stations (INJECT_FAILURE)",
        choices=((0, "Off"), (1, "On")), group="System",
    )  # fmt: skip
    stale_s: float = _param(
        "FS_STALE_T", 0.5, 0.05, 10, "s", "Age at which a state is stale", group="Failure Detector"
    )
    blind_time_s: float = _param(
        "FS_BLIND_T", 2.0, -1, 60, "s", "Time without a state for which rotors hold their speeds; -1 for ever",
        group="Failure Detector",
    )  # fmt: skip

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
"""Field of ``Behaviour`` by parameter name."""


def with_assignments(behaviour: Behaviour, assignments: list[str]) -> Behaviour:
    """Apply ``NAME=VALUE`` texts; raise ConfigError."""
    for text in assignments:
        behaviour = behaviour.updated(*read_assignment(text))
    return behaviour
