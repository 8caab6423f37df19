"""Line coverage of firmware that ran in the emulator: executed addresses, and the line table of its image."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple

import numpy as np

Ranges = Sequence[tuple[int, int]]
"""First address and end of executed code, ascending and disjoint."""
_DWARF_5 = 5


class FileCoverage(NamedTuple):
    """Lines of one source file that have machine code. A line of inlined code counts once."""

    lines: int
    executed: int
    missed: tuple[int, ...]
    """Numbers of the lines that were not executed."""


def merged(starts: Any, sizes: Any) -> list[tuple[int, int]]:
    """Return the ranges of blocks, given by arrays of address and size; adjacent ones become one."""
    ranges: list[tuple[int, int]] = []
    for start, size in sorted(zip(starts.tolist(), sizes.tolist(), strict=True)):
        if ranges and start <= ranges[-1][1]:
            ranges[-1] = ranges[-1][0], max(ranges[-1][1], start + size)
        else:
            ranges.append((start, start + size))
    return ranges


def line_coverage(image: Path, executed: Ranges) -> dict[str, FileCoverage] | None:
    """Return the coverage of each source file, named by folder and file; None without pyelftools or the image."""
    try:
        from elftools.elf.elffile import ELFFile

        with image.open("rb") as file:
            elf = ELFFile(file)
            rows = list(_rows(elf.get_dwarf_info())) if elf.has_dwarf_info() else []
    except (ImportError, OSError):
        return None
    starts = np.array([start for start, _ in executed], np.int64)
    ends = np.array([end for _, end in executed], np.int64)
    found: dict[str, dict[int, bool]] = {}
    for name, line, address in rows:
        at = int(np.searchsorted(starts, address, side="right")) - 1
        ran = at >= 0 and address < int(ends[at])
        lines = found.setdefault(name, {})
        lines[line] = lines.get(line, False) or ran
    return {name: _summary(lines) for name, lines in sorted(found.items())}


def _summary(lines: dict[int, bool]) -> FileCoverage:
    missed = tuple(sorted(line for line, ran in lines.items() if not ran))
    return FileCoverage(len(lines), len(lines) - len(missed), missed)


def _rows(dwarf: Any) -> Iterator[tuple[str, int, int]]:
    """Yield file, line and address of each statement with machine code."""
    for unit in dwarf.iter_CUs():
        program = dwarf.line_program_for_CU(unit)
        if program is None:
            continue
        names = list(file_names(program.header))
        first = 0 if program.header["version"] >= _DWARF_5 else 1
        states = [entry.state for entry in program.get_entries() if entry.state is not None]
        for state, following in pairwise(states):
            has_code = not state.end_sequence and following.address > state.address
            if has_code and state.is_stmt and state.line and state.address:
                yield names[state.file - first], state.line, state.address


def file_names(header: Any) -> Iterator[str]:
    """Yield folder and name of each file; compilers split a path anywhere between the two columns of the table."""
    is_new = header["version"] >= _DWARF_5
    for entry in header["file_entry"]:
        index = entry.dir_index if is_new else entry.dir_index - 1
        folder = header["include_directory"][index].decode() if index >= 0 else ""
        yield "/".join(PurePosixPath(folder, entry.name.decode()).parts[-2:])
