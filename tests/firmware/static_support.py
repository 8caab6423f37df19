"""What the static checks of the firmware share: which sources there are, and how each is compiled for which machine."""

from __future__ import annotations

import importlib.util
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from tests.support.tools import missing

ROOT = Path(__file__).resolve().parents[2]
FIRMWARE = ROOT / "firmware"
CPPCHECK = Path(__file__).parent / "cppcheck"
OWN_DRIVERLIB = Path(__file__).parent / "c" / "f28377s_chip" / "own"
PORTABLE = ("core", "mavlink", "app")
"""Folders of what runs on every target, a C28x among them."""
ESTIMATION = [
    path for folder in ("core/estimation", "sensing") for path in sorted((FIRMWARE / folder).glob("*.c"))
]
"""C files of the estimator and of its events, which are portable too."""
INCLUDES = [f"-I{FIRMWARE / folder}" for folder in (*PORTABLE, "core/estimation", "sensing", "laws")]
LANGUAGE = ["-std=c99", "-O2", "-ffp-contract=off", "-fno-fast-math"]
WARNINGS = [
    *("-Wall", "-Wextra", "-Wpedantic", "-Werror", "-Wconversion", "-Wdouble-promotion", "-Wshadow"),
    *("-Wstrict-prototypes", "-Wmissing-prototypes", "-Wold-style-definition", "-Wundef", "-Wvla"),
    *("-Wcast-align", "-Wcast-qual", "-Wwrite-strings", "-Wpointer-arith", "-Wredundant-decls"),
]


class Target(NamedTuple):
    """A compiler and the machine it compiles for."""

    command: tuple[str, ...]
    flags: tuple[str, ...] = ()
    output: tuple[str, ...] = ("-fsyntax-only",)
    """Warnings that need optimised code, as of variables without a value, come from gcc for the host alone."""


ZIG = (sys.executable, "-m", "ziglang", "cc")
ZIG_OUTPUT = ("-r", "-o", "all.o")
"""It makes one object of many sources by -r; with another option it would compile the first alone."""
CORTEX_M4 = ("-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16")
TARGETS = {
    "gcc": Target(("gcc",), ("-Wlogical-op", "-Wduplicated-cond", "-Wjump-misses-init"), ("-c",)),
    "gcc, double": Target(("gcc",), ("-DFS_DOUBLE", "-Wno-double-promotion")),
    "clang": Target(
        ("clang",), ("-Wcomma", "-Wassign-enum", "-Wconditional-uninitialized", "-Wunreachable-code")
    ),
    "clang, char unsigned": Target(("clang",), ("-funsigned-char",)),
    "zig": Target(ZIG, (), ZIG_OUTPUT),
    "zig, Cortex-M4": Target(
        ZIG, ("-target", "thumb-freestanding-eabihf", "-mcpu=cortex_m4+vfp4d16sp"), ZIG_OUTPUT
    ),
    "gcc, Cortex-M4": Target(("arm-none-eabi-gcc",), CORTEX_M4),
    "gcc, AVR": Target(("avr-gcc",), ("-mmcu=atmega1284p",)),
}


def available(target: Target) -> Target:
    """Return the target; skip the test when its compiler is not installed."""
    if target.command == ZIG:
        if importlib.util.find_spec("ziglang") is None:
            missing("no ziglang in this environment")
    elif not shutil.which(target.command[0]):
        missing(f"no {target.command[0]} on this machine")
    return target


def portable_sources() -> list[Path]:
    """Return the C files that run on every target."""
    return [path for folder in PORTABLE for path in sorted((FIRMWARE / folder).glob("*.c"))]


def portable_files() -> list[Path]:
    """Return C files and headers that run on every target."""
    return [path for folder in PORTABLE for path in sorted((FIRMWARE / folder).glob("*.[ch]"))]


def tools_files(test: str) -> list[Path]:
    """Return the files that say how a test calls its tools, this one among them."""
    return [Path(test), Path(__file__), *sorted(path for path in CPPCHECK.rglob("*") if path.is_file())]


def run(command: Sequence[str | Path], cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run a tool to its end and return what it said."""
    return subprocess.run(
        [str(part) for part in command], check=False, capture_output=True, text=True, cwd=cwd, timeout=300
    )


COMMENT_OR_STRING = re.compile(r"/\*.*?\*/|//[^\n]*|\"(?:\\.|[^\"\\\n])*\"|'(?:\\.|[^'\\\n])*'", re.DOTALL)


def without_comments(text: str) -> str:
    """Return C text with comments, strings and characters blanked out; every line stays where it is."""
    return COMMENT_OR_STRING.sub(lambda found: re.sub(r"[^\n]", " ", found[0]), text)


def code_lines(path: Path) -> Iterator[tuple[int, str]]:
    """Yield number and code of each line."""
    yield from enumerate(without_comments(path.read_text()).splitlines(), start=1)
