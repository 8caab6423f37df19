"""Placed parts of an assembly: copies for arms and rotors, poses relative to their body."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from flightstack.core.contract import FloatArray, Quaternion, Vector3
from flightstack.core.geometry import quaternion_from_euler, rotate
from flightstack.params.vehicle import Vehicle
from flightstack.params.vehicle_parts import Part
from sim_bridge.multibody.mass import MassProperties, combined, solid, transformed


class PlacedPart(NamedTuple):
    """One solid on one body: ``body`` is 0 for the frame, 1 to n for the rotors in the vehicle's order."""

    part: Part  # with a unique name and its pose in the body
    body: int
    has_contact: bool = True  # with the ground

    def properties(self) -> MassProperties:
        """Return its mass properties in the axes FRD of its body."""
        own, position = solid(self.part), np.array(self.part.position_frd_m)
        if not any(self.part.euler_rad):
            return own._replace(centre_m=position + own.centre_m)
        return transformed(own, rotation_matrix(quaternion_from_euler(*self.part.euler_rad)), position)

    def lowest_z_m(self) -> float:
        """Return the lowest point in a level vehicle, FRD of its body; of a mesh, its origin."""
        size, (_, _, z) = self.part.size_m, self.part.position_frd_m
        down = rotation_matrix(quaternion_from_euler(*self.part.euler_rad))[2]
        if self.part.shape == "box":
            return z + float(np.abs(down) @ np.array(size)) / 2.0
        if self.part.shape == "mesh":
            return z
        radius, length = size[0], size[1] if len(size) > 1 else 0.0
        if self.part.shape == "cylinder":
            radius *= math.hypot(down[0], down[1])
        return z + radius + abs(float(down[2])) * length / 2.0


def rotation_matrix(q: Quaternion) -> FloatArray:
    """Return the matrix of a rotation, shape (3, 3)."""
    axes = (Vector3(1.0, 0.0, 0.0), Vector3(0.0, 1.0, 0.0), Vector3(0.0, 0.0, 1.0))
    return np.array([rotate(q, axis) for axis in axes]).T


def place(vehicle: Vehicle, part: Part) -> list[PlacedPart]:
    """Return the copies of a part of a vehicle file, one for the frame or one for each arm or rotor."""
    if part.mount == "body":
        return [PlacedPart(part, 0)]
    copies = []
    for number, rotor in enumerate(vehicle.rotors, start=1):
        name = f"{part.name}_{number}"
        if part.mount == "rotor":
            copies.append(PlacedPart(replace(part, name=name), number, has_contact=False))
            continue
        x, y, z = rotor.position_frd_m
        azimuth = math.atan2(y, x)
        arm = quaternion_from_euler(0.0, 0.0, azimuth)
        away = rotate(arm, Vector3(*part.position_frd_m))
        roll, pitch, yaw = part.euler_rad
        # a rotation about z before the others adds to yaw: the order is yaw, pitch, roll
        copies.append(
            PlacedPart(
                replace(
                    part,
                    name=name,
                    position_frd_m=(x + away.x, y + away.y, z + away.z),
                    euler_rad=(roll, pitch, yaw + azimuth),
                ),
                0,
            )
        )
    return copies


def of_body(parts: Sequence[PlacedPart], body: int) -> MassProperties:
    """Return the mass properties of all parts of one body, in its axes FRD."""
    return combined(item.properties() for item in parts if item.body == body)


def of_all(vehicle: Vehicle, parts: Sequence[PlacedPart]) -> MassProperties:
    """Return the mass properties of the whole vehicle with its rotors at rest, in the axes FRD of the frame."""
    bodies = [of_body(parts, 0)]
    for number, rotor in enumerate(vehicle.rotors, start=1):
        own = of_body(parts, number)
        bodies.append(own._replace(centre_m=own.centre_m + np.array(rotor.position_frd_m)))
    return combined(bodies)
