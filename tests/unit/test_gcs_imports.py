"""``gcs --help`` and completion are quick because they import nothing heavy."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

HEAVY = ("numpy", "numba", "scipy", "matplotlib", "pyulog", "pymavlink", "rich", "jinja2", "plotly")
LIGHT = (
    "flightstack.core",
    "flightstack.core.errors",
    "flightstack.process",
    "flightstack.process.command_line",
    "flightstack.process.console",
    "flightstack.process.options",
    "flightstack.core.port_numbers",
)
"""Of the flight stack's modules only those that print, or hold words and numbers for the help."""


REPORT = (
    "import atexit, sys;"
    f"atexit.register(lambda: print('loaded:', *[name for name in {HEAVY!r} if name in sys.modules],"
    f"*[name for name in sys.modules if name.startswith('flightstack.') and name not in {LIGHT!r}], file=sys.stderr));"
    "sys.argv = ['gcs', *sys.argv[1:]]; from gcs_cli.__main__ import main; main()"
)


def output_of(*arguments: str, **environment: str) -> str:
    result = subprocess.run(
        [sys.executable, "-c", REPORT, *arguments],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, **environment},
    )
    assert result.stderr.strip() == "loaded:"
    return result.stdout


@pytest.mark.parametrize(
    "words", [[], ["param"], ["pil"], ["fly"], ["sim"], ["log"], ["test"], ["pil", "fly"]], ids=" ".join
)
def test_help_imports_nothing_heavy(words: list[str]) -> None:
    assert f"Usage: {' '.join(['gcs', *words])}" in output_of(*words, "--help")


@pytest.mark.parametrize(
    ("line", "completion"),
    [
        ("gcs ", "takeoff"),
        ("gcs param ", "diff"),
        ("gcs fly --w", "--wind"),
        ("gcs fly sq", "square"),
        ("gcs pil fly --c", "--controller"),
        ("gcs paper --no-", "--no-pil"),
    ],
)
def test_completion_imports_nothing_heavy(line: str, completion: str) -> None:
    shell = {"_GCS_COMPLETE": "complete_bash", "COMP_WORDS": line, "COMP_CWORD": str(line.count(" "))}
    assert completion in output_of(**shell).splitlines()


LATE = (
    "numba",
    "scipy",
    "matplotlib",
    "pyulog",
    "rich.console",
    "jinja2",
    "plotly",
    "textual",
    "serial",
)
"""Libraries that a command about messages does not use; a serial port is opened with the last one."""


@pytest.mark.parametrize(
    "module",
    [
        f"gcs_cli.commands.{name}"
        for name in ("actions", "status", "messages", "listen", "send", "record", "shell")
    ],
)
def test_command_imports_only_the_link(module: str) -> None:
    code = f"import sys, {module}; print(*[name for name in {LATE!r} if name in sys.modules])"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == ""
