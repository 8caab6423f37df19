"""A signal becomes a KeyboardInterrupt that no import and no finalizer loses, and never replaces the exit code."""

from __future__ import annotations

import importlib
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from flightstack.process.interrupts import signals

INTERRUPTED_CLASS = """
import os, signal

class Named:
    def __set_name__(self, owner, name):
        os.kill(os.getpid(), signal.SIGINT)

class Owner:
    named = Named()

complete = True
"""


class Finalized:
    """Interrupts the process when it is deleted."""

    def __del__(self) -> None:
        os.kill(os.getpid(), signal.SIGINT)


def wait_for_signals() -> None:
    """Wait until a signal raises."""
    while True:
        signal.pause()


def test_an_interrupted_import_is_completed_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "interrupted_module.py").write_text(INTERRUPTED_CLASS)
    monkeypatch.syspath_prepend(tmp_path)
    signals.catch()
    with pytest.raises(KeyboardInterrupt):
        importlib.import_module("interrupted_module")
    assert sys.modules.pop("interrupted_module").complete


def test_an_interrupt_that_a_class_would_change_is_repeated() -> None:
    signals.catch()
    with pytest.raises(KeyboardInterrupt):  # noqa: PT012
        exec(INTERRUPTED_CLASS, {"__name__": "executed"})
        wait_for_signals()


def test_an_ignored_interrupt_is_repeated(capsys: pytest.CaptureFixture[str]) -> None:
    signals.catch()
    with pytest.raises(KeyboardInterrupt):  # noqa: PT012
        Finalized()
        wait_for_signals()
    assert capsys.readouterr().err == ""


def exit_of(program: str, modules: Path | None = None) -> tuple[str, int]:
    """Return stderr and exit code of a program that interrupts itself with ``hit``."""
    begin = (
        "import atexit, os, signal, sys, threading\n"
        "from flightstack.process.interrupts import report, signals\n"
        "def hit(number=signal.SIGINT): os.kill(os.getpid(), number)\n"
    )
    path = os.pathsep.join(filter(None, [str(modules or ""), os.environ.get("PYTHONPATH", "")]))
    done = subprocess.run(
        [sys.executable, "-c", begin + program],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": path},
    )
    return done.stderr, done.returncode


def test_an_interrupted_exec_does_not_replace_the_exit_code() -> None:
    program = (
        "try: exec('raise KeyboardInterrupt')\n"
        "except KeyboardInterrupt: report('stopped'); sys.exit(signals.end_with(0))"
    )
    assert exit_of(program) == ("stopped\n", 0)


LATE = {
    "exit function": "atexit.register(hit, NUMBER)",
    "last thread": "threading.Thread(target=lambda: (threading.main_thread().join(), hit(NUMBER))).start()",
    "end of the interpreter": "sys.last = type('Late', (), {'__del__': lambda self, hit=hit: hit(NUMBER)})()",
}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGALRM], ids=["SIGINT", "SIGALRM"])
@pytest.mark.parametrize("late", LATE.values(), ids=LATE)
def test_a_signal_at_the_end_does_not_replace_the_exit_code(late: str, number: int) -> None:
    """SIGALRM ends the wait for an import."""
    late = late.replace("NUMBER", str(int(number)))
    assert exit_of(f"signals.catch(); {late}; sys.exit(signals.end_with(130))") == ("", 130)


def test_a_signal_that_still_waits_at_the_end_does_not_replace_the_exit_code(tmp_path: Path) -> None:
    (tmp_path / "ending.py").write_text(
        "import os, signal, sys\n"
        "from flightstack.process.interrupts import signals\n"
        "os.kill(os.getpid(), signal.SIGINT)\n"
        "sys.exit(signals.end_with(3))\n"
    )
    assert exit_of("signals.catch(); import ending", tmp_path) == ("", 3)


