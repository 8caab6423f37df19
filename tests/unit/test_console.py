"""What a process prints, and where it cannot."""

from __future__ import annotations

import errno
import importlib
import io
import os
import sys
import webbrowser
from pathlib import Path
from unittest.mock import Mock

import pytest

from flightstack.process import console
from flightstack.process.console import report_os_error
from gcs_cli.fly.fly_display import FlyConsole
from gcs_cli.output import show_page
from sim_bridge import command as sim_bridge
from tests.support.commands import flightstack_command, sim_bridge_command


class Output(io.TextIOWrapper):
    """Stands for stdout that can encode Latin-1 only."""

    def __init__(self) -> None:
        super().__init__(io.BytesIO(), encoding="latin-1")

    def written(self) -> bytes:
        assert isinstance(self.buffer, io.BytesIO)
        return self.buffer.getvalue()


def test_an_unencodable_character_is_replaced(monkeypatch: pytest.MonkeyPatch) -> None:
    output = Output()
    monkeypatch.setattr(sys, "stdout", output)
    console.replace_unencodable()
    assert console.say("yaw ψ = 30°") is None
    assert console.say("next line") is None
    assert output.written() == b"yaw ? = 30\xb0\nnext line\n"


def test_an_encoding_error_does_not_drop_the_output(monkeypatch: pytest.MonkeyPatch) -> None:
    output = Output()
    monkeypatch.setattr(sys, "stdout", output)
    monkeypatch.setattr(console, "drop", lambda _: pytest.fail("the output is dropped"))
    with pytest.raises(UnicodeEncodeError):
        console.say("ψ")
    assert console.say("next line") is None
    assert output.written() == b"next line\n"


def test_a_closed_output_is_an_error_that_is_returned(monkeypatch: pytest.MonkeyPatch) -> None:
    output = Output()
    output.close()
    monkeypatch.setattr(sys, "stdout", output)
    assert isinstance(console.say("line"), ValueError)


def test_lost_output_is_raised_once_at_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    with Path("/dev/full").open("w") as full:
        monkeypatch.setattr(sys, "stdout", full)
        console.check_output()
        FlyConsole().print("figures")
        assert console.say("line") is None  # to /dev/null
        with pytest.raises(OSError, match="No space left on device"):
            console.check_output()
        console.check_output()


def test_lost_output_of_stderr_or_a_closed_pipe_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    with Path("/dev/full").open("w") as full, os.fdopen(writer, "w") as pipe:
        monkeypatch.setattr(sys, "stderr", full)
        monkeypatch.setattr(sys, "stdout", pipe)
        console.complain("line")
        assert isinstance(console.say("line"), BrokenPipeError)
        FlyConsole().print("figures")
        FlyConsole(stderr=True).print("figures")
        console.check_output()


def test_an_os_error_names_its_file(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stdout", io.StringIO())
    assert report_os_error("flightstack", PermissionError(errno.EACCES, "Permission denied", "a.log")) == 1
    assert capsys.readouterr().err == "flightstack: a.log: Permission denied\n"


def test_an_os_error_without_file_or_output_is_raised() -> None:
    with pytest.raises(OSError, match="Bad address"):
        report_os_error("flightstack", OSError(errno.EFAULT, "Bad address"))


def test_an_error_of_the_output_is_one_sentence(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stdout", io.StringIO())
    assert report_os_error("flightstack", OSError(errno.ENOSPC, "No space left on device")) == 1
    assert capsys.readouterr().err == "flightstack: No space left on device\n"


def test_the_simulator_names_the_file_that_ends_it(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object, **__: object) -> None:
        raise FileNotFoundError(errno.ENOENT, "No such file or directory", "model.xml")

    monkeypatch.setattr(sim_bridge, "app", fails)
    monkeypatch.setattr("sys.stdout", io.StringIO())
    assert sim_bridge.run_command([]) == 1
    assert capsys.readouterr().err == "sim-bridge: model.xml: No such file or directory\n"


@pytest.mark.parametrize("program", ["flightstack.process.program", "flightstack.process.command"])
def test_an_interrupted_start_of_the_flight_stack_is_an_orderly_end(
    program: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While it imports, compiles or loads kernels it ended with 130, and without a sentence."""
    interrupt_use(program, monkeypatch)
    assert flightstack_command("--state-dir", "none") == ("", "flightstack: stopped\n", 0)


@pytest.mark.parametrize("program", ["sim_bridge.program", "sim_bridge.command"])
@pytest.mark.parametrize(
    ("words", "said", "code"),
    [((), "stopped", 0), (("open-loop", "--rotors=1,1,1,1", "--seconds=1"), "interrupted", 130)],
)
def test_an_interrupted_start_of_the_simulator_is_reported(
    program: str, words: tuple[str, ...], said: str, code: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    interrupt_use(program, monkeypatch)
    assert sim_bridge_command(*words) == ("", f"sim-bridge: {said}\n", code)


def test_an_interrupted_check_of_the_simulator_is_not_a_passed_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """`gcs sim` and `gcs fly` went on and ignored a Ctrl-C during it."""
    interrupt_use("sim_bridge.program", monkeypatch)
    with pytest.raises(KeyboardInterrupt):
        sim_bridge.check_arguments([])


def test_a_log_that_cannot_be_written_is_refused_at_the_start(tmp_path: Path) -> None:
    """The flight stack flew without it, and said so when it armed."""
    (tmp_path / "file").touch()
    log = tmp_path / "file" / "flight.ulg"
    ended = flightstack_command("--log", log, "--state-dir", "none", "--params", "none")
    assert ended == ("", f"flightstack: {log}: cannot be written: Not a directory\n", 2)


def interrupt_use(module: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the use of a module, which another test may have imported, raise KeyboardInterrupt."""
    package, _, name = module.rpartition(".")
    monkeypatch.setitem(sys.modules, module, Interrupting())
    monkeypatch.delattr(importlib.import_module(package), name, raising=False)


class Interrupting:
    """A module whose import is interrupted."""

    def __getattr__(self, name: str) -> object:
        raise KeyboardInterrupt


@pytest.mark.parametrize("found", [True, False])
def test_page_is_named_without_a_browser(
    found: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page, shown = tmp_path / "report.html", Mock(return_value=found)
    monkeypatch.setattr(webbrowser, "open", shown)
    show_page(page)
    shown.assert_called_once_with(page.as_uri())
    said = "" if found else f"gcs: --open: there is no browser; the page is {page}\n"
    assert capsys.readouterr() == ("", said)
