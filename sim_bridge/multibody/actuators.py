"""Actuators and the hover of the exported model: any MuJoCo flies it, without this package.

``thrust_1`` … ``thrust_N`` [N] act at the sites ``rotor_1`` … on the spinning rotors: a thrust along z and, with it,
the drag torque of the air, d/b for each newton. ``drive_1`` … ``drive_N`` [N m] act at the hinges, between frame and
rotor. MuJoCo has no actuator whose force grows with the square of a speed, so that who flies the model sets the thrust
b·Ω|Ω| with the speed Ω of the hinge. The drive's torque is free: d·Ω|Ω| holds the speed, and more of it turns the frame
the other way. The model that the multibody plant flies has none of these; see ``rotor_drive.py``.
"""

from __future__ import annotations

import math
from xml.etree.ElementTree import Element

from flightstack.params.vehicle import Vehicle
from sim_bridge.multibody.xml import add, exact

HOVER = "hover"
"""Name of the keyframe: at rest in the air, the rotors at the speeds that carry the vehicle."""

_HOVER_HEIGHT_M = 2.0


def hover_speeds_rad_s(vehicle: Vehicle) -> list[float]:
    """Return the rotor speeds of a hover, those of the least sum of Ω⁴."""
    return [math.sqrt(max(squared, 0.0)) for squared in vehicle.hover_speeds_squared()]


def add_actuators(root: Element, vehicle: Vehicle) -> None:
    """Append actuators and the keyframe ``hover``; the sites and hinges must be there."""
    section = add(root, "actuator")
    for number, rotor in enumerate(vehicle.rotors, start=1):
        per_newton = rotor.torque_coefficient_n_m_s2 / rotor.thrust_coefficient_n_s2
        gear = exact((0.0, 0.0, 1.0, 0.0, 0.0, rotor.spin * per_newton))
        most = rotor.thrust_coefficient_n_s2 * rotor.max_speed_rad_s**2
        limit = {"ctrlrange": exact((0.0, most))} if math.isfinite(most) else {}
        add(section, "motor", name=f"thrust_{number}", site=f"rotor_{number}", gear=gear, **limit)
    for number in range(1, len(vehicle.rotors) + 1):
        add(section, "motor", name=f"drive_{number}", joint=f"rotor_{number}")
    add(add(root, "keyframe"), "key", name=HOVER, **_hover(vehicle))


def _hover(vehicle: Vehicle) -> dict[str, str]:
    speeds = hover_speeds_rad_s(vehicle)
    still = [0.0] * len(speeds)
    thrust, drive = [], []
    for rotor, speed in zip(vehicle.rotors, speeds, strict=True):
        thrust.append(rotor.thrust_coefficient_n_s2 * speed**2)
        drive.append(rotor.torque_coefficient_n_m_s2 * speed**2)
    return {
        "qpos": exact([0.0, 0.0, _HOVER_HEIGHT_M, 1.0, 0.0, 0.0, 0.0, *still]),
        "qvel": exact([0.0] * 6 + speeds),
        "ctrl": exact(thrust + drive),
    }
