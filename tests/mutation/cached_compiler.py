"""A stand-in for ``subprocess`` in the tests' helpers, that compiles each source by itself and none of them twice."""

from __future__ import annotations

import hashlib
import subprocess
from pathlib import Path
from typing import Any

WARNINGS = [
    "-Wall",
    "-Wextra",
    "-Wconversion",
    "-Wdouble-promotion",
    "-Wshadow",
    "-Wstrict-prototypes",
    "-Werror",
]
CalledProcessError = subprocess.CalledProcessError


class CompileError(Exception):
    """The mutant is no C, and does not count."""


class WarningError(Exception):
    """A compiler warns of the mutant, which in this project ends the build."""


class CachedCompiler:
    """Has ``run`` of ``subprocess``, for the commands that make a shared library of many sources."""

    def __init__(self, folder: Path, mutated: str = "") -> None:
        self.folder = folder
        self.mutated = mutated
        """Name of the file that is compiled with all warnings."""

    def run(self, command: list[str], **options: Any) -> subprocess.CompletedProcess[str]:
        """Compile and link; everything else is run as it is."""
        if "-shared" not in command:
            options.setdefault("check", False)
            return subprocess.run(command, **options)  # noqa: PLW1510
        sources = [part for part in command if part.endswith(".c")]
        output = command[command.index("-o") + 1]
        flags = [p for p in command[1:] if p not in {*sources, "-o", output, "-shared", "-lm"}]
        objects = [self._object(command[0], source, flags) for source in sources]
        link = [command[0], "-shared", "-o", output, *objects, "-lm"]
        return subprocess.run(link, check=True, capture_output=True, text=True)

    def _object(self, cc: str, source: str, flags: list[str]) -> str:
        folders = [Path(flag[2:]) for flag in flags if flag.startswith("-I")]
        rest = [flag for flag in flags if not flag.startswith("-I")]
        digest = hashlib.sha256(" ".join([cc, *rest]).encode())
        for path in [Path(source), *(header for folder in folders for header in sorted(folder.glob("*.h")))]:
            digest.update(path.read_bytes())
        made = self.folder / f"{Path(source).stem}-{digest.hexdigest()[:20]}.o"
        if not made.exists():
            self._compile([cc, *flags, "-c", source], made)
        return str(made)

    def _compile(self, command: list[str], made: Path) -> None:
        strict = WARNINGS if self.mutated and Path(command[-1]).parent.name != "c" else []
        done = subprocess.run([*command, *strict, "-o", str(made)], check=False, capture_output=True)
        if done.returncode:
            loose = [part for part in command if part != "-Werror"]
            done = subprocess.run([*loose, "-w", "-o", str(made)], check=False, capture_output=True)
            raise CompileError if done.returncode else WarningError
