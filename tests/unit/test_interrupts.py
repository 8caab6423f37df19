"""A signal becomes a KeyboardInterrupt that no import and no finalizer loses, and never replaces the exit code."""

from __future__ import annotations

import importlib
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from flightstack.process import interrupts

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
    interrupts.Interrupts()
    with pytest.raises(KeyboardInterrupt):  # noqa: PT012  # the signal may come at once or later
        imported = importlib.import_module("interrupted_module")
        wait_for_signals()
    assert imported.complete


def test_an_interrupt_that_a_class_would_change_is_repeated() -> None:
    interrupts.Interrupts()
    with pytest.raises(KeyboardInterrupt):  # noqa: PT012
        exec(INTERRUPTED_CLASS, {"__name__": "executed"})
        wait_for_signals()


def test_an_ignored_interrupt_is_repeated(capsys: pytest.CaptureFixture[str]) -> None:
    interrupts.Interrupts()
    with pytest.raises(KeyboardInterrupt):  # noqa: PT012
        Finalized()
        wait_for_signals()
    assert capsys.readouterr().err == ""


def exit_of(program: str) -> tuple[str, int]:
    """Return stderr and exit code of a program that interrupts itself with ``hit``."""
    begin = (
        "import atexit, os, signal, sys, threading\n"
        "from flightstack.process import interrupts\n"
        "def hit(): os.kill(os.getpid(), signal.SIGINT)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", begin + program], capture_output=True, text=True, check=False
    )
    return done.stderr, done.returncode


def test_an_interrupted_exec_does_not_replace_the_exit_code() -> None:
    program = (
        "try: exec('raise KeyboardInterrupt')\n"
        "except KeyboardInterrupt: interrupts.report('stopped'); sys.exit(0)"
    )
    assert exit_of(program) == ("stopped\n", 0)


@pytest.mark.parametrize(
    "late",
    [
        "atexit.register(hit)",
        "threading.Thread(target=lambda: (threading.main_thread().join(), hit())).start()",
        "sys.last = type('Late', (), {'__del__': lambda self, hit=hit: hit()})()",
    ],
    ids=["exit function", "last thread", "end of the interpreter"],
)
def test_a_signal_at_the_end_does_not_replace_the_exit_code(late: str) -> None:
    assert exit_of(f"interrupts.Interrupts(); {late}; sys.exit(interrupts.end_with(130))") == ("", 130)


def test_a_second_interrupt_does_not_replace_the_report() -> None:
    program = (
        "class Output:\n"
        "    def write(self, text): hit(); return sys.__stderr__.write(text)\n"
        "    def flush(self): sys.__stderr__.flush()\n"
        "signals = interrupts.Interrupts()\n"
        "try: hit(); signal.pause()\n"
        "except KeyboardInterrupt:\n"
        "    signals.reported = True\n"
        "    sys.stderr = Output(); interrupts.report('interrupted'); sys.exit(interrupts.end_with(130))"
    )
    assert exit_of(program) == ("interrupted\n", 130)
