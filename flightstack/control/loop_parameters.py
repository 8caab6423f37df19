"""Parameters of the control loops: their declarations and the arrays that the kernels read."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from flightstack.control.attitude_reference import (
    REFERENCE_TUNABLES,
    ReferenceParams,
    read_reference_params,
)
from flightstack.control.controller import (
    ATTITUDE,
    GUIDANCE,
    MIXER,
    POSITION,
    TILT_FIELD,
    AnyController,
    controller_of,
)
from flightstack.control.controller_loading import fields_of, law_params, law_tunables
from flightstack.core.contract import FloatArray
from flightstack.params.behaviour import SPECS
from flightstack.params.spec import ParamSpec
from flightstack.params.toml_file import Table
from flightstack.params.tunable import Tunable, spec_of
from flightstack.params.vehicle import Vehicle

TILT = "MPC_TILTMAX_AIR"
"""The only parameter of the loops that is also a field of ``Behaviour``; degrees, radians in the kernels."""


LawValues: TypeAlias = Mapping[str, Mapping[str, float]]
"""Parameters of laws, by role and field."""
NOT_GIVEN: LawValues = {}


class LoopNumbers(NamedTuple):
    """Parameter arrays that the kernels read, and the declarations of the parameters."""

    laws: dict[str, FloatArray]
    """Parameters of the laws, by role."""
    reference: FloatArray
    max_tilt_rad: float
    specs: tuple[ParamSpec, ...]
    """Declarations of all parameters, with defaults from vehicle and gains file."""


def loop_numbers(
    vehicle: Vehicle,
    controller: AnyController,
    gains: Table,
    max_tilt_rad: float,
    given: LawValues = NOT_GIVEN,
) -> LoopNumbers:
    """Read and declare the loops' parameters from vehicle and gains file; raise ConfigError.

    ``given`` replaces those of some laws. All backends use these values: loops on a target receive them at their start.
    """
    controller = controller_of(controller)
    values = {
        role: np.array(list(given[role].values())) if role in given else law_params(role, law, vehicle, gains)
        for role, law in controller.laws.items()
    }
    position_fields = fields_of(controller.position.params_type)
    if TILT_FIELD in position_fields:
        values[POSITION][position_fields.index(TILT_FIELD)] = max_tilt_rad
    reference = read_reference_params(gains)
    groups = {
        POSITION: "Position Loop",
        GUIDANCE: "Guidance Law",
        ATTITUDE: f"Attitude Controller {controller.attitude.name}",
        MIXER: "Mixer",
    }
    specs = {
        role: _specs(
            law_tunables(role, law),
            dict(zip(fields_of(law.params_type), values[role].tolist(), strict=True)),
            groups[role],
        )
        for role, law in controller.laws.items()
    }
    of_reference = _specs(REFERENCE_TUNABLES, reference._asdict(), "Attitude Reference")
    every = (
        *specs[GUIDANCE], *specs[POSITION], *of_reference, *specs[ATTITUDE], *specs[MIXER], SPECS[TILT]
    )  # fmt: skip
    return LoopNumbers(values, np.array(reference), max_tilt_rad, every)


def own_values(numbers: LoopNumbers, controller: AnyController) -> dict[str, dict[str, float]]:
    """Return all parameters of the laws that are not built-in, by role and field."""
    return {
        role: dict(zip(fields_of(law.params_type), numbers.laws[role].tolist(), strict=True))
        for role, law in controller_of(controller).own_laws.items()
    }


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

    def __init__(
        self, numbers: LoopNumbers, controller: AnyController, memories: Mapping[str, FloatArray]
    ) -> None:
        """Take the arrays that the kernels read, and the laws' memories by role; both are written in place."""
        self.specs = numbers.specs
        self._slots = {TILT: _Slot(np.array([numbers.max_tilt_rad]), 0)}
        for tunable in REFERENCE_TUNABLES:
            self._slots[tunable.name] = _Slot(numbers.reference, ReferenceParams._fields.index(tunable.field))
        for role, law in controller_of(controller).laws.items():
            values, fields = numbers.laws[role], fields_of(law.params_type)
            for tunable in law_tunables(role, law):
                at = fields_of(law.memory_type).index(tunable.integrates) if tunable.integrates else None
                integral = None if at is None else memories[role][at : at + 1]
                self._slots[tunable.name] = _Slot(values, fields.index(tunable.field), integral)
            if role == POSITION and TILT_FIELD in fields:
                self._slots[TILT] = _Slot(values, fields.index(TILT_FIELD))

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
