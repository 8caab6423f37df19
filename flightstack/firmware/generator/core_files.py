"""Generated files of the firmware's core: types, numbers, parameter table, laws, and the tables of laws by role."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from flightstack.control import mixer
from flightstack.control.attitude_reference import (
    ReferenceMemory,
    ReferenceParams,
    attitude_reference_step,
    in_body_frame,
)
from flightstack.control.control_law import AttitudeInputs, ControlLaw, CStep
from flightstack.control.controller import BUILT_IN
from flightstack.core import contract, geometry
from flightstack.firmware.generator.law_tables import TABLES, controllers_header, controllers_source
from flightstack.firmware.generator.types import REAL, Record, record_name
from flightstack.firmware.generator.unit import Program, structure
from flightstack.firmware.numbers import Laws, TargetNumber, declared, default_numbers, law_name

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
LOOP_TYPES = (ReferenceMemory, ReferenceParams)
FUNCTIONS: tuple[Any, ...] = (
    attitude_reference_step,
    in_body_frame,
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
    "guidance": "indices of the laws",
    "position": "",
    "controller": "of the attitude law: one of FS_CONTROLLER_*",
    "mixing": "",
    "rotors": "4 to FS_MAX_ROTORS",
    "inner_hz": "rate of the inner loop",
    "outer_divisor": "the outer loop runs in every so many inner ticks",
    "max_tilt_deg": "MPC_TILTMAX_AIR",
    "ix_kg_m2": "inertias, which every built-in attitude law has a copy of",
    "iy_kg_m2": "",
    "iz_kg_m2": "",
}


def core_files(laws: Laws) -> dict[str, str]:
    """Return the text of every generated file of ``core`` by name; raise OutsideSubsetError, ConfigError."""
    for law in every(laws):
        check_floats(law)
    numbers = declared(laws)
    check_names(numbers)
    program = law_program(laws)
    texts = {
        "fs_types.h": types(),
        "fs_numbers.h": numbers_header(laws, len(numbers)),
        "fs_param_table.c": table(numbers, default_numbers(laws)),
        "fs_controllers.h": controllers_header(),
        "fs_controllers.c": controllers_source(laws, program),
    }
    for law in every(laws):
        if isinstance(law.step, CStep):
            texts |= hand_written(law, law.step)
    for unit in program.written():
        if unit.module in program.inline:
            texts[f"{unit.name}.h"] = unit.inline()
        else:
            texts |= {f"{unit.name}.h": unit.header(), f"{unit.name}.c": unit.source()}
    return texts


def every(laws: Laws) -> list[ControlLaw]:
    """Return the laws of all roles."""
    return [law for of_role in laws.values() for law in of_role]


def law_program(laws: Laws = BUILT_IN) -> Program:
    """Translate the functions of the loops and the steps of the laws; raise OutsideSubsetError, ValueError."""
    program = Program(types=dict.fromkeys(_law_types(laws), "fs_numbers"), inline=INLINE)
    steps = [law.step for law in every(laws) if not isinstance(law.step, CStep)]
    for function in (*FUNCTIONS, *steps):
        program.add(function)
    return program


def hand_written(law: ControlLaw, step: CStep) -> dict[str, str]:
    """Return the files of a law in C by name, and the header with its parameters; raise ValueError."""
    name = f"{law_name(law)}_params"
    texts = {f"{name}.h": header(f"{name.upper()}_H", '"fs_types.h"', _structures([law.params_type]))}
    for path in (step.header, *step.sources):
        try:
            texts[path.name] = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise ValueError(f"{path} cannot be read: {error}") from None
        if path.name.startswith("fs_"):
            raise ValueError(f"{path.name} needs another name: those with fs_ belong to the firmware")
    return texts


def _structures(kinds: Sequence[type]) -> str:
    return "\n".join("\n".join([*structure(kind), ""]) for kind in kinds)


def _law_types(laws: Laws) -> list[type]:
    generated = [law for law in every(laws) if not isinstance(law.step, CStep)]
    kinds = [kind for law in generated for kind in (law.memory_type, law.params_type)]
    different = list(dict.fromkeys([*LOOP_TYPES, *kinds]))
    names = [record_name(kind) for kind in different]
    double = next((name for name in names if names.count(name) > 1), None)
    if double is not None:
        raise ValueError(f"two NamedTuples have the name {double} in C: rename one")
    return different


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


def numbers_header(laws: Laws, count: int) -> str:
    """Return fs_numbers.h: parameters and memories of the laws, the setup, and the size of the table."""
    parts = [f"#define FS_PARAM_COUNT {count}U\n"]
    for role, role_table in TABLES.items():
        stem = role_table.stem.upper()
        parts += [f"#define {stem}_{law_name(law).upper()} {index}U" for index, law in enumerate(laws[role])]
        parts += [f"#define {stem}S {len(laws[role])}U\n"]
    parts += ["\n".join([*structure(kind), ""]) for kind in _law_types(laws)]
    for role, role_table in TABLES.items():
        for what in ("params", "memory"):
            fields = [f"    {_record_of(law, what)} {law_name(law)};" for law in laws[role]]
            parts += [f"/* {what.capitalize()} of every law of {role}. */", "typedef struct {", *fields]
            parts += [f"}} {role_table.stem}_{what};\n"]
    fields = [f"    fs_real {name};{f' /* {text} */' if text else ''}" for name, text in SETUP.items()]
    parts += [
        "/* What several structures are made of, as it was set. */",
        "typedef struct {",
        *fields,
        "} fs_setup;\n",
    ]
    headers = [law.step.header.name for law in every(laws) if isinstance(law.step, CStep)]
    includes = "\n#include ".join(f'"{name}"' for name in ("fs_types.h", *headers))
    return header("FS_NUMBERS_H", includes, "\n".join(parts))


def _record_of(law: ControlLaw, what: str) -> str:
    """Return the C type of a law's params or memory."""
    if what == "memory" and isinstance(law.step, CStep):
        return law.step.memory
    return record_name(law.params_type if what == "params" else law.memory_type)


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
            *_consistency(numbers),
            "",
            _switch("fs_real *fs_param_integral(fs_loops *loops, uint16_t index)", integrals, "&", "NULL"),
            "",
        ]
    )


