"""A flying site around home, for scale and orientation in pictures; without contact.

World frame NWU [m]. Within 13 m of home there are only a pilot, a bench and a windsock.
"""

from __future__ import annotations

import math
from xml.etree.ElementTree import Element

import numpy as np

from sim_bridge.multibody.xml import add, add_visual

_SEED = 7
_TREES = 46
_FENCE_M = 34.0
_POST_STEP_M = 4.0

Colour = tuple[float, float, float, float]
_WOOD: Colour = (0.42, 0.31, 0.21, 1.0)
_METAL: Colour = (0.72, 0.74, 0.76, 1.0)
_DARK: Colour = (0.12, 0.13, 0.14, 1.0)
_SHADE: Colour = (0.02, 0.05, 0.02, 0.33)


def add_landmarks(world: Element, ground_z_m: float) -> None:
    """Add the surroundings to the world body; ``ground_z_m`` is the height of the ground."""
    site = add(world, "body", name="site", pos=(0.0, 0.0, ground_z_m))
    _hangar(add(site, "body", pos=(25.0, 17.0, 0.0), euler=(0.0, 0.0, math.radians(-148.0))))
    _car(add(site, "body", pos=(15.5, 17.0, 0.0), euler=(0.0, 0.0, math.radians(70.0))))
    _windsock(add(site, "body", pos=(9.0, 8.5, 0.0)))
    _pilot(add(site, "body", pos=(-5.0, -3.0, 0.0)))
    _bench(add(site, "body", pos=(-9.5, 5.5, 0.0), euler=(0.0, 0.0, math.radians(20.0))))
    _fence(site)
    _trees(site)
    _hills(site)


def _shade(body: Element, radius_m: float, along_m: float | None = None) -> None:
    """Add a dark patch on the grass: the sun casts shadows only near the vehicle."""
    size = (radius_m, along_m or radius_m, 0.01)
    add_visual(body, "ellipsoid", size=size, pos=(-0.35 * radius_m, 0.2 * radius_m, 0.02), rgba=_SHADE)


def _hangar(body: Element) -> None:
    """Add a hall of 10 by 8 m with an arched roof and its gate towards x."""
    wall, roof, door = (0.80, 0.79, 0.74, 1.0), (0.36, 0.43, 0.50, 1.0), (0.55, 0.60, 0.64, 1.0)
    _shade(body, 6.5, 5.5)
    add_visual(body, "box", size=(5.0, 4.0, 1.4), pos=(0, 0, 1.4), rgba=wall)
    add_visual(body, "ellipsoid", size=(5.15, 4.2, 1.7), pos=(0, 0, 2.75), rgba=roof)
    add_visual(body, "box", size=(0.04, 2.9, 1.2), pos=(5.0, 0, 1.2), rgba=door)
    for y in (-1.45, 0.0, 1.45):
        add_visual(body, "box", size=(0.03, 0.03, 1.2), pos=(5.03, y, 1.2), rgba=_DARK)
    for x in (-3.0, 0.0, 3.0):
        add_visual(body, "box", size=(0.7, 0.03, 0.4), pos=(x, 4.0, 1.9), rgba=(0.30, 0.42, 0.52, 1.0))
        add_visual(body, "box", size=(0.7, 0.03, 0.4), pos=(x, -4.0, 1.9), rgba=(0.30, 0.42, 0.52, 1.0))


def _car(body: Element) -> None:
    """Add a small estate car."""
    paint = (0.70, 0.16, 0.13, 1.0)
    _shade(body, 2.3, 1.3)
    add_visual(body, "box", size=(2.05, 0.85, 0.32), pos=(0, 0, 0.62), rgba=paint)
    add_visual(body, "box", size=(1.25, 0.76, 0.30), pos=(-0.35, 0, 1.18), rgba=(0.16, 0.20, 0.24, 1.0))
    add_visual(body, "box", size=(1.22, 0.78, 0.04), pos=(-0.35, 0, 1.49), rgba=paint)
    for x in (-1.3, 1.3):
        for y in (-0.8, 0.8):
            add_visual(
                body, "cylinder", size=(0.33, 0.11), pos=(x, y, 0.33), euler=(math.pi / 2, 0, 0), rgba=_DARK
            )


def _windsock(body: Element) -> None:
    """Add a pole of 4 m with a striped sock."""
    add_visual(body, "cylinder", size=(0.04, 2.0), pos=(0, 0, 2.0), rgba=_METAL)
    for stripe in range(5):
        colour = (0.95, 0.42, 0.08, 1.0) if stripe % 2 == 0 else (0.96, 0.96, 0.94, 1.0)
        x, z = 0.2 + 0.3 * stripe, 3.85 - 0.05 * stripe**1.4
        add_visual(
            body, "cylinder", size=(0.22 - 0.025 * stripe, 0.155), pos=(x, 0, z),
            euler=(0.0, math.pi / 2 + 0.05 + 0.05 * stripe, 0.0), rgba=colour,
        )  # fmt: skip


