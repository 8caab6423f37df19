"""The examples in the help of ``gcs`` are valid command lines."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from typing import Any

import pytest
from typer.main import get_command

from gcs_cli.lazy_group import EXAMPLES, LazyGroup
from gcs_cli.program import app


def commands(group: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[str, Any]]:
    for name, command in group.commands.items():
        if isinstance(command, LazyGroup):
            yield from commands(command, (*path, name))
        else:
            loaded = group.lazy[name].load(name) if name in getattr(group, "lazy", {}) else command
            yield " ".join((*path, name)), loaded


COMMANDS = dict(commands(get_command(app)))


def examples(command: Any) -> list[str]:
    _, _, lines = (command.help or "").partition(EXAMPLES)
    return [line.strip() for line in lines.splitlines() if line.strip()]


@pytest.mark.parametrize("name", ["listen", "messages", "record", "send", "shell", "status"])
def test_help_has_examples(name: str) -> None:
    assert 1 <= len(examples(COMMANDS[name])) <= 3


@pytest.mark.parametrize("line", [line for command in COMMANDS.values() for line in examples(command)])
def test_example_is_a_valid_command_line(line: str) -> None:
    program, *words = shlex.split(line, comments=True)
    assert program == "gcs"
    group: Any = get_command(app)
    context = group.make_context("gcs", words)
    while isinstance(group, LazyGroup):
        name, group, words = group.resolve_command(context, [*context._protected_args, *context.args])
        context = group.make_context(name, words, parent=context)


def test_examples_keep_their_lines(capsys: pytest.CaptureFixture[str]) -> None:
    from gcs_cli.__main__ import main  # noqa: PLC0415

    assert main(["listen", "--help"]) == 0
    assert "  Examples:\n    gcs listen\n    gcs listen ATTITUDE" in capsys.readouterr().out
