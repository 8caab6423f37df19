"""Compile the firmware for the emulated Cortex-M4F, and the instruction counter."""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from flightstack.core.errors import INSTALL_FIRMWARE
from flightstack.firmware.emulator import EmulatedTarget, EmulationError
from flightstack.firmware.sources import (
    PORTABLE,
    SENSING,
    SENSING_INCLUDES,
    files,
    firmware_root,
    sensing_files,
)
from flightstack.firmware.toolchain.build import (
    EXACT,
    BuildError,
    Compiler,
    cached,
    compiler_version,
    definitions,
    host_compiler,
    includes,
)

CPU = ("-target", "thumb-freestanding-eabihf", "-mcpu=cortex_m4+vfp4d16sp")
"""Target flags of zig's clang: hardware single precision; the sources use no doubles."""
BARE = (
    "-fno-sanitize=all", "-fno-unwind-tables", "-fno-asynchronous-unwind-tables", "-ffunction-sections", "-flto",
    "-g", "-nostdlib", "-Wl,--gc-sections", "-Wl,--build-id=none", "-Wl,-e,fs_emulated_exchange",
)  # fmt: skip
"""Freestanding build with link-time optimisation, and a line table for the coverage."""
_IMPLIED = ("__aeabi_memcpy", "__aeabi_memcpy4", "__aeabi_memclr", "__aeabi_memclr4", "__aeabi_memset4")
"""Calls added after link-time optimisation, so that their functions must be kept."""
_PORT = "ports/cortex_m4"


@functools.cache
def cross_compiler() -> Compiler:
    """Return zig's C compiler, installed by pip; raise BuildError."""
    zig = (sys.executable, "-m", "ziglang", "cc")
    version = compiler_version(zig)
    if not version:
        raise BuildError(f"zig is not installed: {INSTALL_FIRMWARE}")
    return Compiler(zig, f"zig {version}")


def cortex_m4_image() -> Path:
    """Return the application for the emulated Cortex-M4F as an ELF file; raise BuildError."""
    return emulated_image("emulated.elf", sensing_files(), "emulated.c", flags=includes(*SENSING_INCLUDES))


def emulated_image(name: str, sources: Sequence[Path], *parts: str, flags: Sequence[str] = ()) -> Path:
    """Return an image of ``sources`` and ``parts`` of the port with the entry point of ``Emulator``."""
    compiler, port = cross_compiler(), firmware_root() / _PORT
    own = [port / part for part in (*parts, "emulated_start.c", "support.c")]
    kept = [f"-Wl,-u,{call}" for call in _IMPLIED]
    script = f"-Wl,-T,{port / 'emulated.ld'}"
    command = [
        *CPU,
        *EXACT,
        *BARE,
        *kept,
        script,
        *definitions(compiler),
        *includes(*PORTABLE, _PORT),
        *flags,
    ]
    return cached(
        name, compiler, command, [*sources, *own], [*files(_PORT, "laws", *SENSING), port / "emulated.ld"]
    )


def instruction_counter() -> Path:
    """Return the library that counts instructions, compiled for this machine; raise BuildError."""
    source = firmware_root() / _PORT / "emulator_counter.c"
    return cached("counter.so", host_compiler(), ["-O2", "-shared", "-fPIC"], [source])


def emulated_target(now_s: Callable[[], float] | None = None) -> EmulatedTarget:
    """Start the firmware on an emulated Cortex-M4F, compiled if needed; raise BuildError."""
    try:
        return EmulatedTarget(cortex_m4_image(), instruction_counter(), now_s)
    except EmulationError as error:
        raise BuildError(str(error)) from error
