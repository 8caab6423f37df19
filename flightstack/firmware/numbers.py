"""Numbers of the loops on a target: the declarations of C's table, and the values of a flight.

A target has the parameters of the Python loops under the same names, and quantities derived from the vehicle file as
FS_MASS etc. Indices in names count from zero, as in the arrays.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from flightstack.control import attitude_backstepping, attitude_pid
from flightstack.control.attitude_controller import AttitudeController
from flightstack.control.attitude_reference import REFERENCE_TUNABLES, ReferenceParams
from flightstack.control.controller_loading import controller_tunables, fields_of
from flightstack.control.loop_parameters import TILT, LoopNumbers, loop_numbers, tilt_deg
from flightstack.control.mixer import mixer_for
from flightstack.control.position_pid import POSITION_TUNABLES, PositionParams
from flightstack.core.contract import MAX_ROTORS
from flightstack.core.errors import ConfigError
from flightstack.firmware.generator.text import identifier, snake_case
from flightstack.params.behaviour import SPECS
from flightstack.params.config import DEFAULT_INNER_HZ, DEFAULT_OUTER_HZ
from flightstack.params.gains_file import DEFAULT_GAINS, open_gains
from flightstack.params.toml_file import Table
from flightstack.params.tunable import Tunable
from flightstack.params.vehicle import DEFAULT_VEHICLE, GRAVITY_M_S2, Vehicle, load_vehicle

CONTROLLERS = (attitude_pid.CONTROLLER, attitude_backstepping.CONTROLLER)
"""Controllers available in C; FS_CTRL is the index."""
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


def law_name(controller: AttitudeController) -> str:
    """Return the name of a controller in C."""
    return snake_case(controller.name)


def with_built_in(controller: AttitudeController) -> tuple[AttitudeController, ...]:
    """Return the controllers of the firmware that flies a controller: the built-in ones, and it if it is none."""
    is_built_in = any(controller.name == known.name for known in CONTROLLERS)
    return CONTROLLERS if is_built_in else (*CONTROLLERS, controller)


def _tunable(tunable: Tunable, law: str, memory: str) -> TargetNumber:
    stretched = tunable.name.startswith(_STRETCHED)
    integral = f"{memory}.{identifier(tunable.integrates)}" if tunable.integrates else ""
    place, high = f"{law}.{identifier(tunable.field)}", WIDEST if stretched else tunable.high
    return TargetNumber(tunable.name, place, tunable.low, high, integral=integral)


def _controller_numbers(controller: AttitudeController) -> Iterator[TargetNumber]:
    """Declare every field of a controller's parameters; those of a user's are bounded by the stack alone."""
    law, memory = f"controller.{law_name(controller)}", f"controller_memory.{law_name(controller)}"
    if controller in CONTROLLERS:
        for tunable in controller.tunables or ():
            yield _tunable(tunable, law, memory)
        return
    for tunable in all_tunables(controller):
        yield _tunable(tunable, law, memory)._replace(low=-UNBOUNDED, high=UNBOUNDED)


def all_tunables(controller: AttitudeController) -> tuple[Tunable, ...]:
    """Return the declarations of all fields of a user's controller: FS_LAW_3 is the fourth, if it has none."""
    tunables = controller_tunables(controller)
    known = {tunable.field for tunable in tunables}
    rest = [
        Tunable(field, f"FS_LAW_{index}", -UNBOUNDED, UNBOUNDED, "", "")
        for index, field in enumerate(fields_of(controller.params_type))
        if field not in known
    ]
    return (*tunables, *rest)


def _loop_tunables() -> Iterator[TargetNumber]:
    for law, tunables in (("position", POSITION_TUNABLES), ("reference", REFERENCE_TUNABLES)):
        for tunable in tunables:
            yield _tunable(tunable, law, f"{law}_memory")


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
    TargetNumber("FS_MASS", "position.mass_kg", 1e-3, 1e3),
    TargetNumber("FS_GRAVITY", "position.gravity_m_s2", 0.1, 30.0),
    TargetNumber("FS_IX", "setup.ix_kg_m2", 1e-8, 1e4),
    TargetNumber("FS_IY", "setup.iy_kg_m2", 1e-8, 1e4),
    TargetNumber("FS_IZ", "setup.iz_kg_m2", 1e-8, 1e4),
    TargetNumber("FS_JR", "controller.backstepping.rotor_inertia_kg_m2", 0.0, 1.0),
    *_mixer_numbers(),
)


