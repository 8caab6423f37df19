"""Inputs that take every branch of generated C, found by mutation with feedback from the code itself."""

from __future__ import annotations

import ctypes
import gzip
import json
import math
import subprocess
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from flightstack.firmware.generator.call_c import EDGES, ROTOR_COUNT, CFunction
from flightstack.firmware.generator.law import Function
from flightstack.firmware.generator.types import BOOL, INT, ROTORS, Array, Record, Type
from flightstack.firmware.generator.unit import Program, write
from flightstack.firmware.sources import firmware_root
from flightstack.firmware.toolchain.build import EXACT
from tests.firmware.core_support import run_tool

FEEDBACK = Path(__file__).parent / "c" / "coverage_feedback.c"
Numbers = list[float]
"""All numbers of the arguments of a function, in their order."""


class Covered:
    """The functions of a program in a library that tells which blocks and branches were run."""

    def __init__(self, program: Program, folder: Path) -> None:
        self.folder, root = folder, firmware_root()
        self.sources = write(program.written(), folder)
        flags = [
            *(flag for flag in EXACT if flag != "-O2"),
            "-O0",
            "-g",
            "-fPIC",
            "-DFS_DOUBLE",
            f"-I{folder}",
        ]
        flags += [f"-I{root / name}" for name in ("core", "laws")]
        for source in [*self.sources, root / "core" / "fs_math.c", FEEDBACK]:
            ours = ["--coverage", "-fsanitize-coverage=trace-pc"] if source in self.sources else []
            run_tool(["gcc", *flags, *ours, "-c", source, "-o", folder / f"{source.stem}.o"], cwd=folder)
        library = folder / "covered.so"
        run_tool(["gcc", "--coverage", "-shared", *sorted(folder.glob("*.o")), "-o", library], cwd=folder)
        self.library = ctypes.CDLL(str(library))

    def fresh(self) -> int:
        """Return the number of blocks that ran for the first time since the last call."""
        return int(self.library.coverage_fresh())

    def missed(self) -> list[str]:
        """Return the branches of the generated files that were never taken: file, number and text of the line."""
        self.library.coverage_write()
        run_tool(
            ["gcov", "--json-format", "--branch-probabilities", *self.folder.glob("*.gcda")], cwd=self.folder
        )
        counts: dict[tuple[str, int, int], int] = {}
        for report in self.folder.glob("*.gcov.json.gz"):
            for file in json.loads(gzip.decompress(report.read_bytes()))["files"]:
                path = (self.folder / file["file"]).resolve()
                if path.parent != self.folder.resolve():
                    continue
                for line in file["lines"]:
                    for at, branch in enumerate(line["branches"] or [line]):
                        place = path.name, line["line_number"], at
                        counts[place] = counts.get(place, 0) + branch["count"]
        never = sorted({(name, line) for (name, line, _), count in counts.items() if count == 0})
        return [f"{name}: {self._text(name, line)}" for name, line in never]

    def _text(self, name: str, line: int) -> str:
        return (self.folder / name).read_text(encoding="ascii").split("\n")[line - 1].strip()


def build(kind: Type, numbers: Iterator[float]) -> Any:
    """Return a value of a type made of numbers."""
    if isinstance(kind, Record):
        return kind.kind(*(build(inner, numbers) for inner in kind.fields.values()))
    if isinstance(kind, Array):
        return np.array([next(numbers) for _ in range(math.prod(_sizes(kind)))]).reshape(_sizes(kind))
    number = next(numbers)
    if kind is INT:
        return int(min(max(number, -9.0), 9.0)) if math.isfinite(number) else 0
    return number > 0.0 if kind is BOOL else np.float64(number)


def _sizes(kind: Array) -> list[int]:
    return [ROTOR_COUNT if size == ROTORS else int(size) for size in kind.shape]


def _count(kind: Type) -> int:
    if isinstance(kind, Record):
        return sum(_count(inner) for inner in kind.fields.values())
    return math.prod(_sizes(kind)) if isinstance(kind, Array) else 1


class Search:
    """Finds arguments of a function that run blocks which no others have run."""

    def __init__(self, covered: Covered, function: Function, seed: int = 1) -> None:
        self.covered, self.function = covered, function
        self.call = CFunction(covered.library, function)
        self.kinds = [parameter.type for parameter in function.parameters]
        self.size = sum(map(_count, self.kinds))
        self.kept: list[Numbers] = []
        self._random = np.random.default_rng(seed)

    def arguments(self, numbers: Sequence[float]) -> list[Any]:
        """Return the arguments of the function."""
        stream = iter(numbers)
        return [build(kind, stream) for kind in self.kinds]

    def run(self, tries: int) -> None:
        """Try random arguments and mutations of those kept; keep what runs a new block."""
        for attempt in range(tries):
            with np.errstate(all="ignore"):
                numbers = self._next() if attempt else [0.0] * self.size
            self.call(*self.arguments(numbers))
            if self.covered.fresh():
                self.kept.append(numbers)

    def _next(self) -> Numbers:
        return self._mutated() if self.kept and self._random.random() < 0.7 else self._drawn()

    def _drawn(self) -> Numbers:
        scale = self._random.choice([1e-3, 0.1, 1.0, 1.0, 30.0, 1e6])
        drawn: Numbers = (self._random.normal(size=self.size) * scale).tolist()
        return drawn if self._random.random() < 0.5 else [abs(number) for number in drawn]

    def _mutated(self) -> Numbers:
        numbers = list(self.kept[self._random.integers(len(self.kept))])
        for at in self._random.integers(self.size, size=self._random.integers(1, 5)):
            other = numbers[self._random.integers(self.size)]
            scaled = numbers[at] * 10.0 ** self._random.integers(-9, 9)
            drawn = [self._random.choice(EDGES), self._random.normal(), self._random.integers(-9, 10)]
            changes = [-numbers[at], other, scaled, 0.0, *map(float, drawn)]
            numbers[at] = changes[self._random.integers(len(changes))]
        return numbers


def has_gcov() -> bool:
    """Return True if gcc and gcov of one version are installed."""
    try:
        versions = [
            subprocess.run([tool, "-dumpversion"], capture_output=True, text=True, check=True).stdout
            if tool == "gcc"
            else subprocess.run([tool, "--version"], capture_output=True, text=True, check=True).stdout
            for tool in ("gcc", "gcov")
        ]
    except (OSError, subprocess.CalledProcessError):
        return False
    return versions[0].strip().partition(".")[0] in versions[1].partition("\n")[0]


def is_finite(numbers: Sequence[float]) -> bool:
    """Return True if all numbers are finite."""
    return all(map(math.isfinite, numbers))
