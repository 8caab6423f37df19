"""The assembly of a vehicle as a MuJoCo model (MJCF): bodies, contact with the ground, actuators.

Names: body and free joint "vehicle"; for each rotor, numbered from 1 in the order of the vehicle file, the body and
hinge "rotor_1", the site "rotor_1" on it and the site "hub_1" on the frame. Geoms have the names of their parts. The
plane "ground" is at the feet of a vehicle that stands at the origin. A hinge turns in its rotor's sense of rotation:
its speed is positive in flight. Inertia comes from the geoms.

The exported model flies in any MuJoCo, without this package. Actuators ``thrust_1`` … ``thrust_N`` [N] act at the
sites ``rotor_1`` … on the spinning rotors: a thrust along z and the drag torque of the air, d/b per newton. Actuators
``drive_1`` … ``drive_N`` [N m] act at the hinges, between frame and rotor. MuJoCo has no actuator whose force grows
with the square of a speed, so the user sets the thrust b·Ω|Ω| from the speed Ω of the hinge. The drive torque is free:
d·Ω|Ω| holds the speed, and the reaction to any excess turns the frame. The multibody plant flies a model without these
actuators; see ``rotor_drive.py``.
"""

from __future__ import annotations

import math
from xml.etree.ElementTree import Element, indent, tostring

import numpy as np

from flightstack.core.geometry import quaternion_from_euler
from flightstack.params.vehicle import GRAVITY_M_S2, Vehicle
from flightstack.params.vehicle_parts import Part
from sim_bridge.multibody.assembly import Assembly, assemble
from sim_bridge.multibody.frames import flip_quaternion, flip_vector
from sim_bridge.multibody.mesh_file import corners_and_faces, read_mesh
from sim_bridge.multibody.placing import PlacedPart
from sim_bridge.multibody.scene import add_scene
from sim_bridge.multibody.xml import add, exact
from sim_bridge.plant.contact import DAMPING_RATIO, FRICTION, contact_model
from sim_bridge.plant.dimensions import foot_z_m

HOVER = "hover"
"""Name of the keyframe: hovering at rest, the rotors at hover speed."""

_COLOURS = {
    "carbon": "0.12 0.12 0.13 1",
    "carbon_tube": "0.16 0.16 0.17 1",
    "aluminium": "0.75 0.76 0.78 1",
    "steel": "0.55 0.56 0.58 1",
    "plastic": "0.85 0.86 0.87 1",
    "rubber": "0.08 0.08 0.08 1",
    "wood": "0.60 0.45 0.28 1",
    "foam": "0.90 0.90 0.88 1",
    "battery": "0.13 0.24 0.45 1",
    "electronics": "0.20 0.42 0.26 1",
    "motor": "0.38 0.39 0.41 1",
    "propeller": "0.75 0.78 0.80 0.35",
}
_PLAIN = "0.7 0.7 0.7 1"
_STEP_S = 0.001
_VISIBLE, _HIDDEN = 1, 3  # groups of geoms: viewers show 0 to 2
_HOVER_HEIGHT_M = 2.0

_IMPEDANCE_RATIO = 0.1
_IMPEDANCE = f"{_IMPEDANCE_RATIO} {_IMPEDANCE_RATIO} 0.001"  # MuJoCo's solimp: the same at any depth
_FRICTION = f"{FRICTION} {FRICTION} 0.005 0.0001 0.0001"
_SLIP_TIME_S = (
    0.4  # MuJoCo time constant of friction: slip below its limit decays in 20 ms (times half the impedance)
)
_FRICTION_STIFFNESS = 10  # over that of the normal force: reduces the creep of a foot under a side force
_CREEP_ITERATIONS = 4  # of the no-slip solver, which removes the remaining creep


