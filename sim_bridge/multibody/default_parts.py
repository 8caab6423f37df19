"""The default parts of a multirotor, made from the rotor geometry, the leg height and the mass of a vehicle file.

A plate in the middle, arms with motors under the propellers, legs with feet under the motors, and on a column through
the plate a battery above and the avionics below. Materials are real; the sizes follow from the typical mass share of
each part and from ``Adjustments``, which ``assembly.py`` tunes until the whole meets the vehicle file.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from flightstack.params.vehicle import Rotor, Vehicle
from flightstack.params.vehicle_parts import MATERIALS, Part
from sim_bridge.multibody.placing import PlacedPart
from sim_bridge.plant.dimensions import arm_m, foot_z_m, propeller_radius_m


class Adjustments(NamedTuple):
    """Tuned quantities, 0 by default: logarithms of factors, offsets in arm lengths, an angle [rad]."""

    motors: float = 0.0  # mass, scaled in all directions
    battery: float = 0.0  # mass, scaled in all directions
    avionics: float = 0.0  # mass, scaled in all directions
    arms: float = 0.0  # mass of arms and plate, scaled in thickness
    legs: float = 0.0  # mass of legs and feet
    battery_height: float = 0.0
    avionics_drop: float = 0.0
    battery_length: float = 0.0  # at constant mass
    avionics_length: float = 0.0
    battery_x: float = 0.0
    battery_y: float = 0.0
    avionics_x: float = 0.0
    avionics_y: float = 0.0
    battery_yaw: float = 0.0


_HEIGHT, _LENGTH, _OFFSET, _YAW = math.log(3.0), math.log(1.8), 0.4, math.pi / 4.0
LIMITS = tuple(
    Adjustments(*(math.log(mass),) * 5, *(_HEIGHT,) * 2, *(_LENGTH,) * 2, *(_OFFSET,) * 4, _YAW)
    for mass in (1.6, 3.0, 8.0)
)
"""Limits of each adjustment, up and down, narrow ones first.

The paper's vehicle is met within the first; x_quad needs the second, with light legs and a heavy middle.
"""

# share of the vehicle's mass; motors, arms, legs and feet in total
_PLATE, _ARMS, _MOTORS, _LEGS, _FEET, _BATTERY, _AVIONICS, _COLUMN = (
    0.08, 0.08, 0.24, 0.05, 0.04, 0.31, 0.15, 0.02,
)  # fmt: skip
_PROPELLER_THICKNESS_M = 0.002
_CLEARANCE_M = 0.004


def default_parts(vehicle: Vehicle, adjust: Adjustments) -> list[PlacedPart]:
    """Return all parts: plate, column, battery, avionics and, numbered, arm, motor, leg, foot, propeller."""
    parts = _middle(vehicle, adjust)
    for number, rotor in enumerate(vehicle.rotors, start=1):
        parts += _arm(vehicle, rotor, number, adjust)
    return parts


def _volume(vehicle: Vehicle, share: float, logarithm: float, material: str) -> float:
    return share * vehicle.mass_kg * math.exp(logarithm) / MATERIALS[material]


def _part(
    name: str, shape: str, size: tuple[float, ...], material: str, at: tuple[float, float, float],
    euler: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Part:  # fmt: skip
    return Part(name, shape, size, material, MATERIALS[material], at, euler)


def _middle(vehicle: Vehicle, adjust: Adjustments) -> list[PlacedPart]:
    arm, foot_z = arm_m(vehicle), foot_z_m(vehicle)
    middle = [_motor(vehicle, rotor, adjust).z_m for rotor in vehicle.rotors]
    top_z = sum(middle) / len(middle)
    side = 0.4 * arm
    thickness = _volume(vehicle, _PLATE, adjust.arms, "carbon") / side**2
    x, y, z = _block(vehicle, _BATTERY, adjust.battery, "battery", (2.2, 1.2, 1.0))
    stretch = math.exp(adjust.battery_length)
    battery = (x * stretch, y / stretch, z)
    x, y, z = _block(vehicle, _AVIONICS, adjust.avionics, "electronics", (1.0, 1.6, 0.7))
    stretch = math.exp(adjust.avionics_length)
    avionics = (x / stretch, y * stretch, z)
    above = top_z - thickness / 2.0 - battery[2] / 2.0 - 0.14 * arm * math.exp(adjust.battery_height)
    below = top_z + thickness / 2.0 + avionics[2] / 2.0
    room = max(foot_z - below - avionics[2] / 2.0 - 0.05 * arm, 0.02 * arm)  # above the ground
    drop = 0.14 * arm * math.exp(adjust.avionics_drop)
    below += drop / (1.0 + (drop / room) ** 4) ** 0.25  # smooth, always less than the room
    column_m = below - above
    radius = math.sqrt(_volume(vehicle, _COLUMN, 0.0, "carbon_tube") / (math.pi * column_m))
    battery_at = (adjust.battery_x * arm, adjust.battery_y * arm, above)
    avionics_at = (adjust.avionics_x * arm, adjust.avionics_y * arm, below)
    column_at, yaw = (0.0, 0.0, (above + below) / 2.0), (0.0, 0.0, adjust.battery_yaw)
    return [
        PlacedPart(_part("plate", "box", (side, side, thickness), "carbon", (0.0, 0.0, top_z)), 0, False),
        PlacedPart(_part("column", "cylinder", (radius, column_m), "carbon_tube", column_at), 0, False),
        PlacedPart(_part("battery", "box", battery, "battery", battery_at, yaw), 0),
        PlacedPart(_part("avionics", "box", avionics, "electronics", avionics_at), 0),
    ]


def _block(
    vehicle: Vehicle, share: float, logarithm: float, material: str, ratio: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Return the edges of a block with these ratios."""
    unit = math.cbrt(_volume(vehicle, share, logarithm, material) / math.prod(ratio))
    return ratio[0] * unit, ratio[1] * unit, ratio[2] * unit


