"""Write the files of firmware/core that are data: types, structures of numbers and memories, the parameter table.

They come from the contract, the NamedTuples of the laws and ``flightstack.firmware.numbers``, so that C and Python
cannot differ in a field or a range. ``--check`` fails when a file is stale.
"""

from __future__ import annotations

import sys
from pathlib import Path

from flightstack.control.attitude_backstepping import BacksteppingParams
from flightstack.control.attitude_controller import AttitudeInputs
from flightstack.control.attitude_pid import PidMemory, PidParams
from flightstack.control.attitude_reference import ReferenceMemory, ReferenceParams
from flightstack.control.position_pid import PositionMemory, PositionParams
from flightstack.core import contract
from flightstack.firmware.generator.unit import structure
from flightstack.firmware.numbers import CONTROLLERS, TARGET_NUMBERS, TargetNumber, default_numbers
from tools.generated import ROOT, write_or_check

CORE = ROOT / "firmware" / "core"
NOTICE = "/* Generated from Python by firmware/tools/generate_core.py: do not edit. */\n"
DIGITS = 12
"""Of a default: enough for the loops, and the same on every machine, as the last ones of a pseudo-inverse are not."""
CONTRACT_TYPES = {
    contract.Vector3: "fs_vector3",
    contract.Quaternion: "fs_quaternion",
    contract.VehicleState: "fs_vehicle_state",
    contract.PositionSetpoint: "fs_position_setpoint",
    contract.AttitudeTarget: "fs_attitude_target",
    contract.AttitudeReference: "fs_attitude_reference",
    contract.Wrench: "fs_wrench",
    AttitudeInputs: "fs_attitude_inputs",
}
LAW_TYPES = {
    PositionMemory: "fs_position_memory",
    PositionParams: "fs_position_params",
    ReferenceMemory: "fs_reference_memory",
    ReferenceParams: "fs_reference_params",
    PidMemory: "fs_pid_memory",
    PidParams: "fs_pid_params",
    BacksteppingParams: "fs_backstepping_params",
}
SETUP = {
    "controller": "index of the attitude law: one of FS_CONTROLLER_*",
    "rotors": "4 to FS_MAX_ROTORS",
    "inner_hz": "rate of the inner loop",
    "outer_divisor": "the outer loop runs in every so many inner ticks",
    "max_tilt_deg": "MPC_TILTMAX_AIR",
    "ix_kg_m2": "inertias, which every attitude law has a copy of",
    "iy_kg_m2": "",
    "iz_kg_m2": "",
}


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
    parts += ["\n".join([*structure(kind, name), ""]) for kind, name in CONTRACT_TYPES.items()]
    return header("FS_TYPES_H", '"fs_real.h"', "\n".join(parts))


def numbers() -> str:
    """Return fs_numbers.h: parameters and memories of the laws, the setup, and the size of the table."""
    parts = [f"#define FS_PARAM_COUNT {len(TARGET_NUMBERS)}U\n"]
    parts += [f"#define FS_CONTROLLER_{law.name.upper()} {index}U" for index, law in enumerate(CONTROLLERS)]
    parts += [f"#define FS_CONTROLLERS {len(CONTROLLERS)}U\n"]
    parts += ["\n".join([*structure(kind, name), ""]) for kind, name in LAW_TYPES.items()]
    fields = [f"    fs_real {name};{f' /* {text} */' if text else ''}" for name, text in SETUP.items()]
    parts += [
        "/* What several structures are made of, as it was set. */",
        "typedef struct {",
        *fields,
        "} fs_setup;\n",
    ]
    return header("FS_NUMBERS_H", '"fs_types.h"', "\n".join(parts))


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


def table() -> str:
    """Return fs_param_table.c: declarations, and where each number stands."""
    defaults = rounded(default_numbers())
    rows = [
        f'    {{"{number.name}", {literal(number.low)}, {literal(number.high)}, '
        f"{literal(defaults[number.name])}, {int(number.is_whole)}U}},"
        for number in TARGET_NUMBERS
    ]
    places = {index: number.place for index, number in enumerate(TARGET_NUMBERS)}
    integrals = {index: number.integral for index, number in enumerate(TARGET_NUMBERS) if number.integral}
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


def check_names(declared: tuple[TargetNumber, ...]) -> None:
    """Raise ValueError for a name that MAVLink cannot carry, or one that stands twice."""
    names = [number.name for number in declared]
    if len(set(names)) < len(names) or max(map(len, names)) > 16:
        raise ValueError("parameter names must be different and have 16 characters at most")


def files() -> dict[Path, str]:
    """Return the text of every generated file."""
    check_names(TARGET_NUMBERS)
    return {
        CORE / "fs_types.h": types(),
        CORE / "fs_numbers.h": numbers(),
        CORE / "fs_param_table.c": table(),
    }


if __name__ == "__main__":
    sys.exit(write_or_check(files()))
