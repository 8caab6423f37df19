"""The paper's small-angle plant: its equation 7, corrected as in the project's errata, in NED/FRD.

State vector: position NED, velocity NED, φ θ ψ, p q r; the thirteenth value is unused. The paper sets φ' = p, θ' = q,
ψ' = r. U1…U4 are the vehicle's effectiveness matrix times Ω² for any rotor list, arm included (l·U2, l·U3 of the
paper). As in the paper there is no drag and no spin-up torque.

    x'' = −(cφ sθ cψ + sφ sψ) U1/m      y'' = −(cφ sθ sψ − sφ cψ) U1/m      z'' = g − cφ cθ U1/m
    p' = a1 q r + a2 q Ωr + b1 U2       q' = a3 p r − a4 p Ωr + b2 U3       r' = a5 p q + b3 U4

On the ground the vehicle is one point at its origin. A spring and damper, limited by the load on the feet, holds the
attitude level, and friction holds the heading.
"""

from __future__ import annotations

from typing import NamedTuple

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Record, Vector3
from flightstack.core.geometry import quaternion_from_euler
from flightstack.core.portable_math import sin_cos
from sim_bridge.plant.contact import FRICTION, contact_force, limited, move_anchor, normal_force
from sim_bridge.plant.layout import CONTACT
from sim_bridge.plant.rotors import RotorForces


class _Contact(NamedTuple):
    force_ned_n: Vector3
    torque_frd_n_m: Vector3


@compiled
def _normal(x: FloatArray, m: Record) -> float:
    if m["ground"] == 0:
        return 0.0
    return normal_force(x[2] - m["ground_z"], x[5], m["stiffness"], m["damping"], m["ramp"])


@compiled
def _contact(x: FloatArray, normal_n: float, m: Record) -> _Contact:
    anchor = m["anchor"][0]
    force = contact_force(
        Vector3(x[0], x[1], x[2]), Vector3(x[3], x[4], x[5]), anchor, normal_n, m["stiffness"], m["damping"]
    )
    load = min(1.0, normal_n / m["weight"])
    k, c = load * m["stiffness"] / m["mass"], load * m["damping"] / m["mass"]  # per unit of inertia
    inertia, tilt_limit = m["inertia"], load * m["weight"] * m["lever"]
    return _Contact(
        force,
        Vector3(
            limited(-inertia[0] * (k * sin_cos(x[6])[0] + c * x[9]), tilt_limit),
            limited(-inertia[1] * (k * sin_cos(x[7])[0] + c * x[10]), tilt_limit),
            limited(-inertia[2] * (k * (x[8] - anchor[2]) + c * x[11]), FRICTION * tilt_limit),
        ),
    )


@compiled
def derivative(x: FloatArray, rotors: RotorForces, m: Record, out: FloatArray) -> None:
    """Write the time derivative of the state ``x``, shape (13,), to ``out``."""
    force, torque = m["force"], m["torque"]
    fx, fy, fz = force[0], force[1], force[2] + m["weight"]
    tx, ty, tz = torque[0], torque[1], torque[2]
    normal = _normal(x, m)
    if normal > 0.0:
        ground = _contact(x, normal, m)
        fx, fy, fz = fx + ground.force_ned_n.x, fy + ground.force_ned_n.y, fz + ground.force_ned_n.z
        tx, ty, tz = tx + ground.torque_frd_n_m.x, ty + ground.torque_frd_n_m.y, tz + ground.torque_frd_n_m.z
    (sf, cf), (st, ct), (sp, cp) = sin_cos(x[6]), sin_cos(x[7]), sin_cos(x[8])
    u1, mass, inertia = rotors.thrust_n, m["mass"], m["inertia"]
    p, q, r = x[9], x[10], x[11]
    out[0], out[1], out[2] = x[3], x[4], x[5]
    out[3] = (fx - (cf * st * cp + sf * sp) * u1) / mass
    out[4] = (fy - (cf * st * sp - sf * cp) * u1) / mass
    out[5] = (fz - cf * ct * u1) / mass
    out[6], out[7], out[8] = p, q, r
    h = rotors.momentum_n_m_s  # −J_r Ωr of the paper
    out[9] = ((inertia[1] - inertia[2]) * q * r - q * h + rotors.roll_n_m + tx) / inertia[0]
    out[10] = ((inertia[2] - inertia[0]) * p * r + p * h + rotors.pitch_n_m + ty) / inertia[1]
    out[11] = ((inertia[0] - inertia[1]) * p * q + rotors.drag_torque_n_m + tz) / inertia[2]
    out[12] = 0.0


@compiled
def before_step(x: FloatArray, m: Record) -> None:
    """Slip the friction anchors of position and heading."""
    if m["ground"] == 0:
        return
    anchor, normal = m["anchor"][0], _normal(x, m)
    move_anchor(anchor, x[0], x[1], normal, m["stiffness"])
    if normal == 0.0:
        anchor[2] = x[8]
        return
    # angle at which the heading spring reaches its limit; both grow with the load
    largest = FRICTION * m["weight"] * m["lever"] * m["mass"] / (m["inertia"][2] * m["stiffness"])
    anchor[2] = x[8] - limited(x[8] - anchor[2], largest)


@compiled
def after_step(x: FloatArray) -> None:
    """Do nothing: Euler angles have no constraint."""


@compiled
def show(m: Record, state: FloatArray) -> int:
    """Write the array form of ``VehicleState`` to ``state``; return CONTACT on the ground, else 0."""
    x = m["body"]
    q = quaternion_from_euler(x[6], x[7], x[8])
    for i in range(6):
        state[i] = x[i]
    state[6], state[7], state[8], state[9] = q.w, q.x, q.y, q.z
    state[10], state[11], state[12] = x[9], x[10], x[11]
    return CONTACT if m["ground"] != 0 and x[2] > m["ground_z"] else 0
