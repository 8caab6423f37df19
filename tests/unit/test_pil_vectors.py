"""Test vectors as CSV, MATLAB and HDF5 files: the same bits there and back, and damaged files refused."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from rich.console import Console
from scipy.io import loadmat

from flightstack.core.errors import ConfigError, WriteError
from gcs_cli.errors import CliError
from gcs_cli.pil.excitation import excitation
from gcs_cli.pil.replay import Recording
from gcs_cli.pil.replay_run import configured, fed, outcome_of, prepared, read_flight
from gcs_cli.pil.vectors import Vectors, read_vectors, vectors_of, write_vectors
from tests.support.truth import World

FACTS: dict[str, Any] = {"title": "", "about": "", "meaning": "", "conditions": {}}


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A hop of the loops in C, with a gain that changes in flight."""
    world = World(loops="c")
    world.upload("hop.plan")
    world.arm()
    world.start_mission()
    world.run_for(3.0)
    world.param_set("PID_ROLL_P", 201.7)
    world.run_until("not armed")
    path = tmp_path_factory.mktemp("log") / "flight.ulg"
    path.write_bytes(world.engine.logs[-1].content)
    return path


@pytest.fixture(scope="module")
def excited() -> Vectors:
    setup, info, parameters = configured("paper_quad", "pid", "tuned", 500.0, 100.0)
    return Vectors(excitation(setup), None, info, parameters)


def assert_same(one: Recording, other: Recording) -> None:
    for mine, theirs in zip(one, other, strict=True):
        assert np.array_equal(mine, theirs) if isinstance(mine, np.ndarray) else mine == theirs


@pytest.mark.parametrize("ending", ["csv", "mat", "h5"])
def test_vectors_of_a_flight_are_held_to_the_last_bit(log: Path, ending: str, tmp_path: Path) -> None:
    file = tmp_path / f"vectors.{ending}"
    flight, record = read_flight(log)
    assert record.changes
    written = vectors_of(flight, record)
    write_vectors(file, written)
    read = read_vectors(file)
    assert_same(read.record, record)
    assert written.outputs is not None
    assert read.outputs is not None
    assert np.array_equal(read.outputs.astype(np.float32), written.outputs.astype(np.float32))
    assert prepared(file, None).numbers == prepared(log, None).numbers


def test_vectors_of_a_flight_replay_without_a_difference(log: Path, tmp_path: Path) -> None:
    file = tmp_path / "vectors.csv"
    write_vectors(file, vectors_of(*read_flight(log)))
    replay = prepared(file, None)
    outputs, _ = fed(replay, "c", tmp_path, Console(quiet=True))
    outcome = outcome_of(replay, outputs, None, True, FACTS)
    assert outcome.passed
    of_log = [row for row in outcome.result["differences"] if row["pair"] == "log–target"]
    assert len(of_log) == 10
    assert {row["largest"] for row in of_log} == {0.0}


