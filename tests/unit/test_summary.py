"""The figures of a flight, against cases computed by hand."""

from __future__ import annotations

import hashlib
import json
import math
import re
import struct
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from flightstack.core.enums import NAVIGATION_STATE, Mode
from flightstack.core.errors import ConfigError
from flightstack.core.geometry_bulk import euler_from_quaternions
from flightstack.plan import Command, Frame, MissionItem, Plan
from gcs_cli.errors import FAILED
from gcs_cli.logs.ulog_parser import ParsedLog
from gcs_cli.report.analysis import flight_in, flight_of, read_flight
from gcs_cli.report.flight_data import NO_LOOPS, Flight, MissionProgress, Status, series
from gcs_cli.report.flight_figures import attitude_error, rms_command_rate_rad_s2, rms_torque_n_m
from gcs_cli.report.flight_outcome import COMPLETED, Code, Outcome, with_log
from gcs_cli.report.summary import RunInfo, summarise, write_summary
from tests.support.square_plan import item_at, square_plan
from tests.support.synthetic_flight import HOME, INFO, PARAMETERS, synthetic_flight_bytes
from tests.support.written_flights import armed_from, samples

REQUIRED = {
    "outcome", "plan", "vehicle", "controller", "gains", "plant", "loops", "state", "seed", "inner_hz", "outer_hz",
    "sim_time_s", "wall_time_s", "real_time_factor", "waypoints", "rms_tracking_error_m",
    "max_tracking_error_m", "overruns", "log_sha256", "wind_m_s", "gust_m_s", "torque_gust_n_m",
    "battery_start_percent", "battery_capacity_mah", "battery_drain", "faults", "ideal_rotors",
    "params", "force_n", "torque_n_m", "slope_deg", "boat_m_s", "param", "outcome_text",
    "drag_n_s_m", "faults_not_begun", "flight_time_s",
    "rms_attitude_error_deg", "max_attitude_error_deg", "rms_torque_n_m", "rms_rotor_command_rate_rad_s2",
    "estimate_error",
}  # fmt: skip


@pytest.fixture(scope="module")
def log_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("log") / "flight.ulg"
    path.write_bytes(synthetic_flight_bytes(inner_ms=10, outer_ms=20))
    return path


def test_the_log_reads_back_into_arrays_that_cannot_change(log_path: Path) -> None:
    flight = read_flight(log_path)
    assert flight.duration_s == pytest.approx(35.99)
    assert dict(flight.info) == INFO
    assert dict(flight.parameters) == PARAMETERS
    assert flight.home == HOME
    assert flight.position.values.shape == flight.position_setpoint.values.shape == (1800, 3)
    assert flight.attitude.values.shape == (3600, 3)
    assert flight.rotor_speed.values.shape == (3600, 4)
    assert [status.armed for status in flight.statuses] == [False, True, True, True, True, True, True, False]
    assert flight.landed == ((0.0, True), (1.0, False), (35.0, True))
    assert flight.mission[-1] == MissionProgress(35.0, 5, 5, 6, True)
    assert flight.texts[0] == (1.0, 6, "Armed")
    assert (flight.overruns, flight.loop_timing) == (None, ())
    with pytest.raises(ValueError, match="read-only"):
        flight.position.values[0, 0] = 1.0


def test_attitude_is_that_of_the_quaternion(log_path: Path) -> None:
    flight = read_flight(log_path)
    # the fixture's roll is 0.12 sin 2t, 50 ms late; 1e-7 is what float32 leaves of it
    expected = 0.12 * np.sin(2.0 * (flight.attitude.time_s - 1.05))
    assert np.abs(flight.attitude.values[:, 0] - expected).max() < 1e-6
    assert euler_from_quaternions(np.array([[math.cos(0.25), 0.0, 0.0, math.sin(0.25)]]))[0, 2] == 0.5


def test_the_summary_names_the_conditions_of_the_flight() -> None:
    run = RunInfo("completed", "x.plan", wind="3,-1", gust=0.5, battery_start=40.0, faults=("rotor:2:off@5",))
    summary = summarise(Flight(), square_plan(), run)
    assert (summary["wind_m_s"], summary["gust_m_s"], summary["torque_gust_n_m"]) == ([3.0, -1.0], 0.5, None)
    assert (summary["battery_start_percent"], summary["battery_drain"]) == (40.0, None)
    assert summary["faults"] == ["rotor:2:off@5"]
    assert summarise(Flight(), square_plan(), RunInfo("completed", "x.plan"))["wind_m_s"] is None


