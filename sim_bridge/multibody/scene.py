"""The scene around the vehicle as MJCF: sky, ground, landing pad, light, landmarks and cameras.

World frame NWU [m]. The textures of grass, pad and clouds would need files in MJCF: ``paint.py`` writes them into the
compiled model, elsewhere they are plain colours.
"""

from __future__ import annotations

from xml.etree.ElementTree import Element

from flightstack.params.vehicle import Vehicle
from sim_bridge.multibody import appearance
from sim_bridge.multibody.landmarks import add_landmarks
from sim_bridge.multibody.xml import add, add_visual, section
from sim_bridge.plant.dimensions import foot_z_m

PAD_M = 4.0
"""Half the side of the landing pad."""
GRASS_TILE_M = 20.0
"""Side of the ground texture, which repeats."""

_SUN_TOWARDS = (0.45, 0.55, -1.0)
_SUN_AT = (-18.0, -22.0, 40.0)


def add_scene(root: Element, vehicle: Vehicle) -> None:
    """Add the scene to a model with a body named "vehicle", and the appearance of the vehicle."""
    world, body = section(root, "worldbody"), root.find(".//body[@name='vehicle']")
    if body is None:
        raise ValueError("the model has no body called vehicle")
    ground_m = -foot_z_m(vehicle)
    _visual(root)
    _materials(section(root, "asset"))
    _light(world)
    _ground(world, ground_m)
    _pad(world, ground_m)
    add_landmarks(world, ground_m)
    _cameras(world, body, vehicle, ground_m)
    appearance.add_appearance(body, vehicle)


def _visual(root: Element) -> None:
    statistic = section(root, "statistic")
    statistic.set("extent", "10")  # unit of znear, zfar and the shadows
    statistic.set("center", "0 0 1")
    visual = section(root, "visual")
    add(visual, "global", offwidth=1280, offheight=720, fovy=45)
    add(visual, "quality", shadowsize=4096, offsamples=4, numslices=16, numstacks=10)
    add(visual, "map", znear=0.008, zfar=120, shadowclip=0.35, shadowscale=0.9, haze=0.35)
    add(
        visual,
        "headlight",
        ambient=(0.40, 0.41, 0.43),
        diffuse=(0.16, 0.16, 0.16),
        specular=(0.05, 0.05, 0.05),
    )
    add(visual, "rgba", haze=(0.78, 0.85, 0.91, 1))


def _materials(asset: Element) -> None:
    add(
        asset, "texture", name="sky", type="skybox", builtin="gradient", width=512, height=3072,
        rgb1=(0.24, 0.47, 0.78), rgb2=(0.80, 0.87, 0.93),
    )  # fmt: skip
    for name, size, colour in (
        ("grass", 1024, (0.34, 0.45, 0.20)),
        ("mown", 512, (0.40, 0.50, 0.24)),
        ("concrete", 1024, (0.56, 0.56, 0.54)),
    ):
        add(
            asset, "texture", name=name, type="2d", builtin="flat", width=size, height=size,
            rgb1=colour, rgb2=colour,
        )  # fmt: skip
    repeat = 2.0 / GRASS_TILE_M  # at 1 a texture covers 2 m
    add(asset, "material", name="grass", texture="grass", texuniform="true", texrepeat=(repeat, repeat),
        specular=0.0, shininess=0.0, reflectance=0.0)  # fmt: skip
    add(asset, "material", name="mown", texture="mown", texrepeat=(8.0, 1.0), specular=0.0, shininess=0.0)
    add(asset, "material", name="concrete", texture="concrete", specular=0.05, shininess=0.1)


def _light(world: Element) -> None:
    add(
        world, "light", name="sun", type="directional", mode="trackcom", castshadow="true", dir=_SUN_TOWARDS,
        pos=_SUN_AT, diffuse=(0.72, 0.70, 0.64), specular=(0.25, 0.25, 0.22), ambient=(0.02, 0.02, 0.02),
    )  # fmt: skip


def _ground(world: Element, ground_m: float) -> None:
    ground = world.find("geom[@name='ground']")
    if ground is None:
        ground = add(world, "geom", name="ground", type="plane", pos=(0, 0, ground_m), size=(0, 0, 1))
    for name in ("rgba", "material"):
        ground.attrib.pop(name, None)
    ground.set("material", "grass")
    ground.set("size", "0 0 1")


def _pad(world: Element, ground_m: float) -> None:
    """Add the landing pad at home and a mown strip through the field."""
    add_visual(world, "box", size=(32.0, 3.2, 0.004), pos=(0, 0, ground_m - 0.001), material="mown")
    add_visual(
        world, "box", name="pad", size=(PAD_M, PAD_M, 0.01), pos=(0, 0, ground_m - 0.004), material="concrete"
    )


def _cameras(world: Element, body: Element, vehicle: Vehicle, ground_m: float) -> None:
    """Add cameras for other viewers; the renderer has its own, smoother ones (``cameras.py``)."""
    far = 4.0 * appearance.span_m(vehicle)
    add(
        body,
        "camera",
        name="chase",
        mode="trackcom",
        pos=(-far, 0, 0.5 * far),
        xyaxes=(0, -1, 0, 0.45, 0, 0.9),
    )
    add(world, "camera", name="fixed", mode="targetbody", target="vehicle", pos=(-11, 6, ground_m + 1.75))
    add(body, "camera", name="top", mode="trackcom", pos=(0, 0, 3.0 * far), xyaxes=(0, -1, 0, 1, 0, 0))
    add(world, "camera", name="whole", pos=(0, 0, ground_m + 18.0), xyaxes=(0, -1, 0, 1, 0, 0))
    add(body, "camera", name="side", mode="trackcom", pos=(0, far, 0.1 * far), xyaxes=(-1, 0, 0, 0, -0.1, 1))
