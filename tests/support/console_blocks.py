"""The console blocks of the documentation, as data: commands with the output lines that a page shows.

A fence ``console`` holds ``$ `` lines and output. Its title, if it has one, says that it is not simply run:
``Needs …`` for what a test run cannot have, ``Terminal N: …`` for a program that runs beside the commands after it. A
fence whose title is a file name is a file that the reader writes.
"""

from __future__ import annotations

import math
import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

_FENCE = re.compile(r'^```(\w+)(?: title="([^"]*)")?\n(.*?)^```$', re.MULTILINE | re.DOTALL)
_FIGURE = re.compile(r"(?<![\w.])(-?\d+\.\d+)(?![\w.])")
_FIGURE_GROUP = r"(-?\d+\.\d+)"
_FILE_NAME = re.compile(r"[\w.-]+\.\w+")


class Command(NamedTuple):
    """A command and the lines that the page shows below it; ``…`` stands for any text."""

    arguments: list[str]
    shown: list[str]
    runs_beside: bool = False


class File(NamedTuple):
    """A file that the reader writes."""

    name: str
    text: str


class Skipped(NamedTuple):
    """A block that a test run cannot execute, with the reason that the page gives."""

    reason: str


def steps(page: Path) -> Iterator[Command | File | Skipped]:
    """Yield what a reader of the page does, in order."""
    for language, title, text in _FENCE.findall(page.read_text(encoding="utf-8")):
        if title.startswith("Needs"):
            yield Skipped(title)
        elif _FILE_NAME.fullmatch(title):
            yield File(title, text)
        elif language == "console":
            yield from _commands(text, runs_beside=title.startswith("Terminal"))


def _commands(text: str, runs_beside: bool) -> Iterator[Command]:
    for part in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
        line, *shown = part.rstrip("\n").split("\n")
        yield Command(shlex.split(line), shown, runs_beside)


def shows(output: str, line: str) -> bool:
    """Return True if a line of the output contains the parts of ``line`` between its ``…``, in order.

    A number with a decimal point is a measured figure: it may differ by a quarter or by 0.2, because a change of any
    part that flies moves it a little.
    """
    *texts, last = _FIGURE.split(line.strip())
    pattern = re.compile(_FIGURE_GROUP.join(_with_gaps(text) for text in [*texts[::2], last]))
    figures = [float(figure) for figure in texts[1::2]]
    return any(
        all(
            math.isclose(float(seen), shown, rel_tol=0.25, abs_tol=0.2)
            for seen, shown in zip(groups, figures, strict=True)
        )
        for each in output.splitlines()
        for groups in (found.groups() for found in pattern.finditer(each))
    )


def _with_gaps(text: str) -> str:
    return ".*".join(map(re.escape, text.split("…")))
