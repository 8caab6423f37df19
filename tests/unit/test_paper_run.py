"""``gcs paper`` as a command: what it says of bad input, and what it leaves behind when it ends early."""

from __future__ import annotations

import io
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from flightstack.core.errors import ConfigError
from gcs_cli.__main__ import main
from gcs_cli.errors import USAGE, CliError
from gcs_cli.experiments.paper import linear, run
from gcs_cli.experiments.paper.flights import experiments
from gcs_cli.experiments.paper.flights.experiments import run_cases
from gcs_cli.experiments.paper.flights.types import Case
from gcs_cli.experiments.paper.run import FIGURES_NAME, HTML_NAME, JSON_NAME, PaperOptions

QUICK = Case("one", "step_roll", inner_hz=250)
PLAIN = PaperOptions(Path(), pil=False, multibody=False, jobs=1)


def silent() -> Console:
    return Console(file=io.StringIO())


@pytest.mark.parametrize(
    ("case", "target", "said"),
    [
        (QUICK._replace(trajectory="loop"), "emulated", "loop: is no trajectory; there are"),
        (QUICK._replace(gains="soft"), "emulated", "soft: is neither a file nor built-in gains"),
        (QUICK._replace(vehicle="balloon"), "emulated", "balloon: is neither a file nor a built-in vehicle"),
        (QUICK, "serial:/dev/nobody", "/dev/nobody"),
    ],
)
def test_bad_input_is_told_before_a_directory_is_made(
    tmp_path: Path, case: Case, target: str, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(experiments, "fly", _must_not_be_called)
    with pytest.raises((CliError, ConfigError), match=said):
        run.run(PLAIN._replace(out=tmp_path / "a" / "b", pil=True, target=target), silent(), [QUICK, case])
    assert list(tmp_path.iterdir()) == []


def _must_not_be_called(case: Case) -> None:
    raise AssertionError(case)


def _fails(*_: object) -> Any:
    raise KeyboardInterrupt


def test_an_early_end_leaves_no_empty_directories(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run, "run_cases", _fails)
    (tmp_path / "a").mkdir()
    with pytest.raises(KeyboardInterrupt):
        run.run(PLAIN._replace(out=tmp_path / "a" / "b" / "c"), silent(), [QUICK])
    assert list(tmp_path.iterdir()) == [tmp_path / "a"]  # which was there
    assert list((tmp_path / "a").iterdir()) == []


def test_the_loops_on_a_target_of_a_run_before_do_not_stay_beside_new_results(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    old, foreign = tmp_path / "pil-pid", tmp_path / "pil-mine"
    for folder in (old, foreign):
        folder.mkdir()
        (folder / "pil.json").write_text("{}")
    monkeypatch.setattr(run, "run_cases", _fails)
    with pytest.raises(KeyboardInterrupt):
        run.run(PLAIN._replace(out=tmp_path), silent(), [QUICK])
    assert old.exists()  # as long as there is nothing newer
    monkeypatch.undo()
    for name in ("results", "onset"):
        monkeypatch.setattr(linear, name, dict)
    run.run(PLAIN._replace(out=tmp_path), silent(), [QUICK])
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(
        (JSON_NAME, HTML_NAME, FIGURES_NAME, "pil-mine")
    )


def test_a_bad_file_is_one_sentence_from_another_process_too() -> None:
    with pytest.raises(ConfigError, match=r"^soft: is neither a file nor built-in gains"):
        experiments.run_in_processes([QUICK._replace(gains="soft")], 2, lambda done, total: None)


def test_a_process_that_was_ended_from_outside_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(futures: Any) -> Any:
        raise BrokenProcessPool

    monkeypatch.setattr(experiments, "as_completed", broken)
    with pytest.raises(CliError, match="was ended from outside"):
        run_cases([QUICK], 2)


@pytest.mark.parametrize(
    ("port", "said"),
    [
        ("foo", "gcs: --port foo: expected emulated, host or serial:DEVICE[:BAUD]\n"),
        ("serial:", "gcs: --port: serial: has no device: use for example serial:/dev/ttyACM0\n"),
    ],
)
def test_a_bad_port_is_named_as_the_user_wrote_it(
    tmp_path: Path, port: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["paper", "-o", str(tmp_path / "paper"), "--port", port]) == USAGE
    assert capsys.readouterr().err == said
    assert list(tmp_path.iterdir()) == []
