"""Payload and moved centre of gravity of the multibody plant: another mass, centre and inertia of the frame body.

The frame takes what changes in the whole vehicle, so that vehicle and rotors together have the mass properties of
``loading.py`` while the rotors keep theirs. MuJoCo's axes: FLU.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import mujoco
import numpy as np

from flightstack.core.contract import FloatArray, Vector3
from sim_bridge.multibody.frames import flip_vector
from sim_bridge.multibody.mass import MassProperties, about_point
from sim_bridge.plant.loading import AS_BUILT, Loading


class _Original(NamedTuple):
    mass: float
    position: FloatArray
    inertia: FloatArray
    orientation: FloatArray
    same_frame: int


class FrameLoad:
    """Sets mass, centre of gravity and inertia of the frame in a model."""

    def __init__(self, model: Any) -> None:
        self._model = model
        self._body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, "vehicle")
        body = self._body
        self._original = _Original(
            float(model.body_mass[body]), model.body_ipos[body].copy(), model.body_inertia[body].copy(),
            model.body_iquat[body].copy(), int(model.body_sameframe[body]),
        )  # fmt: skip
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        turn = data.ximat[body].reshape(3, 3)
        self._frame = MassProperties(
            self._original.mass, self._original.position, turn @ np.diag(self._original.inertia) @ turn.T
        )
        mass = model.body_mass[body:]
        self._whole_kg = float(mass.sum())
        self._whole_centre: FloatArray = mass @ data.xipos[body:] / self._whole_kg

    def set(self, loading: Loading) -> None:
        """Change the model; its data must be computed anew."""
        if loading == AS_BUILT:
            self._write(*self._original)
            return
        offset, at = _flipped(loading.centre_frd_m), _flipped(loading.payload_frd_m)
        frame, whole_kg, added_kg = self._frame, self._whole_kg, loading.payload_kg
        mass = frame.mass_kg + added_kg
        centre = (frame.mass_kg * frame.centre_m + whole_kg * offset + added_kg * at) / mass
        # inertia about the origin: the whole vehicle moves, the payload is added
        inertia = frame.inertia_kg_m2 + about_point(frame.mass_kg, frame.centre_m) + about_point(added_kg, at)
        before, after = self._whole_centre, self._whole_centre + offset
        inertia += about_point(whole_kg, after) - about_point(whole_kg, before)
        inertia -= about_point(mass, centre)
        moments, axes, orientation = np.zeros(3), np.zeros(9), np.zeros(4)
        mujoco.mju_eig3(moments, axes, orientation, inertia.ravel())
        self._write(mass, centre, moments, orientation, 0)

    def _write(
        self, mass: float, position: FloatArray, inertia: FloatArray, orientation: FloatArray, same_frame: int
    ) -> None:
        model, body = self._model, self._body
        model.body_mass[body], model.body_ipos[body] = mass, position
        model.body_inertia[body], model.body_iquat[body] = inertia, orientation
        model.body_sameframe[body] = same_frame  # 1: the axes of the inertia are the body's
        mujoco.mj_setConst(model, mujoco.MjData(model))


def _flipped(vector: Vector3) -> FloatArray:
    return np.array(flip_vector(vector))
