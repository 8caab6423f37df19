"""Appearance of a vehicle: colours of its parts, and visual geoms such as blades, lights and a camera.

Body frame FLU of the model: x forward, y left, z up [m].
"""

from __future__ import annotations

import math
import re
from xml.etree.ElementTree import Element

from flightstack.params.vehicle import Rotor, Vehicle
from sim_bridge.multibody.frames import flip_vector
from sim_bridge.multibody.xml import add, add_visual
from sim_bridge.plant.dimensions import arm_m, propeller_radius_m

Colour = tuple[float, float, float, float]
CARBON: Colour = (0.115, 0.12, 0.13, 1.0)
FRONT: Colour = (0.93, 0.33, 0.07, 1.0)
METAL: Colour = (0.62, 0.64, 0.67, 1.0)
SHELL: Colour = (0.90, 0.91, 0.92, 1.0)
GLASS: Colour = (0.25, 0.42, 0.60, 1.0)
BLADE: Colour = (0.16, 0.165, 0.175, 1.0)
DISC: Colour = (0.55, 0.65, 0.75, 0.2)
PARTS: dict[str, Colour] = {
    "plate": CARBON,
    "column": METAL,
    "battery": (0.13, 0.24, 0.45, 1.0),
    "avionics": SHELL,
    "arm": CARBON,
    "motor": METAL,
    "leg": (0.21, 0.215, 0.225, 1.0),
    "foot": (0.06, 0.06, 0.065, 1.0),
}
"""Colours of the default parts by name without number; other parts have the colour of their material."""

DISC_NAME, BLADE_NAME = "disc_{}", "blade_{}_{}"
"""Names of the geoms that the renderer colours by rotor speed; rotors count from 1, blades from 0."""


def span_m(vehicle: Vehicle) -> float:
    """Return the distance from the centre to the tip of the farthest propeller [m]."""
    return max(math.hypot(*r.position_frd_m[:2]) for r in vehicle.rotors) + propeller_radius_m(vehicle)


def add_appearance(body: Element, vehicle: Vehicle) -> None:
    """Colour the body "vehicle" of a model and add its visual geoms."""
    for geom in body.iter("geom"):
        _colour(geom, vehicle)
    radius = propeller_radius_m(vehicle)
    for number, rotor in enumerate(vehicle.rotors, start=1):
        spinning = body.find(f".//body[@name='rotor_{number}']")
        if spinning is not None:
            _propeller(spinning, number, radius, rotor.spin > 0)
        _light(body, rotor, arm_m(vehicle))
    _camera(body, arm_m(vehicle))
    _fairings(body, vehicle)
    battery = body.find("geom[@name='battery']")
    if battery is not None and battery.get("type") == "box":
        _trim_battery(body, battery)


def _colour(geom: Element, vehicle: Vehicle) -> None:
    found = re.fullmatch(r"([a-z]+)(?:_([0-9]+))?", geom.get("name", ""))
    colour = PARTS.get(found[1]) if found else None
    if found is None or colour is None:
        return
    if found[1] == "arm" and found[2] and int(found[2]) <= len(vehicle.rotors):
        forward = vehicle.rotors[int(found[2]) - 1].position_frd_m[0]
        colour = FRONT if forward > 0.05 * arm_m(vehicle) else CARBON
    geom.attrib.pop("material", None)
    geom.set("rgba", " ".join(f"{value:g}" for value in colour))


def _propeller(body: Element, number: int, radius_m: float, clockwise: bool) -> None:
    """Add the blades of rotor ``number`` and the disc that replaces them at speed."""
    r, pitch = radius_m, math.radians(14.0 if clockwise else -14.0)
    add_visual(body, "cylinder", size=(0.09 * r, 0.05 * r), rgba=METAL)
    for blade in range(2):
        side = 1.0 - 2.0 * blade
        add_visual(
            body, "ellipsoid", name=BLADE_NAME.format(number, blade), size=(0.45 * r, 0.085 * r, 0.012 * r),
            pos=(0.53 * r * side, 0, 0.03 * r), euler=(pitch * side, 0, 0), rgba=BLADE,
        )  # fmt: skip
    add_visual(
        body, "cylinder", name=DISC_NAME.format(number), size=(r, 0.006 * r), pos=(0, 0, 0.03 * r), rgba=DISC
    )


