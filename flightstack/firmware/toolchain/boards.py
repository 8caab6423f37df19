"""Compile the firmware for boards: the table of boards, ELF, raw and UF2 files."""

from __future__ import annotations

import shutil
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from flightstack.firmware.choice import DEFAULT_BAUD
from flightstack.firmware.sources import PORTABLE, c_files, files, firmware_root
from flightstack.firmware.toolchain.build import (
    EXACT,
    BuildError,
    Compiler,
    cached,
    compiler_version,
    definitions,
    includes,
)
from flightstack.firmware.toolchain.cortex_m4 import cross_compiler
from flightstack.firmware.toolchain.elf import Elf

GCC, ZIG = "gcc", "zig"
ARM_GCC = "arm-none-eabi-gcc"
STRICT = (
    "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-Wconversion", "-Wdouble-promotion", "-Wshadow",
    "-Wstrict-prototypes", "-Wmissing-prototypes", "-Wundef", "-Wvla", "-Wcast-align", "-Wcast-qual",
)  # fmt: skip
_BARE = (
    "-ffreestanding", "-ffunction-sections", "-fdata-sections", "-fno-unwind-tables",
    "-fno-asynchronous-unwind-tables", "-Wl,--gc-sections", "-Wl,--build-id=none",
)  # fmt: skip
# without -nostdlib zig links its run-time library: arithmetic of a processor without floating-point unit
_GCC_BARE = ("-nostdlib",)
_M4 = ("-mthumb", "-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard")
_M33 = ("-mthumb", "-mcpu=cortex-m33", "-mfpu=fpv5-sp-d16", "-mfloat-abi=hard")
_ZIG_M4 = ("-target", "thumb-freestanding-eabihf", "-mcpu=cortex_m4+vfp4d16sp")
_ZIG_M33 = ("-target", "thumb-freestanding-eabihf", "-mcpu=cortex_m33+fp_armv8d16sp")
_ZIG_HAZARD3 = ("-target", "riscv32-freestanding-none", "-mcpu=generic_rv32+m+a+c+zicsr")
_ARM_SUPPORT = "ports/cortex_m4/support.c"


class Board(NamedTuple):
    """A board and how its firmware is compiled."""

    title: str
    """Its name in FS_PIL_IDENTITY, 24 characters at most."""
    parts: tuple[str, ...]
    """Files of its own, below ``firmware/``."""
    script: str
    baud_macro: str
    gcc: tuple[str, ...]
    """Flags of arm-none-eabi-gcc; empty if it cannot compile for the board."""
    zig: tuple[str, ...]
    flags: tuple[str, ...] = ()
    uf2_family: int | None = None
    """Family in a UF2 file; None for a board that takes raw files."""


_NUCLEO = ("ports/nucleo/nucleo_start.c", "ports/nucleo/nucleo_board.c", _ARM_SUPPORT)
BOARDS = {
    "nucleo-f401re": Board(
        "NUCLEO-F401RE", _NUCLEO, "ports/nucleo/nucleo.ld", "NUCLEO_BAUD", _M4, _ZIG_M4, ("-DNUCLEO_F401RE",)
    ),
    "nucleo-f446re": Board(
        "NUCLEO-F446RE", _NUCLEO, "ports/nucleo/nucleo.ld", "NUCLEO_BAUD", _M4, _ZIG_M4, ("-DNUCLEO_F446RE",)
    ),
    "pico2": Board(
        "Pico 2, Cortex-M33",
        ("ports/pico2/pico2_start_arm.c", "ports/pico2/pico2_board.c", _ARM_SUPPORT),
        "ports/pico2/pico2.ld", "PICO2_BAUD", _M33, _ZIG_M33, (), 0xE48B_FF59,
    ),
    "pico2-riscv": Board(
        "Pico 2, Hazard3",
        ("ports/pico2/pico2_start_riscv.c", "ports/pico2/pico2_board.c", "ports/pico2/pico2_divide.c"),
        "ports/pico2/pico2.ld", "PICO2_BAUD", (), _ZIG_HAZARD3, (), 0xE48B_FF5A,
    ),
}  # fmt: skip
"""Boards of ``gcs pil build``. The F28377S and F28379D are built by TI's tools (firmware/README.md)."""


