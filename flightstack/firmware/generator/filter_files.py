"""Generated files of the estimator in C: ``firmware/core/estimation``."""

from __future__ import annotations

from types import ModuleType
from typing import Any

from flightstack.core import geometry, portable_math
from flightstack.estimation import kalman, rings
from flightstack.estimation.clock_origin import move_clock_kernel
from flightstack.estimation.delayed_filter import field_kernel, imu_kernel, push_kernel
from flightstack.estimation.estimator_params import EstimatorParams
from flightstack.estimation.health import health_kernel
from flightstack.estimation.memory import start_memory
from flightstack.firmware.generator.core_files import header, law_program, literal
from flightstack.firmware.generator.text import identifier
from flightstack.firmware.generator.unit import NOTICE, Program
from flightstack.firmware.numbers import Laws

KERNELS: tuple[Any, ...] = (
    start_memory, push_kernel, imu_kernel, field_kernel, move_clock_kernel, health_kernel,
)  # fmt: skip
"""Functions that the firmware calls."""
NAMES = {geometry.__name__: "fs_estimation_geometry", portable_math.__name__: "fs_estimation_math"}
"""Files of functions that the control laws do not use; those that they use stand in ``firmware/core``."""
INDICES: tuple[tuple[ModuleType, tuple[str, ...]], ...] = (
    (rings, ("GNSS_RING", "MAG_RING", "BARO_RING", "RANGE_RING")),
    (kalman, ("GNSS_VELOCITY", "GNSS_POSITION", "BARO", "MAG")),
)
"""Indices of the arrays in the memory that callers use."""


def filter_program(laws: Laws) -> Program:
    """Translate the estimator beside the control laws; raise OutsideSubsetError."""
    program = Program(below=law_program(laws), names=NAMES)
    for kernel in KERNELS:
        program.add(kernel)
    return program


def filter_files(laws: Laws) -> dict[str, str]:
    """Return the text of every generated file by name; raise OutsideSubsetError."""
    texts = {"fs_estimator.h": _interface(), "fs_estimator_defaults.c": _defaults()}
    for unit in filter_program(laws).written():
        texts[f"{unit.name}.h"] = unit.header()
        if unit.functions:
            texts[f"{unit.name}.c"] = unit.source()
    return texts


def _interface() -> str:
    """Return the header that callers include."""
    lines = [
        "/*",
        " * The estimator. Its memory starts with zeros, as static memory does; then set the parameters and call",
        " * fs_start_memory. Rows of fs_push_kernel begin with the time [s] at which the sensor measured.",
        " */",
    ]
    for module, names in INDICES:
        lines += [f"#define FS_{name} {getattr(module, name)}" for name in names]
    lines += ["", "extern const fs_estimator_params fs_default_estimator_params;", ""]
    files = ("fs_clock_origin.h", "fs_delayed_filter.h", "fs_health.h", "fs_memory.h")
    includes = "\n#include ".join(f'"{file}"' for file in files)
    return header("FS_ESTIMATOR_H", includes, "\n".join(lines))


def _defaults() -> str:
    """Return the C file of the default parameters."""
    values = EstimatorParams()._asdict().items()
    fields = [f"    .{identifier(name)} = {literal(value)}," for name, value in values]
    lines = [f"/* {NOTICE} */", '#include "fs_estimator.h"', ""]
    return "\n".join([*lines, "const fs_estimator_params fs_default_estimator_params = {", *fields, "};", ""])
