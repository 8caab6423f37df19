"""What a command prints when an OSError ends it."""

from __future__ import annotations

import errno
import io

import pytest

from flightstack.console import report_os_error
from sim_bridge import __main__ as sim_bridge


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
    assert sim_bridge.main([]) == 1
    assert capsys.readouterr().err == "sim-bridge: model.xml: No such file or directory\n"
