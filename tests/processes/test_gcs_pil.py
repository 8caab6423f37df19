"""``gcs pil`` on real targets: the whole C program on this machine, and the firmware on an emulated Cortex-M4F."""

from __future__ import annotations

import functools
import importlib.util
import json
import os
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from flightstack.firmware.toolchain.build import host_program
from flightstack.testing.instances import free_instance
from gcs_cli.errors import DONE, FAILED, NO_ANSWER, USAGE, CliError
from gcs_cli.fly.fly_flags import FlyOptions
from gcs_cli.pil import run as pil_run
from gcs_cli.pil.flight_samples import read_samples
from gcs_cli.pil.result import Flown
from gcs_cli.pil.vectors import read_vectors
from tests.support.commands import Ended, gcs
from tests.support.plugin_site import install
from tests.support.process import children_of
from tests.support.tools import NIGHTLY
from tests.support.warm_children import warm_children

LONG_S = 120.0  # a bound for a busy machine that compiles the kernels anew
MISSIONS = Path(__file__).parents[2] / "missions"
emulation = pytest.mark.skipif(
    not all(map(importlib.util.find_spec, ("unicorn", "ziglang"))), reason="unicorn and ziglang are extras"
)


def pil(*arguments: object) -> Ended:
    return gcs("pil", *arguments)


@functools.cache
def instance() -> int:
    """Return the instance of these tests, which is free when the first of them begins."""
    return free_instance()


def hop(out: Path, target: str) -> tuple[object, ...]:
    return (MISSIONS / "hop.plan", "--target", target, "--out", out, "--instance", instance())


def fly(out: Path, target: str, *flags: str) -> Ended:
    with warm_children():
        return pil(*hop(out, target), *flags)


def result_of(out: Path) -> dict[str, Any]:
    return json.loads((out / "pil.json").read_text())


