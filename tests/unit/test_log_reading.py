"""Logs as arrays, fields by incomplete names, motion, and the plot in the terminal."""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pyulog import ULog

from flightstack.core.errors import ConfigError
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link
from flightstack.mavlink.param_values import wire_value
from gcs_cli.charts.figure import Axis, Panel, Series
from gcs_cli.errors import USAGE, CliError
from gcs_cli.link.tlog import encode_record
from gcs_cli.logs.export_mcap import foxglove_channels, topic_channels
from gcs_cli.logs.fields import find_fields
from gcs_cli.logs.info import info_lines
from gcs_cli.logs.motion import motion_of
from gcs_cli.logs.plot import field_figure, terminal_panel
from gcs_cli.logs.reader import read_log
from gcs_cli.logs.recording import TLOG, ULOG, Recording
from gcs_cli.logs.scene import enu_positions, enu_quaternions
from gcs_cli.logs.tlog_reader import read_tlog
from gcs_cli.logs.ulog_reader import read_ulog
from gcs_cli.replay.replay_run import playback_of
from tests.support.sample_logs import EPOCH_US, small_tlog, small_ulog
from tests.support.synthetic_flight import synthetic_flight_bytes


def integer_bits(value: int) -> float:
    """Return the float with the bits of an integer."""
    return wire_value(value, is_integer=True)


@pytest.fixture(scope="module")
def ulog_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("log") / "flight.ulg"
    path.write_bytes(small_ulog())
    return path


@pytest.fixture(scope="module")
def ulog(ulog_path: Path) -> Recording:
    return read_log(ulog_path)


@pytest.fixture(scope="module")
def tlog() -> Recording:
    return read_tlog(small_tlog(), "gcs.tlog")


def test_ulog_topics_equal_those_of_pyulog(ulog: Recording, ulog_path: Path) -> None:
    expected = {item.name: item.data for item in ULog(str(ulog_path)).data_list}
    assert ulog.form == ULOG
    assert {topic.name for topic in ulog.topics} == set(expected)
    for topic in ulog.topics:
        data = expected[topic.name]
        np.testing.assert_array_equal(topic.time_us, data["timestamp"])
        assert set(topic.fields) == set(data) - {"timestamp"}
        for name, values in topic.fields.items():
            np.testing.assert_array_equal(values, data[name])


def test_topics_without_samples_are_left_out(ulog: Recording) -> None:
    assert all(topic.count for topic in ulog.topics)


def test_tlog_topics_are_messages_by_sender(tlog: Recording) -> None:
    counts = {topic.name: topic.count for topic in tlog.topics}
    assert tlog.form == TLOG
    assert tlog.vehicle == (7, 1)
    assert (counts["ATTITUDE"], counts["HEARTBEAT"], counts["HEARTBEAT_255_190"]) == (40, 4, 4)
    assert tlog.parameters == {"MPC_XY_CRUISE": 5.0}
    assert [text.text for text in tlog.texts] == ["Low battery"]
    attitude = tlog.topic("ATTITUDE")
    assert attitude is not None
    assert attitude.rate_hz == pytest.approx(10.0)
    assert attitude.time_us[0] == EPOCH_US + 8


@pytest.mark.parametrize(
    ("autopilot", "sent", "value"),
    [
        (mavlink.MAV_AUTOPILOT_PX4, integer_bits(3), 3),
        (mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, 3.0, 3),
    ],
)
def test_integer_parameters_of_a_tlog_are_read(autopilot: int, sent: float, value: int) -> None:
    message = mavlink.MAVLink_param_value_message(b"N", sent, mavlink.MAV_PARAM_TYPE_INT32, 1, 0)
    content = small_tlog(autopilot) + encode_record(EPOCH_US + 5_000_000, Link(7, 1).encode(message))
    found = read_tlog(content, "log").parameters["N"]
    assert (found, type(found)) == (value, int)


