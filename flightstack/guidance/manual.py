"""Manual modes as in PX4: POSITION sets velocity and holds position, ALTITUDE sets tilt and holds altitude."""

from __future__ import annotations

import math

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Vector3, VehicleState
from flightstack.core.geometry import euler_from_quaternion
from flightstack.core.portable_math import sin_cos, tan
from flightstack.guidance.follow import follow_heading, follow_horizontally, follow_vertically, leashed
from flightstack.guidance.mission import landing_speed
from flightstack.guidance.params import GuidanceParams
from flightstack.guidance.setpoints import NOT_GIVEN
from flightstack.guidance.trajectory import KA, Trajectory, TrajectoryLimits, clipped
from flightstack.params.vehicle import GRAVITY_M_S2

TAKEOFF_STICK = 0.3
"""Shaped throttle, from the centre, above which a landed vehicle takes off; PX4's value."""


@compiled
def shaped(stick: float, deadzone: float, expo: float) -> float:
    """Return the deflection after dead zone and expo: (1 − e) x + e x³."""
    size = min(abs(stick), 1.0)
    if not size > deadzone:
        return 0.0
    x = (size - deadzone) / (1.0 - deadzone)
    return math.copysign((1.0 - expo) * x + expo * x * x * x, stick)


@compiled
def _horizontal_sticks(sticks: FloatArray, params: GuidanceParams, expo: float) -> tuple[float, float]:
    """Return forward and right, clipped to the unit circle so that diagonals are no faster."""
    forward = shaped(sticks[0], params.stick_deadzone, expo)
    right = shaped(sticks[1], params.stick_deadzone, expo)
    return clipped(forward, right, 1.0)


@compiled
def _to_ned(forward: float, right: float, yaw_rad: float) -> tuple[float, float]:
    sin_yaw, cos_yaw = sin_cos(yaw_rad)
    return cos_yaw * forward - sin_yaw * right, sin_yaw * forward + cos_yaw * right


@compiled
def _climb_wanted(sticks: FloatArray, down_m: float, params: GuidanceParams) -> float:
    """Return the vertical speed [m/s], down positive; near the ground at most the landing speed."""
    up = shaped(sticks[2], params.stick_deadzone, params.stick_z_expo)
    return -up * (params.climb_speed_m_s if up > 0.0 else landing_speed(down_m, params))


@compiled
def _tilt_acceleration(sticks: FloatArray, yaw_rad: float, params: GuidanceParams) -> tuple[float, float]:
    """Return the horizontal acceleration, north and east [m/s²], of the tilt that the sticks set."""
    forward, right = _horizontal_sticks(sticks, params, 0.0)
    size = math.sqrt(forward * forward + right * right)
    scale = GRAVITY_M_S2 * tan(size * params.manual_tilt_rad) / size if size > 1e-9 else 0.0
    return _to_ned(forward * scale, right * scale, yaw_rad)


@compiled
def manual_step(
    t: Trajectory,
    sticks: FloatArray,
    state: VehicleState,
    holds_position: bool,
    params: GuidanceParams,
    limits: TrajectoryLimits,
    dt_s: float,
) -> Trajectory:
    """Move the reference by the sticks for one outer tick.

    POSITION (``holds_position``): the sticks set a velocity in the reference's heading frame; centred, the reference
    brakes and holds. ALTITUDE: the sticks set a tilt, converted to an acceleration; the reference's horizontal position
    and velocity are the vehicle's, so that only the tilt acts. The throttle sets the climb or descent rate.
    """
    p, v = state.position_ned_m, state.velocity_ned_m_s
    none = math.nan
    turn = shaped(sticks[3], params.stick_deadzone, params.stick_yaw_expo)
    present_yaw = euler_from_quaternion(state.attitude).z
    top = params.manual_yaw_rate_rad_s
    yaw, yaw_rate = follow_heading(t, none, turn * top, top, present_yaw, dt_s)
    climb = _climb_wanted(sticks, p.z, params)
    z, vz, az = follow_vertically(
        t, none, climb, none, params.climb_speed_m_s, params.descent_speed_m_s, limits, dt_s
    )
    if holds_position:
        forward, right = _horizontal_sticks(sticks, params, params.stick_xy_expo)
        north, east = _to_ned(forward, right, t.yaw_rad)
        top = params.manual_speed_m_s
        x, y, vx, vy, ax, ay = follow_horizontally(
            t, NOT_GIVEN, Vector3(north * top, east * top, 0.0), NOT_GIVEN, top, limits, dt_s
        )
        x, y = leashed(x, p.x), leashed(y, p.y)
    else:
        north, east = _tilt_acceleration(sticks, t.yaw_rad, params)
        jx, jy = clipped(KA * (north - t.ax), KA * (east - t.ay), 2.0 * limits.jerk_m_s3)
        ax, ay = t.ax + jx * dt_s, t.ay + jy * dt_s
        x, y, vx, vy = p.x, p.y, v.x, v.y
    return Trajectory(x, y, leashed(z, p.z), vx, vy, vz, ax, ay, az, yaw, yaw_rate)
