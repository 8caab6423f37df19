"""fs_controllers: the control laws of each role by index, in C."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from flightstack.control.control_law import ControlLaw, CStep
from flightstack.control.controller import ATTITUDE, GUIDANCE, MIXER, POSITION, TILT_FIELD
from flightstack.control.controller_loading import fields_of
from flightstack.firmware.generator.law import Function
from flightstack.firmware.generator.text import comment, fold, identifier, indented
from flightstack.firmware.generator.unit import NOTICE, Program
from flightstack.firmware.numbers import Laws, law_name


class RoleTable(NamedTuple):
    """Names and signature of the table of a role."""

    stem: str
    """Of the functions, ``<stem>s_step``, and of the structures, ``<stem>_memory``."""
    about: str
    before: tuple[tuple[str, str], ...]
    """Declaration and name of the arguments between memory and parameters."""
    after: tuple[tuple[str, str], ...]
    """Of those after the time step."""
    output: tuple[str, str]

    def signature(self, first: str = "") -> str:
        """Return the parameters of a step in C, after those of ``first``."""
        declared = [
            f"const {self.stem}_memory *memory",
            *(text for text, _ in self.before),
            f"const {self.stem}_params *params",
            "fs_real dt_s",
            *(text for text, _ in self.after),
            f"{self.stem}_memory *memory_out",
            self.output[0],
        ]
        return f"({first}{', '.join(declared)})"

    def arguments(self, law: str = "") -> str:
        """Return the arguments of a step: the whole memory and parameters, or those of a law."""
        memory, params, memory_out = "memory", "params", "memory_out"
        if law:
            memory, params, memory_out = (f"&{name}->{law}" for name in (memory, params, memory_out))
        before, after = ([name for _, name in part] for part in (self.before, self.after))
        return ", ".join([memory, *before, params, "dt_s", *after, memory_out, self.output[1]])

    def c_arguments(self, law: str) -> str:
        """Return the arguments of a step that changes its memory in place."""
        before, after = ([name for _, name in part] for part in (self.before, self.after))
        values = [f"&memory_out->{law}", *before, f"&params->{law}", "dt_s", *after, self.output[1]]
        return ", ".join(values)


_STATE = ("const fs_vehicle_state *state", "state")
_SETPOINT = ("const fs_position_setpoint *setpoint", "setpoint")
TABLES = {
    GUIDANCE: RoleTable(
        "fs_guidance_law", "the guidance law of this index: the setpoint to track",
        (_STATE, _SETPOINT), (), ("fs_position_setpoint *setpoint_out", "setpoint_out"),
    ),
    POSITION: RoleTable(
        "fs_position_law", "the position law of this index: the attitude target",
        (_STATE, _SETPOINT), (("fs_real thrust_saturation", "thrust_saturation"),),
        ("fs_attitude_target *target_out", "target_out"),
    ),
    ATTITUDE: RoleTable(
        "fs_controller", "the attitude law of this index, one of FS_CONTROLLER_*: the torque [N m, FRD]",
        (("const fs_attitude_inputs *inputs", "inputs"),), (), ("fs_vector3 *torque_out", "torque_out"),
    ),
    MIXER: RoleTable(
        "fs_mixer_law", "the mixer of this index: rotor speeds [rad/s] and the achieved wrench",
        (("const fs_wrench *wrench", "wrench"), ("const fs_mixer *mixer", "mixer")),
        (
            ("fs_real rotor_speed_rad_s[FS_MAX_ROTORS]", "rotor_speed_rad_s"),
            ("fs_real work[3][FS_MAX_ROTORS]", "work"),
        ),
        ("fs_wrench *achieved_out", "achieved_out"),
    ),
}  # fmt: skip


def controllers_header() -> str:
    """Return fs_controllers.h."""
    parts = [f"/* {NOTICE} */", "#ifndef FS_CONTROLLERS_H", "#define FS_CONTROLLERS_H", ""]
    parts += ['#include "fs_mixer.h"', '#include "fs_numbers.h"', ""]
    for table in TABLES.values():
        parts += [
            f"/* Set the memories of the laws to their initial values. */\n{_reset(table)};\n",
            *comment(f"Run {table.about}. Return 0 if the next memory is not finite."),
            *fold(f"uint16_t {table.stem}s_step{table.signature('uint16_t law, ')};"),
            "",
        ]
    parts += [
        "/* Set the largest tilt of the position laws that have one. */",
        f"{_TILT};",
        "",
        "#endif",
        "",
    ]
    return "\n".join(parts)


_TILT = "void fs_position_laws_tilt(fs_position_law_params *params, fs_real max_tilt_rad)"


def _reset(table: RoleTable) -> str:
    return f"void {table.stem}s_reset({table.stem}_memory *memory)"


def controllers_source(laws: Laws, program: Program) -> str:
    """Return fs_controllers.c: a table of the laws of each role."""
    steps = {
        (role, law.name): program.add(law.step)
        for role in laws
        for law in laws[role]
        if not isinstance(law.step, CStep)
    }
    headers = {f"{program.header_of(step)}.h" for step in steps.values()}
    parts = [f"/* {NOTICE} */", '#include "fs_controllers.h"', ""]
    parts += [*(f'#include "{name}"' for name in sorted({*headers, "fs_math.h"} - {"fs_mixer.h"})), ""]
    for role, table in TABLES.items():
        parts += [_reset(table), "{", *indented(_reset_lines(laws[role])), "}", ""]
        for law in laws[role]:
            if isinstance(law.step, CStep):
                lines = fold(f"{law.step.step}({table.c_arguments(law_name(law))});", "    ")
                lines = ["    (void)memory;", *lines, "    return 1U;"]
            else:
                lines = _generated_step(table, law, steps[role, law.name])
            parts += [*fold(f"static uint16_t run_{role}_{law_name(law)}{table.signature()}")]
            parts += ["{", *lines, "}", ""]
        names = ", ".join(f"run_{role}_{law_name(law)}" for law in laws[role])
        parts += [
            *fold(f"typedef uint16_t (*{role}_step){table.signature()};"),
            "",
            f"static const {role}_step {role}_laws[] = {{{names}}};",
            "",
            *fold(f"uint16_t {table.stem}s_step{table.signature('uint16_t law, ')}"),
            "{",
            "    *memory_out = *memory;",
            f"    return {role}_laws[law]({table.arguments()});",
            "}",
            "",
        ]
    tilted = [law_name(law) for law in laws[POSITION] if TILT_FIELD in fields_of(law.params_type)]
    lines = [f"params->{name}.{TILT_FIELD} = max_tilt_rad;" for name in tilted]
    return "\n".join([*parts, _TILT, "{", *indented(lines), "}", ""])


def _reset_lines(laws: Sequence[ControlLaw]) -> list[str]:
    lines = []
    for law in laws:
        place = f"memory->{law_name(law)}"
        if isinstance(law.step, CStep):
            lines.append(f"{law.step.init}(&{place});")
            continue
        for field, value in zip(fields_of(law.memory_type), law.initial_memory, strict=True):
            lines.append(f"{place}.{identifier(field)} = FS_LIT({float(value)!r});")
    return lines


def _generated_step(table: RoleTable, law: ControlLaw, step: Function) -> list[str]:
    """Return the call of a generated step, and the test whether its memory is finite."""
    name = law_name(law)
    finite = [f"fs_is_finite(memory_out->{name}.{identifier(field)})" for field in fields_of(law.memory_type)]
    result = finite[0] if len(finite) == 1 else f"(uint16_t)({' & '.join(finite)})"
    call = f"{step.c_name}({table.arguments(name)});"
    if (
        step.parameters[-1].name not in step.written
    ):  # C converts no pointer to rows to one of constant rows by itself
        call = call.replace(", work,", ", (const fs_real(*)[FS_MAX_ROTORS])work,")
    return [*fold(call, "    "), *fold(f"return {result};", "    ")]