def test_damaged_log_is_reported(log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    half = tmp_path / "half.ulg"
    content = log.read_bytes()
    half.write_bytes(content[: len(content) // 2])
    read_flight(log)
    assert capsys.readouterr().err == ""
    flight, _ = read_flight(half)
    warning = f"gcs: warning: {half}: the log is damaged; read up to {flight.duration_s:.1f} s\n"
    assert (capsys.readouterr().err, flight.duration_s > 1.0) == (warning, True)


def test_excitation_is_replayed_without_a_flight(excited: Vectors, tmp_path: Path) -> None:
    file = tmp_path / "excitation.csv"
    write_vectors(file, excited)
    replay = prepared(file, None)
    assert_same(replay.record, excited.record)
    outputs, _ = fed(replay, "c", tmp_path, Console(quiet=True))
    outcome = outcome_of(replay, outputs, None, True, FACTS)
    assert outcome.passed
    assert {row["pair"] for row in outcome.result["differences"]} == {"stages–target"}
    wrong = outcome_of(replay, outputs * np.where(np.arange(32) == 16, 1.001, 1.0), None, True, FACTS)
    failed = [check["name"] for check in wrong.result["checks"] if not check["passed"]]
    assert "stages–target wrench slope" in failed


def test_matlab_file_holds_a_table_of_named_columns(excited: Vectors, tmp_path: Path) -> None:
    file = tmp_path / "excitation.mat"
    write_vectors(file, excited)
    table = loadmat(file, simplify_cells=True)["vectors"]
    assert np.array_equal(table["position_n_m"], excited.record.inputs[:, 0].astype(np.float32))
    assert table["time_us"].dtype == np.int64
    assert table["rate_z_rad_s"].dtype == np.float32


def test_hdf5_file_holds_a_group_of_named_columns(excited: Vectors, tmp_path: Path) -> None:
    path = tmp_path / "excitation.h5"
    write_vectors(path, excited)
    with h5py.File(path) as file:
        table = file["vectors"]
        assert np.array_equal(table["position_n_m"], excited.record.inputs[:, 0].astype(np.float32))
        assert table["time_us"].dtype == np.int64
        assert table["rate_z_rad_s"].dtype == np.float32


def test_file_names_the_missing_package_of_its_format(
    excited: Vectors, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "excitation.h5"
    write_vectors(path, excited)
    monkeypatch.setitem(sys.modules, "h5py", None)
    for act in (lambda: read_vectors(path), lambda: write_vectors(path, excited)):
        with pytest.raises(CliError, match=r"needs h5py: pip install 'flightstack\[export\]'"):
            act()


def csv_of(excited: Vectors, tmp_path: Path) -> Path:
    file = tmp_path / "vectors.csv"
    short = excited.record
    few = short._replace(
        time_us=short.time_us[:4], inputs=short.inputs[:4], flags=short.flags[:4], is_outer=short.is_outer[:4]
    )
    write_vectors(file, excited._replace(record=few))
    return file


@pytest.mark.parametrize(
    ("right", "wrong", "words"),
    [
        ("flightstack-vectors-1", "flightstack-vectors-9", "its format is flightstack-vectors-9"),
        ("rate_y_rad_s", "rate_q_rad_s", "it has no rate_y_rad_s"),
        ("\n2000,", "\n0,", "its times do not rise"),
        ("\n4000,0,", "\n4000,0,nan", "is not a file of test vectors"),
        ("# {", "# [", "is not a file of test vectors"),
        ('"changes": []', '"changes": [1]', "is not a file of test vectors"),
        ("\n", " ", "is not a file of test vectors"),
    ],
)
def test_damaged_vectors_are_refused_in_one_sentence(
    excited: Vectors, right: str, wrong: str, words: str, tmp_path: Path
) -> None:
    file = csv_of(excited, tmp_path)
    text = file.read_text()
    assert right in text
    file.write_text(text.replace(right, wrong))
    with pytest.raises(ConfigError, match=words):
        read_vectors(file)


def test_files_that_are_no_vectors_are_refused(excited: Vectors, tmp_path: Path) -> None:
    for name in ("rubbish.csv", "rubbish.mat", "rubbish.h5"):
        (tmp_path / name).write_bytes(b"rubbish")
        with pytest.raises(ConfigError, match="is not a file of test vectors"):
            prepared(tmp_path / name, None)
    with pytest.raises(ConfigError, match="cannot be read"):
        read_vectors(tmp_path / "none.csv")
    with pytest.raises(WriteError, match="cannot be written"):
        write_vectors(tmp_path / "none" / "vectors.csv", excited)


def test_description_is_the_first_line_of_a_csv_file(excited: Vectors, tmp_path: Path) -> None:
    first, header, *_ = csv_of(excited, tmp_path).read_text().splitlines()
    about = json.loads(first.removeprefix("#"))
    assert about["info"]["vehicle"] == "paper_quad"
    assert about["parameters"]["PID_ROLL_P"] == 225.0
    assert header.startswith("time_us,flags,position_n_m,position_e_m")