def board_compilers(name: str) -> tuple[str, ...]:
    """Return the compilers that can build for a board."""
    return (ZIG, GCC) if BOARDS[name].gcc else (ZIG,)


def board_image(name: str, compiler: str = ZIG, baud: int = DEFAULT_BAUD, extra: Sequence[str] = ()) -> Path:
    """Return the firmware of a board as an ELF file, from the cache or compiled now; raise BuildError."""
    board, root = BOARDS[name], firmware_root()
    used = _compiler(name, compiler)
    sources = [path for folder in (*PORTABLE, "ports/bare", "ports/gnu") for path in c_files(folder)]
    own = [root / part for part in board.parts]
    folders = dict.fromkeys(["ports/bare", "ports/gnu", *(str(Path(part).parent) for part in board.parts)])
    flags = [
        *(board.gcc if compiler == GCC else board.zig),
        *EXACT,
        *_BARE,
        *(("-fno-sanitize=all",) if compiler == ZIG else _GCC_BARE),
        f"-Wl,-T,{root / board.script}",
        *definitions(used),
        f'-DFS_BOARD="{board.title}"',
        f"-D{board.baud_macro}={baud}UL",
        *board.flags,
        *includes(*PORTABLE, *folders),
        *extra,
    ]
    headers = [*files(*folders), root / board.script]
    libraries = [] if compiler == ZIG else ["-lgcc"]
    return cached(f"{name}.elf", used, flags, [*sources, *own], headers, libraries)


def _compiler(name: str, compiler: str) -> Compiler:
    if compiler not in board_compilers(name):
        raise BuildError(f"{compiler} cannot compile for {name}: use {ZIG}")
    if compiler == ZIG:
        return cross_compiler()
    if shutil.which(ARM_GCC) is None:
        raise BuildError(f"{ARM_GCC} is not installed: apt install gcc-arm-none-eabi, or use {ZIG}")
    return Compiler((ARM_GCC,), compiler_version([ARM_GCC]))


def raw_image(elf: Elf) -> tuple[int, bytes]:
    """Return the address and the bytes of an image as the flash holds them, gaps filled with 0xFF."""
    start = min(address for address, _ in elf.segments)
    end = max(address + len(content) for address, content in elf.segments)
    data = bytearray(b"\xff" * (end - start))
    for address, content in elf.segments:
        data[address - start : address - start + len(content)] = content
    return start, bytes(data)


_UF2_BEGIN, _UF2_SECOND, _UF2_END, _UF2_HAS_FAMILY = 0x0A32_4655, 0x9E5D_5157, 0x0AB1_6F30, 0x2000
_UF2_PAYLOAD, _UF2_BLOCK = 256, 512


def uf2_image(start: int, data: bytes, family: int) -> bytes:
    """Return an image in Microsoft's UF2 format, which a board's boot drive takes: 512 bytes for each 256."""
    count = -(-len(data) // _UF2_PAYLOAD)
    blocks = []
    for number in range(count):
        at = number * _UF2_PAYLOAD
        payload = data[at : at + _UF2_PAYLOAD].ljust(_UF2_PAYLOAD, b"\xff")
        head = (_UF2_BEGIN, _UF2_SECOND, _UF2_HAS_FAMILY, start + at, _UF2_PAYLOAD, number, count, family)
        block = struct.pack("<8I", *head) + payload
        blocks.append(block.ljust(_UF2_BLOCK - 4, b"\0") + struct.pack("<I", _UF2_END))
    return b"".join(blocks)


def flash_file(name: str, image: Path) -> tuple[str, bytes]:
    """Return the suffix and the content of the file that is copied to the board's drive; raise ElfError, OSError."""
    start, data = raw_image(Elf(image.read_bytes()))
    family = BOARDS[name].uf2_family
    return ("bin", data) if family is None else ("uf2", uf2_image(start, data, family))
