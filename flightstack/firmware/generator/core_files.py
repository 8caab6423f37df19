"""Generated files of the firmware's core: types, numbers, parameter table, laws, and the table of attitude laws."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from flightstack.control import mixer
from flightstack.control.attitude_controller import AttitudeController, AttitudeInputs
from flightstack.control.attitude_reference import (
    ReferenceMemory,
    ReferenceParams,
    attitude_reference_step,
    in_body_frame,
)
from flightstack.control.position_pid import PositionMemory, PositionParams, position_pid_step
from flightstack.core import contract, geometry
from flightstack.firmware.generator.text import fold, identifier, indented
from flightstack.firmware.generator.types import REAL, Record, record_name
from flightstack.firmware.generator.unit import Program, structure
from flightstack.firmware.numbers import TargetNumber, declared, default_numbers, law_name

NOTICE = "/* Generated from Python by flightstack.firmware.generator: do not edit. */\n"
DIGITS = 12
"""Of a default: enough for the loops, and the same on every machine, as the last ones of a pseudo-inverse are not."""
CONTRACT_TYPES = (
    contract.Vector3,
    contract.Quaternion,
    contract.VehicleState,
    contract.PositionSetpoint,
    contract.AttitudeTarget,
    contract.AttitudeReference,
    contract.Wrench,
    AttitudeInputs,
)
LOOP_TYPES = (PositionMemory, PositionParams, ReferenceMemory, ReferenceParams)
LAWS: tuple[Any, ...] = (
    position_pid_step,
    attitude_reference_step,
    in_body_frame,
    mixer.mix,
    mixer.relative_rotor_speed,
    geometry.blend,
    geometry.conjugate,
    geometry.quaternion_product,
    geometry.rotation_vector,
)
"""Functions that fs_loops.c calls."""
INLINE = (geometry.__name__,)
"""Modules of short functions, which stand in a header so that they cost no call."""
SETUP = {
    "controller": "index of the attitude law: one of FS_CONTROLLER_*",
    "rotors": "4 to FS_MAX_ROTORS",
    "inner_hz": "rate of the inner loop",
    "outer_divisor": "the outer loop runs in every so many inner ticks",
    "max_tilt_deg": "MPC_TILTMAX_AIR",
    "ix_kg_m2": "inertias, which every built-in attitude law has a copy of",
    "iy_kg_m2": "",
    "iz_kg_m2": "",
}
_STEP = (
    "(const fs_controller_memory *memory, const fs_attitude_inputs *inputs, const fs_controller_params *params, "
    "fs_real dt_s, fs_controller_memory *memory_out, fs_vector3 *torque_out)"
)


def core_files(controllers: Sequence[AttitudeController]) -> dict[str, str]:
    """Return the text of every generated file of ``core`` by name; raise OutsideSubsetError, ConfigError."""
    for controller in controllers:
        check_floats(controller)
    numbers = declared(controllers)
    check_names(numbers)
    program = law_program(controllers)
    texts = {
        "fs_types.h": types(),
        "fs_numbers.h": numbers_header(controllers, len(numbers)),
        "fs_param_table.c": table(numbers, default_numbers(controllers)),
        "fs_controllers.h": controllers_header(),
        "fs_controllers.c": controllers_source(controllers, program),
    }
    for unit in program.written():
        if unit.module in INLINE:
            texts[f"{unit.name}.h"] = unit.inline()
        else:
            texts |= {f"{unit.name}.h": unit.header(), f"{unit.name}.c": unit.source()}
    return texts


def law_program(controllers: Sequence[AttitudeController]) -> Program:
    """Translate the laws of the loops and the steps of the controllers; raise OutsideSubsetError."""
    program = Program(types=dict.fromkeys(_law_types(controllers), "fs_numbers"))
    for law in (*LAWS, *(controller.step for controller in controllers)):
        program.add(law)
    return program


def _law_types(controllers: Sequence[AttitudeController]) -> list[type]:
    kinds = [kind for controller in controllers for kind in (controller.memory_type, controller.params_type)]
    return list(dict.fromkeys([*LOOP_TYPES, *kinds]))


def header(guard: str, include: str, body: str) -> str:
    """Return a whole header file."""
    return f"{NOTICE}#ifndef {guard}\n#define {guard}\n\n#include {include}\n\n{body}\n#endif\n"


def types() -> str:
    """Return fs_types.h: the contract in C."""
    parts = [f"#define FS_MAX_ROTORS {contract.MAX_ROTORS}U\n", "/* bits of the status */"]
    bits = {name: bit for name, bit in vars(contract.LoopStatus).items() if name.isupper()}
    parts += [f"#define FS_STATUS_{name} {bit}U" for name, bit in bits.items()]
    parts += [
        "",
        "/* World frame NED, body frame FRD, quaternions Hamilton, scalar first, body to world. SI units. */",
    ]
    parts += ["\n".join([*structure(kind), ""]) for kind in CONTRACT_TYPES]
    return header("FS_TYPES_H", '"fs_real.h"', "\n".join(parts))


def numbers_header(controllers: Sequence[AttitudeController], count: int) -> str:
    """Return fs_numbers.h: parameters and memories of the laws, the setup, and the size of the table."""
    names = [law_name(controller) for controller in controllers]
    parts = [f"#define FS_PARAM_COUNT {count}U\n"]
    parts += [f"#define FS_CONTROLLER_{name.upper()} {index}U" for index, name in enumerate(names)]
    parts += [f"#define FS_CONTROLLERS {len(names)}U\n"]
    parts += ["\n".join([*structure(kind), ""]) for kind in _law_types(controllers)]
    for what in ("params", "memory"):
        kinds = [record_name(getattr(controller, f"{what}_type")) for controller in controllers]
        fields = [f"    {kind} {name};" for kind, name in zip(kinds, names, strict=True)]
        parts += [f"/* {what.capitalize()} of every attitude law. */", "typedef struct {", *fields]
        parts += [f"}} fs_controller_{what};\n"]
    fields = [f"    fs_real {name};{f' /* {text} */' if text else ''}" for name, text in SETUP.items()]
    parts += [
        "/* What several structures are made of, as it was set. */",
        "typedef struct {",
        *fields,
        "} fs_setup;\n",
    ]
    return header("FS_NUMBERS_H", '"fs_types.h"', "\n".join(parts))


# ------------------------------------------------------------------ attitude laws by index


def controllers_header() -> str:
    """Return fs_controllers.h."""
    body = [
        "/* Set the memories of all attitude laws to their initial values. */",
        "void fs_controllers_reset(fs_controller_memory *memory);\n",
        "/*",
        " * Run the attitude law of this index, one of FS_CONTROLLER_*: torque [N m, FRD] and the next memory.",
        " * Return 0 if the next memory is not finite.",
        " */",
        *fold(f"uint16_t fs_controllers_step{_STEP.replace('(', '(uint16_t controller, ', 1)};"),
        "",
    ]
    return header("FS_CONTROLLERS_H", '"fs_numbers.h"', "\n".join(body))


def controllers_source(controllers: Sequence[AttitudeController], program: Program) -> str:
    """Return fs_controllers.c: a table of the attitude laws."""
    headers = {f"{program.header_of(program.add(controller.step))}.h" for controller in controllers}
    parts = [NOTICE.strip(), '#include "fs_controllers.h"', ""]
    parts += [*(f'#include "{name}"' for name in sorted({*headers, "fs_math.h"})), ""]
    resets = [line for controller in controllers for line in _reset_lines(controller)]
    parts += ["void fs_controllers_reset(fs_controller_memory *memory)", "{", *indented(resets), "}", ""]
    for controller in controllers:
        parts += _law(controller, program.add(controller.step).c_name)
    names = ", ".join(f"run_{law_name(controller)}" for controller in controllers)
    calls = "laws[controller](memory, inputs, params, dt_s, memory_out, torque_out)"
    parts += [
        *fold(f"typedef uint16_t (*fs_law){_STEP};"),
        "",
        f"static const fs_law laws[FS_CONTROLLERS] = {{{names}}};",
        "",
        *fold(f"uint16_t fs_controllers_step{_STEP.replace('(', '(uint16_t controller, ', 1)}"),
        "{",
        "    *memory_out = *memory;",
        f"    return {calls};",
        "}",
        "",
    ]
    return "\n".join(parts)


def _reset_lines(controller: AttitudeController) -> list[str]:
    fields, values = controller.memory_type._fields, controller.initial_memory  # type: ignore[attr-defined]
    name = law_name(controller)
    return [
        f"memory->{name}.{identifier(field)} = {literal(value)};"
        for field, value in zip(fields, values, strict=True)
    ]


def _law(controller: AttitudeController, step: str) -> list[str]:
    """Return the entry of a law in the table: its step, and whether its memory is finite."""
    name, fields = law_name(controller), controller.memory_type._fields  # type: ignore[attr-defined]
    call = f"{step}(&memory->{name}, inputs, &params->{name}, dt_s, &memory_out->{name}, torque_out);"
    finite = [f"fs_is_finite(memory_out->{name}.{identifier(field)})" for field in fields]
    result = finite[0] if len(finite) == 1 else f"(uint16_t)({' & '.join(finite)})"
    lines = [*fold(call, "    "), *fold(f"return {result};", "    ")]
    return [*fold(f"static uint16_t run_{name}{_STEP}"), "{", *lines, "}", ""]


# ------------------------------------------------------------------ parameter table


def literal(value: float) -> str:
    """Return a number as C writes it: the shortest decimal that is the same double."""
    return f"FS_LIT({float(value)!r})"


def rounded(values: dict[str, float]) -> dict[str, float]:
    """Return defaults with the digits that matter; what an allocation has for a zero becomes one."""
    largest = max(abs(value) for name, value in values.items() if name.startswith("FS_ALLOC_"))
    return {
        name: 0.0
        if name.startswith("FS_ALLOC_") and abs(value) < 1e-9 * largest
        else float(f"{value:.{DIGITS}g}")
        for name, value in values.items()
    }


def table(numbers: Sequence[TargetNumber], defaults: dict[str, float]) -> str:
    """Return fs_param_table.c: declarations, and where each number stands."""
    defaults = rounded(defaults)
    rows = [
        f'    {{"{number.name}", {literal(number.low)}, {literal(number.high)}, '
        f"{literal(defaults[number.name])}, {int(number.is_whole)}U}},"
        for number in numbers
    ]
    places = {index: number.place for index, number in enumerate(numbers)}
    integrals = {index: number.integral for index, number in enumerate(numbers) if number.integral}
    return "\n".join(
        [
            NOTICE.strip(),
            '#include "fs_param_table.h"',
            "",
            "static const fs_param_spec specs[FS_PARAM_COUNT] = {",
            *rows,
            "};",
            "",
            "const fs_param_spec *fs_param_spec_at(uint16_t index)",
            "{",
            "    return &specs[index];",
            "}",
            "",
            _switch("fs_real *fs_param_place(fs_loops *loops, uint16_t index)", places, "&", "NULL"),
            "",
            _switch(
                "fs_real fs_param_value(const fs_loops *loops, uint16_t index)", places, "", literal(0.0)
            ),
            "",
            _switch("fs_real *fs_param_integral(fs_loops *loops, uint16_t index)", integrals, "&", "NULL"),
            "",
        ]
    )


def _switch(signature: str, places: dict[int, str], prefix: str, otherwise: str) -> str:
    """Return a function from an index to a member of the loops."""
    cases = [f"    case {index}U: return {prefix}loops->{place};" for index, place in places.items()]
    return "\n".join(
        [signature, "{", "    switch (index) {", *cases, f"    default: return {otherwise};", "    }", "}"]
    )


def check_floats(controller: AttitudeController) -> None:
    """Raise ValueError if memory or parameters of a controller have other fields than floats."""
    for kind in (controller.memory_type, controller.params_type):
        for field, inner in Record(kind).fields.items():
            if inner is not REAL:
                raise ValueError(f"field {field} of {kind.__name__} is no float")


def check_names(numbers: Sequence[TargetNumber]) -> None:
    """Raise ValueError for a name that MAVLink cannot carry, or one that stands twice."""
    names = [number.name for number in numbers]
    if len(set(names)) < len(names) or max(map(len, names)) > 16:
        raise ValueError("parameter names must be different and have 16 characters at most")