def declared(controllers: Sequence[AttitudeController]) -> tuple[TargetNumber, ...]:
    """Return all numbers of a target with these controllers, in the order of its table."""
    laws = [number for controller in controllers for number in _controller_numbers(controller)]
    index = TargetNumber("FS_CTRL", "setup.controller", 0.0, len(controllers) - 1.0, is_whole=True)
    return (*_loop_tunables(), *laws, _QUANTITIES[0], index, *_QUANTITIES[1:])


TARGET_NUMBERS = declared(CONTROLLERS)
"""Numbers of a target with the built-in controllers."""


def target_numbers(
    vehicle: Vehicle,
    controller: AttitudeController,
    gains: Table,
    max_tilt_rad: float,
    inner_hz: float,
    divisor: int,
) -> dict[str, float]:
    """Return the numbers that make a target's loops equal to ``PythonLoops`` with the same arguments.

    Gains of the other controllers are not included. Raise ConfigError if a number is out of the target's range.
    """
    controllers = with_built_in(controller)
    names = [known.name for known in controllers]
    values = _loop_values(loop_numbers(vehicle, controller, gains, max_tilt_rad), controller)
    ix, iy, iz = vehicle.inertia_kg_m2
    values |= {
        TILT: tilt_deg(max_tilt_rad),
        "FS_CTRL": float(names.index(controller.name)),
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
    _check_ranges(values, declared(controllers))
    return values


def _check_ranges(values: Mapping[str, float], numbers: Sequence[TargetNumber]) -> None:
    for number in numbers:
        value = values.get(number.name, number.low)
        if not number.low <= value <= number.high:
            limits = f"{number.low:g} to {number.high:g}"
            raise ConfigError(
                "--loops", f"{number.name}={value:g}", f"is outside the target's range {limits}"
            )


def _loop_values(numbers: LoopNumbers, controller: AttitudeController) -> dict[str, float]:
    of_laws: tuple[tuple[Sequence[Tunable], type, Any], ...] = (
        (POSITION_TUNABLES, PositionParams, numbers.position),
        (REFERENCE_TUNABLES, ReferenceParams, numbers.reference),
        (_law_tunables(controller), controller.params_type, numbers.controller),
    )
    values: dict[str, float] = {}
    for tunables, params_type, array in of_laws:
        fields: Mapping[str, float] = dict(zip(params_type._fields, array.tolist(), strict=True))  # type: ignore[attr-defined]
        values |= {tunable.name: fields[tunable.field] for tunable in tunables}
    return values


def _law_tunables(controller: AttitudeController) -> Sequence[Tunable]:
    return controller.tunables or () if controller in CONTROLLERS else all_tunables(controller)


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


def default_numbers(controllers: Sequence[AttitudeController] = CONTROLLERS) -> dict[str, float]:
    """Return a target's initial numbers: default vehicle, gains and rates, with the gains of all controllers."""
    vehicle, values = load_vehicle(DEFAULT_VEHICLE), dict[str, float]()
    divisor = round(DEFAULT_INNER_HZ / DEFAULT_OUTER_HZ)
    tilt_rad = math.radians(SPECS[TILT].default)
    for controller in reversed(controllers):  # the first one is active
        gains = open_gains(DEFAULT_GAINS)
        try:
            values |= target_numbers(vehicle, controller, gains, tilt_rad, DEFAULT_INNER_HZ, divisor)
        except (
            ConfigError
        ):  # a user's controller may need its own table of a gains file; a flight sets every number
            if controller in CONTROLLERS:
                raise
            values |= {number.name: 0.0 for number in _controller_numbers(controller)}
    return values
