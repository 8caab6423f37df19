"""The examples of flightstack.testing run, those of docstrings and of docs/reference/testing.md; each name has one."""

from __future__ import annotations

import doctest
import importlib
import pkgutil
import re
from functools import cached_property
from pathlib import Path
from types import ModuleType

import pytest

from flightstack import testing

NAMES = [name for _, name, _ in pkgutil.iter_modules(testing.__path__) if name != "server_guard"]
PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "testing.md"
SECTIONS = {
    title: "\n".join(re.findall(r"^```pycon\n(.*?)^```$", text, re.MULTILINE | re.DOTALL))
    for title, _, text in (part.partition("\n") for part in PAGE.read_text("utf-8").split("\n## ")[1:])
}
"""The examples of each section of the page."""
OWNERS = [name for name in testing.__all__ if isinstance(getattr(testing, name), type)]
SHOWN_BY = {
    "Margin": "Flight", "Signals": "Flight", "Sample": "Flight", "ModeSpan": "Flight", "Event": "Flight",
    "Topic": "Log", "Scenario": "Scenario and Verdict", "Verdict": "Scenario and Verdict",
    "RefusedError": "Errors", "ConditionTimeoutError": "Errors", "PropertyViolationError": "Errors",
}  # fmt: skip
"""The section of each class that has none of its own name."""


def module(name: str) -> ModuleType:
    return importlib.import_module(f"{testing.__name__}.{name}")


@pytest.mark.parametrize("name", NAMES)
def test_examples_of_docstrings_run(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert doctest.testmod(module(name)).failed == 0


@pytest.mark.parametrize("title", SECTIONS)
def test_examples_of_the_reference_run(title: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    example = doctest.DocTestParser().get_doctest(SECTIONS[title], {}, title, str(PAGE), 0)
    said: list[str] = []
    flags = doctest.ELLIPSIS | doctest.REPORT_ONLY_FIRST_FAILURE
    doctest.DocTestRunner(optionflags=flags).run(example, out=said.append)
    assert not said, "".join(said)


def public_members(name: str) -> list[str]:
    """Return the methods and properties that a class defines."""
    kinds = (property, cached_property)
    return [
        member
        for member, value in vars(getattr(testing, name)).items()
        if not member.startswith("_") and (callable(value) or isinstance(value, kinds))
    ]


@pytest.mark.parametrize("name", OWNERS)
def test_every_method_and_property_has_an_example(name: str) -> None:
    shown = SECTIONS[SHOWN_BY.get(name, name)]
    assert [member for member in public_members(name) if not re.search(rf"\.{member}\b", shown)] == []


def test_every_function_has_an_example() -> None:
    everything = "".join(SECTIONS.values())
    others = set(testing.__all__) - set(OWNERS)
    assert {name for name in others if not re.search(rf"\b{name}\b", everything)} == set()
