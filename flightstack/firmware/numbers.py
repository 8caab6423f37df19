"""Numbers of the loops on a target: the declarations of C's table, and the values of a flight.

A target has the parameters of the Python loops under the same names, and quantities derived from the vehicle file as
FS_MASS etc. Indices in names count from zero, as in the arrays.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple, TypeAlias

from flightstack.control.attitude_reference import REFERENCE_TUNABLES, ReferenceParams
from flightstack.control.control_law import ControlLaw
from flightstack.control.controller import (
    ATTITUDE,
    BUILT_IN,
    GUIDANCE,
    MIXER,
    POSITION,
    TILT_FIELD,
    AnyController,
    Controller,
    controller_of,
    is_built_in,
    laws_with,
)
from flightstack.control.controller_loading import fields_of, law_tunables
from flightstack.control.loop_parameters import (
    NOT_GIVEN,
    TILT,
    LawValues,
    LoopNumbers,
    loop_numbers,
    tilt_deg,
)
from flightstack.control.mixer import mixer_for
from flightstack.core.contract import MAX_ROTORS, FloatArray
from flightstack.core.errors import ConfigError, plain
from flightstack.firmware.generator.text import identifier, snake_case
from flightstack.params.behaviour import SPECS
from flightstack.params.config import DEFAULT_INNER_HZ, DEFAULT_OUTER_HZ
from flightstack.params.gains_file import DEFAULT_GAINS, open_gains
from flightstack.params.toml_file import Table
from flightstack.params.tunable import Tunable
from flightstack.params.vehicle import DEFAULT_VEHICLE, GRAVITY_M_S2, Vehicle, load_vehicle

Laws: TypeAlias = Mapping[str, Sequence[ControlLaw]]
"""Laws of a firmware by role; a number selects the law of a role by its index."""
ROLE_MEMBERS = {
    GUIDANCE: ("guidance", "FS_GUIDANCE", "FS_GUI"),
    POSITION: ("position", "FS_POSITION", "FS_POS"),
    ATTITUDE: ("controller", "FS_CTRL", "FS_LAW"),
    MIXER: ("mixing", "FS_MIXING", "FS_MIX"),
}
"""Member of C's ``fs_loops`` with a role's parameters, number of its index, and prefix of undeclared parameters."""
WIDEST = 1e6
"""Range of gains and thrusts on a target. C's table is the same for every vehicle, while Python extends the declared
ranges for gains files in the paper's units and for heavy vehicles."""
UNBOUNDED = 1e12
"""Range of the numbers of a user's controller; the stack checks those that it declares."""
_STRETCHED = ("POS_Z_", "POS_THR_", "PID_ROLL_", "PID_PITCH_", "PID_YAW_")


class TargetNumber(NamedTuple):
    """Declaration of a number of the loops on a target."""

    name: str
    place: str
    """Member of C's ``fs_loops``."""
    low: float
    high: float
    is_whole: bool = False
    integral: str = ""
    """Member that this gain multiplies, scaled when the gain changes; see ``Tunable.integrates``."""
    at_least: str = ""
    """Number that this one must not be below."""


def law_name(law: ControlLaw) -> str:
    """Return the name of a law in C."""
    return snake_case(law.name)


def _tunable(tunable: Tunable, law: str, memory: str) -> TargetNumber:
    stretched = tunable.name.startswith(_STRETCHED)
    integral = f"{memory}.{identifier(tunable.integrates)}" if tunable.integrates else ""
    place, high = f"{law}.{identifier(tunable.field)}", WIDEST if stretched else tunable.high
    return TargetNumber(tunable.name, place, tunable.low, high, False, integral, tunable.at_least)


def _law_numbers(role: str, law: ControlLaw) -> Iterator[TargetNumber]:
    """Declare every field of a law's parameters; those of a user's are bounded by the stack alone."""
    member = ROLE_MEMBERS[role][0]
    for tunable in all_tunables(role, law):
        number = _tunable(tunable, f"{member}.{law_name(law)}", f"{member}_memory.{law_name(law)}")
        yield (
            number if is_built_in(role, law) else number._replace(low=-UNBOUNDED, high=UNBOUNDED, at_least="")
        )