def largest(result: dict[str, Any], pair: str) -> float:
    return max(row["largest"] for row in result["differences"] if row["pair"] == pair)


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The hop, flown as MIL, SIL and PIL on the host program."""
    out = tmp_path_factory.mktemp("pil") / "hop"
    done = fly(out, "host", "--fail-over")
    assert done.returncode == DONE, done.stdout + done.stderr
    return out


@pytest.fixture
def here_as_before(flown: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> None:
    """Take the hop's MIL and SIL from ``flown``: the same options give the same logs. The parameter is PIL's speed."""
    flights, fly_stage = result_of(flown)["flights"], pil_run.fly_stage

    def fly(stage: str, options: FlyOptions, *rest: Any) -> tuple[Flown, CliError | None]:
        if stage == "PIL":
            return fly_stage(stage, replace(options, speed=getattr(request, "param", "max")), *rest)
        _, folder, *_ = rest
        there = shutil.copytree(flown / stage.lower(), folder / stage.lower())
        facts = {
            name: flights[stage][name] for name in ("directory", "sim_time_s", "wall_time_s", "log_sha256")
        }
        return Flown("completed", read_samples(there / "flight.ulg"), facts), None

    monkeypatch.setattr(pil_run, "fly_stage", fly)


def test_three_flights_are_flown_compared_and_reported(flown: Path) -> None:
    result = result_of(flown)
    assert result["verdict"] == "passed"
    assert largest(result, "SIL–PIL") == 0.0
    assert 0.0 < largest(result, "MIL–PIL") == largest(result, "MIL–SIL")
    assert [result["flights"][stage]["outcome"] for stage in ("MIL", "SIL", "PIL")] == ["completed"] * 3
    ticks = result["flights"]["PIL"]["ticks"]
    assert result["profile"]["stages"]["whole"]["count"] >= ticks > 1000
    assert result["profile"]["unit"] == "ns"
    for name in ("pil.html", "mil/report.html", "sil/flight.ulg", "pil/pil-link.json"):
        assert (flown / name).stat().st_size > 0, name


@emulation
@pytest.mark.skipif(not NIGHTLY, reason="compiles a law for Numba, the host and the Cortex-M4F")
def test_user_controller_flies_on_the_emulated_target(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    site = tmp_path / "site"
    site.mkdir()
    install(site)
    monkeypatch.syspath_prepend(str(site))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(site), os.environ.get("PYTHONPATH", "")]))
    done = fly(tmp_path / "out", "emulated", "--controller", "lqr", "--fail-over")
    assert done.returncode == DONE, done.stdout + done.stderr
    assert "C    of lqr: " in done.stdout
    result = result_of(tmp_path / "out")
    assert largest(result, "SIL–PIL") == 0.0
    assert result["conditions"]["controller"] == "lqr"


@emulation
def test_the_emulated_target_counts_instructions_and_makes_the_same_bits(flown: Path, tmp_path: Path) -> None:
    done = fly(tmp_path / "out", "emulated", "--fail-over", "--json")
    assert done.returncode == DONE, done.stderr
    result = result_of(tmp_path / "out")
    printed = json.loads(done.stdout)
    assert printed.pop("directory") == str(tmp_path / "out")
    assert printed == result
    assert largest(result, "SIL–PIL") == 0.0
    assert result["profile"]["unit"] == "instructions"
    assert result["stack"]["high_water"] > 0
    assert "no board" in result["meaning"]
    assert 0.0 < result["load"]["mean_percent"] < result["load"]["max_percent"] < 2.0
    ran = result["coverage"]["files"]
    assert ran["core/fs_attitude_pid.c"]["missed"] == []
    assert ran["core/fs_attitude_backstepping.c"]["executed"] == 0
    assert "F28377S" not in json.dumps([result["target"], result["profile"], result["title"]])
    of_host = result_of(flown)
    assert result["flights"]["SIL"]["log_sha256"] == of_host["flights"]["SIL"]["log_sha256"]
    assert result["target"]["source_hash"] == of_host["target"]["source_hash"]


@pytest.mark.parametrize(
    ("stage", "target"),
    [("mil", "c"), ("pil", "host"), ("sil", "host"), pytest.param("pil", "emulated", marks=emulation)],
)
def test_a_log_is_replayed_on_a_target(stage: str, target: str, flown: Path, tmp_path: Path) -> None:
    done = pil(
        "replay", flown / stage / "flight.ulg", "--target", target, "--out", tmp_path / "out", "--fail-over"
    )
    assert done.returncode == DONE, done.stdout + done.stderr
    result = result_of(tmp_path / "out")
    assert (largest(result, "log–target") == 0.0) is (stage != "mil")


class Board:
    """The host program, which is found at a serial port as a board is."""

    def __init__(self) -> None:
        self.process = subprocess.Popen([host_program()], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        assert self.process.stdout is not None
        self.device = self.process.stdout.readline().decode().strip()
        self._held = os.open(
            self.device, os.O_RDWR | os.O_NOCTTY
        )  # a board does not end when its port is closed

    def remove(self) -> None:
        """Pull the plug."""
        self.process.kill()
        self.process.communicate()
        if self._held >= 0:
            os.close(self._held)
            self._held = -1


@pytest.fixture
def board() -> Iterator[Board]:
    there = Board()
    yield there
    there.remove()


@pytest.mark.usefixtures("here_as_before")
def test_a_board_is_examined_and_flown_at_its_serial_port(board: Board, tmp_path: Path) -> None:
    done = pil("doctor", "--port", board.device, "--baud", "115200", "--exchanges", "50", "--json")
    assert done.returncode == DONE, done.stdout + done.stderr
    (line,) = json.loads(done.stdout)["lines"]
    assert line["exchanges"] == 50
    assert line["steps_per_s"] > 0
    done = fly(tmp_path / "out", f"serial:{board.device}:115200", "--fail-over")
    assert done.returncode == DONE, done.stdout + done.stderr
    result = result_of(tmp_path / "out")
    assert largest(result, "SIL–PIL") == 0.0
    limits = [check["limit"] for check in result["checks"] if check["name"] == "SIL–PIL wrench"]
    assert limits[0] > 0.0  # of a board nobody asks for the same bits


@pytest.mark.parametrize("here_as_before", ["1"], indirect=True)  # leaves time to unplug
@pytest.mark.usefixtures("here_as_before")
def test_a_board_that_is_unplugged_ends_the_run_with_a_sentence(
    board: Board, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    log = out / "pil" / "flight.ulg"

    def unplug(*_: object) -> None:
        """Pull the plug when the log holds a part of the flight: a fifth of it."""
        if log.exists() and log.stat().st_size > 100_000:
            board.remove()

    monkeypatch.setattr(pil_run.NoticeDisplay, "update", unplug)
    done = pil(*hop(out, f"serial:{board.device}"))
    assert not {"sim_bridge", "flightstack"} & set(children_of(os.getpid()))
    assert done.returncode == NO_ANSWER, done.stdout + done.stderr
    assert board.device in done.stderr
    result = result_of(out)
    assert result["verdict"] == "failed"
    assert result["flights"]["SIL"]["outcome"] == "completed"
    assert (done.stdout + done.stderr).count(result["flights"]["PIL"]["outcome_text"]) == 1
    assert largest(result, "SIL–PIL") == 0.0  # as far as it came
    assert (out / "pil.html").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["hop.plan", "--target", "python"], "--target python: expected emulated, host"),
        (["hop.plan", "--target", "serial:/dev/ttyNONE"], "/dev/ttyNONE: no such device"),
        (["none.plan", "--target", "host"], "none.plan"),
        (["hop.plan", "--target", "host", "--controller", "mine"], "--controller: mine: there is no such"),
        (["replay", "hop.plan", "--target", "c"], "not a readable flight log"),
        (["replay", "none.ulg"], "none.ulg"),
        (["hop.plan", "--target", "host", "--limits", "none.toml"], "none.toml: cannot be read"),
        (
            ["replay", "none.ulg", "--junit", "out.txt"],
            "--junit out.txt: give the file a name that ends in .xml",
        ),
        (["vectors", "x.txt"], "x.txt: give the file a name that ends in .csv, .mat or .h5"),
        (["vectors", "x.csv", "--controller", "mine"], "--controller: mine: there is no such"),
        (["doctor"], "give either --port DEVICE or --target"),
        (["doctor", "--port", "/dev/ttyNONE"], "no such device"),
    ],
)
def test_mistakes_are_answered_with_a_sentence(arguments: list[str], words: str, tmp_path: Path) -> None:
    paths = [str(MISSIONS / each) if each.endswith((".plan", ".ulg")) else each for each in arguments]
    out = [] if {"doctor", "vectors"} & set(arguments) else ["--out", str(tmp_path / "out")]
    done = pil(*paths, *out)
    assert done.returncode == USAGE, done.stdout + done.stderr
    assert words in done.stderr
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "out" / "mil").exists()


def test_results_are_never_overwritten(flown: Path) -> None:
    done = fly(flown, "host")
    assert done.returncode == USAGE
    assert "another run is there" in done.stderr


def test_a_verdict_that_is_not_good_fails_when_it_is_asked_for(flown: Path, tmp_path: Path) -> None:
    """The log says that Python's loops flew it; that they were C's is forged, so that the same bits are expected."""
    forged = (flown / "mil" / "flight.ulg").read_bytes().replace(b"loopspython", b"loopshost\0\0")
    log = tmp_path / "flight.ulg"
    log.write_bytes(forged)
    junit = tmp_path / "results.xml"
    for flags, code in (([], DONE), (["--fail-over", "--junit", junit], FAILED)):
        done = pil("replay", log, "--target", "c", "--out", tmp_path / f"out{code}", *flags)
        assert done.returncode == code, done.stdout + done.stderr
        assert "verdict  failed" in done.stdout
    assert "the verdict is not good: log–target attitude target" in done.stderr
    failed = [
        case.get("name")
        for case in ElementTree.parse(junit).iter("testcase")
        if case.find("failure") is not None
    ]
    assert "log–target attitude target" in failed
    assert not any(name.startswith("stages–target") for name in failed if name)  # Python's log, sound loops


def test_vectors_of_a_flight_are_written_and_replayed(flown: Path, tmp_path: Path) -> None:
    file = tmp_path / "hop.csv"
    done = pil("vectors", file, "--log", flown / "sil" / "flight.ulg", "--json")
    assert done.returncode == DONE, done.stderr
    said = json.loads(done.stdout)
    assert (said["event"], said["file"]) == ("vectors", str(file))
    assert pil("vectors", file).returncode == USAGE  # exists
    done = pil("replay", file, "--target", "c", "--out", tmp_path / "out", "--fail-over")
    assert done.returncode == DONE, done.stdout + done.stderr
    result = result_of(tmp_path / "out")
    assert largest(result, "log–target") == 0.0
    assert len(read_vectors(file).record.time_us) == said["steps"]


def test_limits_of_a_file_judge_a_replay(flown: Path, tmp_path: Path) -> None:
    limits = tmp_path / "limits.toml"
    limits.write_text("[stages.target_thrust]\nulp = 0.01\n")
    log, out = flown / "mil" / "flight.ulg", tmp_path / "out"
    done = pil("replay", log, "--target", "c", "--out", out, "--limits", limits, "--fail-over")
    assert done.returncode == FAILED, done.stdout + done.stderr
    assert "the verdict is not good: stages–target attitude target\n" in done.stderr


def test_a_free_running_target_flies_in_real_time_and_reports_its_timing(tmp_path: Path) -> None:
    """How far it comes is left to the machine: a busy one is late. What is reported is complete in any case."""
    plan, out = MISSIONS / "hop.plan", tmp_path / "out"
    done = pil("free-run", plan, "--target", "host", "--out", out, "--instance", instance(), "--json")
    assert done.returncode in (DONE, FAILED, NO_ANSWER), done.stdout + done.stderr
    told = json.loads(done.stdout)["free_running"]
    assert told["period_us"] == 2_000
    assert told["ticks"] > 400
    assert told["states"] > 0
    assert told["commands"] > 0
    assert 0.0 < told["end_to_end_mean_us"] <= told["end_to_end_max_us"] < 1e6
    assert told["late_mean_us"] <= told["late_max_us"]
