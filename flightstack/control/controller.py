"""A controller: the laws of guidance, position, attitude and mixer that fly together."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, TypeAlias

from flightstack.control import attitude_backstepping, attitude_pid
from flightstack.control.control_law import ControlLaw
from flightstack.control.guidance_direct import DIRECT
from flightstack.control.mixer import ALLOCATION
from flightstack.control.position_pid import POSITION_PID
from flightstack.core.contract import AttitudeTarget, PositionSetpoint, Vector3, Wrench

GUIDANCE, POSITION, ATTITUDE, MIXER = ROLES = ("guidance", "position", "attitude", "mixer")
"""Roles of laws, in the order of a tick; fields of ``Controller``."""
BUILT_IN: Mapping[str, tuple[ControlLaw, ...]] = {
    GUIDANCE: (DIRECT,),
    POSITION: (POSITION_PID,),
    ATTITUDE: (attitude_pid.CONTROLLER, attitude_backstepping.CONTROLLER),
    MIXER: (ALLOCATION,),
}
"""Laws of each role that the firmware has."""
TILT_FIELD = "max_tilt_rad"
"""Parameter of a position law that follows MPC_TILTMAX_AIR, if the law has it."""


class StepForm(NamedTuple):
    """What the step of a role takes, and the name and type of what it returns beside its memory."""

    inputs: tuple[str, ...]
    output: str
    output_type: type


STEP_FORMS: Mapping[str, StepForm] = {
    GUIDANCE: StepForm(("memory", "state", "setpoint", "params", "dt_s"), "setpoint", PositionSetpoint),
    POSITION: StepForm(
        ("memory", "state", "setpoint", "params", "dt_s", "thrust_saturation"), "target", AttitudeTarget
    ),
    ATTITUDE: StepForm(("memory", "inputs", "params", "dt_s"), "torque", Vector3),
    MIXER: StepForm(
        ("memory", "wrench", "rotors", "params", "dt_s", "rotor_speed_rad_s", "work"), "achieved", Wrench
    ),
}
"""Form of the step of each role; ``Controller`` explains it."""


class Controller(NamedTuple):
    """The laws that fly together; a law that is left out is the built-in one.

    Every outer tick runs guidance and position, every inner tick attitude and mixer:

    - guidance: ``step(memory, state, setpoint, params, dt_s) -> (memory, setpoint)``, from the ``PositionSetpoint`` of
      mission and modes to the one that is tracked;
    - position: ``step(memory, state, setpoint, params, dt_s, thrust_saturation) -> (memory, target)``, an
      ``AttitudeTarget``; ``thrust_saturation`` is +1 if the mixer achieved less thrust than demanded, −1 if more;
    - attitude: ``step(memory, inputs, params, dt_s) -> (memory, torque)``, see ``AttitudeController``;
    - mixer: ``step(memory, wrench, rotors, params, dt_s, rotor_speed_rad_s, work) -> (memory, achieved)``: writes the
      rotor speeds for the ``Wrench`` and returns the achieved one; ``rotors`` is a ``Mixer``.
    """

    name: str
    attitude: ControlLaw = attitude_pid.CONTROLLER
    position: ControlLaw = POSITION_PID
    guidance: ControlLaw = DIRECT
    mixer: ControlLaw = ALLOCATION

    @property
    def laws(self) -> dict[str, ControlLaw]:
        """The laws by role, in the order of ``ROLES``."""
        return {role: getattr(self, role) for role in ROLES}

    @property
    def own_laws(self) -> dict[str, ControlLaw]:
        """The laws that are not built-in, by role."""
        return {role: law for role, law in self.laws.items() if not is_built_in(role, law)}


AnyController: TypeAlias = Controller | ControlLaw
"""A controller, or a law of attitude that flies with the built-in other laws."""


def controller_of(given: AnyController) -> Controller:
    """Return ``given`` as a controller."""
    return given if isinstance(given, Controller) else Controller(given.name, given)


def is_built_in(role: str, law: ControlLaw) -> bool:
    """Return True if the firmware has the law; laws have their names."""
    return any(law.name == known.name for known in BUILT_IN[role])


def laws_with(controller: AnyController) -> dict[str, tuple[ControlLaw, ...]]:
    """Return the laws of each role in a firmware that flies ``controller``: the built-in ones, then its own."""
    own = controller_of(controller).own_laws
    return {role: (*known, own[role]) if role in own else known for role, known in BUILT_IN.items()}
