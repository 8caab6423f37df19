"""Every branch of generated C is taken by generated inputs, with the bits of Python."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest

from flightstack.control.controller import BUILT_IN
from flightstack.core.compiled import compiled
from flightstack.firmware.generator.call_c import differences
from flightstack.firmware.generator.core_files import FUNCTIONS, every
from flightstack.firmware.generator.unit import Program
from tests.parity.branch_search import Covered, Search, has_gcov, is_finite
from tests.parity.generated_filter import FILTERS
from tests.parity.generated_laws import LAWS
from tests.support.generated_c import in_python
from tests.support.plugin_site import ROOT, example_module
from tests.support.tools import missing

pytestmark = pytest.mark.long

OURS = [*FUNCTIONS, *(law.step for law in every(BUILT_IN))]
TRIES = 1200
"""The last new block of a function is found by try 255, the last branch by try 800."""
UNREACHABLE: dict[str, str] = {}
"""Branches that no input takes, with the reason; there are none today."""


def own_laws() -> list[object]:
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "examples" / "own_laws"))
        controller = importlib.import_module("own_laws").CONTROLLER
    return [law.step for law in controller.own_laws.values()]


@compiled
def never(x: float) -> float:
    """A function with a branch that no number takes."""
    square = x * x
    if square < 0.0:
        return x
    return square


SETS = {
    "our laws": lambda: OURS,
    "LQR": lambda: [example_module().step],
    "own laws": own_laws,
    "laws of ten kinds": lambda: [*LAWS.values(), *FILTERS.values()],
}


@pytest.mark.parametrize("name", SETS)
def test_every_branch_of_generated_c_is_taken(name: str, tmp_path: Path) -> None:
    if not has_gcov():
        missing("needs gcc and gcov of one version")
    program = Program()
    for step in SETS[name]():
        program.add(step)
    covered = Covered(program, tmp_path)
    public = [
        function for unit in program.written() for function in unit.functions if not function.is_private
    ]
    searches = [Search(covered, function) for function in public]
    for search in searches:
        search.run(TRIES if search.size < 200 else TRIES // 12)  # 24 states have 1200 numbers, and one way
        finite = [search.arguments(numbers) for numbers in search.kept if is_finite(numbers)]
        assert not differences(search.call, in_python(search.function.python), finite), search.function.name
    assert [branch for branch in covered.missed() if branch not in UNREACHABLE] == []


def test_search_tells_a_branch_that_it_does_not_take(tmp_path: Path) -> None:
    if not has_gcov():
        missing("needs gcc and gcov of one version")
    program = Program()
    program.add(never)
    covered = Covered(program, tmp_path)
    Search(covered, program.add(never)).run(TRIES)
    missed = covered.missed()
    assert [branch.partition(": ")[2] for branch in missed] == ["if (square < FS_LIT(0.0)) {", "return x;"]