def contact_solref(vehicle: Vehicle, step_s: float) -> tuple[float, float]:
    """Return MuJoCo's ``solref`` for an integration step: time constant [s] and damping ratio.

    It makes the contact as stiff as that of the rigid plant, without a bounce. A MuJoCo contact demands the
    acceleration a* = −b·v − k·r of the contact point (v its speed, r its depth) and gets the share d/(1 − d) of the
    missing acceleration on the effective mass of the point. With b = 2/(d·T), k = 1/(d·T²·ζ*²) and R feet, the
    vehicle stands on a spring and damper with

        κ = R·d/(1 − d)     ω² = κ/(1 + κ)·k     2·ζ·ω = κ/(1 + κ)·b

    from which T and ζ* follow for the ω and ζ of ``sim_bridge/plant/contact.py``.
    """
    contact = contact_model(vehicle, step_s, single_point=False)
    frequency = math.sqrt(contact.stiffness_n_m / vehicle.mass_kg)
    feet = len(vehicle.rotors) * _IMPEDANCE_RATIO / (1.0 - _IMPEDANCE_RATIO)
    share = feet / (1.0 + feet) / _IMPEDANCE_RATIO
    time_s = share / (DAMPING_RATIO * frequency)
    return time_s, math.sqrt(share) / (frequency * time_s)


def model_xml(vehicle: Vehicle, *, scene: bool = False, lean: bool = False) -> str:
    """Return the model of a vehicle and the ground as MJCF, angles in radians, in full precision.

    ``scene`` adds sky, landmarks, light and cameras. ``lean`` omits the actuators, which the multibody plant
    replaces, and makes MuJoCo discard geoms without contact after their inertia is counted. Raises ConfigError for
    a mesh that is not a solid.
    """
    assembly = assemble(vehicle)
    root = Element("mujoco", model=vehicle.name)
    add(root, "compiler", angle="radian", inertiafromgeom="auto", discardvisual="true" if lean else "false")
    option = add(
        root, "option", timestep=_STEP_S, integrator="RK4", gravity=f"0 0 {-GRAVITY_M_S2!r}",
        cone="elliptic", impratio=_FRICTION_STIFFNESS, noslip_iterations=_CREEP_ITERATIONS,
    )  # fmt: skip
    add(option, "flag", autoreset="disable")
    asset = add(root, "asset")
    for name in sorted({placed.part.material for placed in assembly.parts if placed.part.material}):
        add(asset, "material", name=name, rgba=_COLOURS.get(name, _PLAIN))
    for placed in assembly.parts:
        _add_mesh(asset, placed.part)
    world = add(root, "worldbody")
    if not scene:
        add(world, "light", pos="0 0 20", dir="0.2 -0.2 -1", directional="true")
    add(
        world, "geom", name="ground", type="plane", size="0 0 1", pos=exact((0.0, 0.0, -foot_z_m(vehicle))),
        rgba="0.45 0.5 0.42 1", contype=0, conaffinity=1,
    )  # fmt: skip
    _add_vehicle(world, vehicle, assembly, scene)
    _add_contacts(root, vehicle, assembly)
    if not lean:
        _add_actuators(root, vehicle)
    if scene:
        add_scene(root, vehicle)
    indent(root)
    return tostring(root, encoding="unicode") + "\n"


def _add_vehicle(world: Element, vehicle: Vehicle, assembly: Assembly, scene: bool) -> None:
    body = add(world, "body", name="vehicle")
    add(body, "freejoint", name="vehicle")
    for placed in assembly.parts:
        if placed.body == 0:
            _add_geom(body, placed, _VISIBLE)
    for number, rotor in enumerate(vehicle.rotors, start=1):
        hub = exact(flip_vector(rotor.position_frd_m))
        add(body, "site", name=f"hub_{number}", pos=hub, size=0.003, group=4)
        spinning = add(body, "body", name=f"rotor_{number}", pos=hub)
        add(spinning, "joint", name=f"rotor_{number}", type="hinge", axis=f"0 0 {-rotor.spin}")
        add(spinning, "site", name=f"rotor_{number}", size=0.003, group=4)
        for placed in assembly.parts:
            if placed.body == number:
                _add_geom(spinning, placed, _HIDDEN if scene else _VISIBLE)


