"""Which flights a run of scenarios has: files, names, seeds."""

from __future__ import annotations

import ast
import difflib
import os
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from flightstack.core.errors import ConfigError
from flightstack.testing.scenario import Scenario, is_scenario, load_scenario, repeat_command
from gcs_cli.errors import USAGE, CliError
from gcs_cli.transfers.plan_files import examples_folder

_SKIPPED = frozenset({"__pycache__", "build", "dist", "node_modules", "site-packages"})
"""Folders without scenarios, besides hidden ones."""


@dataclass(frozen=True)
class Case:
    """One flight: a scenario with a seed."""

    scenario: Scenario
    seed: int
    label: str
    """Name of the scenario, with its folder where another one has the same name; unique in a run."""
    command: str
    """The command that repeats this flight alone."""

    @property
    def name(self) -> str:
        """Scenario and seed, unique in a run; also the relative path of a folder."""
        return f"{self.label}-seed{self.seed}"

    @property
    def key(self) -> tuple[Path, int]:
        """File and seed: the same in each run, whatever other files there are."""
        return self.scenario.path.resolve(), self.seed


def find_scenarios(paths: Sequence[Path]) -> list[Path]:
    """Return the files among ``paths`` and the scenario files of the folders, in order; raise ConfigError, CliError."""
    found: dict[Path, Path] = {}
    for path in paths:
        if not path.exists():
            raise missing_error(path, is_scenario)
        for file in _in_folder(path) if path.is_dir() else (path,):
            found.setdefault(file.resolve(), file)
    if not found:
        where = ", ".join(map(str, paths))
        raise CliError(f"{where}: no scenario here: a scenario is a TOML file with a table [expect]", USAGE)
    return list(found.values())


def missing_error(path: Path, is_wanted: Callable[[Path], bool]) -> ConfigError:
    """Return the error of a missing file, with the wanted file whose name lacks its suffix or folder, or is like it."""
    name = path.name.removesuffix(".toml")
    folders = (path.parent, Path("missions"), examples_folder())
    found = [{file.stem: file for file in sorted(folder.glob("*.toml"))} for folder in folders]
    places = [stems[name] for stems in found if name in stems]
    places += [stems[near] for stems in found for near in difflib.get_close_matches(name, stems)]
    near = next((place for place in places if is_wanted(place)), None)
    hint = "" if near is None else f"; did you mean {near}?"
    return ConfigError(path, "", f"there is no such file or folder{hint}")


def _in_folder(folder: Path) -> Iterator[Path]:
    for here, folders, files in os.walk(folder):
        folders[:] = sorted(name for name in folders if name not in _SKIPPED and not name.startswith("."))
        yield from (path for name in sorted(files) if is_scenario(path := Path(here, name)))


def select(
    files: Sequence[Path], expression: str | None = None, seed: int | None = None, repeat: int | None = None
) -> list[Case]:
    """Read every file and return the flights, by file and seed; raise ConfigError, CliError.

    ``expression`` selects by name; ``seed`` and ``repeat`` replace those of the files.
    """
    labels = _labels(files)
    is_selected = Selector(expression or "")
    cases = []
    for scenario, label in ((load_scenario(file), labels[file]) for file in files):
        if is_selected(label):
            first = scenario.seed if seed is None else seed
            count = scenario.repeat if repeat is None else repeat
            cases += [
                Case(scenario, number, label, repeat_command(scenario, number))
                for number in range(first, first + count)
            ]
    if not cases:
        raise CliError(f"-k {expression}: matches none of {', '.join(labels.values())}", USAGE)
    return cases


def _labels(files: Sequence[Path]) -> dict[Path, str]:
    """Return the stem of each file, or its path below the common folder if another file has the same stem."""
    counts = Counter(file.stem for file in files)
    top = os.path.commonpath([file.resolve().parent for file in files])
    below = {file: file.resolve().relative_to(top).as_posix().removesuffix(".toml") for file in files}
    return {file: file.stem if counts[file.stem] == 1 else below[file] for file in files}


_WORD = re.compile(r"""'[^']*'|"[^"]*"|[^\s()]+""")
_OPERATORS = ("and", "or", "not")


class Selector:
    """An expression over names as that of pytest's ``-k``: parts of names with ``and``, ``or``, ``not`` and brackets.

    A part has any characters but blanks and brackets, or stands in quotes.

    >>> Selector("square and not in-wind")("square"), Selector("square and not in-wind")("square-in-wind")
    (True, False)
    """

    def __init__(self, text: str) -> None:
        """Raise CliError (usage) for an expression with an error."""
        self._parts: list[str] = []
        try:
            source = _WORD.sub(self._operand, text).strip()
            self._tree = ast.parse(source, mode="eval").body if source else None
            self("")
        except (SyntaxError, ValueError):
            problem = "must be parts of names, joined by and, or, not and brackets"
            raise CliError(f"-k {text}: {problem}", USAGE) from None

    def _operand(self, word: re.Match[str]) -> str:
        """Return an operator as it is, and the name of a variable for a part."""
        if word[0] in _OPERATORS:
            return word[0]
        self._parts.append(word[0].strip("'\"").lower())
        return f"part{len(self._parts) - 1}"

    def __call__(self, name: str) -> bool:
        """Return True if the expression selects a name."""
        return self._tree is None or self._matches(self._tree, name.lower())

    def _matches(self, node: ast.expr, name: str) -> bool:
        if isinstance(node, ast.Name):
            return self._parts[int(node.id.removeprefix("part"))] in name
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            return not self._matches(node.operand, name)
        if isinstance(node, ast.BoolOp):
            found = [self._matches(part, name) for part in node.values]
            return all(found) if isinstance(node.op, ast.And) else any(found)
        raise ValueError("-k")
