"""Command lines of our own programs are read without typer, as typer reads them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from flightstack.core.geodesy import GeoPoint
from flightstack.process import command, program
from flightstack.process.command_line import run_app
from flightstack.process.options import RunOptions
from flightstack.process.plain_arguments import read_plain
from gcs_cli.fly.fly_flags import FlyOptions
from gcs_cli.fly.fly_options import simulator_arguments, stack_arguments
from sim_bridge import command as sim_command
from sim_bridge import program as sim_program
from sim_bridge.options import SimulatorOptions

HOME = GeoPoint(-1e-05, 8.5, 488.0)
FLIGHTS = [
    FlyOptions(),
    FlyOptions(
        wind="1,2", gust=1e-05, force="0,0,-1", battery_start=50.0, faults=["rotor:2:off@10-20", "payload 0.3"],
        drag=True, ideal_rotors=True, view=True, outer_hz=125.0, param=["MC_ROLL_P=7", "A=b=c"], state="truth",
        params=Path("some where.params"), signing_key=Path("key"), physics_hz=2000.0, slope=3.0, boat="1,0",
    ),
]  # fmt: skip


def read_by_typer(monkeypatch: pytest.MonkeyPatch, words: list[str]) -> RunOptions:
    read: list[RunOptions] = []
    monkeypatch.setattr(program, "run", read.append)
    run_app(command.app, "flightstack", words)
    return read[0]


@pytest.mark.parametrize("options", FLIGHTS, ids=["defaults", "many options"])
def test_arguments_of_gcs_fly_are_read_as_typer_reads_them(
    monkeypatch: pytest.MonkeyPatch, options: FlyOptions
) -> None:
    words = stack_arguments(options, HOME, Path("out"), 14600)
    assert read_plain(RunOptions, words) == read_by_typer(monkeypatch, words)

    read: list[Any] = []
    monkeypatch.setattr(sim_program, "simulate", lambda given: read.append(given) or 0)
    words = simulator_arguments(options, HOME)
    run_app(sim_command.app, "sim-bridge", words)
    assert [read_plain(SimulatorOptions, words)] == read


@pytest.mark.parametrize(
    "word",
    ["--help", "--version", "paper_quad", "--unknown=1", "--vehicle", "--check=1", "--instance=-1", "--instance=1.0",
     "--instance=10000", "--inner-hz=fast", "--inner-hz=nan", "--inner-hz=", "--no-ideal-rotors", "--"],
)  # fmt: skip
def test_errors_and_other_forms_are_left_to_typer(word: str) -> None:
    assert read_plain(RunOptions, ["--check"]) == RunOptions(check=True)
    assert read_plain(RunOptions, ["--check", word]) is None


def test_completion_which_has_no_arguments_is_left_to_typer() -> None:
    assert read_plain(RunOptions, []) is None


def test_the_last_one_of_an_option_counts_unless_it_may_be_repeated() -> None:
    words = ["--gcs=a:1", "--instance=1", "--gcs=b:2", "--instance=2"]
    assert read_plain(RunOptions, words) == RunOptions(gcs=["a:1", "b:2"], instance=2)
