"""The multibody plant: frame and spinning rotors as bodies of a MuJoCo model, on legs on the ground.

MuJoCo computes the accelerations of all bodies and the contact with the ground; ``rotor_drive.py`` makes the forces of
every stage and integrates with the classic Runge-Kutta method, in the same variables as the rigid plant. MuJoCo's own
``mj_step`` has an RK4 of the same order, but asks for the forces of a stage by a callback that a whole process shares.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from flightstack.core.contract import FloatArray, RecordArray, Vector3
from flightstack.core.errors import ConfigError
from flightstack.core.geometry import quaternion_from_euler
from flightstack.params.vehicle import Vehicle
from sim_bridge.multibody import contact
from sim_bridge.multibody.assembly import assemble
from sim_bridge.multibody.mjcf import model_xml
from sim_bridge.multibody.usual_parts import foot_z_m
from sim_bridge.plant import rotor_drive
from sim_bridge.plant.layout import DIVERGED
from sim_bridge.plant.plant import InitialState, PlantOptions
from sim_bridge.plant.record_plant import DEFAULT_STEP_S, RecordPlant
from sim_bridge.plant.rotor_drive import LOST, NEAR

_NO_CONTACT = int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
_AFTER_VELOCITY = int(mujoco.mjtStage.mjSTAGE_VEL)
_STAGES = (0, 1, 2, 3)
_FIRST_DEPTH_M = 1e-5
_FRAME = 6  # degrees of freedom


def _compiled(vehicle: Vehicle) -> Any:
    """Return MuJoCo's model of a vehicle; raise ConfigError where its compiler refuses a part."""
    try:
        return mujoco.MjModel.from_xml_string(model_xml(vehicle, lean=True))
    except ValueError as error:
        first = str(error).partition("\n")[0].removeprefix("Error: ")
        raise ConfigError(vehicle.name, "part", f"MuJoCo refuses the model: {first}") from None


