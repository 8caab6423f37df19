"""The rigid-body plant: quaternion kinematics, gyroscopic rotors, drag against the air, feet on the ground.

State vector: the array form of ``VehicleState`` (position NED, velocity NED, quaternion, body rates FRD).

    m v' = m g + R (−T e_z − D Rᵀ(v − wind)) + external force + contact
    q' = ½ q ⊗ ω
    I ω' = −ω × (I ω + h e_z) + rotor torques − Σ s J_r Ω̇ e_z + external torque + contact

with h = Σ s·J_r·Ω (errata.md's a1…a5, written without the small-angle kinematics). ``loading.py`` has the equations for
a payload or a moved centre of gravity, ``near_ground.py`` wind shear and ground effect. The ground is a plane that may
rise to the north.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Quaternion, Record, Vector3
from flightstack.core.geometry import cross
from sim_bridge.plant.contact import contact_force, move_anchor, normal_force
from sim_bridge.plant.layout import CONTACT
from sim_bridge.plant.loading import loaded_acceleration
from sim_bridge.plant.near_ground import thrust_ratio, wind_share
from sim_bridge.plant.rotors import RotorForces


class Rotation(NamedTuple):
    """Rotation matrix body to world, by rows."""

    row_n: Vector3
    row_e: Vector3
    row_d: Vector3


@compiled
def rotation(x: FloatArray) -> Rotation:
    """Return the rotation matrix of the quaternion in the state."""
    w, i, j, k = x[6], x[7], x[8], x[9]
    return Rotation(
        Vector3(1.0 - 2.0 * (j * j + k * k), 2.0 * (i * j - w * k), 2.0 * (i * k + w * j)),
        Vector3(2.0 * (i * j + w * k), 1.0 - 2.0 * (i * i + k * k), 2.0 * (j * k - w * i)),
        Vector3(2.0 * (i * k - w * j), 2.0 * (j * k + w * i), 1.0 - 2.0 * (i * i + j * j)),
    )


@compiled
def _dot(a: Vector3, b: Vector3) -> float:
    return a.x * b.x + a.y * b.y + a.z * b.z


@compiled
def _to_world(r: Rotation, v: Vector3) -> Vector3:
    return Vector3(_dot(r.row_n, v), _dot(r.row_e, v), _dot(r.row_d, v))


@compiled
def _to_body(r: Rotation, v: Vector3) -> Vector3:
    n, e, d = r.row_n, r.row_e, r.row_d
    return Vector3(
        n.x * v.x + e.x * v.y + d.x * v.z,
        n.y * v.x + e.y * v.y + d.y * v.z,
        n.z * v.x + e.z * v.y + d.z * v.z,
    )


@compiled
def _add(a: Vector3, b: Vector3) -> Vector3:
    return Vector3(a.x + b.x, a.y + b.y, a.z + b.z)


@compiled
def _on_slope(v: Vector3, m: Record) -> Vector3:
    """Return a vector NED along the ground (up the slope, east, and down along its normal)."""
    sine, cosine = m["ground_slope"][0], m["ground_slope"][1]
    return Vector3(cosine * v.x - sine * v.z, v.y, cosine * v.z + sine * v.x)


@compiled
def _off_slope(v: Vector3, m: Record) -> Vector3:
    """Return a vector along the ground in NED: the inverse of ``_on_slope``."""
    sine, cosine = m["ground_slope"][0], m["ground_slope"][1]
    return Vector3(cosine * v.x + sine * v.z, v.y, cosine * v.z - sine * v.x)


@compiled
def _near_ground(x: FloatArray, m: Record) -> bool:
    down = m["ground_slope"][1] * x[2] + m["ground_slope"][0] * x[0]
    near: bool = m["ground"] != 0 and down + m["reach"] > m["ground_z"]
    return near


@compiled
def _contact(x: FloatArray, r: Rotation, rates: Vector3, m: Record) -> tuple[Vector3, Vector3]:
    """Return force NED [N] and torque FRD [N m] of all contact points."""
    force, torque = Vector3(0.0, 0.0, 0.0), Vector3(0.0, 0.0, 0.0)
    points, shares, anchors = m["point"], m["point_share"], m["anchor"]
    for i in range(m["point_count"]):
        p = Vector3(points[i, 0], points[i, 1], points[i, 2])
        arm = _to_world(r, p)
        at = _on_slope(Vector3(x[0] + arm.x, x[1] + arm.y, x[2] + arm.z), m)
        depth = at.z - m["ground_z"]
        if depth > 0.0:
            spin = _to_world(r, cross(rates, p))
            velocity = _on_slope(Vector3(x[3] + spin.x, x[4] + spin.y, x[5] + spin.z), m)
            stiffness, damping = m["stiffness"] * shares[i], m["damping"] * shares[i]
            normal = normal_force(depth, velocity.z, stiffness, damping, m["ramp"])
            f = _off_slope(contact_force(at, velocity, anchors[i], normal, stiffness, damping), m)
            force = _add(force, f)
            torque = _add(torque, cross(p, _to_body(r, f)))
    return force, torque


@compiled
def _store_attitude_rate(q: Quaternion, rates: Vector3, out: FloatArray) -> None:
    """Write the time derivative of the quaternion, ½ q ⊗ (0, ω), to ``out``."""
    out[6] = -0.5 * (q.x * rates.x + q.y * rates.y + q.z * rates.z)
    out[7] = 0.5 * (q.w * rates.x + q.y * rates.z - q.z * rates.y)
    out[8] = 0.5 * (q.w * rates.y + q.z * rates.x - q.x * rates.z)
    out[9] = 0.5 * (q.w * rates.z + q.x * rates.y - q.y * rates.x)


@compiled
def derivative(x: FloatArray, rotors: RotorForces, m: Record, out: FloatArray) -> None:
    """Write the time derivative of the state ``x``, shape (13,), to ``out``."""
    r = rotation(x)
    rates = Vector3(x[10], x[11], x[12])
    wind, gust, drag = m["wind"], m["gust"], m["drag"]
    wn, we, wd = wind[0], wind[1], wind[2]
    thrust, tx, ty = rotors.thrust_n, rotors.roll_n_m, rotors.pitch_n_m
    if m["alters_air"] != 0:
        share, lift = wind_share(m, x[2]), thrust_ratio(m, x[2], r.row_d.z)
        wn, we, wd = share * wn, share * we, share * wd
        thrust, tx, ty = lift * thrust, lift * tx, lift * ty
    air = _to_body(r, Vector3(x[3] - wn - gust[0], x[4] - we - gust[1], x[5] - wd - gust[2]))
    push = _to_world(r, Vector3(-drag[0] * air.x, -drag[1] * air.y, -drag[2] * air.z - thrust))
    tx = tx + m["torque"][0]
    ty = ty + m["torque"][1]
    tz = rotors.drag_torque_n_m + rotors.spin_up_torque_n_m + m["torque"][2]
    if _near_ground(x, m):
        force, torque = _contact(x, r, rates, m)
        push = _add(push, force)
        tx, ty, tz = tx + torque.x, ty + torque.y, tz + torque.z
    out[0], out[1], out[2] = x[3], x[4], x[5]
    external, mass = m["force"], m["mass"]
    _store_attitude_rate(Quaternion(x[6], x[7], x[8], x[9]), rates, out)
    inertia, h = m["inertia"], rotors.momentum_n_m_s
    if m["is_loaded"] != 0:
        force = Vector3(push.x + external[0], push.y + external[1], push.z + external[2])
        a = loaded_acceleration(m, _to_body(r, force), Vector3(tx, ty, tz), rates, h)
        of_origin = _to_world(r, a.of_origin)
        out[3], out[4], out[5] = of_origin.x, of_origin.y, of_origin.z + m["weight"] / mass
        out[10], out[11], out[12] = a.angular.x, a.angular.y, a.angular.z
        return
    out[3] = (push.x + external[0]) / mass
    out[4] = (push.y + external[1]) / mass
    out[5] = (push.z + external[2] + m["weight"]) / mass
    out[10] = (tx + (inertia[1] - inertia[2]) * rates.y * rates.z - rates.y * h) / inertia[0]
    out[11] = (ty + (inertia[2] - inertia[0]) * rates.z * rates.x + rates.x * h) / inertia[1]
    out[12] = (tz + (inertia[0] - inertia[1]) * rates.x * rates.y) / inertia[2]


@compiled
def before_step(x: FloatArray, m: Record) -> None:
    """Slip the friction anchors."""
    if not _near_ground(x, m):
        return
    r = rotation(x)
    rates = Vector3(x[10], x[11], x[12])
    points, shares, anchors = m["point"], m["point_share"], m["anchor"]
    for i in range(m["point_count"]):
        p = Vector3(points[i, 0], points[i, 1], points[i, 2])
        arm, spin = _to_world(r, p), _to_world(r, cross(rates, p))
        at = _on_slope(Vector3(x[0] + arm.x, x[1] + arm.y, x[2] + arm.z), m)
        sink = _on_slope(Vector3(x[3] + spin.x, x[4] + spin.y, x[5] + spin.z), m).z
        stiffness, damping = m["stiffness"] * shares[i], m["damping"] * shares[i]
        normal = normal_force(at.z - m["ground_z"], sink, stiffness, damping, m["ramp"])
        move_anchor(anchors[i], at.x, at.y, normal, stiffness)


@compiled
def after_step(x: FloatArray) -> None:
    """Normalise the quaternion."""
    scale = 1.0 / math.sqrt(x[6] * x[6] + x[7] * x[7] + x[8] * x[8] + x[9] * x[9])
    x[6], x[7], x[8], x[9] = x[6] * scale, x[7] * scale, x[8] * scale, x[9] * scale


@compiled
def show(m: Record, state: FloatArray) -> int:
    """Write the array form of ``VehicleState`` to ``state``; return CONTACT on the ground, else 0."""
    x = m["body"]
    for i in range(13):
        state[i] = x[i]
    if _near_ground(x, m):
        r = rotation(x)
        points = m["point"]
        for i in range(m["point_count"]):
            arm = _to_world(r, Vector3(points[i, 0], points[i, 1], points[i, 2]))
            if _on_slope(Vector3(x[0] + arm.x, x[1] + arm.y, x[2] + arm.z), m).z > m["ground_z"]:
                return CONTACT
    return 0