class _Motor(NamedTuple):
    radius_m: float
    length_m: float
    z_m: float


def _foot_radius_m(vehicle: Vehicle, adjust: Adjustments) -> float:
    volume = _volume(vehicle, _FEET / len(vehicle.rotors), adjust.legs, "rubber")
    return math.cbrt(volume / (4.0 / 3.0 * math.pi))


def _has_legs(vehicle: Vehicle, rotor: Rotor) -> bool:
    """Return True if a motor and a leg of default size fit under the propeller."""
    volume = _volume(vehicle, _MOTORS / len(vehicle.rotors), 0.0, "motor")
    needed = math.cbrt(volume) + 4.0 * _foot_radius_m(vehicle, Adjustments())
    return foot_z_m(vehicle) - rotor.position_frd_m[2] > needed


def _motor(vehicle: Vehicle, rotor: Rotor, adjust: Adjustments) -> _Motor:
    """Return size and height of a motor: under the propeller, or above it if there is no room."""
    volume = _volume(vehicle, _MOTORS / len(vehicle.rotors), adjust.motors, "motor")
    radius = math.cbrt(volume / (0.9 * math.pi))
    length, z = 0.9 * radius, rotor.position_frd_m[2]
    side = 1.0 if _has_legs(vehicle, rotor) else -1.0
    return _Motor(radius, length, z + side * (_CLEARANCE_M + length / 2.0))


def _arm(vehicle: Vehicle, rotor: Rotor, number: int, adjust: Adjustments) -> list[PlacedPart]:
    """Return arm, motor, leg, foot and propeller of one rotor."""
    x, y, _ = rotor.position_frd_m
    length, azimuth, foot_z = math.hypot(x, y), math.atan2(y, x), foot_z_m(vehicle)
    each = 1.0 / len(vehicle.rotors)
    inner = 0.2 * arm_m(vehicle)
    motor_radius, motor_m, motor_z = _motor(vehicle, rotor, adjust)
    foot_radius = _foot_radius_m(vehicle, adjust)
    tube = _volume(vehicle, _ARMS * each, adjust.arms, "carbon_tube") / max(length - inner, 0.1 * length)
    middle = 0.5 * (1.0 + inner / length)
    parts = [
        _part(
            f"arm_{number}", "cylinder", (math.sqrt(tube / math.pi), max(length - inner, 0.1 * length)),
            "carbon_tube", (middle * x, middle * y, motor_z), (0.0, math.pi / 2.0, azimuth),
        ),
        _part(f"motor_{number}", "cylinder", (motor_radius, motor_m), "motor", (x, y, motor_z)),
        _part(f"foot_{number}", "sphere", (foot_radius,), "rubber", (x, y, foot_z - foot_radius)),
    ]  # fmt: skip
    if _has_legs(vehicle, rotor):
        leg_m = max(foot_z - 2.0 * foot_radius - motor_z - motor_m / 2.0, 0.1 * foot_radius)
        volume = _volume(vehicle, _LEGS * each, adjust.legs, "carbon_tube")
        at = (x, y, foot_z - 2.0 * foot_radius - leg_m / 2.0)
        radius = math.sqrt(volume / (math.pi * leg_m))
        parts.append(_part(f"leg_{number}", "cylinder", (radius, leg_m), "carbon_tube", at))
    frame = [PlacedPart(part, 0, part.name.startswith(("motor", "foot"))) for part in parts]
    disc = (propeller_radius_m(vehicle), _PROPELLER_THICKNESS_M)
    propeller = _part(f"propeller_{number}", "cylinder", disc, "propeller", (0.0, 0.0, 0.0))
    return [*frame, PlacedPart(propeller, number, False)]
