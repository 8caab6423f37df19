"""Interface of attitude controllers.

A controller is a module-level ``AttitudeController``, registered in the entry point group
``flightstack.attitude_controllers`` (``controller_loading``). A user's package registers its controller in its own
``pyproject.toml`` and selects it with ``--controller name``; docs/tutorials/controller.md shows an example.

A module of its own: packages of users import it.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

from flightstack.control.control_law import ControlLaw
from flightstack.core.contract import AttitudeReference, Quaternion, Vector3


class AttitudeInputs(NamedTuple):
    """Inputs of an attitude controller in one tick.

    ``error_rad`` is the rotation from the vehicle to the reference as a rotation vector in the body frame; for a
    rotation about one axis it is the angle error. ``relative_rotor_speed_rad_s`` is the paper's Ω_r from the previous
    tick. ``saturation`` is −1, 0 or +1 for each axis: the direction in which the mixer was saturated.
    """

    attitude: Quaternion
    rates_frd_rad_s: Vector3
    reference: AttitudeReference
    error_rad: Vector3
    relative_rotor_speed_rad_s: float
    saturation: Vector3


AttitudeController: TypeAlias = ControlLaw
"""A law of attitude: ``step(memory, inputs, params, dt_s) -> (memory, torque)``.

``inputs`` are ``AttitudeInputs``; the torque is a ``Vector3`` in N m about the body axes.
"""
