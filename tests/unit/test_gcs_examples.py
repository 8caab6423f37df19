"""The examples in the help of ``gcs`` are valid command lines."""

from __future__ import annotations

import functools
import re
import shlex
from collections.abc import Iterator
from typing import Any

import pytest
from typer import Context
from typer.main import get_command

import flightstack.process.command
import sim_bridge.command
from gcs_cli.__main__ import main
from gcs_cli.commands.examples import EXAMPLES
from gcs_cli.commands.lazy_group import LazyGroup
from gcs_cli.program import app


def commands(group: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[str, Any]]:
    for name, command in group.commands.items():
        words = " ".join((*path, name))
        if isinstance(command, LazyGroup):
            yield from commands(command, (*path, name))
        elif not command.hidden:
            yield words, group.lazy[name].load(words) if name in getattr(group, "lazy", {}) else command


@functools.cache
def all_commands() -> dict[str, Any]:
    """Return every command by its words; loading all takes a second."""
    return dict(commands(get_command(app)))


def test_examples_are_those_of_the_commands() -> None:
    assert set(EXAMPLES) == set(all_commands())


def test_help_names_the_value_of_each_option() -> None:
    """Typer shows the type, as in ``<int range>``, of an option without a name of its value."""
    simulator = get_command(sim_bridge.command.app)
    every = {**all_commands(), **simulator.commands, "sim-bridge": simulator}
    every["flightstack"] = get_command(flightstack.process.command.app)
    unnamed = [
        f"{name} {record[0]}"
        for name, command in every.items()
        for option in command.params
        if option.param_type_name == "option"
        and (record := option.get_help_record(Context(command)))
        and re.search(r"<(?!.*\|)", record[0])
    ]
    assert unnamed == []


@pytest.mark.parametrize("name", EXAMPLES)
def test_help_ends_with_examples(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    lines = EXAMPLES[name]
    assert 1 <= len(lines) <= 3
    assert main([*name.split(), "--help"]) == 0
    ending = ["  Examples:", *(f"    {line}" for line in lines)]
    assert capsys.readouterr().out.rstrip().splitlines()[-len(ending) :] == ending


@pytest.mark.parametrize(
    ("name", "line"), [(name, line) for name, lines in EXAMPLES.items() for line in lines]
)
def test_example_is_a_valid_command_line(name: str, line: str) -> None:
    program, *words = shlex.split(line)
    assert program == "gcs"
    group: Any = get_command(app)
    context = group.make_context("gcs", words)
    path = []
    while isinstance(group, LazyGroup):
        word, group, words = group.resolve_command(context, [*context._protected_args, *context.args])
        path.append(word)
        context = group.make_context(word, words, parent=context)
    assert " ".join(path) == name


def test_help_of_command_that_asks_names_its_option() -> None:
    asking = {n: each.help for n, each in all_commands().items() if any(p.name == "yes" for p in each.params)}
    assert len(asking) > 2
    assert [name for name, text in asking.items() if "--yes" not in text] == []


def test_negative_number_needs_no_separator() -> None:
    assert not [line for lines in EXAMPLES.values() for line in lines if " -- " in line]