def _pilot(body: Element) -> None:
    """Add a person of 1.78 m with a transmitter, facing north."""
    vest, trousers, skin = (0.93, 0.76, 0.10, 1.0), (0.17, 0.22, 0.33, 1.0), (0.80, 0.61, 0.49, 1.0)
    for y in (-0.11, 0.11):
        add_visual(body, "capsule", size=(0.085,), fromto=(0, y, 0.09, 0, y, 0.80), rgba=trousers)
        add_visual(
            body, "capsule", size=(0.055,), fromto=(0.0, 2.1 * y, 1.36, 0.10, 1.9 * y, 1.08), rgba=vest
        )
        add_visual(body, "capsule", size=(0.045,), fromto=(0.10, 1.9 * y, 1.08, 0.34, y, 1.13), rgba=skin)
    add_visual(body, "ellipsoid", size=(0.15, 0.22, 0.36), pos=(0, 0, 1.12), rgba=vest)
    add_visual(body, "ellipsoid", size=(0.10, 0.09, 0.125), pos=(0.02, 0, 1.64), rgba=skin)
    add_visual(body, "ellipsoid", size=(0.115, 0.10, 0.07), pos=(0.0, 0, 1.72), rgba=trousers)
    add_visual(body, "box", size=(0.05, 0.11, 0.03), pos=(0.38, 0, 1.14), rgba=_DARK)


def _bench(body: Element) -> None:
    """Add a work bench with a case on it."""
    add_visual(body, "box", size=(0.4, 0.9, 0.025), pos=(0, 0, 0.75), rgba=_WOOD)
    for x in (-0.33, 0.33):
        for y in (-0.8, 0.8):
            add_visual(body, "box", size=(0.03, 0.03, 0.37), pos=(x, y, 0.37), rgba=_WOOD)
    add_visual(body, "box", size=(0.2, 0.3, 0.1), pos=(0, 0.3, 0.87), rgba=(0.15, 0.17, 0.20, 1.0))


def _fence(site: Element) -> None:
    """Add posts and two rails around the field."""
    posts = np.arange(-_FENCE_M, _FENCE_M + 0.1, _POST_STEP_M)
    for side in (-1.0, 1.0):
        for along in posts.tolist():
            for x, y in ((along, side * _FENCE_M), (side * _FENCE_M, along)):
                add_visual(site, "box", size=(0.06, 0.06, 0.6), pos=(x, y, 0.6), rgba=_WOOD)
        for z in (0.55, 1.0):
            add_visual(site, "box", size=(_FENCE_M, 0.02, 0.06), pos=(0, side * _FENCE_M, z), rgba=_WOOD)
            add_visual(site, "box", size=(0.02, _FENCE_M, 0.06), pos=(side * _FENCE_M, 0, z), rgba=_WOOD)


def _trees(site: Element) -> None:
    """Add trees outside the fence, from a fixed seed."""
    random = np.random.default_rng(_SEED)
    for _ in range(_TREES):
        bearing, distance = random.uniform(0.0, 2.0 * math.pi), random.uniform(44.0, 95.0)
        x, y = distance * math.cos(bearing), distance * math.sin(bearing)
        body = add(site, "body", pos=(x, y, 0.0), euler=(0.0, 0.0, random.uniform(0.0, 6.0)))
        scale = random.uniform(0.75, 1.5)
        (_fir if random.random() < 0.35 else _broadleaf)(body, scale, random)


def _broadleaf(body: Element, scale: float, random: np.random.Generator) -> None:
    _shade(body, 2.6 * scale)
    add_visual(body, "cylinder", size=(0.16 * scale, 1.3 * scale), pos=(0, 0, 1.3 * scale), rgba=_WOOD)
    green = np.array([0.22, 0.37, 0.13]) * random.uniform(0.8, 1.25) + random.uniform(-0.02, 0.03, 3)
    for _ in range(5):
        offset = random.uniform(-1.0, 1.0, 3) * (1.1, 1.1, 0.8)
        size = random.uniform(1.1, 1.8, 3) * scale
        colour = (*(green * random.uniform(0.88, 1.12)).clip(0, 1).tolist(), 1.0)
        offset[2] += 3.6
        add_visual(body, "ellipsoid", size=size.tolist(), pos=(offset * scale).tolist(), rgba=colour)


def _fir(body: Element, scale: float, random: np.random.Generator) -> None:
    _shade(body, 1.7 * scale)
    add_visual(body, "cylinder", size=(0.14 * scale, 0.8 * scale), pos=(0, 0, 0.8 * scale), rgba=_WOOD)
    green = np.array([0.13, 0.27, 0.16]) * random.uniform(0.85, 1.2)
    for tier in range(4):
        radius, height = (1.75 - 0.4 * tier) * scale, 1.25 * scale
        pos = (0.0, 0.0, (1.7 + 1.25 * tier) * scale)
        colour = (*(green * (1.0 + 0.06 * tier)).tolist(), 1.0)
        add_visual(body, "ellipsoid", size=(radius, radius, height), pos=pos, rgba=colour)


def _hills(site: Element) -> None:
    """Add hills at the horizon, bluer with distance."""
    for bearing_deg, distance, width, height, colour in (
        (10.0, 420.0, 230.0, 46.0, (0.47, 0.57, 0.60, 1.0)),
        (62.0, 380.0, 190.0, 34.0, (0.43, 0.54, 0.53, 1.0)),
        (118.0, 460.0, 260.0, 52.0, (0.50, 0.60, 0.65, 1.0)),
        (185.0, 400.0, 210.0, 36.0, (0.45, 0.56, 0.57, 1.0)),
        (238.0, 440.0, 240.0, 55.0, (0.49, 0.59, 0.64, 1.0)),
        (305.0, 390.0, 220.0, 40.0, (0.44, 0.55, 0.55, 1.0)),
    ):
        bearing = math.radians(bearing_deg)
        pos = (distance * math.cos(bearing), distance * math.sin(bearing), 0.0)
        add_visual(site, "ellipsoid", size=(90.0, width, height), pos=pos, euler=(0, 0, bearing), rgba=colour)
