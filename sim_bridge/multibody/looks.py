"""What a vehicle looks like: a whole body drawn from the rotor geometry, for vehicles whose model brings none.

Body frame FLU of the model: x forward, y left, z up [m]; the vehicle file's FRD positions are turned by pi about x.
"""

from __future__ import annotations

import math
from xml.etree.ElementTree import Element

from flightstack.params.vehicle import Vehicle
from sim_bridge.multibody.xml import add, paint_only

Colour = tuple[float, float, float, float]
CARBON: Colour = (0.115, 0.12, 0.13, 1.0)
FRONT: Colour = (0.93, 0.33, 0.07, 1.0)
METAL: Colour = (0.62, 0.64, 0.67, 1.0)
BATTERY: Colour = (0.13, 0.24, 0.45, 1.0)
SHELL: Colour = (0.90, 0.91, 0.92, 1.0)
BLADE: Colour = (0.16, 0.165, 0.175, 1.0)
DISC: Colour = (0.55, 0.65, 0.75, 0.2)
DISC_NAME, BLADE_NAME = "disc_{}", "blade_{}_{}"
"""Names of what the renderer tints with the rotor's speed; rotors count from 1, blades from 0."""


def span_m(vehicle: Vehicle) -> float:
    """Distance from the centre to the tip of the farthest propeller [m]."""
    return max(math.hypot(*r.position_frd_m[:2]) for r in vehicle.rotors) + propeller_radius_m(vehicle)


def propeller_radius_m(vehicle: Vehicle) -> float:
    """Radius that leaves the propellers room beside each other [m]."""
    at = [rotor.position_frd_m[:2] for rotor in vehicle.rotors]
    gaps = [math.dist(a, b) for index, a in enumerate(at) for b in at[:index] if math.dist(a, b) > 1e-3]
    return 0.44 * min([*gaps, 1.2 * max(math.hypot(*a) for a in at)])


def foot_z_m(vehicle: Vehicle) -> float:
    """Height of the feet, negative [m]: where the ground is when the vehicle stands at home."""
    return -max(vehicle.leg_height_m, *(rotor.position_frd_m[2] for rotor in vehicle.rotors))


def add_body(body: Element, vehicle: Vehicle) -> None:
    """Draw frame, arms, motors and legs into the body of the vehicle."""
    arm_m = max(math.hypot(*rotor.position_frd_m[:2]) for rotor in vehicle.rotors)
    _hub(body, arm_m)
    for rotor in vehicle.rotors:
        x, y, z = rotor.position_frd_m[0], -rotor.position_frd_m[1], -rotor.position_frd_m[2]
        _arm(body, (x, y, z), arm_m, foot_z_m(vehicle), propeller_radius_m(vehicle))


def add_trim(body: Element, vehicle: Vehicle, top_m: float) -> None:
    """Add what tells front from back to any vehicle: canopy, camera, lights; ``top_m`` is its height."""
    arm_m = max(math.hypot(*rotor.position_frd_m[:2]) for rotor in vehicle.rotors)
    s = arm_m
    paint_only(body, "ellipsoid", size=(0.24 * s, 0.15 * s, 0.12 * s), pos=(0.04 * s, 0, top_m), rgba=SHELL)
    paint_only(
        body,
        "ellipsoid",
        size=(0.10 * s, 0.11 * s, 0.08 * s),
        pos=(0.18 * s, 0, top_m + 0.02 * s),
        rgba=FRONT,
    )
    paint_only(
        body, "cylinder", size=(0.055 * s, 0.014 * s), pos=(-0.13 * s, 0, top_m + 0.125 * s), rgba=CARBON
    )
    paint_only(body, "sphere", size=(0.075 * s,), pos=(0.27 * s, 0, -0.09 * s), rgba=CARBON)
    paint_only(
        body, "cylinder", size=(0.04 * s, 0.02 * s), pos=(0.34 * s, 0, -0.09 * s),
        euler=(0, math.pi / 2, 0), rgba=(0.25, 0.42, 0.60, 1.0),
    )  # fmt: skip


def add_propeller(body: Element, number: int, radius_m: float, clockwise: bool) -> None:
    """Draw blades and the disc that they blur to into the body of rotor ``number``, from 1."""
    r, pitch = radius_m, math.radians(14.0 if clockwise else -14.0)
    paint_only(body, "cylinder", size=(0.09 * r, 0.05 * r), rgba=METAL)
    for blade in range(2):
        side = 1.0 - 2.0 * blade
        paint_only(
            body, "ellipsoid", name=BLADE_NAME.format(number, blade), size=(0.45 * r, 0.085 * r, 0.012 * r),
            pos=(0.53 * r * side, 0, 0.03 * r), euler=(pitch * side, 0, 0), rgba=BLADE,
        )  # fmt: skip
    paint_only(
        body, "cylinder", name=DISC_NAME.format(number), size=(r, 0.006 * r), pos=(0, 0, 0.03 * r), rgba=DISC
    )


