"""The multibody plant: frame and spinning rotors as bodies of a MuJoCo model, on legs on the ground.

MuJoCo computes the accelerations of all bodies and the contact with the ground; ``rotor_drive.py`` computes the forces
of each stage and integrates with the classic Runge-Kutta method, in the variables of the rigid plant. ``mj_step`` of
MuJoCo has an RK4 of the same order, but takes the forces of a stage from a callback that is global to the process.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from flightstack.core.contract import FloatArray, RecordArray, Vector3
from flightstack.core.errors import ConfigError
from flightstack.core.geometry import quaternion_from_euler
from flightstack.params.vehicle import Vehicle
from sim_bridge.multibody.assembly import assemble
from sim_bridge.multibody.frame_load import FrameLoad
from sim_bridge.multibody.mjcf import contact_solref, model_xml
from sim_bridge.plant import rotor_drive
from sim_bridge.plant.dimensions import foot_z_m
from sim_bridge.plant.layout import DIVERGED
from sim_bridge.plant.loading import Loading
from sim_bridge.plant.plant import InitialState, PlantOptions
from sim_bridge.plant.record_plant import DEFAULT_STEP_S, RecordPlant
from sim_bridge.plant.rotor_drive import LOST, NEAR

_NO_CONTACT = int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
_AFTER_VELOCITY = int(mujoco.mjtStage.mjSTAGE_VEL)
_STAGES = (0, 1, 2, 3)
_FIRST_DEPTH_M = 1e-5
_FRAME = 6  # degrees of freedom


def _compiled(vehicle: Vehicle) -> Any:
    """Return the MuJoCo model of a vehicle; raise ConfigError if MuJoCo's compiler rejects a part."""
    try:
        return mujoco.MjModel.from_xml_string(model_xml(vehicle, lean=True))
    except ValueError as error:
        first = str(error).partition("\n")[0].removeprefix("Error: ")
        raise ConfigError(vehicle.name, "part", f"MuJoCo rejects the model: {first}") from None


