"""The assembly: closed forms against MuJoCo's compiler, tuning to the vehicle file, meshes, and errors."""

from __future__ import annotations

import math
import re
import struct
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from flightstack.core.errors import ConfigError
from flightstack.params.vehicle import BUILT_IN, Vehicle, load_vehicle
from flightstack.params.vehicle_parts import MATERIALS, Part
from sim_bridge.multibody.assembly import TOLERANCE, assemble, mass_table, tuned_masses
from sim_bridge.multibody.mass import about_point, solid
from sim_bridge.multibody.mjcf import model_xml
from sim_bridge.plant.plant import PlantOptions
from sim_bridge.plants import make_plant
from tests.support.rotor_sets import multirotor

PAPER = load_vehicle("paper_quad")
BOTH_VEHICLES = pytest.mark.parametrize("name", ["paper_quad", "x_quad"])
TEXT = (BUILT_IN / "paper_quad.toml").read_text(encoding="utf-8")

# a wedge: half of a box of 0.06 by 0.04 by 0.02 m, cut from edge to edge, off the origin
CORNERS = np.array([[0, 0, 0], [6, 0, 0], [0, 4, 0], [0, 0, 2], [6, 0, 2], [0, 4, 2]]) * 0.01 + 0.005
FACES = [(0, 2, 1), (3, 4, 5), (0, 1, 4), (0, 4, 3), (1, 2, 5), (1, 5, 4), (2, 0, 3), (2, 3, 5)]
WEDGE_M3 = 0.5 * 0.06 * 0.04 * 0.02


def write_obj(path: Path, faces: list[tuple[int, int, int]] = FACES) -> Path:
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in CORNERS]
    lines += ["f " + " ".join(f"{corner + 1}//1" for corner in face) for face in faces]
    path.write_text("# wedge\nvn 0 0 1\n" + "\n".join(lines) + "\n", encoding="utf-8")
    return path


def write_stl(path: Path, faces: list[tuple[int, int, int]] = FACES) -> Path:
    body = b"".join(struct.pack("<12fH", 0, 0, 0, *CORNERS[list(face)].ravel(), 0) for face in faces)
    path.write_bytes(b"wedge".ljust(80) + struct.pack("<I", len(faces)) + body)
    return path


def write_text_stl(path: Path) -> Path:
    words = ["solid wedge"]
    for face in FACES:
        words += ["facet normal 0 0 0", "outer loop"]
        words += [f"vertex {x:.9g} {y:.9g} {z:.9g}" for x, y, z in CORNERS[list(face)]]
        words += ["endloop", "endfacet"]
    path.write_text("\n".join([*words, "endsolid wedge"]), encoding="ascii")
    return path


def with_parts(folder: Path, parts: str, head: str = "") -> Vehicle:
    path = folder / "my.toml"
    path.write_text(f"{head}\n{TEXT}\n{parts}", encoding="utf-8")
    return load_vehicle(str(path))


def compiled_whole(vehicle: Vehicle) -> tuple[float, np.ndarray, np.ndarray]:
    """Mass, centre of gravity and inertia about the origin in FRD, of the whole vehicle in MuJoCo."""
    model = mujoco.MjModel.from_xml_string(model_xml(vehicle))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    mass, first, second = 0.0, np.zeros(3), np.zeros((3, 3))
    for body in range(1, model.nbody):
        m, at = model.body_mass[body], data.xipos[body]
        axes = data.ximat[body].reshape(3, 3)
        own = axes @ np.diag(model.body_inertia[body]) @ axes.T
        mass, first = mass + m, first + m * at
        second += own + m * (at @ at * np.eye(3) - np.outer(at, at))
    flip = np.diag([1.0, -1.0, -1.0])
    return mass, flip @ first / mass, flip @ second @ flip


def part(shape: str, size: tuple[float, ...], **more: object) -> Part:
    return Part("it", shape, size, "", 700.0, **more)  # type: ignore[arg-type]