def test_the_summary_of_a_whole_flight(log_path: Path) -> None:
    flight = read_flight(log_path)
    run = RunInfo("completed", "missions/square.plan", 1.5, plant="rigid", seed=3, log_path=log_path)
    summary = summarise(flight, square_plan(), run)
    assert set(summary) == REQUIRED
    assert summary["real_time_factor"] == pytest.approx(35.99 / 1.5, abs=1e-6)
    assert (summary["vehicle"], summary["plant"], summary["seed"]) == ("paper_quad", "rigid", 3)
    assert summary["log_sha256"] == hashlib.sha256(log_path.read_bytes()).hexdigest()
    rows = summary["waypoints"]
    assert [row["seq"] for row in rows] == [0, 1, 2, 3, 4, 5]
    assert [row["time_s"] for row in rows] == [6.2, 12.2, 18.2, 24.2, 30.2, 35.0]
    assert all(row["reached"] for row in rows)
    # noise of 1 cm on the path, 0.7 cm of rounding to 1e-7 degrees; the largest measured is 1.3 cm
    assert max(row["miss_distance_m"] for row in rows) < 0.03
    # the path is the setpoint 0.15 s late: a cubic blend of 10 m in 6 s moves at 2.5 m/s at most, or 0.375 m
    assert 0.36 < summary["max_tracking_error_m"] < 0.43
    assert 0.0 < summary["rms_tracking_error_m"] < summary["max_tracking_error_m"]


def test_what_the_run_knows_goes_before_what_the_log_says(log_path: Path) -> None:
    run = RunInfo("vehicle lost", "p.plan", controller="backstepping", inner_hz=250.0, overruns=7)
    summary = summarise(read_flight(log_path), square_plan(), run)
    assert (summary["controller"], summary["inner_hz"], summary["overruns"]) == ("backstepping", 250.0, 7)
    assert (summary["gains"], summary["real_time_factor"], summary["log_sha256"]) == ("tuned", None, None)


def test_tracking_error_by_hand() -> None:
    flight = Flight(
        position=samples([0, 1, 2, 3, 4], [[0, 0, 0], [3, 0, 0], [0, 4, 0], [0, 0, 0], [9, 9, 9]]),
        position_setpoint=samples(
            [0, 1, 2, 3, 4], [[9, 9, 9], [0, 0, 0], [0, 0, 0], [math.nan, 0, 0], [0, 0, 0]]
        ),
        statuses=armed_from(1.0, 5.0),
        landed=((0.0, True), (1.0, False), (4.0, True)),
    )
    # at 0 s on the ground, at 3 s without a setpoint, at 4 s landed: 3 m and 4 m remain
    summary = summarise(flight, Plan(()), RunInfo("completed", "x.plan"))
    assert summary["max_tracking_error_m"] == 4.0
    assert summary["rms_tracking_error_m"] == pytest.approx(math.sqrt(12.5), abs=1e-6)


def test_a_landing_counts_from_the_touchdown() -> None:
    time_s = [0, 1, 2, 3, 4, 5]
    flight = Flight(
        position=samples(time_s, [[0, 0, z] for z in (-2, -1, 0, 0, 0, 0)]),
        velocity=samples(time_s, [[0, 0, v] for v in (1, 1, 0.01, 0, 0, 0)]),
        position_setpoint=samples(time_s, [[0, 0, z] for z in (-2, -1, 0, 1, 2, 2)]),
        statuses=armed_from(0.0),
        landed=((0.0, False), (4.0, True)),
    )
    # standing since 2 s, found landed at 4 s: the setpoint 1 m below the ground at 3 s is no error
    assert flight.flying(flight.position.time_s).tolist() == [True, True, False, False, False, False]
    assert flight.tracking_error().values[:, 0].tolist() == [0.0, 0.0]


