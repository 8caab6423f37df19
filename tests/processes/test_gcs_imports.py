"""Help, completion and commands are quick because they import only what they use."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from unittest.mock import MagicMock

import pytest

from flightstack.process.supervised import PreparedPrograms
from gcs_cli import program
from gcs_cli.__main__ import main
from gcs_cli.commands.lazy_group import LazyGroup
from gcs_cli.commands.registry import (
    FenceGroup,
    GcsGroup,
    LogGroup,
    MissionGroup,
    ParamGroup,
    PilGroup,
    RallyGroup,
)
from gcs_cli.fly import processes
from gcs_cli.fly.processes import prepare
from gcs_cli.program import run
from tests.support.sample_logs import small_tlog, small_ulog

HEAVY = ("numpy", "numba", "scipy", "matplotlib", "pyulog", "pymavlink", "rich", "jinja2", "plotly")
LIGHT = (
    "flightstack.core",
    "flightstack.core.errors",
    "flightstack.process",
    "flightstack.process.collection",
    "flightstack.process.command_line",
    "flightstack.process.console",
    "flightstack.process.interrupts",
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


def test_help_of_gcs_imports_no_command_line_library() -> None:
    code = (
        "import sys, gcs_cli.__main__; gcs_cli.__main__.main(['--help']); assert 'typer' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL)


@pytest.mark.parametrize("columns", ["60", "80", "200"])
def test_help_of_gcs_fits_the_terminal(
    columns: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    assert main(["--help"]) == run(["--help"]) == 0
    printed = capsys.readouterr().out
    assert printed[: len(printed) // 2] == printed[len(printed) // 2 :]
    assert max(map(len, printed.splitlines())) < int(columns)


def completions(line: str, *, checks: bool = True) -> list[str]:
    """Return the completions of bash; with ``checks``, nothing heavy is imported for them."""
    words = {"_GCS_COMPLETE": "complete_bash", "COMP_WORDS": line, "COMP_CWORD": str(line.count(" "))}
    if checks:
        return output_of(**words).splitlines()
    command = [sys.executable, "-m", "gcs_cli"]
    return subprocess.run(
        command, capture_output=True, text=True, check=True, env={**os.environ, **words}
    ).stdout.splitlines()


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
    assert completion in completions(line)


@pytest.mark.parametrize(
    ("line", "completion"),
    [
        ("gcs param get mpc_xy_cr", "mpc_xy_cruise"),
        ("gcs param set MPC_XY_CR", "MPC_XY_CRUISE"),
        ("gcs mode al", "altitude"),
        ("gcs mode alt_", "alt_hold"),
        ("gcs listen ATTITUDE_Q", "ATTITUDE_QUATERNION"),
        ("gcs send command_l", "command_long"),
    ],
)
def test_values_are_completed(line: str, completion: str) -> None:
    assert completion in completions(line, checks=False)


LIBRARIES = (
    "numpy",
    "numpy.ma",
    "numba",
    "scipy",
    "matplotlib",
    "pyulog",
    "rich",
    "jinja2",
    "plotly",
    "textual",
    "serial",
    "pandas",
)
"""Libraries that a command about a vehicle does not use; a serial port is opened with pyserial."""

USED: dict[str, set[str]] = {
    "mission.new": {"numpy"},
    "log.file": {"numpy", "pyulog"},
    "log.plot": {"numpy", "pyulog", "rich", "jinja2"},
    "log.draw": {"numpy", "pyulog"},
    "replay": {"numpy", "pyulog"},
    "report": {"numpy", "pyulog", "jinja2"},
    "compare": {"numpy", "pyulog", "jinja2", "rich"},
    "estimate": {"numpy", "pyulog", "jinja2"},
    "watch": {"rich"},
}
"""Libraries that a command imports at once, because it uses them always."""


def modules_of(group: type[LazyGroup] = GcsGroup) -> set[str]:
    own = {command.module for command in group.lazy.values()}
    parts = (MissionGroup, FenceGroup, RallyGroup, ParamGroup, LogGroup, PilGroup)
    return own.union(*(modules_of(part) for part in parts)) if group is GcsGroup else own


def loaded_by(code: str, *arguments: str) -> set[str]:
    """Return the libraries that a Python program has imported at its end."""
    ending = f"import sys; print('loaded', *[n for n in {LIBRARIES!r} if n in sys.modules], file=sys.stderr)"
    command = [sys.executable, "-c", f"{code}\n{ending}", *arguments]
    result = subprocess.run(command, capture_output=True, text=True, check=True)
    return set(result.stderr.splitlines()[-1].split()[1:])


@pytest.mark.parametrize("module", sorted(modules_of()))
def test_command_imports_only_what_it_uses(module: str) -> None:
    assert loaded_by(f"import {module}") == USED.get(module.removeprefix("gcs_cli.commands."), set())


@pytest.mark.parametrize("module", ["gcs_cli.fly.fly_run", "gcs_cli.sim.sim_run"])
def test_checks_before_a_flight_need_no_compiler(module: str) -> None:
    code = f"import {module}; from sim_bridge.command import check_arguments; check_arguments([])"
    assert not loaded_by(code) & {"numba", "scipy", "jinja2", "plotly"}


@pytest.mark.parametrize("words", [["status"], ["listen", "ATTITUDE"], ["messages"]], ids=" ".join)
def test_link_command_runs_without_numpy(words: list[str], tmp_path: Path) -> None:
    recording = tmp_path / "small.tlog"
    recording.write_bytes(small_tlog())
    code = "import sys; from gcs_cli.__main__ import main; assert main(sys.argv[1:]) == 0"
    assert loaded_by(code, "--connect", str(recording), *words) == set()


@pytest.mark.parametrize("words", [["log", "info"], ["report"]], ids=" ".join)
def test_short_log_is_read_without_a_compiler_and_masked_arrays(words: list[str], tmp_path: Path) -> None:
    log = tmp_path / "small.ulg"
    log.write_bytes(small_ulog())
    code = "import sys; from gcs_cli.__main__ import main; assert main(sys.argv[1:]) == 0"
    assert not loaded_by(code, *words, str(log)) & {"numba", "numpy.ma"}


@pytest.mark.parametrize(
    ("words", "is_started"),
    [
        (["fly", "square"], True),
        (["sim"], True),
        (["fly", "square", "--help"], False),
        (["sim", "-h"], False),
        (["param", "get", "fly"], False),
        ([], False),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else None,
)
def test_simulator_and_flight_stack_start_before_the_command_line_is_imported(
    words: list[str], is_started: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    programs = MagicMock()
    programs.__enter__.return_value = programs
    given: list[object] = []
    monkeypatch.setattr(processes, "prepare", lambda: programs)
    monkeypatch.setattr(program, "run", lambda _words, prepared: given.append(prepared) or 3)
    assert main(words) == 3
    assert given == [programs if is_started else None]
    assert programs.__exit__.called == is_started


def test_programs_that_are_not_used_end_with_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[PreparedPrograms] = []

    def start() -> PreparedPrograms:
        started.append(prepare())
        return started[0]

    monkeypatch.setattr(processes, "prepare", start)
    assert main(["fly", "--no-such-option"]) == 2
    for module in ("flightstack", "sim_bridge"):
        assert started[0].take(module, [], Path(os.devnull)) is None
