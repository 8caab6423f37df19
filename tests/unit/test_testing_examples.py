"""The examples in the docstrings of flightstack.testing run, and every public name has one."""

from __future__ import annotations

import doctest
import importlib
import pkgutil
from pathlib import Path
from types import ModuleType

import pytest

from flightstack import testing

NAMES = [name for _, name, _ in pkgutil.iter_modules(testing.__path__) if name != "server_guard"]
DATA = {
    "Event", "Log", "Margin", "ModeSpan", "SIGNALS", "Sample", "Scenario", "Signals", "State", "Topic", "Verdict",
}  # fmt: skip
"""Public names without an example of their own: results that those of other names show."""


def module(name: str) -> ModuleType:
    return importlib.import_module(f"{testing.__name__}.{name}")


def sources() -> str:
    """Return all examples, each with the name of its owner."""
    finder = doctest.DocTestFinder()
    tests = [test for name in NAMES for test in finder.find(module(name))]
    return "\n".join(f"{test.name} {example.source}" for test in tests for example in test.examples)


@pytest.mark.parametrize("name", NAMES)
def test_examples_run(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert doctest.testmod(module(name)).failed == 0


def test_public_names_have_examples() -> None:
    texts = sources()
    shown = {name for name in testing.__all__ if name in texts}
    assert set(testing.__all__) - shown - DATA == set()


@pytest.mark.parametrize("owner", ["Flight", "Link"])
def test_public_methods_have_examples(owner: str) -> None:
    cls = getattr(testing, owner)
    texts = sources()
    methods = [name for name, value in vars(cls).items() if not name.startswith("_") and callable(value)]
    assert [name for name in methods if f".{name}(" not in texts] == []
