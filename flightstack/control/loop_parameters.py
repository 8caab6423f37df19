"""The parameters of the control loops: declarations on one side, the numbers that the kernels read on the other."""

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
"""The one parameter of the loops that belongs to the vehicle's behaviour as well: degrees, in the kernels radians."""
TILT_AT = PositionParams._fields.index("max_tilt_rad")


class LoopNumbers(NamedTuple):
    """All numbers of the loops in the form that the kernels read, and the parameters that they are."""

    position: FloatArray
    reference: FloatArray
    controller: FloatArray
    specs: tuple[ParamSpec, ...]
    """Declarations of all parameters; the defaults are what vehicle and gains file give."""


def loop_numbers(
    vehicle: Vehicle, controller: AttitudeController, gains: Table, max_tilt_rad: float
) -> LoopNumbers:
    """Read the numbers of the loops from vehicle and gains file, and declare them; raise ConfigError.

    The same for every backend: loops that run elsewhere are given these numbers at their start.
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
    """Return the shortest number of degrees that ``math.radians`` turns into ``tilt_rad``, to the last bit."""
    exact = math.degrees(tilt_rad)
    return next(
        (short for digits in (9, 12) if math.radians(short := round(exact, digits)) == tilt_rad), exact
    )


class _Slot(NamedTuple):
    """Where a parameter's number stands, and the integral that it multiplies: both live arrays of the kernels."""

    values: FloatArray
    at: int
    integral: FloatArray | None = None


class LoopParameters:
    """Reads and writes the numbers of running loops by the names of their parameters."""

    def __init__(self, numbers: LoopNumbers, controller: AttitudeController, memory: FloatArray) -> None:
        """Take the arrays that the kernels read, and the controller's ``memory``: they are written in place."""
        self.specs = numbers.specs
        self._slots = {TILT: _Slot(numbers.position, TILT_AT)}
        self._add(POSITION_TUNABLES, PositionParams._fields, numbers.position)
        self._add(REFERENCE_TUNABLES, ReferenceParams._fields, numbers.reference)
        fields, remembered = fields_of(controller.params_type), list(fields_of(controller.memory_type))
        for tunable in controller_tunables(controller):
            at = remembered.index(tunable.integrates) if tunable.integrates else None
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
        """Change a parameter, which the next tick uses; raise KeyError for an unknown name.

        An integral that its gain multiplies is scaled, so that the product stays; one that holds its output already
        (the position loop's) needs nothing. A proportional gain or a damping acts at once on the present error. To
        set the value that stands changes no bit: whoever hears no answer sets again.
        """
        slot = self._slots[name]
        number = math.radians(value) if name == TILT else float(value)
        if number == float(slot.values[slot.at]):
            return
        if slot.integral is not None:
            slot.integral[0] = _carried_over(float(slot.integral[0]), float(slot.values[slot.at]), number)
        slot.values[slot.at] = number


def _carried_over(integral: float, old_gain: float, new_gain: float) -> float:
    """Return the integral that gives with the new gain what it gave with the old one; zero if none can."""
    carried = integral * old_gain / new_gain if new_gain != 0.0 else 0.0
    return carried if math.isfinite(carried) else 0.0