def _add_geom(body: Element, placed: PlacedPart, group: int) -> None:
    part = placed.part
    attributes: dict[str, str | float] = {"name": part.name, "type": part.shape}
    if part.shape == "mesh":
        attributes["mesh"] = part.name
    else:
        attributes["size"] = exact(_model_size(part))
    if part.material:
        attributes["material"] = part.material
    else:
        attributes["rgba"] = _PLAIN
    if any(part.euler_rad):
        attributes["quat"] = exact(flip_quaternion(quaternion_from_euler(*part.euler_rad)))
    add(
        body, "geom", **attributes, pos=exact(flip_vector(part.position_frd_m)),
        density=repr(part.density_kg_m3), group=group, contype=1 if placed.has_contact else 0, conaffinity=0,
    )  # fmt: skip


def _add_contacts(root: Element, vehicle: Vehicle, assembly: Assembly) -> None:
    """Add a contact pair of the ground and each part with contact.

    MuJoCo's friction cone couples slip and normal force: a foot that slides at v_t rises at about μ·v_t·b_t/b, where
    b_t and b are the damping rates of friction and normal force. Only a pair has a ``solref`` of its own for friction.
    """
    contacts = add(root, "contact")
    solref = exact(contact_solref(vehicle, _STEP_S))
    for placed in assembly.parts:
        if placed.has_contact:
            add(
                contacts, "pair", geom1="ground", geom2=placed.part.name, friction=_FRICTION,
                solref=solref, solreffriction=f"{_SLIP_TIME_S} 1", solimp=_IMPEDANCE,
            )  # fmt: skip


def _model_size(part: Part) -> tuple[float, ...]:
    """Return the size in MuJoCo's convention: half edges and half lengths."""
    if part.shape == "box":
        return tuple(edge / 2.0 for edge in part.size_m)
    return (part.size_m[0], *(length / 2.0 for length in part.size_m[1:]))


def _add_mesh(asset: Element, part: Part) -> None:
    """Write the mesh itself into the model: it needs no second file, and any STL is accepted."""
    if part.file is None:
        return
    corners, faces = corners_and_faces(read_mesh(part.file) * part.scale)
    turned = corners * np.array([1.0, -1.0, -1.0])
    add(
        asset, "mesh", name=part.name, vertex=exact(turned.ravel().tolist()),
        face=" ".join(map(str, faces.ravel().tolist())), inertia="exact",
    )  # fmt: skip


def _add_actuators(root: Element, vehicle: Vehicle) -> None:
    """Append actuators and the keyframe ``hover``; the sites and hinges must exist."""
    actuators = add(root, "actuator")
    for number, rotor in enumerate(vehicle.rotors, start=1):
        per_newton = rotor.torque_coefficient_n_m_s2 / rotor.thrust_coefficient_n_s2
        gear = exact((0.0, 0.0, 1.0, 0.0, 0.0, rotor.spin * per_newton))
        most = rotor.thrust_coefficient_n_s2 * rotor.max_speed_rad_s**2
        limit = {"ctrlrange": exact((0.0, most))} if math.isfinite(most) else {}
        add(actuators, "motor", name=f"thrust_{number}", site=f"rotor_{number}", gear=gear, **limit)
    for number in range(1, len(vehicle.rotors) + 1):
        add(actuators, "motor", name=f"drive_{number}", joint=f"rotor_{number}")
    add(add(root, "keyframe"), "key", name=HOVER, **_hover(vehicle))


def _hover(vehicle: Vehicle) -> dict[str, str]:
    """Return the hover of least Σ Ω⁴: positions, speeds and controls."""
    speeds = [math.sqrt(max(squared, 0.0)) for squared in vehicle.hover_speeds_squared()]
    thrust, drive = [], []
    for rotor, speed in zip(vehicle.rotors, speeds, strict=True):
        thrust.append(rotor.thrust_coefficient_n_s2 * speed**2)
        drive.append(rotor.torque_coefficient_n_m_s2 * speed**2)
    return {
        "qpos": exact([0.0, 0.0, _HOVER_HEIGHT_M, 1.0, 0.0, 0.0, 0.0, *[0.0] * len(speeds)]),
        "qvel": exact([0.0] * 6 + speeds),
        "ctrl": exact(thrust + drive),
    }