def _consistency(numbers: Sequence[TargetNumber]) -> list[str]:
    """Return a function that compares the numbers of each pair."""
    places = {number.name: number.place for number in numbers}
    pairs = [(places[number.at_least], number.place) for number in numbers if number.at_least]
    tests = " && ".join(f"loops->{least} <= loops->{largest}" for least, largest in pairs)
    return [
        "uint16_t fs_param_is_consistent(const fs_loops *loops)",
        "{",
        f"    return ({tests}) ? 1U : 0U;",
        "}",
    ]


def _switch(signature: str, places: dict[int, str], prefix: str, otherwise: str) -> str:
    """Return a function from an index to a member of the loops."""
    cases = [f"    case {index}U: return {prefix}loops->{place};" for index, place in places.items()]
    return "\n".join(
        [signature, "{", "    switch (index) {", *cases, f"    default: return {otherwise};", "    }", "}"]
    )


def check_floats(law: ControlLaw) -> None:
    """Raise ValueError if memory or parameters of a law have other fields than floats."""
    for kind in (law.memory_type, law.params_type):
        for field, inner in Record(kind).fields.items():
            if inner is not REAL:
                raise ValueError(f"field {field} of {kind.__name__} is no float")


def check_names(numbers: Sequence[TargetNumber]) -> None:
    """Raise ValueError for a name that MAVLink cannot carry, or one that stands twice."""
    names = [number.name for number in numbers]
    if len(set(names)) < len(names) or max(map(len, names)) > 16:
        raise ValueError("parameter names must be different and have 16 characters at most")