SHAPES = [
    part("box", (0.03, 0.05, 0.02)),
    part("cylinder", (0.02, 0.07)),
    part("capsule", (0.015, 0.06)),
    part("sphere", (0.025,)),
]


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.shape)
@pytest.mark.parametrize("mount", ["body", "arm"])
def test_part_properties_agree_with_mujoco(shape: Part, mount: str) -> None:
    tilted = replace(shape, position_frd_m=(0.02, -0.03, 0.04), euler_rad=(0.3, -0.5, 0.9), mount=mount)
    vehicle = replace(PAPER, parts=(tilted,), default_parts=False)
    ours = assemble(vehicle).whole
    mass, centre, inertia = compiled_whole(vehicle)
    about_origin = ours.inertia_kg_m2 + about_point(ours.mass_kg, ours.centre_m)
    assert mass == pytest.approx(ours.mass_kg, rel=1e-13)
    assert np.allclose(centre, ours.centre_m, rtol=0.0, atol=1e-15)
    assert np.allclose(inertia, about_origin, rtol=1e-12, atol=1e-17)


def test_box_and_cylinder_inertia_are_the_closed_forms() -> None:
    box = solid(part("box", (0.1, 0.2, 0.3)))
    assert box.mass_kg == pytest.approx(700.0 * 0.006, rel=1e-15)
    assert box.inertia_kg_m2[0, 0] == pytest.approx(box.mass_kg / 12.0 * (0.04 + 0.09), rel=1e-14)
    tube = solid(part("cylinder", (0.1, 0.5)))
    assert tube.inertia_kg_m2[2, 2] == pytest.approx(0.5 * tube.mass_kg * 0.01, rel=1e-14)


@BOTH_VEHICLES
def test_tuned_assembly_meets_the_vehicle_file(name: str) -> None:
    vehicle = load_vehicle(name)
    assert assemble(vehicle).largest_error < 1e-12  # measured: 4e-15
    mass, centre, inertia = compiled_whole(vehicle)
    assert mass == pytest.approx(vehicle.mass_kg, rel=1e-13)
    assert np.abs(centre).max() < 1e-14
    assert np.allclose(inertia, np.diag(vehicle.inertia_kg_m2), rtol=0.0, atol=1e-14)  # measured: 1e-16
    model = mujoco.MjModel.from_xml_string(model_xml(vehicle))
    for number, rotor in enumerate(vehicle.rotors, start=1):
        body = model.body(f"rotor_{number}")
        about = sorted(body.inertia)
        assert about[2] == pytest.approx(rotor.inertia_kg_m2, rel=1e-13)
        assert about[0] == pytest.approx(about[1], rel=1e-12)  # axisymmetric: balanced rotors


@BOTH_VEHICLES
def test_inertia_comes_from_geoms_with_material_densities(name: str) -> None:
    vehicle = load_vehicle(name)
    assert "<inertial" not in model_xml(vehicle)
    densities = {placed.part.density_kg_m3 for placed in assemble(vehicle).parts if placed.body == 0}
    assert densities == {1600.0, 550.0, 2000.0, 1500.0, 4000.0, 1150.0}


@pytest.mark.parametrize(("name", "most"), [("paper_quad", 1.6), ("x_quad", 3.0)])
def test_masses_are_tuned_as_little_as_possible(name: str, most: float) -> None:
    """The parts of the paper's vehicle stay near their default mass; those of x_quad cannot."""
    vehicle = load_vehicle(name)
    assembly = assemble(vehicle)
    factors = tuned_masses(vehicle, assembly)
    on_frame = [factors[placed.part.name] for placed in assembly.parts if placed.body == 0]
    assert max(on_frame) < most
    assert min(on_frame) > 0.999 / most
    assert max(on_frame) / min(on_frame) > 1.5  # some parts are tuned
    assert factors["column"] == pytest.approx(1.0)  # which is not tuned
    table = mass_table(vehicle, assembly)
    for part in ("plate", "motor_1", "propeller_1"):
        line = next(line for line in table.splitlines() if line.startswith(part))
        assert f" {factors[part]:.2f} " in line
    # propeller densities follow from the rotor inertia
    propeller = next(placed for placed in assembly.parts if placed.part.name == "propeller_1")
    assert propeller.part.density_kg_m3 == pytest.approx(factors["propeller_1"] * MATERIALS["propeller"])
    assert "the densities of the propellers are set by the inertia J" in table