def test_a_signal_during_an_import_raises_before_the_next_call(tmp_path: Path) -> None:
    """A short program ended before the signal was raised, with exit code 0."""
    (tmp_path / "interrupted_module.py").write_text(INTERRUPTED_CLASS)
    program = (
        "signals.catch()\n"
        "try: import interrupted_module; str(); report('too late')\n"
        "except KeyboardInterrupt: report(interrupted_module.complete)"
    )
    assert exit_of(program, tmp_path) == ("True\n", 0)


@pytest.mark.parametrize("hits", [1, 2])
def test_an_import_that_hangs_is_interrupted(hits: int, tmp_path: Path) -> None:
    """By a second signal, or after a second."""
    (tmp_path / "hanging.py").write_text(
        "import os, signal\n"
        + "os.kill(os.getpid(), signal.SIGINT)\n" * hits
        + "while True: signal.pause()\n"
    )
    program = "signals.catch()\ntry: import hanging\nexcept KeyboardInterrupt: report('stopped')"
    assert exit_of(program, tmp_path) == ("stopped\n", 0)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=["SIGINT", "SIGTERM"])
def test_an_ignored_signal_stays_ignored(number: int) -> None:
    """As SIGINT in a background job of a shell."""
    program = (
        f"signal.signal({number:d}, signal.SIG_IGN); signals.catch(); hit({number:d})\n"
        f"code = signals.end_with(3); hit({number:d}); report('goes on'); sys.exit(code)"
    )
    assert exit_of(program) == ("goes on\n", 3)


def test_a_second_interrupt_does_not_replace_the_report() -> None:
    program = (
        "class Output:\n"
        "    def write(self, text): hit(); return sys.__stderr__.write(text)\n"
        "    def flush(self): sys.__stderr__.flush()\n"
        "signals.catch()\n"
        "try: hit(); signal.pause()\n"
        "except KeyboardInterrupt:\n"
        "    signals.reported = True\n"
        "    sys.stderr = Output(); report('interrupted'); sys.exit(signals.end_with(130))"
    )
    assert exit_of(program) == ("interrupted\n", 130)


COMMAND = """
import os, signal, sys
import gcs_cli.__main__, gcs_cli.output, gcs_cli.program

def hit(): os.kill(os.getpid(), signal.SIGINT)

def complain(line, printed=gcs_cli.output.complain): printed(line); hit()

def app(*_, **__): eval("(hit(), signal.pause())")

gcs_cli.output.complain, gcs_cli.program.app = complain, app
sys.exit(gcs_cli.__main__.main(["status", "--json"]))
"""


def test_a_second_interrupt_of_a_command_is_not_reported() -> None:
    """There were two sentences and two JSON objects; after an interrupted `eval`, Python ended with the signal."""
    done = subprocess.run([sys.executable, "-c", COMMAND], capture_output=True, text=True, check=False)
    assert (done.stderr, done.stdout.count("interrupted"), done.returncode) == ("gcs: interrupted\n", 1, 130)


MAINS = {
    "gcs_cli": ("gcs_cli.program.run", 130, "gcs: interrupted"),
    "flightstack": ("flightstack.process.command.run_command", 0, "flightstack: stopped"),
    "sim_bridge": ("sim_bridge.command.run_command", 0, "sim-bridge: stopped"),
}


@pytest.mark.parametrize("package", MAINS)
@pytest.mark.parametrize("place", ["catch", "end_with"])
def test_an_interrupt_around_the_command_gives_no_traceback(package: str, place: str) -> None:
    function, code, said = MAINS[package]
    module, _, name = function.rpartition(".")
    program = (
        f"import {package}.__main__, {module}; {module}.{name} = lambda *_: 5\n"
        "def profile(frame, event, _):\n"
        f"    if event == ('return' if '{place}' == 'catch' else 'call') and frame.f_code.co_name == '{place}':\n"
        "        sys.setprofile(None); hit()\n"
        f"sys.argv = ['x']; sys.setprofile(profile); sys.exit({package}.__main__.main())"
    )
    assert exit_of(program) == ((f"{said}\n", code) if place == "catch" else ("", 5))
