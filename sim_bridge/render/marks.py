"""Marks in the scene: trail, target and plan; and the appearance of rotors by speed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import mujoco
import numpy as np

from flightstack.core.contract import FloatArray
from flightstack.params.vehicle import Vehicle
from sim_bridge.multibody import appearance
from sim_bridge.multibody.frames import flip_vector
from sim_bridge.render.poses import MOST_TRAIL, Moment

_LEAST_LINE_PX, _LEAST_SPHERE_PX = 1.3, 4.5
_TRAIL_NEW, _TRAIL_OLD = np.array([1.0, 0.78, 0.10, 0.95]), np.array([0.98, 0.90, 0.55, 0.28])
_TARGET = np.array([0.95, 0.10, 0.62, 0.75])
_PLAN = np.array([0.10, 0.42, 0.95, 0.45])
_SLOW, _FAST = np.array([0.50, 0.66, 0.82]), np.array([1.0, 0.36, 0.06])
_BLUR_FROM, _BLUR_TO = 40.0, 130.0  # rad/s: the disc replaces the blades in this range
_UPRIGHT = np.eye(3).reshape(9)

Point = Sequence[float]


class Marks:
    """Adds geoms to a scene; ``trail`` returns the path flown until a time, NED [m], with a limit of points."""

    def __init__(
        self,
        trail: Callable[[float, int], FloatArray],
        waypoints_ned_m: FloatArray,
        span_m: float,
        ground_m: float,
        names: Sequence[str] = (),
    ) -> None:
        """``names`` label the waypoints; without names there are no labels."""
        self._trail = trail
        self._span_m, self._ground_m = span_m, ground_m
        self._width_m = 0.022 * span_m
        self._waypoints = [flip_vector(row) for row in waypoints_ned_m.tolist()]
        self._names = names or [""] * len(self._waypoints)

    def draw(self, scene: Any, moment: Moment, pixel_m: float = 0.0) -> None:
        """Add all marks of a moment to a scene that contains the model.

        ``pixel_m``, the size of a pixel at the look-at point, bounds the width of lines from below.
        """
        self._draw_plan(scene, pixel_m)
        points = self._trail(moment.time_s, MOST_TRAIL)
        along = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))))
        age = 1.0 - along[1:] / max(float(along[-1]), 1e-9)
        width_m = max(self._width_m, _LEAST_LINE_PX * pixel_m)
        places = [flip_vector(row) for row in points.tolist()]
        for (begin, end), share in zip(pairwise(places), age**0.5, strict=True):
            _line(scene, begin, end, width_m, _TRAIL_NEW + (_TRAIL_OLD - _TRAIL_NEW) * share)
        if moment.target_ned_m is not None:
            self._draw_target(scene, flip_vector(moment.target_ned_m))

    def _draw_target(self, scene: Any, at: Point) -> None:
        """Add a sphere, and marks around it: the vehicle usually hides its target."""
        _solid(scene, mujoco.mjtGeom.mjGEOM_SPHERE, (0.045 * self._span_m,) * 3, at, _TARGET)
        for axis in range(3):
            for side in (-self._span_m, self._span_m):
                ends = np.array([at, at], dtype=np.float64)
                ends[:, axis] += (1.15 * side, 1.45 * side)
                _line(scene, ends[0].tolist(), ends[1].tolist(), 0.5 * self._width_m, _TARGET)

    def _draw_plan(self, scene: Any, pixel_m: float) -> None:
        """Add spheres on poles, joined by thin lines."""
        radius_m = max(0.13 * self._span_m, _LEAST_SPHERE_PX * pixel_m)
        width_m = 0.35 * max(self._width_m, _LEAST_LINE_PX * pixel_m)
        for name, at in zip(self._names, self._waypoints, strict=True):
            _solid(scene, mujoco.mjtGeom.mjGEOM_SPHERE, (radius_m,) * 3, at, _PLAN, label=name)
            foot = (at[0], at[1], self._ground_m)
            if at[2] > self._ground_m:
                _line(scene, foot, at, width_m, _PLAN * (1, 1, 1, 0.7))
        for begin, end in pairwise(self._waypoints):
            _line(scene, begin, end, width_m, _PLAN * (1, 1, 1, 0.8))


class RotorAppearance:
    """Shows the speed of each rotor: blades at low speed, above that a disc from blue (slow) to orange (fast)."""

    def __init__(self, model: Any, vehicle: Vehicle) -> None:
        self._model = model
        self._fastest = [min(rotor.max_speed_rad_s, 1e4) for rotor in vehicle.rotors]
        numbers = range(1, len(vehicle.rotors) + 1)
        self._discs = [_geom(model, appearance.DISC_NAME.format(number)) for number in numbers]
        self._blades = [
            [_geom(model, appearance.BLADE_NAME.format(n, blade)) for blade in range(2)] for n in numbers
        ]

    @property
    def discs(self) -> frozenset[int]:
        """Transparent geoms, which cast no shadow."""
        return frozenset(disc for disc in self._discs if disc >= 0)

    def show(self, speeds_rad_s: Sequence[float]) -> None:
        """Colour the propellers of the model."""
        rgba = self._model.geom_rgba
        for index, rad_s in enumerate(speeds_rad_s[: len(self._discs)]):
            speed = abs(rad_s) if np.isfinite(rad_s) else 0.0
            blur = min(max((speed - _BLUR_FROM) / (_BLUR_TO - _BLUR_FROM), 0.0), 1.0)
            share = min(speed / self._fastest[index], 1.0)
            heat = min(max((share - 0.60) / 0.30, 0.0), 1.0)  # hover is about 0.7 of the largest speed
            if self._discs[index] >= 0:
                rgba[self._discs[index], :3] = _SLOW + (_FAST - _SLOW) * heat
                rgba[self._discs[index], 3] = 0.30 * blur
            for blade in self._blades[index]:
                if blade >= 0:
                    rgba[blade, 3] = 1.0 - 0.72 * blur

    def replace_discs(self, scene: Any, data: Any) -> None:
        """Replace the model's discs, which cast shadows, by marks of a scene."""
        for disc in sorted(self.discs):
            rgba = self._model.geom_rgba[disc].copy()
            if rgba[3] <= 0.0:
                continue
            geom = _new_geom(scene)
            if geom is None:
                return
            mujoco.mjv_initGeom(
                geom, mujoco.mjtGeom.mjGEOM_CYLINDER, self._model.geom_size[disc], data.geom_xpos[disc],
                data.geom_xmat[disc], rgba,
            )  # fmt: skip
            geom.category = mujoco.mjtCatBit.mjCAT_DECOR
            self._model.geom_rgba[disc, 3] = 0.0


