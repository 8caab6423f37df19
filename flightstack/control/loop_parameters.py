"""Parameters of the control loops: their declarations and the arrays that the kernels read."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flightstack.control.attitude_controller import AttitudeController
from flightstack.control.attitude_reference import (
    REFERENCE_TUNABLES,
    ReferenceParams,
    read_reference_params,
)
from flightstack.control.controller_loading import controller_params, controller_tunables, fields_of
from flightstack.control.position_pid import POSITION_TUNABLES, PositionParams, read_position_params
from flightstack.core.contract import FloatArray
from flightstack.params.behaviour import SPECS
from flightstack.params.spec import ParamSpec
from flightstack.params.toml_file import Table
from flightstack.params.tunable import Tunable, spec_of
from flightstack.params.vehicle import Vehicle

TILT = "MPC_TILTMAX_AIR"
"""The only parameter of the loops that is also a field of ``Behaviour``; degrees, radians in the kernels."""
TILT_AT = PositionParams._fields.index("max_tilt_rad")


class LoopNumbers(NamedTuple):
    """Parameter arrays that the kernels read, and the declarations of the parameters."""

    position: FloatArray
    reference: FloatArray
    controller: FloatArray
    specs: tuple[ParamSpec, ...]
    """Declarations of all parameters, with defaults from vehicle and gains file."""


def loop_numbers(
    vehicle: Vehicle, controller: AttitudeController, gains: Table, max_tilt_rad: float
) -> LoopNumbers:
    """Read and declare the loops' parameters from vehicle and gains file; raise ConfigError.

    All backends use these values: loops on a target receive them at their start.
    """
    position = read_position_params(vehicle, gains, max_tilt_rad)
    reference = read_reference_params(gains)
    values = controller_params(controller, vehicle, gains)
    by_field = dict(zip(fields_of(controller.params_type), values.tolist(), strict=True))
    specs = [
        *_specs(POSITION_TUNABLES, position._asdict(), "Position Loop"),
        *_specs(REFERENCE_TUNABLES, reference._asdict(), "Attitude Reference"),
        *_specs(controller_tunables(controller), by_field, f"Attitude Controller {controller.name}"),
        SPECS[TILT],
    ]
    return LoopNumbers(np.array(position), np.array(reference), values, tuple(specs))


def _specs(tunables: Sequence[Tunable], values: dict[str, float], group: str) -> list[ParamSpec]:
    return [spec_of(tunable, values[tunable.field], group) for tunable in tunables]


def tilt_deg(tilt_rad: float) -> float:
    """Return the shortest number of degrees that ``math.radians`` converts exactly to ``tilt_rad``."""
    exact = math.degrees(tilt_rad)
    return next(
        (short for digits in (9, 12) if math.radians(short := round(exact, digits)) == tilt_rad), exact
    )


class _Slot(NamedTuple):
    """Position of a parameter in its array, and the integral that it multiplies; both arrays are the kernels' own."""

    values: FloatArray
    at: int
    integral: FloatArray | None = None


class LoopParameters:
    """Gets and sets parameters of running loops by name."""

    def __init__(self, numbers: LoopNumbers, controller: AttitudeController, memory: FloatArray) -> None:
        """Take the arrays that the kernels read, and the controller's ``memory``; both are written in place."""
        self.specs = numbers.specs
        self._slots = {TILT: _Slot(numbers.position, TILT_AT)}
        self._add(POSITION_TUNABLES, PositionParams._fields, numbers.position)
        self._add(REFERENCE_TUNABLES, ReferenceParams._fields, numbers.reference)
        fields, memory_fields = fields_of(controller.params_type), list(fields_of(controller.memory_type))
        for tunable in controller_tunables(controller):
            at = memory_fields.index(tunable.integrates) if tunable.integrates else None
            integral = None if at is None else memory[at : at + 1]
            self._slots[tunable.name] = _Slot(numbers.controller, fields.index(tunable.field), integral)

    def _add(self, tunables: Sequence[Tunable], fields: Sequence[str], values: FloatArray) -> None:
        for tunable in tunables:
            self._slots[tunable.name] = _Slot(values, fields.index(tunable.field))

    def get(self, name: str) -> float:
        """Return a parameter's value; raise KeyError for an unknown name."""
        slot = self._slots[name]
        number = float(slot.values[slot.at])
        return tilt_deg(number) if name == TILT else number

    def set(self, name: str, value: float) -> None:
        """Set a parameter from the next tick on; raise KeyError for an unknown name.

        An integral that the gain multiplies is rescaled, so that the product is unchanged; the position loop's
        integrals hold the product itself. Other gains act at once on the present error. Setting the present value
        again changes no bit, because a client without a reply repeats its request.
        """
        slot = self._slots[name]
        number = math.radians(value) if name == TILT else float(value)
        if number == float(slot.values[slot.at]):
            return
        if slot.integral is not None:
            slot.integral[0] = _rescaled_integral(
                float(slot.integral[0]), float(slot.values[slot.at]), number
            )
        slot.values[slot.at] = number


def _rescaled_integral(integral: float, old_gain: float, new_gain: float) -> float:
    """Return the integral whose product with the new gain equals that with the old one; zero if there is none."""
    carried = integral * old_gain / new_gain if new_gain != 0.0 else 0.0
    return carried if math.isfinite(carried) else 0.0
