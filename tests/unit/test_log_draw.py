"""``gcs log draw``: from a log to poses, and what is said when that cannot be."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from flightstack.core.errors import ConfigError
from flightstack.plan import save_plan
from gcs_cli.errors import CliError
from gcs_cli.report.analysis import read_flight
from gcs_cli.report.flight_data import NO_LOOPS, Flight, series
from gcs_cli.report.poses import Run, find_run, poses_of
from tests.support.commands import gcs
from tests.support.square_plan import square_plan
from tests.support.synthetic_flight import synthetic_flight_bytes


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    (folder / "flight.ulg").write_bytes(synthetic_flight_bytes(inner_ms=10, outer_ms=20))
    save_plan(folder / "square.plan", square_plan())
    summary = {"vehicle": "paper_quad", "plan": str(folder / "square.plan")}
    (folder / "summary.json").write_text(json.dumps(summary))
    return folder


def test_poses_are_those_of_the_log(run: Path) -> None:
    flight = read_flight(run / "flight.ulg")
    poses = poses_of(flight, find_run(run), None)
    assert poses.vehicle == "paper_quad"
    assert poses.title == "paper_quad · square.plan"
    np.testing.assert_array_equal(poses.time_s, flight.position.time_s)
    np.testing.assert_array_equal(poses.position_ned_m, flight.position.values)
    np.testing.assert_allclose(np.linalg.norm(poses.attitude, axis=1), 1.0)
    assert poses.rotor_speed_rad_s.shape == (len(poses.time_s), 4)
    assert 190.0 < np.nanmedian(poses.rotor_speed_rad_s) < 240.0
    assert np.isfinite(poses.target_ned_m).any()
    assert poses.waypoints_ned_m.shape[1] == 3
    places = [seq for seq, item in enumerate(square_plan().items) if item.position_deg is not None]
    assert poses.waypoint_numbers.tolist() == places


def test_there_is_no_target_on_the_ground(run: Path) -> None:
    flight = read_flight(run / "flight.ulg")
    poses = poses_of(flight, find_run(run), None)
    flying = flight.flying(poses.time_s)
    assert 0 < flying.sum() < len(flying)
    assert np.isnan(poses.target_ned_m[~flying]).all()
    assert np.isfinite(poses.target_ned_m[flying]).any()


def test_a_log_alone_names_its_vehicle_and_has_no_plan(run: Path, tmp_path: Path) -> None:
    log = tmp_path / "other.ulg"
    log.write_bytes((run / "flight.ulg").read_bytes())
    found = find_run(log)
    poses = poses_of(read_flight(log), found, None)
    assert poses.vehicle == "paper_quad"
    assert len(poses.waypoints_ned_m) == 0
    assert found.film == tmp_path / "other.mp4"
    assert find_run(tmp_path).log == log
    assert find_run(run).film == run / "replay.mp4"


def _flight(position: list[list[float]], vehicle: str | None = "paper_quad") -> Flight:
    time_s = np.arange(float(len(position)))
    return Flight(
        info={} if vehicle is None else {"vehicle": vehicle},
        position=series(time_s, np.array(position)),
        attitude=series(time_s.copy(), np.zeros((len(position), 3))),
        read_loops=lambda: NO_LOOPS._replace(rotor_speed=series(time_s.copy(), np.zeros((len(position), 4)))),
    )


def test_moments_that_are_not_finite_are_left_out() -> None:
    poses = poses_of(_flight([[0.0, 0.0, 0.0], [np.nan] * 3, [1.0, 0.0, 0.0]]), Run(Path("a.ulg"), {}), None)
    assert poses.time_s.tolist() == [0.0, 2.0]


@pytest.mark.parametrize(
    ("flight", "vehicle", "said"),
    [
        (
            Flight(info={"vehicle": "paper_quad"}),
            None,
            "a.ulg: the log has no positions and attitudes",
        ),
        (
            _flight([[np.nan] * 3]),
            None,
            "a.ulg: the log has no positions and attitudes",
        ),
        (_flight([[0.0] * 3], None), None, "a.ulg does not say which vehicle flew: give --vehicle"),
        (_flight([[0.0] * 3], "mine"), None, "it flew in a.ulg; name its file with --vehicle"),
    ],
)
def test_flights_that_cannot_be_shown(flight: Flight, vehicle: str | None, said: str) -> None:
    with pytest.raises(CliError) as caught:
        poses_of(flight, Run(Path("a.ulg"), {}), vehicle)
    assert said in str(caught.value)


def test_another_vehicle_may_be_drawn_if_it_has_as_many_rotors(tmp_path: Path) -> None:
    flight, run = _flight([[0.0] * 3], None), Run(Path("a.ulg"), {})
    assert poses_of(flight, run, "x_quad").vehicle == "x_quad"
    with pytest.raises(ConfigError, match="nor a built-in vehicle"):
        poses_of(flight, run, "nobody")


def test_directories_without_one_log_are_named(tmp_path: Path) -> None:
    with pytest.raises(CliError, match="there is no log in this directory; name the directory of a flight"):
        find_run(tmp_path)
    for name in ("a.ulg", "b.ulg"):
        (tmp_path / name).touch()
    with pytest.raises(CliError, match=r"this directory has 2 logs; name one, for example .*\.ulg"):
        find_run(tmp_path)
    with pytest.raises(CliError, match="there is no such directory or log"):
        find_run(tmp_path / "c.ulg")


@pytest.mark.parametrize(
    ("size", "reason"),
    [(30, "the log has no data"), (3250, "the log is damaged before its first position")],
)
def test_a_log_cut_before_its_first_position_holds_no_flight(
    size: int, reason: str, run: Path, tmp_path: Path
) -> None:
    (tmp_path / "flight.ulg").write_bytes((run / "flight.ulg").read_bytes()[:size])
    ended = gcs("log", "draw", tmp_path)
    assert ended.returncode == 2
    assert ended.stderr.startswith(f"gcs: {tmp_path}/flight.ulg: {reason}")


def test_what_is_no_log_is_refused(tmp_path: Path) -> None:
    (tmp_path / "flight.ulg").write_bytes(b"not a log")
    ended = gcs("log", "draw", tmp_path)
    assert ended.returncode == 2
    assert "is not a readable flight log" in ended.stderr
    assert not (tmp_path / "replay.mp4").exists()
