"""Compile the firmware for this machine, cached by sources, compiler and flags.

The cache is ``~/.cache/flightstack/firmware``. Files are renamed into it when complete, so that concurrent processes
never see a partial file; a process waits for another one that compiles the same.
"""

from __future__ import annotations

import fcntl
import functools
import hashlib
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from flightstack.core.errors import INSTALL_FIRMWARE
from flightstack.firmware.sources import (
    PORTABLE,
    SENSING,
    SENSING_INCLUDES,
    c_files,
    digest,
    files,
    firmware_root,
    sensing_files,
    source_hash,
)

EXACT = ("-std=c99", "-O2", "-ffp-contract=off", "-fno-fast-math", "-fno-math-errno")
"""Flags that make every compiler round each operation as written."""
KEPT_STATES = 24
COMPILE_LIMIT_S = 300.0


class BuildError(RuntimeError):
    """Compilation failed; the text is one sentence for the user."""


class Compiler(NamedTuple):
    """A C compiler of this machine."""

    command: tuple[str, ...]
    version: str
    """Name and version, one line."""


@functools.cache
def host_compiler() -> Compiler:
    """Return the compiler in $CC, or the first of cc, gcc, clang and zig; raise BuildError."""
    named = os.environ.get("CC")
    tried = [shlex.split(named)] if named else []
    tried += [["cc"], ["gcc"], ["clang"]]
    for command in tried:
        if command and shutil.which(command[0]) is not None and (version := compiler_version(command)):
            return Compiler(tuple(command), version)
    zig = [sys.executable, "-m", "ziglang", "cc"]
    if version := compiler_version(zig):
        return Compiler((*zig, "-fno-sanitize=all"), f"zig {version}")
    names = ", ".join([*([named] if named else []), "cc", "gcc", "clang"])
    raise BuildError(f"no C compiler found: tried {names} and zig ({INSTALL_FIRMWARE})")


def compiler_version(command: Sequence[str]) -> str:
    """Return the first line of a compiler's version, empty if it cannot be run."""
    try:
        done = subprocess.run(
            [*command, "--version"], capture_output=True, text=True, check=False, timeout=COMPILE_LIMIT_S
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.partition("\n")[0].strip() if done.returncode == 0 else ""


def cached(
    name: str,
    compiler: Compiler,
    flags: Sequence[str],
    sources: Sequence[Path],
    headers: Sequence[Path] = (),
    libraries: Sequence[str] = (),
) -> Path:
    """Return the output of ``compiler flags sources libraries -o``, from the cache or compiled now; raise BuildError.

    ``headers`` are included by the sources and part of the cache key.
    """
    named = [path for path in (*sources, *headers) if path.is_relative_to(firmware_root())]
    state = digest(sorted({*named, *files(*PORTABLE)})).hex()[:16]
    key = hashlib.sha256("\0".join([*compiler.command, compiler.version, *flags]).encode()).hexdigest()[:12]
    stem, dot, ending = name.partition(".")
    place = _folder(state) / f"{stem}-{key}{dot}{ending}"
    if not place.exists():
        _compile(place, [*compiler.command, *flags, *map(str, sources), *libraries])
    return place


def cache_root() -> Path:
    """Return the folder of compiled firmware."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "flightstack" / "firmware"


def _folder(state: str) -> Path:
    """Return the folder for a state of the sources; delete the oldest folders."""
    base = cache_root()
    folder = base / state
    try:
        folder.mkdir(parents=True, exist_ok=True)
        os.utime(folder)
        states = sorted(base.glob("[0-9a-f]" * 16), key=lambda path: path.stat().st_mtime, reverse=True)
        for old in states[KEPT_STATES:]:
            shutil.rmtree(old, ignore_errors=True)
    except OSError:  # read-only home, or concurrent deletion
        if not os.access(folder, os.W_OK):
            return Path(tempfile.mkdtemp(prefix="flightstack-firmware-"))
    return folder


def _compile(place: Path, command: list[str]) -> None:
    is_bare = "-nostdlib" in command or "-ffreestanding" in command
    libraries = [] if is_bare else ["-lm"]
    try:
        with (
            place.with_name(f".{place.stem}.lock").open("w") as lock,
            tempfile.TemporaryDirectory(dir=place.parent, prefix=".") as folder,
        ):
            fcntl.flock(lock, fcntl.LOCK_EX)
            if place.exists():
                return
            fresh = Path(folder) / place.name
            done = subprocess.run(
                [*command, *libraries, "-o", str(fresh)], capture_output=True, text=True, check=False,
                timeout=COMPILE_LIMIT_S,
            )  # fmt: skip
            if done.returncode != 0:
                said = next((line for line in done.stderr.splitlines() if "error" in line), "no message")
                raise BuildError(f"the firmware does not compile with {command[0]}: {said}")
            fresh.replace(place)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise BuildError(f"the firmware cannot be compiled with {command[0]}: {error}") from error


def definitions(compiler: Compiler) -> list[str]:
    """Return the flags that define source hash and compiler for a port."""
    digits = ",".join(f"0x{byte:02x}" for byte in source_hash())
    plain = "".join(c for c in compiler.version if c.isalnum() or c in " .-+()")[:47]
    return [f"-DFS_SOURCE_HASH={digits}", f'-DFS_COMPILER="{plain}"']


def includes(*folders: str) -> list[str]:
    """Return the include flags of folders."""
    return [f"-I{firmware_root() / folder}" for folder in folders]


def host_library(real: str = "float") -> Path:
    """Return the shared library of the loops in ``float`` or ``double``; raise BuildError."""
    compiler = host_compiler()
    flags = [*EXACT, "-shared", "-fPIC", *includes("core", "ports/host")]
    if real == "double":
        flags.append("-DFS_DOUBLE")
    port = firmware_root() / "ports" / "host"
    return cached(
        f"loops-{real}.so", compiler, flags, [*c_files("core"), port / "fs_sil.c"], [port / "fs_sil.h"]
    )


def host_program() -> Path:
    """Return the firmware as a host program on a pseudo-terminal; raise BuildError."""
    compiler, port = host_compiler(), firmware_root() / "ports" / "host"
    parts = [port / f"{name}.c" for name in ("fs_host", "fs_host_app", "fs_host_program")]
    flags = [*EXACT, *definitions(compiler), "-DFS_SENSING", *includes(*SENSING_INCLUDES, "ports/host")]
    headers = files("ports/host", *SENSING, "laws")
    return cached("fs_host", compiler, flags, [*sensing_files(), *parts], headers)
