"""The structure of the programs, by the figures of tools/structure.py."""

from __future__ import annotations

import pytest

from tools.structure import PROGRAMS, cycles, lines, sources

LONGEST_FILE = 400


@pytest.mark.parametrize("program", PROGRAMS)
def test_packages_import_each_other_without_cycles(program: str) -> None:
    assert cycles(sources(program)) == []


@pytest.mark.parametrize("program", PROGRAMS)
def test_files_have_at_most_400_lines(program: str) -> None:
    assert max(lines(program)) <= LONGEST_FILE
