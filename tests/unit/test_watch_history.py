"""History of telemetry: fields, bounded rows and rates."""

from __future__ import annotations

import math

import pytest

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link
from gcs_cli.tui.fly.history import ROWS_KEPT, History
from tests.support.telemetry_frames import attitude, received


def test_history_keeps_each_numeric_field_with_its_time() -> None:
    history = History()
    for step in range(3):
        history.record(attitude(0.5 * step), 10.0 + step)
    series = history.series("ATTITUDE.roll")
    assert series.times_s.tolist() == [10.0, 11.0, 12.0]
    assert series.values.tolist() == [0.0, 0.5, 1.0]
    assert "ATTITUDE.yawspeed" in set(history.fields())


def test_history_splits_arrays_and_skips_texts() -> None:
    history = History()
    quaternion = [1.0, 0.0, 0.0, 0.5]
    history.record(received(mavlink.MAVLink_attitude_target_message(0, 0, quaternion, 0, 0, 0, 0.4)), 1.0)
    history.record(received(mavlink.MAVLink_statustext_message(6, b"hello")), 1.0)
    assert history.series("ATTITUDE_TARGET.q[3]").values.tolist() == [0.5]
    assert "STATUSTEXT.text" not in set(history.fields())


def test_history_separates_instances_of_a_message() -> None:
    history = History()
    for number, voltage in ((0, 12_000), (1, 11_000)):
        cells = [voltage] + [65535] * 9
        history.record(
            received(mavlink.MAVLink_battery_status_message(number, 0, 0, 0, cells, -1, -1, -1, 50)), 1.0
        )
    assert history.series("BATTERY_STATUS[1].voltages[0]").values.tolist() == [11_000.0]


def test_history_drops_the_oldest_rows() -> None:
    history = History()
    message = attitude(0.0)
    for step in range(ROWS_KEPT + 10):
        history.record(message, float(step))
    times_s = history.series("ATTITUDE.roll").times_s
    assert len(times_s) == ROWS_KEPT
    assert (times_s[0], times_s[-1]) == (10.0, ROWS_KEPT + 9.0)


def test_history_of_an_unknown_field_is_empty() -> None:
    assert len(History().series("ATTITUDE.roll").values) == 0


def test_rate_falls_to_zero_when_a_stream_stops() -> None:
    history = History()
    message = attitude(math.nan)
    for step in range(100):
        history.record(message, step * 0.1)
    (stream,) = history.streams(1)
    assert history.rate_hz(stream, 9.9) == pytest.approx(10.0, abs=0.4)
    assert history.rate_hz(stream, 20.0) == 0.0


def test_rate_of_a_slow_stream_is_measured_between_its_messages() -> None:
    history = History()
    message = attitude(0.0)
    for step in range(4):
        history.record(message, 2.0 * step)
        (stream,) = history.streams(1)
        rates = [history.rate_hz(stream, 2.0 * step + late_s) for late_s in (0.0, 0.5, 1.9)]
        assert rates == ([0.5] * 3 if step else [0.0] * 3)
    assert history.rate_hz(stream, 13.0) == 0.0


def test_message_that_becomes_known_replaces_its_unknown_stream() -> None:
    history = History()
    link = Link(1, 1)
    frame = link.encode(mavlink.MAVLink_attitude_message(1, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0))
    unknown = mavlink.MAVLink_unknown(mavlink.MAVLINK_MSG_ID_ATTITUDE, frame)
    known = received(mavlink.MAVLink_attitude_message(1, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0))
    unknown._header = known.get_header()
    history.record(unknown, 1.0)
    history.record(known, 2.0)
    assert [stream.name for stream in history.streams()] == ["ATTITUDE"]
    assert history.series("ATTITUDE.roll").values.tolist() == [0.5]