class MultibodyPlant(RecordPlant):
    """The vehicle's assembly on MuJoCo; see ``Plant`` for its methods."""

    def __init__(self, vehicle: Vehicle, options: PlantOptions) -> None:
        super().__init__(vehicle, options)
        self.assembly = assemble(vehicle)
        self._model = _compiled(vehicle)
        self.data = mujoco.MjData(self._model)
        """MuJoCo's state, forces and accelerations, in its own frames; read only."""
        self._softness_m = 0.0
        self._watched = NEAR
        first = 1 + mujoco.mj_name2id(self._model, mujoco.mjtObj.mjOBJ_BODY, "vehicle")
        self._on_rotors: FloatArray = self.data.xfrc_applied[first:]
        self._views()
        self._drive: RecordArray = np.zeros(1, rotor_drive.DRIVE)
        self._set_drive(len(vehicle.rotors))
        self.memory[0]["ground_z"], self.memory[0]["reach"] = foot_z_m(vehicle), self._reach_m()
        self._set_state(options.initial)
        self.set_step(DEFAULT_STEP_S)

    def _views(self) -> None:
        """Keep MuJoCo's arrays at hand: looking them up takes as long as a kernel."""
        data = self.data
        self._qpos: FloatArray = data.qpos
        self._qvel: FloatArray = data.qvel
        self._qacc: FloatArray = data.qacc
        self._bias: FloatArray = data.qfrc_bias
        self._held: FloatArray = data.qfrc_constraint
        self._applied: FloatArray = data.qfrc_applied
        self._warm_start: FloatArray = data.qacc_warmstart

    def _set_drive(self, rotors: int) -> None:
        """Read the constants of the drives out of MuJoCo's mass matrix at the level attitude."""
        model, data, d = self._model, self.data, self._drive[0]
        mujoco.mj_forward(model, data)
        columns = np.eye(model.nv)
        mass = np.zeros((model.nv, model.nv))
        for row, column in zip(mass, columns, strict=True):
            mujoco.mj_mulM(model, data, row, column)
        self._held[:] = 0.0  # what stood on the ground was the model, not yet the vehicle
        row = np.linalg.solve(mass[:_FRAME, :_FRAME], mass[:_FRAME, _FRAME:]).T
        d["gain"][:rotors, :rotors] = mass[_FRAME:, _FRAME:] - row @ mass[:_FRAME, _FRAME:]
        d["row"][:rotors] = row * np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])  # FLU to FRD
        d["spin"][:rotors] = [rotor.spin for rotor in self._vehicle.rotors]

    def _reach_m(self) -> float:
        """Distance from the origin to the farthest point that may touch the ground."""
        geoms = [index for index in range(self._model.ngeom) if self._model.geom_contype[index]]
        away = np.linalg.norm(self.data.geom_xpos[geoms] - self.data.qpos[:3], axis=1)
        return float((away + self._model.geom_rbound[geoms]).max(initial=0.0))

    def _set_state(self, initial: InitialState) -> None:
        body = self.memory[0]["body"]
        body[0:3], body[3:6] = initial.position_ned_m, initial.velocity_ned_m_s
        body[6:10], body[10:13] = quaternion_from_euler(*initial.euler_rad), initial.rates_frd_rad_s

    # ------------------------------------------------------------------ time

    def set_step(self, step_s: float) -> None:
        """Choose the fixed step of the integration [s]."""
        super().set_step(step_s)
        self._model.opt.timestep = step_s
        self._model.geom_solref[:] = contact.reference(self._vehicle, step_s)
        self._softness_m = self._rest_depth_m()
        self._drive[0]["sink"] = self._softness_m

    def _rest_depth_m(self) -> float:
        """How deep a level vehicle stands in the ground, by a secant step: the force is linear in the depth."""
        if not self.memory[0]["ground"]:
            return 0.0
        model = self._model
        data = mujoco.MjData(model)
        self._look_for_contacts(True)
        self._watched = NEAR
        depths, falls = (_FIRST_DEPTH_M, 2.0 * _FIRST_DEPTH_M), []
        for depth in depths:
            data.qpos[2] = -depth
            mujoco.mj_forward(model, data)
            falls.append(float(data.qacc[2]))
        rise = falls[1] - falls[0]
        return (1.0 - falls[0] / rise) * _FIRST_DEPTH_M if rise > 0.0 else 0.0

    def _advance(self, command_rad_s: FloatArray, flags: int, steps: int) -> int:
        rotor_drive.hold_commands(self.memory, command_rad_s, flags)
        where = rotor_drive.FLYING
        for _ in range(steps):
            where = self._step()
            if where == LOST:
                break
        return self.show()

    def _step(self) -> int:
        """Advance by one step; return where the vehicle is."""
        memory, drive, qpos, qvel = self.memory, self._drive, self._qpos, self._qvel
        where = rotor_drive.begin_step(memory, drive, qpos, qvel)
        self._watch_ground(where)
        for stage in _STAGES:
            if where == LOST:
                break
            self._accelerations(stage)
            where = rotor_drive.end_stage(memory, drive, stage, self._qacc, qpos, qvel)
        return where

    def _watch_ground(self, where: int) -> None:
        """Let MuJoCo look for contacts only where there may be some."""
        if where != self._watched:
            self._watched = where
            self._look_for_contacts(where == NEAR)

    def _look_for_contacts(self, wanted: bool) -> None:
        option = self._model.opt
        others = option.disableflags & ~_NO_CONTACT
        option.disableflags = others if wanted else others | _NO_CONTACT

    def _accelerations(self, stage: int) -> None:
        """Let MuJoCo compute the accelerations of the state that was written to it."""
        model, data = self._model, self.data
        mujoco.mj_step1(model, data)
        rotor_drive.apply_forces(
            self.memory, self._drive, stage, self._bias, self._held, self._applied, self._on_rotors
        )
        mujoco.mj_forwardSkip(model, data, _AFTER_VELOCITY, 1)

    # ------------------------------------------------------------------ what is

    def show(self) -> int:
        """Write the present state to ``output``; returns as ``advance``."""
        where = rotor_drive.show_pose(self.memory, self._drive, self._qpos, self._qvel)
        touches = 0
        if where == NEAR:
            self._watch_ground(where)
            mujoco.mj_fwdPosition(self._model, self.data)
            touches = int(self.data.ncon > 0)
        return rotor_drive.show_state(self.memory, self.output, touches)

    def acceleration_ned_m_s2(self) -> Vector3:
        """Acceleration at the present state; asking changes nothing of the flight that follows."""
        where = rotor_drive.show_pose(self.memory, self._drive, self._qpos, self._qvel)
        if where == LOST:
            return Vector3(0.0, 0.0, 0.0)
        self._watch_ground(where)
        # the next stage takes both from the stage before: one more evaluation must not be that stage
        held, warm_start = self._held.copy(), self._warm_start.copy()
        self._accelerations(0)
        self._held[:], self._warm_start[:] = held, warm_start
        x, y, z = self._qacc[:3].tolist()
        return Vector3(x, -y, -z)

    @property
    def ground_softness_m(self) -> float:
        """How far the ground gives way under the vehicle's weight; more with longer steps."""
        return self._softness_m

    def buried_m(self) -> float:
        """How far the vehicle reaches into the ground in the state shown; 0 above it."""
        if self.show() & DIVERGED or not self.data.ncon:
            return 0.0
        return max(0.0, -float(self.data.contact.dist.min()) - self._softness_m)

    def about(self) -> str | None:
        """Tell how well the assembly meets the vehicle file."""
        return self.assembly.worst_line()

    def euler_rad(self) -> Vector3 | None:
        """Roll, pitch, yaw are no states of this plant."""
        return None