def test_a_vehicle_that_wind_pushes_about_on_the_ground_has_landed() -> None:
    time_s = [0, 1, 2, 3, 4, 5]
    flight = Flight(
        position=samples(
            time_s, [[0, 0, -2], [0, 0, -1], [0.5, 0, 0.01], [1, 0, -0.03], [1.5, 0, 0], [1.5, 0, 0]]
        ),
        velocity=samples(time_s, [[0, 0, 1], [0, 0, 1], [0.5, 0, 0], [0.5, 0, 0], [0.5, 0, 0], [0, 0, 0]]),
        position_setpoint=samples(
            time_s, [[x, 0, z] for x, z in zip([0, 0, 0.5, 1, 1.5, 1.5], range(-2, 4), strict=True)]
        ),
        statuses=armed_from(0.0),
        landed=((0.0, True), (0.5, False), (5.0, True)),
    )
    assert flight.tracking_error().time_s.tolist() == [1.0]
    assert flight.standing(flight.position.time_s).tolist() == [False, False, True, True, True, True]


def test_bounces_of_a_landing_in_wind_are_not_tracked() -> None:
    """The setpoint sinks from the first touch at 2 s on; the vehicle bounces 0.2 m high until it is found landed."""
    time_s = [0, 1, 2, 3, 4, 5]
    flight = Flight(
        position=samples(time_s, [[0, 0, z] for z in (-3, -1, -0.01, -0.2, 0, 0)]),
        position_setpoint=samples(time_s, [[0, 0, z] for z in (-3, -1, 0.5, 1, 2, 2)]),
        statuses=armed_from(0.0),
        landed=((0.0, False), (5.0, True)),
    )
    assert flight.tracking_error().time_s.tolist() == [0.0, 1.0]
    assert flight.standing(flight.position.time_s).tolist() == [False, False, True, True, True, True]


def test_a_second_takeoff_is_flight_again() -> None:
    time_s = [0, 1, 2, 3, 4, 5, 6]
    flight = Flight(
        position=samples(time_s, [[0, 0, z] for z in (0, -1, 0, 0, -1, -1, 0)]),
        statuses=armed_from(0.0),
        landed=((0.0, True), (0.5, False), (2.5, True), (3.5, False), (6.0, True)),
    )
    flying = flight.flying(flight.position.time_s)
    assert flying.tolist() == [False, True, False, False, True, True, False]


def test_a_landing_without_a_stand_before_it_counts_from_its_detection() -> None:
    flight = Flight(
        velocity=samples([0, 1, 2], [[0, 0, 1], [0, 0, 1], [0, 0, 0]]),
        statuses=armed_from(0.0),
        landed=((0.0, False), (1.5, True)),
    )
    assert flight.flying(np.array([1.0, 1.4, 1.6])).tolist() == [True, True, False]


def test_a_setpoint_at_other_times_is_interpolated() -> None:
    flight = Flight(
        position=samples([1, 2], [[1, 0, 0], [2, 0, 0]]),
        position_setpoint=samples([0, 4], [[0, 0, 0], [4, 0, 0]]),
        statuses=armed_from(0.5),
    )
    assert flight.tracking_error().values[:, 0].tolist() == [0.0, 0.0]


def test_attitude_error_is_the_angle_between_attitude_and_setpoint() -> None:
    time_s = [0, 1, 2, 3]
    flight = Flight(
        attitude=samples(time_s, [[0, 0, 3.1], [0.1, 0, 0], [0, 0, 0], [1, 0, 0]]),
        attitude_target=samples(time_s, [[0, 0, -3.1], [0, 0, 0], [0, -0.2, 0], [0, 0, 0]]),
        statuses=armed_from(0.0, 3.0),
    )
    # across ±180° of yaw, in roll, in pitch; disarmed from 3 s on
    assert attitude_error(flight).values[:, 0] == pytest.approx([2 * math.pi - 6.2, 0.1, 0.2], abs=1e-12)


def test_control_effort_by_hand() -> None:
    time_s = [0.0, 0.5, 1.0, 1.5]
    loops = NO_LOOPS._replace(
        torque=samples(time_s, [[9, 9, 9], [1, 0, 0], [-1, 2, 0], [9, 9, 9]]),
        rotor_command=samples(time_s, [[0, 0], [100, 100], [103, 96], [0, 0]]),
    )
    flight = Flight(read_loops=lambda: loops, statuses=armed_from(0.5, 1.5))
    assert rms_torque_n_m(flight) == pytest.approx([1.0, math.sqrt(2.0), 0.0])
    assert rms_command_rate_rad_s2(flight) == pytest.approx(math.sqrt((6.0**2 + 8.0**2) / 2))


# ---------------------------------------------------------------- outcome