def _fairings(body: Element, vehicle: Vehicle) -> None:
    """Add shells over default parts: a hood from the plate to the battery, and the arms."""
    s, plate = arm_m(vehicle), body.find("geom[@name='plate']")
    battery = body.find("geom[@name='battery']")
    if plate is None or battery is None or battery.get("type") != "box":
        return
    plate_z, battery_z = _numbers(plate, "pos")[2], _numbers(battery, "pos")[2] - _numbers(battery, "size")[2]
    high = max(battery_z - plate_z + 0.02 * s, 0.1 * s)
    add_visual(body, "ellipsoid", size=(0.34 * s, 0.22 * s, high), pos=(0, 0, plate_z), rgba=SHELL)
    add_visual(
        body,
        "ellipsoid",
        size=(0.20 * s, 0.17 * s, 0.7 * high),
        pos=(0.17 * s, 0, plate_z + 0.01 * s),
        rgba=FRONT,
    )
    for number, rotor in enumerate(vehicle.rotors, start=1):
        arm = body.find(f"geom[@name='arm_{number}']")
        if arm is not None:
            x, y, _ = flip_vector(rotor.position_frd_m)
            z, colour = _numbers(arm, "pos")[2], FRONT if x > 0.05 * s else CARBON
            add_visual(
                body,
                "capsule",
                size=(0.036 * s,),
                fromto=(0.15 * x, 0.15 * y, z, 0.97 * x, 0.97 * y, z),
                rgba=colour,
            )


def _numbers(geom: Element, name: str) -> list[float]:
    return [float(value) for value in geom.get(name, "0 0 0").split()]


def _light(body: Element, rotor: Rotor, arm: float) -> None:
    """Add a light under a motor: red on the left, green on the right, white in front and behind."""
    x, y, z = flip_vector(rotor.position_frd_m)
    if abs(y) < 0.05 * arm:
        colour = (0.97, 0.97, 0.95, 1.0)
    else:
        colour = (0.95, 0.10, 0.08, 1.0) if y > 0.0 else (0.12, 0.85, 0.25, 1.0)
    at = (0.86 * x, 0.86 * y, z - 0.13 * arm)
    add_visual(body, "sphere", size=(0.035 * arm,), pos=at, rgba=colour)


def _camera(body: Element, arm: float) -> None:
    """Add a forward camera, which marks the front."""
    s = arm
    add_visual(body, "box", size=(0.05 * s, 0.03 * s, 0.09 * s), pos=(0.24 * s, 0, -0.11 * s), rgba=CARBON)
    add_visual(body, "sphere", size=(0.075 * s,), pos=(0.29 * s, 0, -0.20 * s), rgba=CARBON)
    add_visual(
        body, "cylinder", size=(0.042 * s, 0.02 * s), pos=(0.355 * s, 0, -0.20 * s),
        euler=(0, math.pi / 2, 0), rgba=GLASS,
    )  # fmt: skip


def _trim_battery(body: Element, battery: Element) -> None:
    """Add two straps around the battery and a GPS antenna on it."""
    x, y, z = _numbers(battery, "size")
    frame = add(body, "body", pos=battery.get("pos", "0 0 0"), quat=battery.get("quat", "1 0 0 0"))
    for side in (-0.5, 0.5):
        add_visual(frame, "box", size=(0.1 * x, 1.03 * y, 1.03 * z), pos=(side * x, 0, 0), rgba=FRONT)
    add_visual(frame, "cylinder", size=(0.62 * y, 0.12 * z), pos=(0, 0, 1.12 * z), rgba=SHELL)