@pytest.mark.parametrize(("mass", "inertia"), [(1.2, 1.0), (1.0, 0.7), (1.0, 1.3)])
def test_other_masses_and_inertias_are_met(mass: float, inertia: float) -> None:
    wanted = tuple(inertia * value for value in PAPER.inertia_kg_m2)
    changed = replace(PAPER, mass_kg=mass * PAPER.mass_kg, inertia_kg_m2=wanted)  # type: ignore[arg-type]
    assert assemble(changed).largest_error < 1e-12


def test_unreachable_inertia_is_reported_with_its_error() -> None:
    vehicle = replace(PAPER, leg_height_m=0.0)  # its inertia needs masses far above and below the rotors
    assembly = assemble(vehicle)
    assert assembly.largest_error > 10.0 * TOLERANCE
    _, centre, inertia = compiled_whole(vehicle)  # the model has the reported errors
    wanted = np.array(vehicle.inertia_kg_m2)
    for axis, miss in zip("xyz", np.abs(np.diag(inertia) / wanted - 1.0), strict=True):
        assert miss == pytest.approx(assembly.errors[f"I{axis}"], abs=1e-12)
    assert assembly.errors["mass"] < TOLERANCE  # mass and centre of gravity come first: it hovers
    assert np.abs(centre).max() < TOLERANCE
    assert "meet the vehicle file within" in assembly.summary()
    assert f"{assembly.errors['Ix']:.1e}" in mass_table(vehicle, assembly)


def test_asymmetric_rotors_are_balanced_by_battery_and_avionics() -> None:
    vehicle = multirotor([(0.25, 0.2), (-0.2, -0.25), (0.22, -0.2), (-0.25, 0.18)], [-1, -1, 1, 1])
    assert (
        assemble(vehicle).largest_error < 1e-9
    )  # measured: 9e-16 at most, with four kernels of OpenBLAS and libm
    mass, centre, inertia = compiled_whole(vehicle)
    assert mass == pytest.approx(vehicle.mass_kg, rel=1e-9)
    assert np.abs(centre).max() < 1e-9
    assert np.allclose(inertia, np.diag(vehicle.inertia_kg_m2), rtol=0.0, atol=1e-10)


def test_feet_are_the_lowest_parts() -> None:
    for name in ("paper_quad", "x_quad"):
        vehicle = load_vehicle(name)
        lowest = {
            placed.part.name: placed.lowest_z_m() for placed in assemble(vehicle).parts if not placed.body
        }
        feet = [value for key, value in lowest.items() if key.startswith("foot")]
        assert feet == pytest.approx([vehicle.leg_height_m] * 4, rel=1e-12)
        assert max(value for key, value in lowest.items() if "foot" not in key) < vehicle.leg_height_m


@pytest.mark.parametrize("write", [write_stl, write_text_stl, write_obj])
def test_mesh_mass_follows_from_its_volume(tmp_path: Path, write: object) -> None:
    file = write(tmp_path / ("wedge.obj" if write is write_obj else "wedge.stl"))  # type: ignore[operator]
    own = solid(part("mesh", (), file=file))
    assert own.mass_kg == pytest.approx(700.0 * WEDGE_M3, rel=1e-6)  # STL has seven digits
    third = np.array([0.06 / 3.0, 0.04 / 3.0, 0.02 / 2.0]) + 0.005
    assert np.allclose(own.centre_m, third, atol=1e-8)
    # of a right prism: m h²/12 + m b²/18 about the axis along the other leg, and so on
    m = own.mass_kg
    assert own.inertia_kg_m2[2, 2] == pytest.approx(m / 18.0 * (0.06**2 + 0.04**2), rel=1e-5)
    assert own.inertia_kg_m2[0, 0] == pytest.approx(m * (0.04**2 / 18.0 + 0.02**2 / 12.0), rel=1e-5)
    assert own.inertia_kg_m2[0, 1] == pytest.approx(m * 0.06 * 0.04 / 36.0, rel=1e-5)


