"""Off-screen renderer: one moment in, one array of pixels out."""

from __future__ import annotations

from typing import Any, TypeAlias

import mujoco
import numpy as np

from flightstack.params.vehicle import Vehicle
from sim_bridge.errors import UsageProblemError
from sim_bridge.multibody import appearance
from sim_bridge.multibody.frames import flip_quaternion, flip_vector
from sim_bridge.multibody.mjcf import model_xml
from sim_bridge.plant.dimensions import foot_z_m
from sim_bridge.render.cameras import Site, View, view
from sim_bridge.render.marks import Marks, RotorAppearance
from sim_bridge.render.offscreen import make_context
from sim_bridge.render.paint import paint
from sim_bridge.render.poses import MOST_TRAIL, FlightPath, Moment

Picture: TypeAlias = np.ndarray[Any, np.dtype[np.uint8]]
"""Shape (height, width, 3), red, green, blue."""

_MARKS = 3 * MOST_TRAIL


class Stage:
    """The compiled and painted model of a vehicle in its scene, without dynamics."""

    def __init__(self, vehicle: Vehicle) -> None:
        self.vehicle = vehicle
        try:
            self.model = mujoco.MjModel.from_xml_string(model_xml(vehicle, scene=True))
        except ValueError as error:  # a missing mesh
            raise UsageProblemError(f"the vehicle {vehicle.name} cannot be drawn: {error}") from error
        paint(self.model)
        self.data = mujoco.MjData(self.model)
        self.span_m, self.ground_m = appearance.span_m(vehicle), -foot_z_m(vehicle)
        self.rotors = RotorAppearance(self.model, vehicle)
        self._free_joint = self._address("vehicle")
        self._hinges = [self._address(f"rotor_{n}") for n in range(1, len(vehicle.rotors) + 1)]
        self.body = int(mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_BODY, "vehicle"))
        moves = self.model.body_rootid[self.model.geom_bodyid] == self.body
        self.shadeless = frozenset(np.flatnonzero(~moves).tolist()) | self.rotors.discs

    def _address(self, joint: str) -> int:
        number = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_JOINT, joint)
        return int(self.model.jnt_qposadr[number])

    def put(self, moment: Moment) -> None:
        """Set pose, rotor angles and rotor colours of a moment."""
        at, q = self._free_joint, self.data.qpos
        q[at : at + 3] = flip_vector(moment.position_ned_m)
        q[at + 3 : at + 7] = flip_quaternion(moment.attitude)
        for address, angle in zip(self._hinges, moment.rotor_angle_rad, strict=False):
            q[address] = angle % (2.0 * np.pi)
        self.rotors.show(moment.rotor_speed_rad_s)
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)


class Renderer:
    """Draws moments of one flight; raises UsageProblemError without an off-screen renderer."""

    def __init__(self, vehicle: Vehicle, path: FlightPath, width: int, height: int) -> None:
        self.width, self.height = width, height
        self._gl = make_context(width, height)
        self._stage = Stage(vehicle)
        span_m, ground_m = self._stage.span_m, self._stage.ground_m
        corners = np.array([flip_vector(path.low_ned_m), flip_vector(path.high_ned_m)])
        low, high = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
        self._site = Site(
            span_m, ground_m, (low[0], low[1], low[2]), (high[0], high[1], high[2]), width / height
        )
        self._marks = Marks(path.trail, path.poses.waypoints_ned_m, span_m, ground_m)
        model = self._stage.model
        model.vis.global_.offwidth, model.vis.global_.offheight = width, height
        self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)
        self._scene = mujoco.MjvScene(model, maxgeom=model.ngeom + _MARKS)
        self._options = mujoco.MjvOption()
        self._camera = mujoco.MjvCamera()

    def draw(self, moment: Moment, camera: str) -> Picture:
        """Return the picture of a moment by a camera of ``cameras.CAMERAS``."""
        stage, scene = self._stage, self._scene
        stage.put(moment)
        seen = self.view(moment, camera)
        self._set_camera(seen)
        mujoco.mjv_updateScene(
            stage.model,
            stage.data,
            self._options,
            None,
            self._camera,
            mujoco.mjtCatBit.mjCAT_ALL.value,
            scene,
        )
        # only the vehicle casts a shadow: those of the ground have artefacts
        for geom in scene.geoms[: scene.ngeom]:
            if geom.objtype == mujoco.mjtObj.mjOBJ_GEOM and geom.objid in stage.shadeless:
                geom.category = mujoco.mjtCatBit.mjCAT_DECOR
        self._marks.draw(scene, moment, seen.pixel_m(self.height))
        return self._read()

    def view(self, moment: Moment, camera: str) -> View:
        """Return the view of a moment by a camera of ``cameras.CAMERAS``."""
        return view(camera, moment, self._site)

    def _set_camera(self, seen: View) -> None:
        self._camera.lookat[:] = seen.look_at_m
        self._camera.distance = seen.distance_m
        self._camera.azimuth, self._camera.elevation = seen.azimuth_deg, seen.elevation_deg
        self._stage.model.vis.global_.fovy = seen.field_deg

    def _read(self) -> Picture:
        area = mujoco.MjrRect(0, 0, self.width, self.height)
        mujoco.mjr_render(area, self._scene, self._context)
        upside_down = np.empty((self.height, self.width, 3), np.uint8)
        mujoco.mjr_readPixels(upside_down, None, area, self._context)
        return np.ascontiguousarray(upside_down[::-1])

    def close(self) -> None:
        """Free the context."""
        self._context.free()
        self._gl.free()

    def __enter__(self) -> Renderer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
