"""The three commands have one look: plain help with every bracket, ``-h``, ``--version`` and completion."""

from __future__ import annotations

import functools
import re
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import pytest
import typer

import flightstack
from flightstack.process.command import app as flightstack_app
from flightstack.process.command_line import PANELS
from gcs_cli.commands.lazy_group import LazyGroup
from gcs_cli.program import app as gcs_app
from sim_bridge.command import app as sim_bridge_app
from tests.support.commands import flightstack_command, gcs, sim_bridge_command

APPS = {"flightstack": flightstack_app, "gcs": gcs_app, "sim-bridge": sim_bridge_app}
COMMANDS = {"flightstack": flightstack_command, "gcs": gcs, "sim-bridge": sim_bridge_command}
MODULES = {"flightstack": "flightstack", "gcs": "gcs_cli", "sim-bridge": "sim_bridge"}
BRACKETS = re.compile(r"\[[^\]]*\]")


def found() -> Iterator[tuple[str, Any, Any]]:
    """Every command that has a help page: its words, the command, and its context."""
    for name, app in APPS.items():
        command = typer.main.get_command(app)
        waiting = [
            (name, command, command.context_class(command, info_name=name, **command.context_settings))
        ]
        while waiting:
            words, command, context = waiting.pop()
            yield words, command, context
            for part in getattr(command, "commands", ()):
                child = command.resolve_command(context, [part])[1]
                made = child.context_class(child, info_name=part, parent=context, **child.context_settings)
                waiting.append((f"{words} {part}", child, made))


@functools.cache
def pages() -> dict[str, tuple[Any, Any]]:
    """Return command and context of every help page by the words of its command; loading all takes a second."""
    return {words: (command, context) for words, command, context in found()}


def test_summary_of_a_lazy_command_is_that_of_its_help() -> None:
    lazy = [
        (words, name, command)
        for words, (command, _) in pages().items()
        if isinstance(command, LazyGroup)
        for name in command.lazy
    ]
    assert len(lazy) > 20
    for words, name, command in lazy:
        listed, shown = command.commands[name], pages()[f"{words} {name}"][0]
        assert listed.get_short_help_str(200) == shown.get_short_help_str(200), f"{words} {name}"


def one_line(text: str) -> str:
    return " ".join(text.split())


def test_help_shows_every_bracket_of_its_source() -> None:
    for words, (command, context) in pages().items():
        shown = one_line(command.get_help(context))
        for param in command.params:
            if not getattr(param, "hidden", False):
                for bracket in BRACKETS.findall(f"{param.help or ''} {param.metavar or ''}"):
                    assert one_line(bracket) in shown, f"{words} --help drops {bracket}"
        for bracket in BRACKETS.findall(command.help or ""):
            assert bracket in shown, words


def test_help_is_plain_text() -> None:
    for words, (command, context) in pages().items():
        assert command.rich_markup_mode is None, words
        assert not set(command.get_help(context)) & set("╭│╰"), words
        assert list(context.help_option_names) == ["-h", "--help"], words


@pytest.mark.parametrize("words", ["gcs fly", "gcs pil fly", "flightstack", "sim-bridge"])
def test_help_of_many_options_is_grouped(words: str) -> None:
    command, context = pages()[words]
    sections: dict[str, list[str]] = {}
    for line in command.get_help(context).splitlines():
        if re.fullmatch(r"\S.*:", line):
            flags = sections.setdefault(line.rstrip(":"), [])
        elif line.startswith("  -"):
            flags.append(line.split()[0])
    assert [title for title in sections if title in PANELS] == [
        title for title in PANELS if title in sections
    ]
    assert len(sections.keys() & set(PANELS)) >= 4
    assert max(map(len, sections.values())) <= 12
    common = {"-h,", "--version", "--install-completion", "--show-completion", "--check"}
    assert set(sections["Options"]) <= common


def run(program: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    words = [sys.executable, "-m", MODULES[program], *arguments]
    return subprocess.run(words, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("program", APPS)
def test_version_names_the_program(program: str) -> None:
    result = COMMANDS[program]("--version")
    assert (result.returncode, result.stdout) == (0, f"{program} {flightstack.__version__}\n")


@pytest.mark.parametrize("program", APPS)
def test_completion_script_names_the_program(program: str, monkeypatch: pytest.MonkeyPatch) -> None:
    # the shell that is named, not the one that runs the tests
    monkeypatch.setenv("_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION", "1")
    result = run(program, "--show-completion", "bash")
    assert result.returncode == 0, result.stderr
    assert result.stdout.rstrip().endswith(
        f"complete -o default -F _{program.replace('-', '_')}_completion {program}"
    )


@pytest.mark.parametrize("program", APPS)
def test_unknown_option_is_refused_in_one_sentence(program: str) -> None:
    result = run(program, "--no-such-option")
    assert (result.returncode, result.stdout) == (2, "")
    assert re.fullmatch(rf"{program}: No such option: --no-such-option.*\n", result.stderr)


@pytest.mark.parametrize(
    ("command", "words", "name"),
    [("gcs", "campaign", "argument 'FILE'"), ("sim-bridge", "open-loop --seconds 1", "option '--rotors'")],
)
def test_missing_argument_of_a_group_of_options_is_named(command: str, words: str, name: str) -> None:
    ended = COMMANDS[command](*words.split())
    assert ended.returncode == 2
    assert f"Missing {name}" in ended.stderr


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("perf a.tlog", "perf takes no argument a.tlog: give a recording as --connect a.tlog"),
        ("perf b a.tlog", "perf takes no argument b a.tlog"),
        ("param set A 1 2", "param set takes no argument 2"),
        ("sim x", "sim takes no argument x"),
    ],
)
def test_an_argument_too_many_is_named(words: str, said: str) -> None:
    assert gcs(*words.split()) == ("", f"gcs: {said}\n", 2)


def test_an_argument_is_shown_without_braces_and_types() -> None:
    assert "Usage: gcs compare [OPTIONS] RUN RUN...\n" in gcs("compare", "--help").stdout
    assert "Usage: gcs test [OPTIONS] [PATH]...\n" in gcs("test", "--help").stdout
    for words, command, context in found():
        shown = command.get_help(context)
        assert (
            re.findall(r"[{}]|<(?:list|str|path|Path|float|int)\b.*>|\[\[", shown.split("\n\n")[0]) == []
        ), words
        if "Arguments:" in shown:
            assert "<" not in shown.partition("Arguments:\n")[2].split()[1], words
