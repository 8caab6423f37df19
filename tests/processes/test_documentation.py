"""The commands of the documentation run as the pages say, each page in an empty directory."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from flightstack.testing.instances import free_instance
from tests.support import commands
from tests.support.console_blocks import Command, File, Skipped, shows, steps
from tests.support.plugin_run import PLUGIN
from tests.support.programs import Program
from tests.support.tools import NIGHTLY
from tests.support.warm_children import warm_children

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGES = sorted(page for folder in ("start", "tutorials", "how-to") for page in (DOCS / folder).glob("*.md"))
BY_NIGHT = {"campaigns", "faults", "pil", "scripts", "sensors"}
"""Pages whose commands take 10 to 30 s each."""
SKIPPED = {
    "install.md": 3,
    "first-flight.md": 2,
    "controller.md": 2,
    "mission-tests.md": 1,
    "qgroundcontrol-mavsdk.md": 1,
    "pil.md": 4,
    "compare.md": 1,
    "faults.md": 1,
    "film.md": 1,
    "logs.md": 2,
    "sim.md": 1,
    "connect.md": 1,
    "watch.md": 1,
}
"""Number of blocks that a page marks as not to be run; 0 for any other page."""
MODULES = {"sim-bridge": "sim_bridge", "flightstack": "flightstack", "gcs": "gcs_cli"}
IN_PROCESS = {
    "gcs": commands.gcs,
    "flightstack": commands.flightstack_command,
    "sim-bridge": commands.sim_bridge_command,
}


class Reader:
    """Does what a page says, on ports of its own."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._instance = str(free_instance())
        self._beside: list[Program] = []
        self._last = commands.Ended("", "", 0)
        self.skipped = 0

    def follow(self, page: Path) -> None:
        """Do every step of the page; raise AssertionError where it differs from the page."""
        try:
            for step in steps(page):
                if isinstance(step, Skipped):
                    self.skipped += 1
                elif isinstance(step, File):
                    (self._folder / step.name).write_text(step.text, encoding="utf-8")
                elif step.runs_beside:
                    self._start(step)
                else:
                    self._run(step)
            self._end()
        finally:
            for program in self._beside:
                program.kill()

    def _start(self, command: Command) -> None:
        program, *arguments = command.arguments
        arguments += ["--instance", self._instance]
        self._beside.append(Program(MODULES[program], arguments, self._folder, joins_output=True))
        if program == "gcs":  # gcs sim
            while "Ctrl-C ends" not in (line := self._beside[-1].stdout.readline()):
                assert line, "gcs sim ended at its start"
        else:
            self._beside[-1].stdout.readline()  # written once its ports are open

    def _run(self, command: Command) -> None:
        if command.arguments == ["echo", "$?"]:
            assert command.shown == [str(self._last.returncode)]
            self._last = commands.Ended("", "", 0)
            return
        assert self._last.returncode == 0, f"{self._last.stdout}{self._last.stderr}"
        self._last = self._result(command.arguments)
        output = self._last.stdout + self._last.stderr
        for line in command.shown:
            assert shows(output, line), f"{command.arguments}: {line!r} is not in\n{output}"

    def _result(self, arguments: list[str]) -> commands.Ended:
        program, *rest = arguments
        if program == "pytest":
            tests = Program("pytest", [*PLUGIN, *rest], self._folder, imports=["pytest"])
            return commands.Ended(*tests.communicate(), tests.wait())
        if program == "python":
            done = subprocess.run([sys.executable, *rest], capture_output=True, text=True, check=False)
            return commands.Ended(done.stdout, done.stderr, done.returncode)
        if program == "gcs":
            starts_processes = rest[0] == "fly" or (
                rest[0] == "pil" and rest[1] not in ("doctor", "replay", "vectors")
            )
            own = ["--instance", self._instance]
            rest = rest + own if starts_processes else [*own, "--timeout", "60", *rest]
        return IN_PROCESS[program](*rest)

    def _end(self) -> None:
        """Interrupt the vehicle; the simulator, which serves one vehicle, ends after it."""
        for program in reversed(self._beside):
            if program.args[0] != "sim_bridge":
                program.send_signal(signal.SIGINT)
            output, _ = program.communicate()
            assert program.returncode == 0, output
        assert self._last.returncode == 0, f"{self._last.stdout}{self._last.stderr}"


@pytest.mark.parametrize(
    "page", [page for page in PAGES if NIGHTLY or page.stem not in BY_NIGHT], ids=lambda page: page.stem
)
def test_commands_of_a_page_run_as_shown(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    reader = Reader(tmp_path)
    with warm_children():
        reader.follow(page)
    assert reader.skipped == SKIPPED.get(page.name, 0)
