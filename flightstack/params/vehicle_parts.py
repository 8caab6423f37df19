"""Parts of a vehicle for the multibody plant: the optional tables ``[[part]]`` of a vehicle file.

A part is a solid of one material. Its mount is the frame ("body"), every arm ("arm": the axes of each copy point
outwards along the arm, to its right and down, with the origin at the rotor hub) or every spinning rotor ("rotor").
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from flightstack.params.toml_file import Table

SHAPES = {"box": 3, "cylinder": 2, "capsule": 2, "sphere": 1, "mesh": 0}
"""Shapes, each with the length of its ``size_m``.

box: edge lengths x, y, z. cylinder: radius, length along z. capsule: radius, distance between the centres of its round
ends along z. sphere: radius. mesh: an STL or OBJ file instead.
"""

MATERIALS = {
    "carbon": 1600.0,  # laminate
    "carbon_tube": 550.0,  # treated as solid
    "aluminium": 2700.0,
    "steel": 7850.0,
    "plastic": 1250.0,
    "rubber": 1150.0,
    "wood": 600.0,
    "foam": 40.0,
    "battery": 2000.0,  # lithium-polymer pack with its sleeve and leads
    "electronics": 1500.0,  # boards in their case
    "motor": 4000.0,  # copper, steel and magnets with the gaps between them
    "propeller": 100.0,  # smeared over the disc that it sweeps
}
"""Densities [kg/m³]."""

MOUNTS = ("body", "arm", "rotor")
MESH_FILES = (".stl", ".obj")
MAX_PARTS = 100

_NOWHERE = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Part:
    """One solid. Pose relative to its mount: position of the centre (of the file's origin for a mesh) and attitude."""

    name: str
    shape: str
    size_m: tuple[float, ...]
    material: str
    density_kg_m3: float
    position_frd_m: tuple[float, float, float] = _NOWHERE
    euler_rad: tuple[float, float, float] = _NOWHERE  # roll, pitch, yaw
    mount: str = "body"
    tune: bool = False  # its density is adjusted so that the total mass and inertia match [body]
    file: Path | None = None
    scale: float = 1.0  # metres per unit of the file


def read_parts(top: Table) -> tuple[Part, ...]:
    """Read the tables ``[[part]]``, if any; raise ConfigError."""
    if not top.has("part"):
        return ()
    entries = top.tables("part")
    if len(entries) > MAX_PARTS:
        raise top.error("part", f"{len(entries)} parts given, at most {MAX_PARTS} are allowed")
    parts: list[Part] = []
    for entry in entries:
        part = _part(entry)
        if any(part.name == other.name for other in parts):
            raise entry.error("name", f"{part.name!r} is the name of two parts")
        parts.append(part)
    return tuple(parts)


def _part(entry: Table) -> Part:
    name = entry.text("name")
    if not name or not all(letter.isalnum() or letter in "_-" for letter in name) or len(name) > 40:
        raise entry.error("name", f"{name!r} is not 1 to 40 letters, digits, - or _")
    shape = entry.choice("shape", tuple(SHAPES))
    material, density = _material(entry)
    file, scale = _mesh(entry) if shape == "mesh" else (None, 1.0)
    tune = entry.flag("tune", False)
    mount = entry.choice("mount", MOUNTS) if entry.has("mount") else "body"
    if tune and mount == "rotor":
        raise entry.error("tune", "rotor parts are always tuned to the rotor inertia: remove it")
    roll, pitch, yaw = entry.numbers("euler_deg", 3, -360.0, 360.0, _NOWHERE)
    x, y, z = entry.numbers("position_frd_m", 3, -10.0, 10.0, _NOWHERE)
    if mount == "rotor" and (shape in ("box", "mesh") or x or y or roll or pitch):
        raise entry.error(
            "mount", "a rotor part must be symmetric about the rotor axis: "
            "use a cylinder, capsule or sphere on the axis",
        )  # fmt: skip
    part = Part(
        name,
        shape,
        entry.numbers("size_m", SHAPES[shape], 1e-5, 10.0) if SHAPES[shape] else (),
        material,
        density,
        (x, y, z),
        (math.radians(roll), math.radians(pitch), math.radians(yaw)),
        mount,
        tune,
        file,
        scale,
    )
    entry.finish()
    return part


def _material(entry: Table) -> tuple[str, float]:
    material = entry.choice("material", tuple(MATERIALS)) if entry.has("material") else ""
    if not material and not entry.has("density_kg_m3"):
        raise entry.error("density_kg_m3", f"is missing: give it or a material ({', '.join(MATERIALS)})")
    return material, entry.number("density_kg_m3", 1e-3, 3e4, MATERIALS.get(material))


def _mesh(entry: Table) -> tuple[Path, float]:
    name = entry.text("file")
    path = Path(name) if Path(name).is_absolute() else Path(str(entry.file)).parent / name
    if path.suffix.lower() not in MESH_FILES:
        raise entry.error("file", f"{name!r} is neither STL nor OBJ")
    if not path.is_file():
        raise entry.error("file", f"{str(path)!r} is not a file")
    return path.resolve(), entry.number("scale", 1e-6, 1e3, 1.0)