def all_tunables(role: str, law: ControlLaw) -> tuple[Tunable, ...]:
    """Return the declarations of a law, for a user's of all its fields: FS_LAW_3 is the fourth, if it has none."""
    tunables = law_tunables(role, law)
    if is_built_in(role, law):
        return tunables
    known = {tunable.field for tunable in tunables} | ({TILT_FIELD} if role == POSITION else set())
    prefix = ROLE_MEMBERS[role][2]
    rest = [
        Tunable(field, f"{prefix}_{index}", -UNBOUNDED, UNBOUNDED, "", "")
        for index, field in enumerate(fields_of(law.params_type))
        if field not in known
    ]
    return (*tunables, *rest)


def _mixer_numbers() -> Iterator[TargetNumber]:
    rotors, axes = range(MAX_ROTORS), range(4)
    for rotor in rotors:
        for axis in axes:
            yield TargetNumber(f"FS_ALLOC_{rotor}{axis}", f"mixer.allocation[{rotor}][{axis}]", -1e15, 1e15)
    for axis in axes:
        for rotor in rotors:
            yield TargetNumber(f"FS_EFF_{axis}{rotor}", f"mixer.effectiveness[{axis}][{rotor}]", -1e3, 1e3)
    for name, field, limit in (("LOW", "low", 1e12), ("HIGH", "high", 1e12), ("SPIN", "spin", 1.0)):
        for rotor in rotors:
            yield TargetNumber(f"FS_{name}_{rotor}", f"mixer.{field}[{rotor}]", -limit, limit)


_QUANTITIES = (
    TargetNumber(TILT, "setup.max_tilt_deg", SPECS[TILT].low, SPECS[TILT].high),
    TargetNumber("FS_ROTORS", "setup.rotors", 4.0, MAX_ROTORS, is_whole=True),
    TargetNumber("FS_INNER_HZ", "setup.inner_hz", 1.0, 20e3),
    TargetNumber("FS_OUTER_DIV", "setup.outer_divisor", 1.0, 20e3, is_whole=True),
    TargetNumber("FS_MASS", "position.pid.mass_kg", 1e-3, 1e3),
    TargetNumber("FS_GRAVITY", "position.pid.gravity_m_s2", 0.1, 30.0),
    TargetNumber("FS_IX", "setup.ix_kg_m2", 1e-8, 1e4),
    TargetNumber("FS_IY", "setup.iy_kg_m2", 1e-8, 1e4),
    TargetNumber("FS_IZ", "setup.iz_kg_m2", 1e-8, 1e4),
    TargetNumber("FS_JR", "controller.backstepping.rotor_inertia_kg_m2", 0.0, 1.0),
    *_mixer_numbers(),
)


def declared(laws: Laws) -> tuple[TargetNumber, ...]:
    """Return all numbers of a target with these laws, in the order of its table."""
    of_laws = {role: [n for law in laws[role] for n in _law_numbers(role, law)] for role in laws}
    reference = [_tunable(tunable, "reference", "reference_memory") for tunable in REFERENCE_TUNABLES]
    own = [number for role in (GUIDANCE, MIXER) for number in of_laws[role]]
    return (
        *of_laws[POSITION], *reference, *of_laws[ATTITUDE], *own, _QUANTITIES[0], *_indices(laws), *_QUANTITIES[1:]
    )  # fmt: skip


def _indices(laws: Laws) -> Iterator[TargetNumber]:
    """Declare the index of each role that has several laws."""
    for role, (member, name, _) in ROLE_MEMBERS.items():
        if len(laws[role]) > 1:
            yield TargetNumber(name, f"setup.{member}", 0.0, len(laws[role]) - 1.0, is_whole=True)


TARGET_NUMBERS = declared(BUILT_IN)
"""Numbers of a target with the built-in laws."""
_LEAST = frozenset(number.at_least for number in TARGET_NUMBERS)
FIRST_NUMBERS = {number.name: number.low for number in TARGET_NUMBERS if number.name in _LEAST}
"""Numbers to set before all others: a pair then fits whatever the target had; the larger one comes first in a table."""