def flown_with(*statuses: Status, landed: bool = True, mission: tuple[MissionProgress, ...] = ()) -> Flight:
    end = Status(9.0, NAVIGATION_STATE[Mode.HOLD], False)
    return Flight(
        statuses=(*statuses, end), landed=((0.0, True), (1.0, False), (8.0, landed)), mission=mission
    )


ARMED = Status(0.0, NAVIGATION_STATE[Mode.MISSION], True)
TERMINATION = Status(5.0, NAVIGATION_STATE[Mode.TERMINATION], False)
EARLY = Outcome(Code.INCOMPLETE, "the vehicle disarmed at item 2 (last 5), before the mission was done")


def test_the_log_tells_why_a_mission_ended_early() -> None:
    items = square_plan().items
    assert with_log(EARLY, flown_with(ARMED), items) == EARLY
    assert with_log(EARLY, flown_with(ARMED, ARMED._replace(failsafe=True)), items).code is Code.FAILSAFE
    assert with_log(EARLY, flown_with(ARMED, TERMINATION), items).code is Code.LOST_CONTROL
    assert with_log(EARLY, flown_with(ARMED, landed=False), items).code is Code.LOST_CONTROL
    crashed = with_log(COMPLETED, flown_with(ARMED, landed=False), items)
    assert (crashed.code, crashed.exit_code) == (Code.LOST_CONTROL, FAILED)
    cut = flown_with(ARMED, landed=False)
    cut = replace(cut, statuses=cut.statuses[:-1], duration_s=1.52)
    note = "; the flight log ends early, at 1.5 s, and so do the figures"
    assert with_log(EARLY, cut, items) == EARLY._replace(reason=EARLY.reason + note)
    assert with_log(COMPLETED, cut, items) == COMPLETED._replace(reason=COMPLETED.reason + note)
    refused = Outcome(Code.REFUSED, "the vehicle refused to arm: no")
    assert with_log(refused, flown_with(ARMED, TERMINATION), items) == refused


def test_a_completed_mission_names_the_items_that_were_not_reached() -> None:
    items = [item_at(Command.NAV_WAYPOINT, (float(north), 0.0, -3.0)) for north in range(4)]
    jump = MissionItem(Command.DO_JUMP, Frame.MISSION, 3.0, 1.0)
    steps = ((0, -1), (1, 0), (3, 1), (3, 3))
    mission = tuple(MissionProgress(float(at), *step, 4, False) for at, step in enumerate(steps))
    flight = flown_with(ARMED, mission=mission)
    assert with_log(COMPLETED, flight, items).reason == "the mission was flown to its end; item 2 not reached"
    jumps = [*items[:2], jump, *items[2:]]
    steps = ((0, -1), (1, 0), (4, 1), (4, 4))
    mission = tuple(MissionProgress(float(at), *step, 5, False) for at, step in enumerate(steps))
    jumped = with_log(COMPLETED, flown_with(ARMED, mission=mission), jumps)
    assert jumped == COMPLETED._replace(reason="the mission was flown to its end; item 3 skipped by DO_JUMP")


def test_a_fault_that_begins_after_the_flight_is_named() -> None:
    flight = Flight(2.0, 10.0, statuses=armed_from(0.0))
    faults = ("rotor:2:off", "rotor:2:off@11.9", "state:freeze@12-13", "battery:level=0.1@500")
    summary = summarise(flight, square_plan(), RunInfo("completed", "x.plan", faults=faults))
    assert summary["faults_not_begun"] == ["state:freeze@12-13", "battery:level=0.1@500"]
    assert (
        summarise(Flight(), square_plan(), RunInfo("no_vehicle", "x", faults=faults))["faults_not_begun"]
        == []
    )


def test_every_key_of_the_summary_is_documented(log_path: Path) -> None:
    page = (Path(__file__).parents[2] / "docs" / "reference" / "summary.md").read_text()
    told = set(re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE))
    summary = summarise(read_flight(log_path), square_plan(), RunInfo("completed", "x.plan"))
    assert told == {*summary, *summary["waypoints"][0], *Code, "directory"}