def _hub(body: Element, arm_m: float) -> None:
    s = arm_m
    for z in (-0.07, 0.06):
        paint_only(body, "cylinder", size=(0.30 * s, 0.012 * s), pos=(0, 0, z * s), rgba=CARBON)
    for corner in range(4):
        angle = math.pi * (0.25 + 0.5 * corner)
        pos = (0.24 * s * math.cos(angle), 0.24 * s * math.sin(angle), 0.0)
        paint_only(body, "cylinder", size=(0.015 * s, 0.07 * s), pos=pos, rgba=METAL)
    paint_only(body, "box", size=(0.17 * s, 0.17 * s, 0.035 * s), rgba=(0.10, 0.30, 0.20, 1.0))
    paint_only(
        body, "box", size=(0.26 * s, 0.12 * s, 0.075 * s), pos=(-0.02 * s, 0, -0.165 * s), rgba=BATTERY
    )
    paint_only(body, "box", size=(0.03 * s, 0.125 * s, 0.08 * s), pos=(-0.02 * s, 0, -0.165 * s), rgba=FRONT)


def _arm(
    body: Element, hub: tuple[float, float, float], arm_m: float, foot_m: float, radius_m: float
) -> None:
    """One arm with motor, leg and foot; ``hub`` is where the rotor is."""
    x, y, z = hub
    s, front = arm_m, x > 0.05 * arm_m
    motor_m = 0.07 * s
    seat = z - motor_m - 0.03 * s
    paint_only(
        body, "capsule", size=(0.038 * s,), fromto=(0.2 * x, 0.2 * y, 0.0, x, y, seat),
        rgba=FRONT if front else CARBON,
    )  # fmt: skip
    paint_only(
        body, "cylinder", size=(0.085 * s, 0.5 * motor_m), pos=(x, y, seat + 0.5 * motor_m), rgba=METAL
    )
    paint_only(
        body, "cylinder", size=(0.087 * s, 0.25 * motor_m), pos=(x, y, seat + 0.72 * motor_m), rgba=CARBON
    )
    light = (0.95, 0.10, 0.08, 1.0) if front and y > 0 else (0.15, 0.85, 0.25, 1.0)
    paint_only(
        body, "sphere", size=(0.035 * s,), pos=(1.06 * x, 1.06 * y, seat - 0.03 * s),
        rgba=light if abs(y) > 0.05 * s and front else (0.95, 0.95, 0.95, 1.0),
    )  # fmt: skip
    foot = 0.022 * s
    paint_only(
        body,
        "capsule",
        size=(0.022 * s,),
        fromto=(0.86 * x, 0.86 * y, seat, x, y, foot_m + foot),
        rgba=CARBON,
    )
    paint_only(body, "sphere", size=(0.036 * s,), pos=(x, y, foot_m + 0.036 * s), rgba=CARBON)


def bare_model(vehicle: Vehicle) -> Element:
    """Return a model with the bodies and joints that a renderer moves, and nothing in them yet."""
    root = Element("mujoco", model=vehicle.name)
    body = add(add(root, "worldbody"), "body", name="vehicle")
    add(body, "freejoint", name="vehicle")
    add(body, "inertial", pos=(0, 0, 0), mass=vehicle.mass_kg, diaginertia=vehicle.inertia_kg_m2)
    for number, rotor in enumerate(vehicle.rotors, start=1):
        x, y, z = rotor.position_frd_m
        child = add(body, "body", name=f"rotor_{number}", pos=(x, -y, -z))
        add(child, "joint", name=f"rotor_{number}", type="hinge", axis=(0, 0, 1))
        add(child, "inertial", pos=(0, 0, 0), mass=1e-3, diaginertia=(1e-6, 1e-6, 2e-6))
    return root


def dress(body: Element, vehicle: Vehicle) -> None:
    """Draw the vehicle into a model's body called "vehicle"."""
    if body.find("geom") is None:
        add_body(body, vehicle)
    add_trim(body, vehicle, 0.06 * max(math.hypot(*r.position_frd_m[:2]) for r in vehicle.rotors))
    for number, rotor in enumerate(vehicle.rotors, start=1):
        child = body.find(f".//body[@name='rotor_{number}']")
        if child is not None:
            add_propeller(child, number, propeller_radius_m(vehicle), rotor.spin > 0)