def target_numbers(
    vehicle: Vehicle,
    controller: AnyController,
    gains: Table,
    max_tilt_rad: float,
    inner_hz: float,
    divisor: int,
    given: LawValues = NOT_GIVEN,
) -> dict[str, float]:
    """Return the numbers that make a target's loops equal to ``PythonLoops`` with the same arguments.

    Gains of the other laws are not included. Raise ConfigError if a number is out of the target's range.
    """
    laws = laws_with(controller)
    values = _loop_values(loop_numbers(vehicle, controller, gains, max_tilt_rad, given), controller)
    for role, law in controller_of(controller).laws.items():
        if len(laws[role]) > 1:
            values[ROLE_MEMBERS[role][1]] = float([known.name for known in laws[role]].index(law.name))
    ix, iy, iz = vehicle.inertia_kg_m2
    values |= {
        TILT: tilt_deg(max_tilt_rad),
        "FS_ROTORS": float(len(vehicle.rotors)),
        "FS_INNER_HZ": inner_hz,
        "FS_OUTER_DIV": float(divisor),
        "FS_MASS": vehicle.mass_kg,
        "FS_GRAVITY": GRAVITY_M_S2,
        "FS_IX": ix,
        "FS_IY": iy,
        "FS_IZ": iz,
        "FS_JR": vehicle.mean_rotor_inertia_kg_m2,
        **_mixer_values(vehicle),
    }
    _check_ranges(values, declared(laws))
    return values


def _check_ranges(values: Mapping[str, float], numbers: Sequence[TargetNumber]) -> None:
    for number in numbers:
        value = values.get(number.name, number.low)
        if not number.low <= value <= number.high:
            limits = f"{plain(number.low)} to {plain(number.high)}"
            raise ConfigError(
                "--loops", f"{number.name}={value:g}", f"is outside the target's range {limits}"
            )


def _loop_values(numbers: LoopNumbers, controller: AnyController) -> dict[str, float]:
    laws = controller_of(controller).laws
    groups: list[tuple[Sequence[Tunable], type, FloatArray]] = [
        (all_tunables(role, law), law.params_type, numbers.laws[role]) for role, law in laws.items()
    ]
    groups.append((REFERENCE_TUNABLES, ReferenceParams, numbers.reference))
    values: dict[str, float] = {}
    for tunables, params_type, array in groups:
        fields = dict(zip(fields_of(params_type), array.tolist(), strict=True))
        values |= {tunable.name: fields[tunable.field] for tunable in tunables}
    return values


def _mixer_values(vehicle: Vehicle) -> dict[str, float]:
    mixer = mixer_for(vehicle)
    values = {number.name: 0.0 for number in _mixer_numbers()}
    for rotor in range(len(vehicle.rotors)):
        for axis in range(4):
            values[f"FS_ALLOC_{rotor}{axis}"] = float(mixer.allocation[rotor, axis])
            values[f"FS_EFF_{axis}{rotor}"] = float(mixer.effectiveness[axis, rotor])
        values[f"FS_LOW_{rotor}"] = float(mixer.low[rotor])
        values[f"FS_HIGH_{rotor}"] = float(mixer.high[rotor])
        values[f"FS_SPIN_{rotor}"] = float(mixer.spin[rotor])
    return values


def default_numbers(laws: Laws = BUILT_IN) -> dict[str, float]:
    """Return a target's initial numbers: default vehicle, gains and rates, with the gains of all laws.

    The first law of each role is active. A user's law may need its own table of a gains file: then its numbers are 0,
    and a flight sets every one.
    """
    vehicle, divisor = load_vehicle(DEFAULT_VEHICLE), round(DEFAULT_INNER_HZ / DEFAULT_OUTER_HZ)
    tilt_rad, values = math.radians(SPECS[TILT].default), dict[str, float]()
    for role, known in laws.items():
        for law in known:
            controller = Controller(law.name, **{role: law})
            try:
                numbers = loop_numbers(vehicle, controller, open_gains(DEFAULT_GAINS), tilt_rad)
                values |= _loop_values(numbers, controller)
            except ConfigError:
                if is_built_in(role, law):
                    raise
                values |= {number.name: 0.0 for number in _law_numbers(role, law)}
    first = Controller("default", **{role: known[0] for role, known in laws.items()})
    gains = open_gains(DEFAULT_GAINS)
    values |= target_numbers(vehicle, first, gains, tilt_rad, DEFAULT_INNER_HZ, divisor)
    return values | {number.name: 0.0 for number in _indices(laws)}
