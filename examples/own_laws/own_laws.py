"""A controller of three laws: a leash on the setpoint, a position cascade, and a mixer that clips."""

from __future__ import annotations

import math
from typing import NamedTuple

from flightstack.control.control_law import ControlLaw, NoMemory, NoParams
from flightstack.control.controller import Controller
from flightstack.control.mixer import Mixer, PerRotor, Work
from flightstack.core.compiled import compiled
from flightstack.core.contract import AttitudeTarget, PositionSetpoint, Vector3, VehicleState, Wrench
from flightstack.core.geometry import quaternion_from_euler
from flightstack.core.portable_math import atan2, sin_cos
from flightstack.params.toml_file import Table
from flightstack.params.tunable import Tunable
from flightstack.params.vehicle import GRAVITY_M_S2, Vehicle

# ------------------------------------------------------------------ guidance


class LeashParams(NamedTuple):
    """Largest distance from the vehicle to the setpoint."""

    length_m: float


@compiled
def leash_step(
    memory: NoMemory, state: VehicleState, setpoint: PositionSetpoint, params: LeashParams, dt_s: float
) -> tuple[NoMemory, PositionSetpoint]:
    """Pull the setpoint to within the leash, so that a vehicle held up by wind does not race after it."""
    p, wanted = state.position_ned_m, setpoint.position_ned_m
    x, y, z = wanted.x - p.x, wanted.y - p.y, wanted.z - p.z
    distance = math.sqrt(x * x + y * y + z * z)
    if distance <= params.length_m:
        return memory, setpoint
    share = params.length_m / distance
    return memory, PositionSetpoint(
        Vector3(p.x + share * x, p.y + share * y, p.z + share * z),
        setpoint.velocity_ned_m_s,
        setpoint.acceleration_ned_m_s2,
        setpoint.yaw_rad,
        setpoint.yaw_rate_rad_s,
    )


LEASH = ControlLaw(
    "leash",
    leash_step,
    NoMemory,
    LeashParams,
    (0.0,),
    lambda vehicle, gains: LeashParams(gains.number("length_m", 0.1, 100.0, 2.0)),
    (Tunable("length_m", "LEASH_LENGTH", 0.1, 100.0, "m", "Largest distance to the setpoint"),),
)

# ------------------------------------------------------------------ position


class CascadeMemory(NamedTuple):
    """Integral of the velocity error, as acceleration [m/s²], NED."""

    x: float
    y: float
    z: float


class CascadeParams(NamedTuple):
    """Gains of position [1/s] and velocity [1/s, 1/s²], and limits; max_tilt_rad follows MPC_TILTMAX_AIR."""

    position_gain: float
    velocity_gain: float
    integral_gain: float
    largest_integral_m_s2: float
    mass_kg: float
    largest_thrust_n: float
    max_tilt_rad: float


@compiled
def _axis(
    error_m: float, velocity_error_m_s: float, ahead_m_s2: float, integral: float, params: CascadeParams
) -> float:
    """Return the acceleration of an axis: the position error sets a velocity, whose error sets the acceleration."""
    return (
        ahead_m_s2 + params.velocity_gain * (params.position_gain * error_m + velocity_error_m_s) + integral
    )


@compiled
def _integrated(
    integral: float, error_m: float, velocity_error_m_s: float, params: CascadeParams, dt_s: float
) -> float:
    moved = integral + params.integral_gain * (params.position_gain * error_m + velocity_error_m_s) * dt_s
    return min(max(moved, -params.largest_integral_m_s2), params.largest_integral_m_s2)


