"""Tests share helpers by modules that hold no tests."""

from __future__ import annotations

import ast
from pathlib import Path

TESTS = Path(__file__).parents[1]
RUNNER = TESTS / "mutation"  # calls tests on changed programs


def imported(module: Path) -> set[str]:
    """Names of the modules and members that a file imports."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(module.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def test_no_module_imports_a_test_module() -> None:
    tests = {
        ".".join(["tests", *file.relative_to(TESTS).with_suffix("").parts])
        for file in TESTS.rglob("test_*.py")
    }
    assert "tests.unit.test_test_imports" in tests
    wrong = [
        f"{file.relative_to(TESTS)} imports {name}"
        for file in TESTS.rglob("*.py")
        if file.parent != RUNNER
        for name in sorted(imported(file))
        if name in tests or name.rpartition(".")[0] in tests
    ]
    assert not wrong, "\n".join(wrong)
