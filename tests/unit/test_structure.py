"""The structure of the programs, by the figures of tools/structure.py; the limits are those reached so far."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator

import pytest

from tools.structure import (
    PROGRAMS,
    ROOT,
    cycles,
    forget,
    has_one_definition,
    has_one_small_definition,
    imported,
    index_constants,
    lines,
    long_functions,
    nodes,
    private_uses,
    sources,
)

LONGEST_FILE = 400
MOST_HOPS = 12
ONE_DEFINITION = {"flightstack": 14, "sim_bridge": 4, "gcs_cli": 15}
SMALL_WITHOUT_REASON = {"flightstack": 0, "sim_bridge": 0, "gcs_cli": 0}
"""Files with one small definition whose docstring does not say why it is a module of its own."""
LONG_FUNCTIONS = {"flightstack": 2, "sim_bridge": 0, "gcs_cli": 0}
INDEX_CONSTANTS = {"flightstack": 0, "sim_bridge": 0, "gcs_cli": 0}


@pytest.fixture(scope="module", autouse=True)
def _forgotten() -> Iterator[None]:
    yield
    forget()


@pytest.mark.parametrize("program", PROGRAMS)
def test_packages_import_each_other_without_cycles(program: str) -> None:
    assert cycles(sources(program)) == []


@pytest.mark.parametrize("program", [*PROGRAMS, "tests"])
def test_files_have_at_most_400_lines(program: str) -> None:
    assert max(lines(program)) <= LONGEST_FILE


@pytest.mark.parametrize("program", PROGRAMS)
def test_files_of_one_definition_do_not_grow_in_number(program: str) -> None:
    modules = sources(program)
    alone = [name for name, tree in modules.items() if has_one_definition(tree)]
    assert len(alone) <= ONE_DEFINITION[program], alone
    small = [name for name, tree in modules.items() if has_one_small_definition(tree)]
    assert len(small) <= SMALL_WITHOUT_REASON[program], small


@pytest.mark.parametrize("program", PROGRAMS)
def test_functions_of_more_than_40_lines_do_not_grow_in_number(program: str) -> None:
    found = list(long_functions(sources(program)))
    assert len(found) <= LONG_FUNCTIONS[program], found


@pytest.mark.parametrize("program", PROGRAMS)
def test_index_constants_do_not_grow_in_number(program: str) -> None:
    found = [place for name in sources(program) for place in index_constants(name)]
    assert len(found) <= INDEX_CONSTANTS[program], found


def test_an_offboard_setpoint_passes_few_files_from_the_socket_to_guidance() -> None:
    command = [sys.executable, "-m", "tools.hops"]
    printed = subprocess.run(
        command, capture_output=True, text=True, check=True, cwd=ROOT
    ).stdout.splitlines()
    assert printed[0] == "process/connections.py"
    assert "guidance/setpoints.py" in printed
    assert len(printed[:-1]) <= MOST_HOPS


def test_tests_use_no_private_names_of_the_programs() -> None:
    assert list(private_uses(nodes("tests"))) == []


def test_no_module_imports_a_test_module() -> None:
    """Tests share helpers by modules that hold no tests; tests/mutation calls tests on changed programs."""
    modules = nodes("tests")
    tests = {name for name in modules if name.rpartition(".")[2].startswith("test_")}
    assert "tests.unit.test_structure" in tests
    wrong = [
        f"{module} imports {name}"
        for module, found in modules.items()
        if not module.startswith("tests.mutation.")
        for name in sorted(imported(found))
        if name in tests or name.rpartition(".")[0] in tests
    ]
    assert not wrong, "\n".join(wrong)