@compiled
def cascade_step(
    memory: CascadeMemory,
    state: VehicleState,
    setpoint: PositionSetpoint,
    params: CascadeParams,
    dt_s: float,
    thrust_saturation: float,
) -> tuple[CascadeMemory, AttitudeTarget]:
    """Return attitude and thrust of a cascade of position and velocity, as PX4 and ArduPilot have it."""
    p, v, a = setpoint.position_ned_m, setpoint.velocity_ned_m_s, setpoint.acceleration_ned_m_s2
    x, y, z = p.x - state.position_ned_m.x, p.y - state.position_ned_m.y, p.z - state.position_ned_m.z
    vx, vy = v.x - state.velocity_ned_m_s.x, v.y - state.velocity_ned_m_s.y
    vz = v.z - state.velocity_ned_m_s.z
    north, east = _axis(x, vx, a.x, memory.x, params), _axis(y, vy, a.y, memory.y, params)
    lift = max(GRAVITY_M_S2 - _axis(z, vz, a.z, memory.z, params), 0.3 * GRAVITY_M_S2)
    sine, cosine = sin_cos(setpoint.yaw_rad)
    forward, right = cosine * north + sine * east, cosine * east - sine * north
    limit = params.max_tilt_rad
    pitch = min(max(atan2(-forward, lift), -limit), limit)
    level = math.sqrt(forward * forward + lift * lift)
    roll = min(max(atan2(right, level), -limit), limit)
    q = state.attitude
    cos_tilt = max(1.0 - 2.0 * (q.x * q.x + q.y * q.y), 0.5)
    thrust = min(params.mass_kg * lift / cos_tilt, params.largest_thrust_n)
    if thrust_saturation == 0.0:
        memory = CascadeMemory(
            _integrated(memory.x, x, vx, params, dt_s),
            _integrated(memory.y, y, vy, params, dt_s),
            _integrated(memory.z, z, vz, params, dt_s),
        )
    return memory, AttitudeTarget(quaternion_from_euler(roll, pitch, setpoint.yaw_rad), thrust)


def read_cascade(vehicle: Vehicle, gains: Table) -> CascadeParams:
    """Read ``[position_cascade]``. Every key has a default."""
    params = CascadeParams(
        gains.number("position_gain", 0.0, 10.0, 1.6),
        gains.number("velocity_gain", 0.0, 20.0, 5.0),
        gains.number("integral_gain", 0.0, 10.0, 1.5),
        gains.number("largest_integral_m_s2", 0.0, 10.0, 4.0),
        vehicle.mass_kg,
        0.95 * vehicle.max_thrust_n,
        0.0,
    )
    gains.finish()
    return params


CASCADE = ControlLaw(
    "cascade",
    cascade_step,
    CascadeMemory,
    CascadeParams,
    (0.0, 0.0, 0.0),
    read_cascade,
    (
        Tunable("position_gain", "CAS_POS_P", 0.0, 10.0, "1/s", "Velocity per position error"),
        Tunable("velocity_gain", "CAS_VEL_P", 0.0, 20.0, "1/s", "Acceleration per velocity error"),
        Tunable("integral_gain", "CAS_VEL_I", 0.0, 10.0, "1/s^2", "Acceleration per integral of it"),
    ),
)

# ------------------------------------------------------------------ mixer


@compiled
def clip_step(
    memory: NoMemory,
    wrench: Wrench,
    rotors: Mixer,
    params: NoParams,
    dt_s: float,
    rotor_speed_rad_s: PerRotor,
    work: Work,
) -> tuple[NoMemory, Wrench]:
    """Clip each rotor's share by itself, without priorities."""
    torque = wrench.torque_frd_n_m
    thrust, roll, pitch, yaw = 0.0, 0.0, 0.0, 0.0
    for i in range(rotors.low.size):
        squared = rotors.allocation[i, 0] * wrench.thrust_n + rotors.allocation[i, 1] * torque.x
        squared += rotors.allocation[i, 2] * torque.y + rotors.allocation[i, 3] * torque.z
        squared = min(max(squared, rotors.low[i]), rotors.high[i])
        rotor_speed_rad_s[i] = math.copysign(math.sqrt(abs(squared)), squared)
        thrust += rotors.effectiveness[0, i] * squared
        roll += rotors.effectiveness[1, i] * squared
        pitch += rotors.effectiveness[2, i] * squared
        yaw += rotors.effectiveness[3, i] * squared
    return memory, Wrench(thrust, Vector3(roll, pitch, yaw))


CLIP = ControlLaw("clip", clip_step, NoMemory, NoParams, (0.0,), lambda vehicle, gains: NoParams(0.0), ())

CONTROLLER = Controller("cascade", position=CASCADE, guidance=LEASH, mixer=CLIP)
