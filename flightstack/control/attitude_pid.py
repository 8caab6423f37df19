"""PID attitude control, the paper's inner loop (section II.B.1)."""

from __future__ import annotations

from typing import NamedTuple

from flightstack.control.control_law import AttitudeController, AttitudeInputs
from flightstack.core.compiled import compiled
from flightstack.core.contract import Vector3
from flightstack.params.toml_file import Table
from flightstack.params.tunable import Tunable
from flightstack.params.vehicle import Vehicle


class PidMemory(NamedTuple):
    """Integral of the attitude error [rad s]."""

    roll: float
    pitch: float
    yaw: float


class PidParams(NamedTuple):
    """Gains in angular acceleration per error, independent of the vehicle; its inertia converts them to torque."""

    kp_roll: float
    kp_pitch: float
    kp_yaw: float
    ki_roll: float
    ki_pitch: float
    ki_yaw: float
    kd_roll: float
    kd_pitch: float
    kd_yaw: float
    rate_feedforward: float
    acceleration_feedforward: float
    ix_kg_m2: float
    iy_kg_m2: float
    iz_kg_m2: float


PID_TUNABLES = (
    Tunable("kp_roll", "PID_ROLL_P", 0.0, 1e5, "1/s^2", "Acceleration per angle error, roll"),
    Tunable("kp_pitch", "PID_PITCH_P", 0.0, 1e5, "1/s^2", "Acceleration per angle error, pitch"),
    Tunable("kp_yaw", "PID_YAW_P", 0.0, 1e5, "1/s^2", "Acceleration per angle error, yaw"),
    Tunable("ki_roll", "PID_ROLL_I", 0.0, 1e5, "1/s^3", "Acceleration per error integral, roll", integrates="roll"),
    Tunable("ki_pitch", "PID_PITCH_I", 0.0, 1e5, "1/s^3", "Acceleration per error integral, pitch", integrates="pitch"),
    Tunable("ki_yaw", "PID_YAW_I", 0.0, 1e5, "1/s^3", "Acceleration per error integral, yaw", integrates="yaw"),
    Tunable("kd_roll", "PID_ROLL_D", 0.0, 1e4, "1/s", "Acceleration per rate error, roll"),
    Tunable("kd_pitch", "PID_PITCH_D", 0.0, 1e4, "1/s", "Acceleration per rate error, pitch"),
    Tunable("kd_yaw", "PID_YAW_D", 0.0, 1e4, "1/s", "Acceleration per rate error, yaw"),
    Tunable("rate_feedforward", "PID_RATE_FF", 0.0, 1.0, "", "Share of the reference rate fed ahead"),
    Tunable("acceleration_feedforward", "PID_ACC_FF", 0.0, 1.0, "", "Share of the reference acceleration fed ahead"),
)  # fmt: skip


@compiled
def integrated(integral: float, error: float, saturation: float, dt_s: float) -> float:
    """Integrate ``error`` unless the actuators are saturated in its direction (anti-windup)."""
    return integral if error * saturation > 0.0 else integral + error * dt_s


@compiled
def attitude_pid_step(
    memory: PidMemory, inputs: AttitudeInputs, params: PidParams, dt_s: float
) -> tuple[PidMemory, Vector3]:
    """Return the torque [N m, FRD]: PID on the angle error, with the rate error as derivative, and feed-forward."""
    error, rates, reference = inputs.error_rad, inputs.rates_frd_rad_s, inputs.reference
    rates_d, acceleration_d = reference.rates_frd_rad_s, reference.acceleration_frd_rad_s2
    memory = PidMemory(
        integrated(memory.roll, error.x, inputs.saturation.x, dt_s),
        integrated(memory.pitch, error.y, inputs.saturation.y, dt_s),
        integrated(memory.yaw, error.z, inputs.saturation.z, dt_s),
    )
    ff, fa = params.rate_feedforward, params.acceleration_feedforward
    roll = (
        params.kp_roll * error.x + params.ki_roll * memory.roll + params.kd_roll * (ff * rates_d.x - rates.x)
    )
    pitch = (
        params.kp_pitch * error.y
        + params.ki_pitch * memory.pitch
        + params.kd_pitch * (ff * rates_d.y - rates.y)
    )
    yaw = params.kp_yaw * error.z + params.ki_yaw * memory.yaw + params.kd_yaw * (ff * rates_d.z - rates.z)
    torque = Vector3(
        params.ix_kg_m2 * (roll + fa * acceleration_d.x),
        params.iy_kg_m2 * (pitch + fa * acceleration_d.y),
        params.iz_kg_m2 * (yaw + fa * acceleration_d.z),
    )
    return memory, torque


def paper_arm_m(vehicle: Vehicle) -> float:
    """Return the paper's l: the largest lever arm of a rotor about a horizontal body axis."""
    return max(max(abs(r.position_frd_m[0]), abs(r.position_frd_m[1])) for r in vehicle.rotors)


def read_pid_params(vehicle: Vehicle, gains: Table) -> PidParams:
    """Read ``[attitude_pid]``.

    ``convention = "paper"``: kp and kd give U2, U3 in N (b1 = l/Ix, b2 = l/Iy) and U4 in N m (b3 = 1/Iz).
    ``convention = "angular_acceleration"``: rad/s² per rad, per rad s and per rad/s.
    """
    kp, kd = gains.numbers("kp", 3, 0.0, 1e5), gains.numbers("kd", 3, 0.0, 1e4)
    ki = gains.numbers("ki", 3, 0.0, 1e5, (0.0, 0.0, 0.0))
    ix, iy, iz = vehicle.inertia_kg_m2
    scale = (1.0, 1.0, 1.0)
    if gains.choice("convention", ("angular_acceleration", "paper")) == "paper":
        arm = paper_arm_m(vehicle)
        scale = (arm / ix, arm / iy, 1.0 / iz)
    feedforward = (
        gains.number("rate_feedforward", 0.0, 1.0),
        gains.number("acceleration_feedforward", 0.0, 1.0),
    )
    gains.finish()
    flat = [g * s for group in (kp, ki, kd) for g, s in zip(group, scale, strict=True)]
    return PidParams._make((*flat, *feedforward, ix, iy, iz))


CONTROLLER = AttitudeController(
    "pid", attitude_pid_step, PidMemory, PidParams, (0.0, 0.0, 0.0), read_pid_params, PID_TUNABLES
)