@pytest.mark.parametrize("write", [write_stl, write_text_stl, write_obj])
def test_other_parts_are_tuned_around_a_mesh(tmp_path: Path, write: object) -> None:
    name = "wedge.obj" if write is write_obj else "wedge.stl"
    write(tmp_path / name)  # type: ignore[operator]
    vehicle = with_parts(
        tmp_path,
        f'[[part]]\nname = "plate"\nshape = "mesh"\nfile = "{name}"\nmaterial = "aluminium"\n'
        "position_frd_m = [-0.02, 0.01, 0.005]\neuler_deg = [10, 0, 30]\n",
    )
    assembly = assemble(vehicle)
    assert [placed.part.shape for placed in assembly.parts if placed.part.name == "plate"] == ["mesh"]
    assert assembly.largest_error < 1e-9
    mass, centre, inertia = compiled_whole(vehicle)
    assert mass == pytest.approx(vehicle.mass_kg, rel=1e-7)
    assert np.abs(centre).max() < 1e-8
    assert np.allclose(inertia, np.diag(vehicle.inertia_kg_m2), rtol=0.0, atol=1e-9)


def test_model_rejected_by_mujoco_is_one_sentence(tmp_path: Path) -> None:
    write_obj(tmp_path / "wedge.obj")
    speck = '[[part]]\nname = "speck"\nshape = "mesh"\nfile = "wedge.obj"\nscale = 1e-5\nmaterial = "wood"\n'
    with pytest.raises(ConfigError, match="paper_quad: part: MuJoCo rejects the model: "):
        make_plant(with_parts(tmp_path, speck), "multibody", PlantOptions())


def test_own_parts_are_not_changed(tmp_path: Path) -> None:
    vehicle = with_parts(
        tmp_path,
        '[[part]]\nname = "ball"\nshape = "sphere"\nsize_m = [0.05]\ndensity_kg_m3 = 1000.0\n'
        '[[part]]\nname = "tip"\nshape = "box"\nsize_m = [0.02, 0.03, 0.01]\nmaterial = "motor"\nmount = "arm"\n'
        '[[part]]\nname = "disc"\nshape = "cylinder"\nsize_m = [0.1, 0.002]\nmaterial = "plastic"\n'
        'mount = "rotor"\n',
        head="default_parts = false",
    )
    parts = {placed.part.name: placed for placed in assemble(vehicle).parts}
    assert sorted(parts) == ["ball", *(f"{name}_{i}" for name in ("disc", "tip") for i in range(1, 5))]
    assert parts["ball"].properties().mass_kg == pytest.approx(1000.0 * 4.0 / 3.0 * math.pi * 0.05**3)
    # the arm's axes point along the arm: all tips are 20 mm long outwards
    assert parts["tip_2"].properties().centre_m == pytest.approx((0.0, 0.2, 0.0), abs=1e-15)
    tip = solid(parts["tip_1"].part).inertia_kg_m2
    assert parts["tip_2"].properties().inertia_kg_m2[1, 1] == pytest.approx(tip[0, 0], rel=1e-12)


def test_density_of_a_tuned_part_may_change(tmp_path: Path) -> None:
    ball = '[[part]]\nname = "ball"\nshape = "sphere"\nsize_m = [0.05]\nmaterial = "plastic"\n'
    fixed = assemble(with_parts(tmp_path, ball, head="default_parts = false"))
    tuned = assemble(with_parts(tmp_path, ball + "tune = true\n", head="default_parts = false"))
    assert tuned.errors["mass"] < fixed.errors["mass"]


