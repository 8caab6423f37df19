"""A stand-in for ``subprocess`` in the tests' helpers, which compiles only what a mutant changes."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

WARNINGS = [
    *("-Wall", "-Wextra", "-Wconversion", "-Wdouble-promotion", "-Wshadow", "-Wstrict-prototypes", "-Werror"),
]
TRIED_AT = "-O1"
"""Compiles in two thirds of the time of -O2, and computes the same bits."""
COMPARED_AT = ("-O2", "-O3")
"""Where code that tests cannot tell from the original is compared with it once more."""


class CompileError(Exception):
    """The mutant is no C, and does not count."""


class WarningError(Exception):
    """A compiler warns of the mutant, which in this project ends the build."""


class Unit(NamedTuple):
    """A source and the compiler's words for it, without the optimisation level."""

    cc: str
    flags: tuple[str, ...]
    source: str


class Library(NamedTuple):
    """What a command makes of its sources."""

    units: tuple[Unit, ...]
    output: str


def library_of(command: list[str]) -> Library:
    """Return the parts of a command that makes a shared library."""
    sources = [word for word in command if word.endswith(".c")]
    output = command[command.index("-o") + 1]
    left_out = {*sources, "-o", output, "-shared", "-lm"}
    flags = sorted(word for word in command[1:] if word not in left_out and word[:2] != "-O")
    return Library(tuple(Unit(command[0], tuple(flags), source) for source in sources), output)


class Objects:
    """Object code of all units: that of the sources, kept in ``folder``, and that of one mutant at a time."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.libraries: list[Library] = []
        """Those made of the sources as they are: of each, a mutant makes another."""
        self._kept: dict[Unit, Path] = {}
        self._depends: dict[Unit, frozenset[str]] = {}
        self._originals: dict[tuple[Unit, str], bytes] = {}
        self._mutated: Path | None = None
        self._fresh: dict[Unit, Path] = {}
        self._linked: dict[tuple[Unit, ...], Path] = {}

    def run(self, command: list[str], **options: Any) -> subprocess.CompletedProcess[str]:
        """Make a shared library; everything else is run as it is."""
        if "-shared" not in command:
            options.setdefault("check", False)
            return subprocess.run(command, **options)  # noqa: PLW1510
        library = library_of(command)
        if self._mutated is None:
            self.libraries.append(library)
        shared = self._shared(library.units)
        Path(library.output).unlink(missing_ok=True)  # a library that is loaded must not change
        shutil.copyfile(shared, library.output)
        return subprocess.CompletedProcess(command, 0, "", "")

    def mutate(self, path: Path | None) -> None:
        """Tell that this file is another one now, or that all are as they were."""
        self._mutated = path
        for made in self._fresh.values():
            made.unlink()
        self._fresh.clear()
        self._linked.clear()

    def is_same_code(self, libraries: list[Library]) -> bool:
        """Compile until an object differs from the kept one; CompileError, WarningError."""
        return all(
            self._object(unit).read_bytes() == self._kept[unit].read_bytes()
            for unit in self._concerned(libraries)
        )

    def is_same_optimised(self, libraries: list[Library], original: str) -> bool:
        """Tell whether a compiler makes the same code of the mutant when it optimises more."""
        assert self._mutated is not None
        mutant, made = self._mutated.read_text(), self.folder / "optimised.o"
        for level in COMPARED_AT:
            for unit in self._concerned(libraries):
                if (unit, level) not in self._originals:
                    self._mutated.write_text(original)
                    _compile(unit, made, level)
                    self._originals[unit, level] = made.read_bytes()
                    self._mutated.write_text(mutant)
                _compile(unit, made, level)
                if made.read_bytes() != self._originals[unit, level]:
                    break
            else:
                return True
        return False

    def _concerned(self, libraries: list[Library]) -> Iterator[Unit]:
        units = dict.fromkeys(unit for library in libraries for unit in library.units)
        return (unit for unit in units if str(self._mutated) in self._depends[unit])

    def _shared(self, units: tuple[Unit, ...]) -> Path:
        """Link units once for all tests of a mutant."""
        if units not in self._linked:
            made = self.folder / f"linked-{len(self._linked)}.so"
            objects = [str(self._object(unit)) for unit in units]
            link = ["ld", "-shared", "-o", str(made), *objects, "-lm"]
            subprocess.run(link, check=True, capture_output=True)
            self._linked[units] = made
        return self._linked[units]

    def _object(self, unit: Unit) -> Path:
        if unit not in self._kept:
            self._kept[unit] = self.folder / f"{Path(unit.source).stem}-{len(self._kept)}.o"
            rule = self._kept[unit].with_suffix(".d")
            _compile(unit, self._kept[unit], TRIED_AT, "-MMD", "-MF", str(rule))
            self._depends[unit] = frozenset(rule.read_text().split())
        if str(self._mutated) not in self._depends[unit]:
            return self._kept[unit]
        if unit not in self._fresh:
            made = self.folder / f"mutant-{len(self._fresh)}.o"
            _compile_strictly(unit, made)
            self._fresh[unit] = made
        return self._fresh[unit]


def _compile(unit: Unit, made: Path, *flags: str) -> None:
    command = [unit.cc, *unit.flags, *flags, "-w", "-Wno-error", "-c", unit.source, "-o", str(made)]
    if subprocess.run(command, check=False, capture_output=True).returncode:
        raise CompileError


def _compile_strictly(unit: Unit, made: Path) -> None:
    """Compile with all warnings, unless it is a source of the tests."""
    strict = WARNINGS if Path(unit.source).parent.name != "c" else []
    command = [unit.cc, *unit.flags, TRIED_AT, *strict, "-c", unit.source, "-o", str(made)]
    if subprocess.run(command, check=False, capture_output=True).returncode:
        _compile(unit, made, TRIED_AT)
        raise WarningError