def test_a_run_without_a_log_still_has_a_summary(tmp_path: Path) -> None:
    run = RunInfo(
        "process_ended",
        "p.plan",
        outcome_text="sim-bridge ended early",
        log_path=tmp_path / "flight.ulg",
        inner_hz=math.nan,
    )
    summary = summarise(Flight(), square_plan(), run)
    assert set(summary) == REQUIRED
    write_summary(tmp_path / "summary.json", summary)
    got = json.loads((tmp_path / "summary.json").read_text())
    assert (got["outcome"], got["outcome_text"]) == ("process_ended", "sim-bridge ended early")
    assert got["rms_tracking_error_m"] is got["log_sha256"] is got["inner_hz"] is None
    assert len(got["waypoints"]) == 6
    assert [path.name for path in tmp_path.iterdir()] == ["summary.json"]


def test_a_summary_that_cannot_be_written_leaves_the_old_one(tmp_path: Path) -> None:
    path = tmp_path / "summary.json"
    write_summary(path, {"outcome": "old"})
    with pytest.raises(ValueError, match="JSON"):
        write_summary(path, {"outcome": math.nan})
    assert json.loads(path.read_text()) == {"outcome": "old"}


@pytest.mark.parametrize("content", [b"", b"ULog", b"not a log at all, but text", bytes(5000)])
def test_a_file_that_is_no_log_is_one_sentence(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "flight.ulg"
    path.write_bytes(content)
    with pytest.raises(ConfigError, match=r"flight\.ulg: is not a readable flight log"):
        read_flight(path)


def test_a_missing_log_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot be read: No such file"):
        read_flight(tmp_path / "flight.ulg")


def test_a_log_cut_anywhere_is_read_as_far_as_it_goes(log_path: Path, tmp_path: Path) -> None:
    content = log_path.read_bytes()
    path = tmp_path / "cut.ulg"
    durations = []
    for size in np.linspace(4000, len(content), 23, dtype=int):  # the definitions take less than 4000 bytes
        path.write_bytes(content[:size])
        durations.append(read_flight(path).duration_s)
    assert durations == sorted(durations)
    assert durations[-1] == pytest.approx(35.99)


def test_unknown_message_longer_than_its_log_ends_the_reading(log_path: Path) -> None:
    content = bytearray(log_path.read_bytes()[:20_000])
    size, _ = struct.unpack_from("<HB", content, 16)
    struct.pack_into("<HB", content, 16 + 3 + size, 0xFFFF, 0)  # the second definition
    assert flight_of(bytes(content), "log").damaged


def test_damage_is_never_printed_or_raised_as_anything_else(
    log_path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    content = bytearray(log_path.read_bytes()[:60_000])
    path = tmp_path / "damaged.ulg"
    rng = np.random.default_rng(5)
    outcomes = set()
    for _ in range(60):
        damaged = content.copy()
        for position in rng.integers(0, 8000, 12):
            damaged[position] = rng.integers(0, 256)
        path.write_bytes(damaged)
        try:
            outcomes.add(type(read_flight(path)))
        except ConfigError:
            outcomes.add(ConfigError)
    assert outcomes <= {Flight, ConfigError}
    assert capsys.readouterr().out == ""


def test_flight_time_is_unknown_without_an_arming_state() -> None:
    time_s = np.arange(0.0, 10.0, 0.1)
    flight = Flight(duration_s=10.0, position=series(time_s, np.zeros((100, 3))))
    assert summarise(flight, Plan(()), RunInfo("", ""))["flight_time_s"] is None


def test_first_instance_of_a_topic_and_first_known_origin_count() -> None:
    def topic(name: str, number: int, **fields: list[float]) -> SimpleNamespace:
        data = {"timestamp": np.array([0, 1], dtype=np.uint64)}
        return SimpleNamespace(
            name=name, multi_id=number, data=data | {k: np.array(v) for k, v in fields.items()}
        )

    place = {"ref_lat": [math.nan, 47.0], "ref_lon": [math.nan, 8.0], "ref_alt": [math.nan, 400.0]}
    topics = [
        topic("battery_status", number, remaining=[share] * 2, voltage_v=[12.0] * 2)
        for number, share in ((0, 0.9), (1, 0.2))
    ]
    log = SimpleNamespace(
        start_timestamp=0, last_timestamp=1, data_list=[*topics, topic("vehicle_local_position", 0, **place)],
        msg_info_dict={}, initial_parameters={}, logged_messages=[], file_corruption=False,
    )  # fmt: skip
    flight = flight_in(ParsedLog(log, False), "log")
    assert flight.battery.values[:, 0].tolist() == [0.9, 0.9]
    assert flight.local_origin == (47.0, 8.0, 400.0)
