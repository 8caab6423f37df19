"""The ULog writer, with pyulog as the judge."""

from __future__ import annotations

import io
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyulog import ULog

from flightstack.core.contract import LoopRow, Quaternion
from flightstack.core.geodesy import GeoPoint
from flightstack.core.geometry import euler_from_quaternion
from flightstack.core.geometry_bulk import euler_from_quaternions, heading_from_quaternions
from flightstack.flight_log import ulog
from flightstack.flight_log.flight_log import FlightLog, vehicle_fields
from flightstack.flight_log.row_block import RowBlock
from flightstack.flight_log.topics import EVENT_TOPICS, OUTER, OUTER_TOPICS, inner_topics
from flightstack.params.vehicle import load_vehicle
from tests.support.synthetic_flight import HOME, INFO, PARAMETERS, KeptBytes, synthetic_flight_bytes

ROTORS = 6


class BlockFile(KeptBytes):
    """Remembers where each block written ends."""

    def __init__(self) -> None:
        super().__init__()
        self.ends: list[int] = []

    def write(self, data: Any) -> int:
        written = super().write(data)
        self.ends.append(self.tell())
        return written


def read(content: bytes) -> ULog:
    log = ULog(io.BytesIO(content))
    assert not log.file_corruption
    return log


def random_log(inner_rows: np.ndarray, outer_rows: np.ndarray, capacity: int = 16) -> BlockFile:
    """Inner rows every 2 ms, an outer row with every fifth of them."""
    file = BlockFile()
    log = FlightLog(file, ROTORS, capacity)
    log.start(0, INFO, PARAMETERS, HOME)
    for index, row in enumerate(inner_rows):
        log.inner.append(2000 * index)[:] = row
        if index % 5 == 0:
            log.outer.append(2000 * index)[:] = outer_rows[index // 5]
    log.close()
    return file


@pytest.fixture(scope="module")
def traces() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(7)
    inner, outer = rng.normal(size=(103, LoopRow.SIZE)), rng.normal(size=(21, OUTER.size))
    inner[:, LoopRow.STATUS] = rng.integers(0, 2**16, 103)
    outer[:, OUTER.loop_flags] = rng.integers(0, 2**8, 21)
    return inner, outer


def columns_of(data: dict[str, np.ndarray], name: str, count: int) -> np.ndarray:
    return np.column_stack([data[f"{name}[{index}]"] for index in range(count)])


def test_every_loop_topic_and_field_reads_back(traces: tuple[np.ndarray, np.ndarray]) -> None:
    inner, outer = traces
    log = read(random_log(inner, outer).content)
    for topics, rows, step_us in ((inner_topics(ROTORS), inner, 2000), (OUTER_TOPICS, outer, 10000)):
        for topic in topics:
            data = log.get_dataset(topic.name).data
            assert data["timestamp"].tolist() == [step_us * index for index in range(len(rows))]
            checked = 1
            for field in topic.fields:
                if not isinstance(field.source, int):
                    continue
                if field.length:
                    got = columns_of(data, field.name, field.length)
                    expected = rows[:, field.source : field.source + field.length]
                else:
                    got, expected = data[field.name], rows[:, field.source]
                dtype = {"uint16_t": np.uint16, "uint8_t": np.uint8}.get(field.type, np.float32)
                assert got.dtype == dtype
                assert np.array_equal(got, expected.astype(dtype)), f"{topic.name}.{field.name}"
                checked += max(1, field.length)
            constant = sum(1 for field in topic.fields if not isinstance(field.source, int))
            assert len(data) == checked + constant


def test_columns_of_the_traces_neither_overlap_nor_leave_gaps() -> None:
    used = [(f.source, max(1, f.length)) for topic in inner_topics(8) for f in topic.fields]
    covered = sorted(column for source, length in used for column in range(source, source + length))
    assert covered == list(range(6, LoopRow.SIZE))  # position and velocity are logged at the outer rate
    assert (OUTER.setpoint, OUTER.target_attitude, OUTER.target_thrust) == (13, 24, 28)
    assert (OUTER.loop_flags, OUTER.size) == (29, 30)


def test_local_position_has_heading_reference_and_flags(traces: tuple[np.ndarray, np.ndarray]) -> None:
    inner, outer = traces
    outer = outer.copy()
    outer[:, 6:10] /= np.linalg.norm(outer[:, 6:10], axis=1)[:, None]
    data = read(random_log(inner, outer).content).get_dataset("vehicle_local_position").data
    expected = [euler_from_quaternion(Quaternion(*q)).z for q in outer[:, 6:10]]
    assert data["heading"] == pytest.approx(expected, abs=3e-7)  # float32 near π rounds by 1.2e-7
    assert set(data["ref_lat"]) == {HOME.latitude_deg}
    assert set(data["ref_lon"]) == {HOME.longitude_deg}
    assert set(data["ref_alt"]) == {np.float32(HOME.altitude_m)}
    for flag in ("xy_valid", "z_valid", "v_xy_valid", "v_z_valid", "xy_global", "z_global"):
        assert set(data[flag]) == {1}


def test_every_event_topic_and_field_reads_back() -> None:
    file = KeptBytes()
    log = FlightLog(file, 4)
    log.start(500, {}, {}, HOME)
    given_values: dict[str, dict[str, float]] = {}
    for topic in EVENT_TOPICS:
        values = {f.name: 1 if f.type == "bool" else 3 + index for index, f in enumerate(topic.fields)}
        given_values[topic.name] = values
        log.event(topic.name, 1000, **values)
        log.event(topic.name, 2000)
    log.close()
    read_back = read(file.content)
    for topic in EVENT_TOPICS:
        data = read_back.get_dataset(topic.name).data
        assert data["timestamp"].tolist()[-2:] == [1000, 2000]
        for field in topic.fields:
            assert data[field.name][-2] == given_values[topic.name][field.name]
            last = data[field.name][-1]
            assert last == field.default or (math.isnan(last) and math.isnan(field.default))


def test_an_unknown_field_of_an_event_is_an_error() -> None:
    log = FlightLog(KeptBytes(), 4)
    log.start(0, {}, {}, HOME)
    with pytest.raises(TypeError, match="altitude"):
        log.event("home_position", 0, altitude=3.0)


def test_info_parameters_texts_and_home_read_back() -> None:
    file = KeptBytes()
    log = FlightLog(file, 4)
    info = {**INFO, "seed": 2**40, "operator": "Zoë", "note": ""}
    log.start(123, info, PARAMETERS, HOME)
    log.message(200, 4, "wind is 3 m/s — careful")
    log.message(300, 0, "emergency")
    log.close()
    got = read(file.content)
    assert got.start_timestamp == 123
    assert got.msg_info_dict == info
    assert got.initial_parameters == PARAMETERS
    assert {name: type(value) for name, value in got.initial_parameters.items()}["INNER_DIVISOR"] is int
    texts = [(m.timestamp, m.log_level_str(), m.message) for m in got.logged_messages]
    assert texts == [(200, "WARNING", "wind is 3 m/s — careful"), (300, "EMERGENCY", "emergency")]


def test_log_bytes_are_independent_of_block_size(
    traces: tuple[np.ndarray, np.ndarray],
) -> None:
    assert synthetic_flight_bytes(20, 100, 8.0) == synthetic_flight_bytes(20, 100, 8.0)
    small, large = (random_log(*traces, capacity=capacity).content for capacity in (7, 64))
    assert small != large  # the order across topics differs
    assert len(small) == len(large)
    ulogs = [read(content) for content in (small, large)]
    assert ulogs[0].data_list == ulogs[1].data_list


def test_the_log_of_a_killed_process_reads_up_to_its_last_block(
    traces: tuple[np.ndarray, np.ndarray],
) -> None:
    file = random_log(*traces)
    rows = []
    for end in file.ends:
        data = {d.name: d.data for d in read(file.content[:end]).data_list}
        rows.append(len(data["vehicle_attitude"]["timestamp"]) if "vehicle_attitude" in data else 0)
    assert rows == sorted(rows)
    assert rows[0] == 0
    assert rows[-1] == len(traces[0])


def test_events_come_after_the_rows_before_them() -> None:
    file = BlockFile()
    log = FlightLog(file, 4)
    log.start(0, {}, {}, HOME)
    log.inner.append(1000)
    log.event("vehicle_land_detected", 1500, landed=True)
    before = read(file.getvalue())
    assert before.get_dataset("vehicle_attitude").data["timestamp"].tolist() == [1000]
    assert before.get_dataset("vehicle_land_detected").data["landed"].tolist() == [1]


def test_a_loop_may_write_its_rows_in_place() -> None:
    file = KeptBytes()
    log = FlightLog(file, 4, capacity=4)
    log.start(0, {}, {}, HOME)
    trace = log.inner
    for tick in range(11):
        trace.rows[trace.n, LoopRow.WRENCH.start] = tick
        trace.times_us[trace.n] = tick
        trace.n += 1
        if trace.n == trace.capacity:
            log.flush()
    log.close()
    assert read(file.content).get_dataset("wrench").data["thrust_n"].tolist() == list(range(11))


def test_values_that_do_not_fit_neither_raise_nor_warn() -> None:
    block = RowBlock(inner_topics(4), 0)
    rows = np.array([[math.nan], [1e300], [-1e300], [math.inf]]) * np.ones((4, LoopRow.SIZE))
    assert len(block.encode(np.arange(4, dtype=np.uint64), rows)) == 4 * block.row_size


class FullDisk(KeptBytes):
    """Takes a number of bytes, partly where need be, and then fails."""

    def __init__(self, room: int) -> None:
        super().__init__()
        self.room = room

    def write(self, data: Any) -> int:
        if self.room == 0:
            raise OSError(28, "No space left on device")
        part = memoryview(data)[: self.room]
        self.room -= len(part)
        return super().write(part)


def whole_length(content: bytes) -> int:
    """Bytes up to the end of the last whole message, by the format's definition: size, type, content."""
    end = 16 if len(content) >= 16 else 0
    while 16 <= end <= len(content) - 3 and end + 3 + int.from_bytes(content[end : end + 2], "little") <= len(
        content
    ):
        end += 3 + int.from_bytes(content[end : end + 2], "little")
    return end


def test_a_full_disk_ends_the_log_but_not_the_flight(traces: tuple[np.ndarray, np.ndarray]) -> None:
    complete = random_log(*traces).content
    file = FullDisk(room=12345)
    log = FlightLog(file, ROTORS, 16)
    log.start(0, INFO, PARAMETERS, HOME)
    for index, row in enumerate(traces[0]):
        log.inner.append(2000 * index)[:] = row
        if index % 5 == 0:
            log.outer.append(2000 * index)[:] = traces[1][index // 5]
    log.close()
    log.close()
    assert isinstance(log.error, OSError)
    assert len(file.content) == whole_length(complete[:12345])
    assert complete.startswith(file.content)
    assert not ULog(io.BytesIO(file.content)).file_corruption


@pytest.mark.parametrize("room", [0, 1, 15, 16, 17, 60, 5000, 20_000])
def test_truncated_log_ends_with_complete_message(traces: tuple[np.ndarray, np.ndarray], room: int) -> None:
    file = FullDisk(room)
    log = FlightLog(file, ROTORS, 16)
    log.start(0, INFO, PARAMETERS, HOME)
    for index, row in enumerate(traces[0]):
        log.inner.append(2000 * index)[:] = row
    log.close()
    assert len(file.content) == whole_length(file.content)
    assert len(file.content) <= room


def test_partial_writes_are_completed(traces: tuple[np.ndarray, np.ndarray]) -> None:
    class Sips(KeptBytes):
        def write(self, data: Any) -> int:
            return super().write(memoryview(data)[:1000])

    file = Sips()
    log = FlightLog(file, ROTORS)
    log.start(0, INFO, PARAMETERS, HOME)
    log.close()
    whole = KeptBytes()
    log = FlightLog(whole, ROTORS)
    log.start(0, INFO, PARAMETERS, HOME)
    log.close()
    assert file.content == whole.content


@settings(max_examples=50)
@given(
    st.dictionaries(st.from_regex(r"[a-z_0-9]{1,20}", fullmatch=True), st.text(max_size=40), max_size=5),
    st.lists(st.tuples(st.integers(0, 7), st.text(max_size=60)), max_size=5),
)
def test_any_text_survives(info: dict[str, str], texts: list[tuple[int, str]]) -> None:
    file = KeptBytes()
    log = FlightLog(file, 4)
    log.start(0, info, {}, GeoPoint(0.0, 0.0, 0.0))
    for level, text in texts:
        log.message(0, level, text)
    log.close()
    got = read(file.content)
    assert got.msg_info_dict == info
    assert [(m.log_level - ord("0"), m.message) for m in got.logged_messages] == texts


def test_a_message_too_long_for_the_format_is_an_error() -> None:
    with pytest.raises(ValueError, match="65535"):
        ulog.logged_string(0, 6, "x" * 70000)


def test_vehicle_info_has_limits_only_where_there_are_some() -> None:
    vehicle = load_vehicle("paper_quad")
    assert vehicle_fields(vehicle)["rotor_max_speed_rad_s"] == pytest.approx(303.4, abs=0.1)
    assert "rotor_max_speed_rad_s" not in vehicle_fields(vehicle.with_ideal_rotors())


def test_bulk_euler_angles_equal_the_compiled_ones() -> None:
    q = np.random.default_rng(3).normal(size=(500, 4))
    q /= np.linalg.norm(q, axis=1)[:, None]
    one_by_one = np.array([euler_from_quaternion(Quaternion(*row)) for row in q])
    # 2e-15 measured; NumPy's and the C library's inverse functions differ in the last digit
    assert np.abs(euler_from_quaternions(q) - one_by_one).max() < 1e-12
    assert np.array_equal(heading_from_quaternions(q), euler_from_quaternions(q)[:, 2])
