"""Directories and live lines of a flight."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console
from rich.spinner import Spinner
from rich.text import Text

from gcs_cli.__main__ import main
from gcs_cli.errors import DONE, USAGE, CliError
from gcs_cli.fly.flight import Phase
from gcs_cli.fly.fly_display import LineDisplay, make_display, phase_words, progress, speed_words
from gcs_cli.fly.fly_results import flight_files
from gcs_cli.report.flight_outcome import Code, Outcome
from gcs_cli.report.poses import Run
from gcs_cli.run_directory import LOG_NAME, make_run_directory
from tests.support.fake_vehicle import SHUT_DOWN, FakeVehicle
from tests.support.flight_story import Story

HOP = Path(__file__).parents[2] / "missions" / "hop.plan"


def test_run_directories_never_meet(tmp_path: Path) -> None:
    folders = [make_run_directory(Path("missions/square.plan"), None, tmp_path) for _ in range(3)]
    assert len(set(folders)) == 3
    assert all(folder.is_dir() and "-square" in folder.name for folder in folders)


def test_a_directory_with_a_flight_is_refused(tmp_path: Path) -> None:
    out = tmp_path / "deep" / "run"
    assert make_run_directory(HOP, out) == out
    assert make_run_directory(HOP, out) == out  # nothing is in it yet
    (out / "flight.ulg").write_bytes(b"x")
    with pytest.raises(CliError, match=r"of another flight is there.*--overwrite") as error:
        make_run_directory(HOP, out)
    assert error.value.exit_code == USAGE
    assert make_run_directory(HOP, out, overwrite=True) == out
    assert list(out.iterdir()) == []


def test_what_a_flight_that_never_began_has_left_does_not_stay_beside_the_next_one(tmp_path: Path) -> None:
    film = Run(tmp_path / LOG_NAME, {}).film.name
    names = (LOG_NAME, "report.html", "summary.json", "gcs.tlog", "sim-bridge.log", "pil-link.json", film)
    for name in (*names, "notes.txt", "old.ulg"):
        (tmp_path / name).write_text("")
    make_run_directory(HOP, tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["notes.txt", "old.ulg"]


def test_only_the_files_of_the_flight_are_listed(tmp_path: Path) -> None:
    for name in (LOG_NAME, "summary.json", "sim-bridge.log", "notes.txt"):
        (tmp_path / name).touch()
    assert flight_files(tmp_path) == f"{LOG_NAME} summary.json"


def test_a_directory_without_permission_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gcs_cli.run_directory.os.access", lambda *_: False)  # root may write anywhere
    with pytest.raises(CliError, match="nothing can be written there: permission denied") as error:
        make_run_directory(HOP, tmp_path)
    assert error.value.exit_code == USAGE


def test_a_directory_that_cannot_be_made(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(CliError, match="cannot be made"):
        make_run_directory(HOP, tmp_path / "file" / "run")


@pytest.mark.parametrize(
    ("width", "bar", "place"), [(40, False, False), (60, True, False), (89, True, False), (100, True, True)]
)
def test_the_live_line_fits_the_terminal(width: int, bar: bool, place: bool) -> None:
    story = Story(FakeVehicle()).run(until=Phase.FLY)
    story.vehicle.poll(story.now_s)
    console = Console(file=io.StringIO(), width=width, force_terminal=True, legacy_windows=False)
    with console.capture() as captured:
        console.print(progress(story.flight, story.now_s, Spinner("dots"), width))
    line = Text.from_ansi(captured.get()).plain
    assert line.count("\n") <= 1
    assert "…" not in line
    assert "MISSION" in line
    assert "t " in line
    assert ("━" in line, "up " in line) == (bar, place)


def test_the_live_line_leaves_room_for_the_echo_of_an_interrupt() -> None:
    """^C wrapped into a new line, and the line stayed above the summary."""
    story = Story(FakeVehicle()).run(until=Phase.FLY)
    console = Console(file=io.StringIO(), width=100, force_terminal=True, _environ={"TERM": "xterm"})
    display = make_display(console)
    display.update(story.flight)
    display.close()
    assert isinstance(console.file, io.StringIO)
    lines = Text.from_ansi(console.file.getvalue()).plain.splitlines()
    assert 80 < max(map(len, lines)) <= 100 - len("^C^C") - 1


def test_the_state_line_has_the_clock_of_the_texts() -> None:
    story = Story(FakeVehicle())
    story.vehicle.time_s = 60.0  # the vehicle has waited on the ground
    story.run(until=Phase.FLY)
    assert story.flight.flown_s == 5.0
    assert speed_words(story.flight).startswith("t 1:05.0")


def test_what_the_vehicle_says_of_an_early_end_is_not_shown() -> None:
    story = Story(FakeVehicle(refusals={SHUT_DOWN: "Command refused: in the air"})).run(until=Phase.FLY)
    console = Console(file=io.StringIO(), force_terminal=False)
    display = LineDisplay(console)
    story.flight.abort(Outcome(Code.INTERRUPTED, "interrupted", USAGE), story.now_s)
    display.update(story.flight)
    story.run(most_s=10.0)
    display.update(story.flight)
    assert phase_words(story.flight) == "flight ended"
    assert "Command refused: in the air" in [entry.text for entry in story.flight.view.texts]
    assert isinstance(console.file, io.StringIO)
    assert "Command refused" not in console.file.getvalue()


@pytest.mark.parametrize("words", [["fly"], ["pil", "fly"]])
def test_instance_of_a_flight_shows_its_range(words: list[str], capsys: Any) -> None:
    assert main([*words, "--help"]) == DONE
    assert "0<=x<=249" in capsys.readouterr().out.partition("--instance")[2][:200]
    assert main([*words, "--instance", "250"]) == USAGE


def test_a_dumb_terminal_gets_lines() -> None:
    console = Console(file=io.StringIO(), force_terminal=True, _environ={"TERM": "dumb"})
    assert isinstance(make_display(console), LineDisplay)


def test_lines_tell_the_course_of_a_flight() -> None:
    story = Story(FakeVehicle())
    console = Console(file=io.StringIO(), width=40, force_terminal=False)
    display = LineDisplay(console)
    for phase in (Phase.UPLOAD, Phase.ARM, Phase.FLY, Phase.OVER):
        story.run(until=phase)
        display.update(story.flight)
    assert isinstance(console.file, io.StringIO)
    lines = console.file.getvalue().splitlines()
    assert lines[0] == "uploading the plan"
    assert lines[1] == "arming"
    assert lines[2].startswith("MISSION  item ")
    assert "N   +1.0 E   +2.0 up   3.0 m" in lines[2]
    assert lines[-1] == "flight completed"