def test_truncated_logs_are_read_and_reported() -> None:
    for read, content in ((read_ulog, small_ulog()), (read_tlog, small_tlog())):
        recording = read(content[: 2 * len(content) // 3], "log")
        assert recording.damaged
        assert recording.duration_s > 1.0
        assert not read(content, "log").damaged


def test_replay_of_a_truncated_log_is_warned_of(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "flight.ulg"
    content = small_ulog()
    path.write_bytes(content[: 2 * len(content) // 3])
    playback_of(path)
    assert capsys.readouterr().err.startswith(f"gcs: warning: {path}: the log is damaged; read up to ")


@pytest.mark.parametrize("read", [read_ulog, read_tlog])
def test_damaged_bytes_never_raise_another_error(read: Callable[[bytes, str], Recording]) -> None:
    content = synthetic_flight_bytes(200, 400, 8.0) if read is read_ulog else small_tlog()
    refused = 0
    for seed in range(60):
        rng, damaged = random.Random(seed), bytearray(content)
        for _ in range(rng.choice((1, 5, 50))):
            damaged[rng.randrange(rng.choice((len(content), 3000)))] = rng.randrange(256)
        try:
            recording = read(bytes(damaged), "log")
            assert list(info_lines(recording))
            motion_of(recording)
            for channel in (*topic_channels(recording), *foxglove_channels(recording)):
                json.dumps(channel.row(len(channel.time_us) - 1), allow_nan=False)
        except (ConfigError, CliError):
            refused += 1
    assert refused < 30  # 15 of the ULogs, none of the tlogs


def test_a_file_that_is_no_log_is_a_usage_error(tmp_path: Path) -> None:
    for name, content in (("a.tlog", b"hello"), ("b.ulg", b"ULog\x01\x12\x35"), ("c", b"")):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(CliError) as error:
            read_log(tmp_path / name)
        assert error.value.exit_code == USAGE
        assert str(tmp_path / name) in str(error.value)
    with pytest.raises(CliError, match="cannot be read"):
        read_log(tmp_path / "missing.ulg")


def test_info_names_rates_and_texts(tlog: Recording) -> None:
    lines = list(info_lines(tlog))
    about, topics = (
        lines[0].facts,
        {line.facts["name"]: line.facts for line in lines if line.event == "topic"},
    )
    assert about["start_utc"] == "2023-11-14T22:13:20.000+00:00"
    assert about["vehicle"] == {"vehicle_type": "quadrotor", "autopilot": "px4"}
    assert topics["ATTITUDE"]["rate_hz"] == pytest.approx(10.0)
    assert lines[-1].facts == {"time_s": pytest.approx(1.000004), "severity": 4, "text": "Low battery"}


@pytest.mark.parametrize(
    ("wanted", "found"),
    [
        ("vehicle_local_position.x", ["vehicle_local_position.x"]),
        ("Vehicle_Local_Position.X", ["vehicle_local_position.x"]),
        ("vehicle_attitude.q", [f"vehicle_attitude.q[{index}]" for index in range(4)]),
        ("attitude.q", [f"vehicle_attitude.q[{index}]" for index in range(4)]),
        ("vehicle_attitude.q[2]", ["vehicle_attitude.q[2]"]),
        ("overruns", ["loop_timing.overruns"]),
        ("local_position.v?", [f"vehicle_local_position.v{axis}" for axis in "xyz"]),
        ("*local_position.v?", [f"vehicle_local_position.v{axis}" for axis in "xyz"]),
        ("loop overruns", ["loop_timing.overruns"]),
    ],
)
def test_fields_are_found_by_incomplete_names(ulog: Recording, wanted: str, found: list[str]) -> None:
    assert [field.label for field in find_fields(ulog, wanted)] == found


def test_topic_stands_for_all_its_fields(ulog: Recording, monkeypatch: pytest.MonkeyPatch) -> None:
    found = find_fields(ulog, "Vehicle_Attitude")
    assert {field.topic.name for field in found} == {"vehicle_attitude"}
    assert [field.name for field in found][-4:] == [f"q[{index}]" for index in range(4)]
    monkeypatch.setattr("gcs_cli.logs.fields.MOST_FIELDS", 3)
    with pytest.raises(
        CliError, match=r"vehicle_attitude has \d+ fields, give some of them: .*q\[0\], q\[1\]"
    ):
        find_fields(ulog, "vehicle_attitude")


@pytest.mark.parametrize(
    ("wanted", "said"),
    [
        ("vehicle_local_positon.x", "did you mean vehicle_local_position.x"),
        ("valid", "valid is not unique: "),
        ("zzz", "has no such field"),
    ],
)
def test_unknown_and_ambiguous_fields_are_usage_errors(ulog: Recording, wanted: str, said: str) -> None:
    with pytest.raises(CliError) as error:
        find_fields(ulog, wanted)
    assert said in str(error.value)
    assert error.value.exit_code == USAGE


def test_motion_of_a_ulog_derives_places_from_the_origin(ulog: Recording) -> None:
    motion = motion_of(ulog)
    assert motion.home is not None
    assert len(motion.geodetic.time_us) == len(motion.position.time_us)
    first = motion.geodetic.values[0]
    assert first[:2] == pytest.approx([motion.home.latitude_deg, motion.home.longitude_deg], abs=1e-6)
    assert first[2] == pytest.approx(motion.home.altitude_m - motion.position.values[0, 2])


def test_motion_of_a_tlog_has_attitudes_and_places(tlog: Recording) -> None:
    motion = motion_of(tlog)
    np.testing.assert_allclose(np.linalg.norm(motion.attitude.values, axis=1), 1.0)
    assert motion.position.values[10].tolist() == pytest.approx([1.0, 0.0, -1.0])
    assert motion.geodetic.values[0].tolist() == pytest.approx([47.397742, 8.545594, 489.0])


def test_scene_attitude_is_the_product_of_three_turns() -> None:
    rng = np.random.default_rng(1)
    q = rng.standard_normal((5, 4))
    q /= np.linalg.norm(q, axis=1)[:, None]
    half = np.sqrt(0.5)
    for given, turned in zip(q, enu_quaternions(q), strict=True):
        expected = product(product((0.0, half, half, 0.0), given), (0.0, 1.0, 0.0, 0.0))
        np.testing.assert_allclose(turned, expected, atol=1e-12)
    np.testing.assert_array_equal(enu_positions(np.array([[1.0, 2.0, -3.0]])), [[2.0, 1.0, 3.0]])


def product(p: object, q: object) -> list[float]:
    (a, b, c, d), (w, x, y, z) = p, q  # type: ignore[misc]
    return [
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x,
        a * z + b * y - c * x + d * w,
    ]


def test_curves_of_one_legend_differ_in_name_and_colour(ulog: Recording) -> None:
    labels = ("vehicle_attitude.q[0]", "attitude_reference.q[0]", "vehicle_local_position.z")
    fields = [field for label in labels for field in find_fields(ulog, label)]
    figure = field_figure(ulog, fields, 0.0, 10.0)
    curves = [series for panel in figure.panels for series in panel.series]
    assert [series.name for series in curves] == [labels[0], labels[1], "z"]
    assert len({series.colour for series in curves}) == 3
    assert [panel.title for panel in figure.panels] == [label.partition(".")[0] for label in labels]


def test_terminal_plot_has_the_extremes_at_its_edges() -> None:
    x = np.linspace(0.0, 10.0, 200)
    lines = terminal_panel(Panel(Axis(), [Series("ramp", x, x)], title="topic"), 40, 4).plain.split("\n")
    assert lines[0] == "topic  ramp"
    assert [len(line) for line in lines[1:]] == [40] * 5
    assert (lines[1][:12], lines[4][:12]) == ("         10┤", "          0┤")
    assert " " not in lines[1][-1] + lines[4][12]
    assert lines[5].split() == ["0.00", "s", "10.00", "s"]


def test_terminal_plot_of_no_finite_values_is_a_sentence() -> None:
    nothing = Series("a", np.array([0.0]), np.array([np.nan]))
    assert terminal_panel(Panel(Axis(), [nothing], title="t"), 40, 4).plain == "t  a: no finite values"