def _geom(model: Any, name: str) -> int:
    return int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, name))


def _new_geom(scene: Any) -> Any | None:
    """Return the next unused geom of a scene; None when it is full."""
    if scene.ngeom >= scene.maxgeom:
        return None
    scene.ngeom += 1
    return scene.geoms[scene.ngeom - 1]


def _solid(scene: Any, kind: Any, size: Sequence[float], at: Point, rgba: Any, label: str = "") -> None:
    geom = _new_geom(scene)
    if geom is None:
        return
    mujoco.mjv_initGeom(
        geom, kind, np.array(size), np.array(at, dtype=np.float64), _UPRIGHT, rgba.astype(np.float32)
    )
    _finish(geom, label)


def _line(scene: Any, begin: Point, end: Point, width_m: float, rgba: Any) -> None:
    geom = _new_geom(scene)
    if geom is None:
        return
    kind = mujoco.mjtGeom.mjGEOM_CYLINDER  # round ends would overlap and show through each other
    mujoco.mjv_initGeom(geom, kind, np.zeros(3), np.zeros(3), _UPRIGHT, rgba.astype(np.float32))
    mujoco.mjv_connector(geom, kind, width_m, np.array(begin, np.float64), np.array(end, np.float64))
    _finish(geom, "")


def _finish(geom: Any, label: str) -> None:
    """Make a mark emissive and without a shadow."""
    geom.category = mujoco.mjtCatBit.mjCAT_DECOR
    geom.emission, geom.specular = 0.55, 0.0
    geom.label = label
