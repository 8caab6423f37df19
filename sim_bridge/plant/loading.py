"""Mass, centre of gravity and inertia of a vehicle with a payload or a moved centre of gravity, and its motion.

The state of a plant is that of the origin O of the vehicle file, at which the centre of gravity C is by default. With
C at c from O (body FRD), mass m and inertia J about C, Newton's law for C and Euler's law about C (Featherstone, Rigid
Body Dynamics Algorithms, 2008, chapter 2) give

    J ω' = τ − c × F − ω × (J ω + h)
    a_O = g + R [F / m − ω' × c − ω × (ω × c)]

F is the sum of all forces but gravity, τ their torque about O, h the angular momentum of the rotors, R body to world:
gravity has no torque about C, and the acceleration of O is that of C without the rotation of c.

A payload is a point mass. Steiner's theorem: about C, each part adds m_i (|r|² 1 − r rᵀ), r from C to the part.
"""

from __future__ import annotations

from typing import NamedTuple

from flightstack.core.compiled import compiled
from flightstack.core.contract import Record, Vector3
from flightstack.core.geometry import cross

Matrix = tuple[Vector3, Vector3, Vector3]
"""A 3×3 matrix by rows."""

_ORIGIN = Vector3(0.0, 0.0, 0.0)


class Loading(NamedTuple):
    """Change of a vehicle's mass properties, body axes from the origin of the vehicle file."""

    centre_frd_m: Vector3 = _ORIGIN  # centre of gravity without payload
    payload_kg: float = 0.0
    payload_frd_m: Vector3 = _ORIGIN


AS_BUILT = Loading()


class Body(NamedTuple):
    """Mass properties of a body."""

    mass_kg: float
    centre_m: Vector3
    inertia_kg_m2: Matrix  # about the centre


def scaled(matrix: Matrix, factor: float) -> Matrix:
    """Return a matrix times a number."""
    a, b, c = (Vector3(factor * row.x, factor * row.y, factor * row.z) for row in matrix)
    return a, b, c


def added(one: Matrix, other: Matrix) -> Matrix:
    """Return the sum of two matrices."""
    a, b, c = (Vector3(p.x + q.x, p.y + q.y, p.z + q.z) for p, q in zip(one, other, strict=True))
    return a, b, c


def steiner(mass_kg: float, r: Vector3) -> Matrix:
    """Return the inertia of a point mass at ``r``: m (|r|² 1 − r rᵀ)."""
    xy, xz, yz = -mass_kg * r.x * r.y, -mass_kg * r.x * r.z, -mass_kg * r.y * r.z
    return (
        Vector3(mass_kg * (r.y * r.y + r.z * r.z), xy, xz),
        Vector3(xy, mass_kg * (r.x * r.x + r.z * r.z), yz),
        Vector3(xz, yz, mass_kg * (r.x * r.x + r.y * r.y)),
    )


def moved(body: Body, offset_m: Vector3) -> Body:
    """Return the body with its centre elsewhere and the same inertia about it."""
    return body._replace(centre_m=_sum(body.centre_m, offset_m))


def with_point(body: Body, mass_kg: float, at_m: Vector3) -> Body:
    """Return the body with a point mass."""
    mass = body.mass_kg + mass_kg
    share = mass_kg / mass
    away = _difference(at_m, body.centre_m)
    reduced_kg = body.mass_kg * share  # m1·m2/(m1 + m2)
    centre = _sum(body.centre_m, Vector3(share * away.x, share * away.y, share * away.z))
    return Body(mass, centre, added(body.inertia_kg_m2, steiner(reduced_kg, away)))


def loaded(body: Body, loading: Loading) -> Body:
    """Return a vehicle whose centre of gravity is in the origin with a loading."""
    body = moved(body, loading.centre_frd_m)
    return with_point(body, loading.payload_kg, loading.payload_frd_m) if loading.payload_kg > 0.0 else body


def inverse(matrix: Matrix) -> Matrix:
    """Return the inverse of a symmetric matrix by its cofactors."""
    a, b, c = matrix
    ca, cb, cc = cross(b, c), cross(c, a), cross(a, b)
    determinant = a.x * ca.x + a.y * ca.y + a.z * ca.z
    return scaled((ca, cb, cc), 1.0 / determinant)


def _sum(a: Vector3, b: Vector3) -> Vector3:
    return Vector3(a.x + b.x, a.y + b.y, a.z + b.z)


def _difference(a: Vector3, b: Vector3) -> Vector3:
    return Vector3(a.x - b.x, a.y - b.y, a.z - b.z)


class Acceleration(NamedTuple):
    """Accelerations of a body in body axes."""

    of_origin: Vector3  # without gravity, m/s²
    angular: Vector3  # rad/s²


@compiled
def _product(matrix: Record, v: Vector3) -> Vector3:
    return Vector3(
        matrix[0, 0] * v.x + matrix[0, 1] * v.y + matrix[0, 2] * v.z,
        matrix[1, 0] * v.x + matrix[1, 1] * v.y + matrix[1, 2] * v.z,
        matrix[2, 0] * v.x + matrix[2, 1] * v.y + matrix[2, 2] * v.z,
    )


@compiled
def loaded_acceleration(
    m: Record, force: Vector3, torque: Vector3, rates: Vector3, momentum: float
) -> Acceleration:
    """Return the accelerations of a loaded vehicle, by the equations of this module.

    ``force`` [N] is F and ``torque`` [N m] τ about the origin, both in body axes; ``momentum`` [N m s] is h about z.
    """
    c = Vector3(m["centre"][0], m["centre"][1], m["centre"][2])
    spin = _product(m["inertia_matrix"], rates)
    turned = cross(rates, Vector3(spin.x, spin.y, spin.z + momentum))
    lever = cross(c, force)
    angular = _product(
        m["inverse_inertia"],
        Vector3(torque.x - lever.x - turned.x, torque.y - lever.y - turned.y, torque.z - lever.z - turned.z),
    )
    tangential, centripetal = cross(angular, c), cross(rates, cross(rates, c))
    mass = m["mass"]
    return Acceleration(
        Vector3(
            force.x / mass - tangential.x - centripetal.x,
            force.y / mass - tangential.y - centripetal.y,
            force.z / mass - tangential.z - centripetal.z,
        ),
        angular,
    )
