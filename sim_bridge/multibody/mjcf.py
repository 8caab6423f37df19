"""The assembly of a vehicle as a MuJoCo model (MJCF).

Names: body and free joint "vehicle"; for each rotor, in the order of the vehicle file from 1, the body and hinge
"rotor_1", the site "rotor_1" on it and the site "hub_1" on the frame; geoms are called as the parts; the plane
"ground" is where the feet of a vehicle are that stands at the origin. A hinge turns about the rotor's own sense of
rotation: its speed is positive in flight. Inertia comes from the geoms.
"""

from __future__ import annotations

from xml.etree.ElementTree import Element, indent, tostring

import numpy as np

from flightstack.core.geometry import quaternion_from_euler
from flightstack.params.vehicle import GRAVITY_M_S2, Vehicle
from flightstack.params.vehicle_parts import Part
from sim_bridge.multibody import contact
from sim_bridge.multibody.actuators import add_actuators
from sim_bridge.multibody.assembly import Assembly, assemble
from sim_bridge.multibody.frames import flip_quaternion, flip_vector
from sim_bridge.multibody.mesh_file import corners_and_faces, read_mesh
from sim_bridge.multibody.placing import PlacedPart
from sim_bridge.multibody.usual_parts import foot_z_m
from sim_bridge.multibody.xml import add, exact
from sim_bridge.plant.contact import FRICTION

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
_SEEN, _HIDDEN = 1, 3  # groups of geoms: viewers show 0 to 2


def model_xml(vehicle: Vehicle, *, scene: bool = False, lean: bool = False) -> str:
    """Return the model of a vehicle and the ground as MJCF, angles in radians, in full precision.

    ``scene`` adds sky, landmarks, light and cameras; ``lean`` leaves out the actuators, whose work the
    multibody plant does, and, once their inertia is counted, the geoms that touch nothing. Raises ConfigError for a
    mesh that is not a solid.
    """
    assembly = assemble(vehicle)
    solref = exact(contact.reference(vehicle, _STEP_S))
    root = Element("mujoco", model=vehicle.name)
    add(root, "compiler", angle="radian", inertiafromgeom="auto", discardvisual="true" if lean else "false")
    option = add(
        root, "option", timestep=_STEP_S, integrator="RK4", gravity=f"0 0 {-GRAVITY_M_S2!r}",
        cone="elliptic", impratio=contact.FRICTION_STIFFNESS, noslip_iterations=contact.CREEP_ITERATIONS,
    )  # fmt: skip
    add(option, "flag", autoreset="disable")
    asset = add(root, "asset")
    for name in sorted({placed.part.material for placed in assembly.parts if placed.part.material}):
        add(asset, "material", name=name, rgba=_COLOURS.get(name, _PLAIN))
    for placed in assembly.parts:
        _mesh_asset(asset, placed.part)
    world = add(root, "worldbody")
    if not scene:
        add(world, "light", pos="0 0 20", dir="0.2 -0.2 -1", directional="true")
    add(
        world, "geom", name="ground", type="plane", size="0 0 1", pos=exact((0.0, 0.0, -foot_z_m(vehicle))),
        rgba="0.45 0.5 0.42 1", contype=0, conaffinity=1, friction=f"{FRICTION} 0.005 0.0001",
        solref=solref, solimp=contact.IMPEDANCE,
    )  # fmt: skip
    _vehicle(world, vehicle, assembly, solref, scene)
    if not lean:
        add_actuators(root, vehicle)
    if scene:
        from sim_bridge.multibody.scene import decorate  # noqa: PLC0415  # the view's; not needed to fly

        decorate(root, vehicle)
    indent(root)
    return tostring(root, encoding="unicode") + "\n"


def _vehicle(world: Element, vehicle: Vehicle, assembly: Assembly, solref: str, scene: bool) -> None:
    body = add(world, "body", name="vehicle")
    add(body, "freejoint", name="vehicle")
    for placed in assembly.parts:
        if placed.body == 0:
            _geom(body, placed, solref, _SEEN)
    for number, rotor in enumerate(vehicle.rotors, start=1):
        hub = exact(flip_vector(rotor.position_frd_m))
        add(body, "site", name=f"hub_{number}", pos=hub, size=0.003, group=4)
        spinning = add(body, "body", name=f"rotor_{number}", pos=hub)
        add(spinning, "joint", name=f"rotor_{number}", type="hinge", axis=f"0 0 {-rotor.spin}")
        add(spinning, "site", name=f"rotor_{number}", size=0.003, group=4)
        for placed in assembly.parts:
            if placed.body == number:
                _geom(spinning, placed, solref, _HIDDEN if scene else _SEEN)


def _geom(body: Element, placed: PlacedPart, solref: str, group: int) -> None:
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
    touches = placed.touches
    add(
        body, "geom", **attributes, pos=exact(flip_vector(part.position_frd_m)),
        density=repr(part.density_kg_m3), group=group, contype=1 if touches else 0, conaffinity=0,
        **({"friction": f"{FRICTION} 0.005 0.0001", "solref": solref, "solimp": contact.IMPEDANCE}
           if touches else {}),
    )  # fmt: skip


def _model_size(part: Part) -> tuple[float, ...]:
    """MuJoCo has half edges and half lengths."""
    if part.shape == "box":
        return tuple(edge / 2.0 for edge in part.size_m)
    return (part.size_m[0], *(length / 2.0 for length in part.size_m[1:]))


def _mesh_asset(asset: Element, part: Part) -> None:
    """Put the mesh itself into the model: it then needs no second file, and any STL will do."""
    if part.file is None:
        return
    corners, faces = corners_and_faces(read_mesh(part.file) * part.scale)
    turned = corners * np.array([1.0, -1.0, -1.0])
    add(
        asset, "mesh", name=part.name, vertex=exact(turned.ravel().tolist()),
        face=" ".join(map(str, faces.ravel().tolist())), inertia="exact",
    )  # fmt: skip
