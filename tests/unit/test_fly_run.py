"""The loop of ``gcs fly``: it exchanges messages while other work is done; refusals before and without a flight."""

from __future__ import annotations

import errno
import json
import sys
import threading
from pathlib import Path
from types import SimpleNamespace

import pytest

from flightstack.core.errors import INSTALL_FIRMWARE, INSTALL_MULTIBODY
from flightstack.firmware.toolchain.build import BuildError
from gcs_cli.__main__ import main
from gcs_cli.errors import FAILED, USAGE
from gcs_cli.fly import fly_results, fly_run
from gcs_cli.fly.flight import Flown, Phase
from gcs_cli.report.flight_outcome import COMPLETED
from tests.support.commands import gcs
from tests.support.sample_logs import small_ulog


def test_results_are_imported_once_beside_the_exchange_of_messages(monkeypatch: pytest.MonkeyPatch) -> None:
    """The vehicle counts simulated time: a pause of 0.2 s is a lost ground station at 50 times real time."""
    importers: list[threading.Thread] = []
    is_imported = threading.Event()

    def import_module(name: str) -> SimpleNamespace:
        importers.append(threading.current_thread())
        return SimpleNamespace(prepare=is_imported.set)

    class Connection:
        now_s, steps = 0.0, 0

        def step(self, until_s: float) -> None:
            if flight.phase is Phase.FLY:
                is_imported.wait()
            self.steps += 1
            flight.phase = Phase.FLY
            flight.is_over = self.steps == 4

    flight = SimpleNamespace(
        is_over=False,
        outcome=None,
        phase=Phase.CONNECT,
        view=SimpleNamespace(powered_off=False),
        step=lambda now_s: None,
    )
    children = SimpleNamespace(ended=list, notices=list)
    monkeypatch.setattr(fly_run, "importlib", SimpleNamespace(import_module=import_module))
    fly_run.run_flight(
        flight,
        Connection(),
        children,
        SimpleNamespace(reason=""),
        SimpleNamespace(update=lambda flight: None),
    )
    assert len(importers) == 1
    assert importers[0] is not threading.main_thread()


def test_full_disk_loses_neither_the_evaluation_nor_that_the_log_is_cut(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    content = small_ulog()
    (tmp_path / "flight.ulg").write_bytes(content[: len(content) // 2])

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    flown = Flown(tmp_path, COMPLETED, 1.0, None, False)
    monkeypatch.setattr(fly_run, "fly", lambda *_: flown)
    monkeypatch.setattr(fly_results, "write_summary", full)
    ended = gcs("fly", "square", "--out", tmp_path)
    failure = f"{tmp_path}: the results cannot be written: No space left on device"
    assert (ended.stderr, ended.returncode) == (f"gcs: {failure}\n", FAILED)
    assert "the mission was flown to its end; the flight log ends early, at 1" in ended.stdout
    assert "tracking rms error 0." in ended.stdout
    ended = gcs("fly", "square", "--out", tmp_path, "--json")
    summary, error = map(json.loads, ended.stdout.splitlines())
    assert "the flight log ends early" in summary["outcome_text"]
    assert error["message"] == failure


def refusal(words: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """Return the sentence that refuses a flight."""
    assert main(["fly", "square", *words]) == USAGE
    printed = capsys.readouterr()
    assert printed.out == ""
    return printed.err


@pytest.mark.parametrize("words", [["--view"], ["--plant", "multibody"]], ids=" ".join)
def test_flight_without_mujoco_is_refused_before_anything_starts(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sim_bridge.arguments.find_spec", lambda _name: None)
    assert refusal(words, capsys).endswith(f" needs MuJoCo: {INSTALL_MULTIBODY}\n")
    assert list(tmp_path.iterdir()) == []


def test_emulated_loops_without_emulator_are_refused_before_anything_starts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "flightstack.firmware.toolchain.cortex_m4", None)
    said = f"gcs: --loops: emulated: unicorn is not installed: {INSTALL_FIRMWARE}\n"
    assert refusal(["--loops", "emulated"], capsys) == said
    assert list(tmp_path.iterdir()) == []


def test_loops_in_c_without_compiler_are_refused_before_anything_starts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)

    def no_compiler() -> None:
        raise BuildError("no C compiler found")

    monkeypatch.setattr("flightstack.firmware.targets.host_compiler", no_compiler)
    assert refusal(["--loops", "c"], capsys) == "gcs: --loops: c: no C compiler found\n"
    assert list(tmp_path.iterdir()) == []