BAD = [
    ('name = "a b"', "'a b' is not 1 to 40 letters"),
    ('name = "a"\nshape = "cone"', "'cone' is not one of box, cylinder, capsule, sphere, mesh"),
    ('name = "a"\nshape = "box"', "part[0].density_kg_m3: is missing: give it or a material (carbon"),
    ('name = "a"\nshape = "box"\nmaterial = "gold"', "'gold' is not one of carbon"),
    ('name = "a"\nshape = "box"\nmaterial = "wood"', "part[0].size_m: is missing"),
    ('name = "a"\nshape = "box"\nmaterial = "wood"\nsize_m = [1, 1]', "must be a list of 3 numbers"),
    ('name = "a"\nshape = "box"\nmaterial = "wood"\nsize_m = [1, 1, 0]', "outside the allowed range"),
    ('name = "a"\nshape = "sphere"\nmaterial = "wood"\nsize_m = [1]\nmount = "tail"', "'tail' is not one of"),
    (
        'name = "a"\nshape = "sphere"\nmaterial = "wood"\nsize_m = [1]\ncolour = 1',
        "colour: is not a known key",
    ),
    ('name = "a"\nshape = "sphere"\nmaterial = "wood"\nsize_m = [1]\ntune = 1', "is neither true nor false"),
    (
        'name = "a"\nshape = "box"\nmaterial = "wood"\nsize_m = [1, 1, 1]\nmount = "rotor"',
        "must be symmetric",
    ),
    ('name = "a"\nshape = "mesh"\nmaterial = "wood"\nfile = "a.step"', "neither STL nor OBJ"),
    ('name = "a"\nshape = "mesh"\nmaterial = "wood"\nfile = "none.stl"', "is not a file"),
]


@pytest.mark.parametrize(("part_text", "problem"), BAD)
def test_invalid_part_is_named(tmp_path: Path, part_text: str, problem: str) -> None:
    with pytest.raises(ConfigError, match=re.escape(problem)) as caught:
        with_parts(tmp_path, f"[[part]]\n{part_text}\n")
    assert "part" in str(caught.value)
    assert "my.toml" in str(caught.value)


def test_frame_without_parts_is_rejected(tmp_path: Path) -> None:
    disc = '[[part]]\nname = "disc"\nshape = "sphere"\nsize_m = [0.02]\nmaterial = "wood"\nmount = "rotor"\n'
    with pytest.raises(ConfigError, match="the frame has no mass"):
        assemble(with_parts(tmp_path, disc, head="default_parts = false"))


@pytest.mark.parametrize(
    ("name", "problem"), [("ground", "is a reserved name"), ("motor_2", "is the name of two parts")]
)
def test_reserved_or_repeated_part_name_is_rejected(tmp_path: Path, name: str, problem: str) -> None:
    ball = f'[[part]]\nname = "{name}"\nshape = "sphere"\nsize_m = [0.01]\nmaterial = "wood"\n'
    motors = (
        '[[part]]\nname = "motor"\nshape = "sphere"\nsize_m = [0.01]\nmaterial = "motor"\nmount = "arm"\n'
    )
    with pytest.raises(ConfigError, match=f"'{name}' {problem}"):
        assemble(with_parts(tmp_path, ball + motors))


def test_duplicate_part_name_is_rejected(tmp_path: Path) -> None:
    ball = '[[part]]\nname = "ball"\nshape = "sphere"\nsize_m = [0.05]\nmaterial = "wood"\n'
    with pytest.raises(ConfigError, match="'ball' is the name of two parts"):
        with_parts(tmp_path, ball + ball)


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"solid nothing\nendsolid", "is not a solid"),
        (b"\xff\xfe junk", "is not a mesh"),
        (b"vertex 1 2", "is not a mesh"),
        (b"vertex nan 0 0 " * 12, "is not a solid"),
    ],
)
def test_invalid_mesh_file_is_named(tmp_path: Path, content: bytes, problem: str) -> None:
    (tmp_path / "bad.stl").write_bytes(content)
    with pytest.raises(ConfigError, match=problem):
        solid(part("mesh", (), file=tmp_path / "bad.stl"))


def test_mesh_must_be_closed_with_outward_faces(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="is not a closed surface"):
        solid(part("mesh", (), file=write_stl(tmp_path / "open.stl", FACES[1:])))
    inside_out = [(a, c, b) for a, b, c in FACES]
    with pytest.raises(ConfigError, match="is inside out"):
        solid(part("mesh", (), file=write_obj(tmp_path / "out.obj", inside_out)))
