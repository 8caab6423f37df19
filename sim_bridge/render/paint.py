"""Procedural textures of sky, grass and landing pad, written into a compiled model."""

from __future__ import annotations

from functools import cache
from typing import Any, TypeAlias

import mujoco
import numpy as np

Image: TypeAlias = np.ndarray[Any, np.dtype[np.float64]]
"""Shape (height, width, 3) or (height, width), 0 to 1."""

_SEED = 3
_BAND = 0.35
"""Bandwidth of the noise; narrower bands look regular."""


def paint(model: Any) -> None:
    """Replace the plain textures of a model; one without them is not changed."""
    for index in range(model.ntex):
        painter = _PAINTERS.get(mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_TEXTURE, index))
        if painter is None:
            continue
        height, width = int(model.tex_height[index]), int(model.tex_width[index])
        channels, start = int(model.tex_nchannel[index]), int(model.tex_adr[index])
        pixels = np.full((height, width, channels), 255, np.uint8)
        pixels[:, :, :3] = np.clip(np.rint(painter(height, width) * 255.0), 0, 255)
        model.tex_data[start : start + pixels.size] = pixels.reshape(-1)


def _noise(size: int, cells: int, seed: int) -> Image:
    """Return smooth periodic noise around 0 with ``cells`` waves along each side."""
    spectrum = np.fft.rfft2(np.random.default_rng(seed).standard_normal((size, size)))
    waves = np.hypot(np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size)[None, :]) * size
    field = np.fft.irfft2(spectrum * np.exp(-((waves / cells - 1.0) ** 2) / _BAND), (size, size))
    return np.asarray(field / field.std())


def _mix(a: tuple[float, ...], b: tuple[float, ...], share: Image) -> Image:
    return np.asarray(np.array(a) + (np.array(b) - np.array(a)) * share[..., None])


def _grass(height: int, _width: int) -> Image:
    """Return 20 m of a field with a faint metre grid."""
    size = height
    coarse = 0.5 * _noise(size, 3, _SEED) + 0.5 * _noise(size, 7, _SEED + 1)
    fine = 0.6 * _noise(size, 60, _SEED + 2) + 0.8 * _noise(size, 260, _SEED + 3)
    image = _mix((0.265, 0.375, 0.145), (0.405, 0.485, 0.225), np.clip(0.5 + 0.22 * coarse, 0, 1))
    image *= (1.0 + 0.085 * fine)[..., None]
    pixels_m = size / 20.0
    at = (np.arange(size) + 0.5) / pixels_m
    for spacing, width_m, strength in ((1.0, 0.035, 0.10), (10.0, 0.08, 0.20)):
        line = np.abs((at + spacing / 2.0) % spacing - spacing / 2.0) < width_m
        on_line = line[:, None] | line[None, :]
        image[on_line] += strength * (np.array([0.9, 0.92, 0.82]) - image[on_line])
    return image


def _mown(height: int, _width: int) -> Image:
    """Return a strip of 8 by 6.4 m with mowing lanes: columns along it, rows across."""
    size = height
    lane = np.sin(2.0 * np.pi * 4.0 * (np.arange(size) + 0.5) / size)[:, None] > 0.0
    fine = 0.6 * _noise(size, 40, _SEED + 10) + 0.8 * _noise(size, 130, _SEED + 11)
    image = _mix((0.345, 0.455, 0.185), (0.415, 0.515, 0.235), lane * np.ones((size, size)))
    return image * (1.0 + 0.06 * fine)[..., None]