class MultibodyPlant(RecordPlant):
    """The vehicle's assembly on MuJoCo; see ``Plant`` for its methods."""

    def __init__(self, vehicle: Vehicle, options: PlantOptions) -> None:
        super().__init__(vehicle, options)
        self.assembly = assemble(vehicle)
        self._model = _compiled(vehicle)
        self.data = mujoco.MjData(self._model)
        """MuJoCo's state, forces and accelerations, NWU and FLU; read only."""
        self._rest_depth_m = 0.0
        self._proximity = NEAR
        first = 1 + mujoco.mj_name2id(self._model, mujoco.mjtObj.mjOBJ_BODY, "vehicle")
        self._on_rotors: FloatArray = self.data.xfrc_applied[first:]
        self._bind_arrays()
        self._drive: RecordArray = np.zeros(1, rotor_drive.DRIVE)
        self._set_drive(self.data)
        self._contact_force[:] = 0.0  # the contact of the default pose is not that of the vehicle
        self._frame_load: FrameLoad | None = None
        self.memory[0]["ground_z"], self.memory[0]["reach"] = foot_z_m(vehicle), self._reach_m()
        self._set_state(options.start)
        self.set_step(DEFAULT_STEP_S)

    def _bind_arrays(self) -> None:
        """Keep views of MuJoCo's arrays: an attribute lookup takes as long as a kernel."""
        data = self.data
        self._qpos: FloatArray = data.qpos
        self._qvel: FloatArray = data.qvel
        self._qacc: FloatArray = data.qacc
        self._bias: FloatArray = data.qfrc_bias
        self._contact_force: FloatArray = data.qfrc_constraint
        self._applied: FloatArray = data.qfrc_applied
        self._warm_start: FloatArray = data.qacc_warmstart

    def _set_drive(self, data: Any) -> None:
        """Compute the constants of the drives from MuJoCo's mass matrix at the level attitude of new ``data``."""
        model, d, rotors = self._model, self._drive[0], len(self._vehicle.rotors)
        mujoco.mj_forward(model, data)
        columns = np.eye(model.nv)
        mass = np.zeros((model.nv, model.nv))
        for row, column in zip(mass, columns, strict=True):
            mujoco.mj_mulM(model, data, row, column)
        row = np.linalg.solve(mass[:_FRAME, :_FRAME], mass[:_FRAME, _FRAME:]).T
        d["inertia"][:rotors, :rotors] = mass[_FRAME:, _FRAME:] - row @ mass[:_FRAME, _FRAME:]
        d["coupling"][:rotors] = row * np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])  # FLU to FRD
        d["spin"][:rotors] = [rotor.spin for rotor in self._vehicle.rotors]

    def _set_loading(self, loading: Loading) -> None:
        super()._set_loading(loading)
        self._frame_load = self._frame_load or FrameLoad(self._model)
        self._frame_load.set(loading)
        self._set_drive(mujoco.MjData(self._model))

    def _reach_m(self) -> float:
        """Return the distance from the origin to the farthest point with contact."""
        geoms = [index for index in range(self._model.ngeom) if self._model.geom_contype[index]]
        away = np.linalg.norm(self.data.geom_xpos[geoms] - self.data.qpos[:3], axis=1)
        return float((away + self._model.geom_rbound[geoms]).max(initial=0.0))

    def _set_state(self, initial: InitialState) -> None:
        body = self.memory[0]["body"]
        body[0:3], body[3:6] = initial.position_ned_m, initial.velocity_ned_m_s
        body[6:10], body[10:13] = quaternion_from_euler(*initial.euler_rad), initial.rates_frd_rad_s

    # ------------------------------------------------------------------ time

    def set_step(self, step_s: float) -> None:
        """Set the fixed integration step [s]."""
        super().set_step(step_s)
        self._model.opt.timestep = step_s
        self._model.pair_solref[:] = contact_solref(self._vehicle, step_s)
        self._rest_depth_m = self._find_rest_depth_m()
        self._drive[0]["sink"] = self._rest_depth_m

    def _find_rest_depth_m(self) -> float:
        """Return the depth at which a level vehicle rests, by one secant step: the force is linear in the depth."""
        if not self.memory[0]["ground"]:
            return 0.0
        model = self._model
        data = mujoco.MjData(model)
        self._enable_contacts(True)
        self._proximity = NEAR
        depths, falls = (_FIRST_DEPTH_M, 2.0 * _FIRST_DEPTH_M), []
        for depth in depths:
            data.qpos[2] = -depth
            mujoco.mj_forward(model, data)
            falls.append(float(data.qacc[2]))
        rise = falls[1] - falls[0]
        return (1.0 - falls[0] / rise) * _FIRST_DEPTH_M if rise > 0.0 else 0.0

    def _advance(self, command_rad_s: FloatArray, flags: int, steps: int) -> int:
        rotor_drive.hold_commands(self.memory, command_rad_s, flags)
        proximity = rotor_drive.FLYING
        for _ in range(steps):
            proximity = self._step()
            if proximity == LOST:
                break
        return self._show()

    def _step(self) -> int:
        """Advance by one step; return FLYING, NEAR or LOST."""
        memory, drive, qpos, qvel = self.memory, self._drive, self._qpos, self._qvel
        proximity = rotor_drive.begin_step(memory, drive, qpos, qvel)
        self._update_contacts(proximity)
        for stage in _STAGES:
            if proximity == LOST:
                break
            self._accelerations(stage)
            proximity = rotor_drive.end_stage(memory, drive, stage, self._qacc, qpos, qvel)
        return proximity

    def _update_contacts(self, proximity: int) -> None:
        """Enable contact detection only near the ground."""
        if proximity != self._proximity:
            self._proximity = proximity
            self._enable_contacts(proximity == NEAR)

    def _enable_contacts(self, enable: bool) -> None:
        option = self._model.opt
        others = option.disableflags & ~_NO_CONTACT
        option.disableflags = others if enable else others | _NO_CONTACT

    def _accelerations(self, stage: int) -> None:
        """Compute the accelerations of the state in MuJoCo's arrays."""
        model, data = self._model, self.data
        mujoco.mj_step1(model, data)
        rotor_drive.apply_forces(
            self.memory, self._drive, stage, self._bias, self._contact_force, self._applied, self._on_rotors
        )
        mujoco.mj_forwardSkip(model, data, _AFTER_VELOCITY, 1)

    # ------------------------------------------------------------------ state

    def show(self) -> int:
        """Write the present state to ``output``; return the bits of ``advance``."""
        result = self._show()
        self._add_boat()
        return result

    def _show(self) -> int:
        proximity = rotor_drive.show_pose(self.memory, self._drive, self._qpos, self._qvel)
        touches = 0
        if proximity == NEAR:
            self._update_contacts(proximity)
            mujoco.mj_fwdPosition(self._model, self.data)
            touches = int(self.data.ncon > 0)
        return rotor_drive.show_state(self.memory, self.output, touches)

    def acceleration_ned_m_s2(self) -> Vector3:
        """Return the acceleration at the present state, without an effect on the flight."""
        proximity = rotor_drive.show_pose(self.memory, self._drive, self._qpos, self._qvel)
        if proximity == LOST:
            return Vector3(0.0, 0.0, 0.0)
        self._update_contacts(proximity)
        # the next stage uses both from the stage before: restore them after this evaluation
        force, warm_start = self._contact_force.copy(), self._warm_start.copy()
        self._accelerations(0)
        self._contact_force[:], self._warm_start[:] = force, warm_start
        x, y, z = self._qacc[:3].tolist()
        return Vector3(x, -y, -z)

    @property
    def rest_depth_m(self) -> float:
        """Depth [m] at which the vehicle rests; it grows with the step."""
        return self._rest_depth_m

    def penetration_m(self) -> float:
        """Return the depth [m] below the rest depth in the present state; 0 without contact."""
        if self.show() & DIVERGED or not self.data.ncon:
            return 0.0
        return max(0.0, -float(self.data.contact.dist.min()) - self._rest_depth_m)

    def description(self) -> str | None:
        """Return how well the assembly meets the vehicle file."""
        return self.assembly.summary()

    def euler_rad(self) -> Vector3 | None:
        """Return None: Euler angles are not states of this plant."""
        return None