def _concrete(height: int, _width: int) -> Image:
    """Return the pad, 8 m wide: slabs, a circle with an H, and an arrow with an N to the north.

    Rows run from west to east, columns from south to north: the box's y and x.
    """
    size = height
    at = 8.0 * ((np.arange(size) + 0.5) / size - 0.5)
    east, north = at[:, None], at[None, :]
    stains = (
        0.5 * _noise(size, 4, _SEED + 4)
        + 0.4 * _noise(size, 25, _SEED + 5)
        + 0.5 * _noise(size, 300, _SEED + 6)
    )
    image = _mix((0.53, 0.53, 0.515), (0.63, 0.63, 0.61), np.clip(0.5 + 0.2 * stains, 0, 1))
    joint = (np.abs((at + 1.0) % 2.0 - 1.0) < 0.012) & (np.abs(at) < 3.9)
    image[joint[:, None] | joint[None, :]] *= 0.72
    radius = np.hypot(east, north)
    white, orange = np.array([0.92, 0.92, 0.90]), np.array([0.93, 0.42, 0.08])
    marks = (np.abs(radius - 1.5) < 0.07) | _letter_h(east, north)
    edge = (np.maximum(np.abs(east), np.abs(north)) > 3.72) & (np.maximum(np.abs(east), np.abs(north)) < 3.84)
    arrow = (north > 1.75) & (north < 2.45) & (np.abs(east) < 0.5 * (2.45 - north))
    letter = _letter_n(east, north - 3.0)
    wear = (1.0 - 0.10 * np.clip(stains, -1, 2))[..., None]
    for where, colour in ((marks, white), (edge, white), (arrow, orange), (letter, orange)):
        image = np.where(where[..., None], colour * wear, image)
    return image


def _letter_h(east: Image, north: Image) -> Any:
    return ((np.abs(np.abs(east) - 0.45) < 0.09) & (np.abs(north) < 0.75)) | (
        (np.abs(north) < 0.09) & (np.abs(east) < 0.45)
    )


def _letter_n(east: Image, north: Image) -> Any:
    inside = np.abs(north) < 0.36
    return inside & ((np.abs(np.abs(east) - 0.26) < 0.055) | (np.abs(east + 0.72 * north) < 0.065))


def _sky(height: int, width: int) -> Image:
    """Return six faces, stacked: right, left, up, down, front, back."""
    at = 2.0 * ((np.arange(width) + 0.5) / width) - 1.0
    u, v = np.meshgrid(at, at)
    one = np.ones_like(u)
    faces = ((one, -v, -u), (-one, -v, u), (u, one, v), (u, -one, -v), (u, -v, one), (-u, -v, -one))
    return np.concatenate([_sky_towards(*face) for face in faces])[:height]


@cache
def _clouds() -> Image:
    """Return the thickness of the cloud layer, periodic."""
    size = 512
    return (
        0.75 * _noise(size, 5, _SEED + 7)
        + 0.45 * _noise(size, 13, _SEED + 8)
        + 0.3 * _noise(size, 40, _SEED + 9)
    )


def _sky_towards(x: Image, up: Image, z: Image) -> Image:
    """Return the colour of the sky in directions of any length; ``up`` is away from the ground."""
    length = np.sqrt(x * x + up * up + z * z)
    high = np.clip(up / length, 0.0, 1.0)
    image = _mix((0.80, 0.87, 0.93), (0.42, 0.63, 0.86), np.clip(high * 2.4, 0, 1) ** 0.7)
    image += (np.array([0.20, 0.42, 0.72]) - image) * (np.clip((high - 0.25) / 0.75, 0, 1) ** 1.1)[..., None]
    # flat cloud layer, seen from below
    reach = 0.30
    layer = _clouds()
    size = len(layer)
    scale = 0.17 * size / np.maximum(high, 0.02)
    column = np.floor(x / length * scale).astype(int) % size
    row = np.floor(z / length * scale).astype(int) % size
    cloud = np.clip((layer[row, column] - 0.45) * 0.8, 0.0, 1.0) * np.clip((high - 0.04) / reach, 0.0, 1.0)
    return np.asarray(image + (np.array([0.97, 0.975, 0.98]) - image) * (0.85 * cloud)[..., None])


_PAINTERS = {"grass": _grass, "mown": _mown, "concrete": _concrete, "sky": _sky}
