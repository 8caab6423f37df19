"""The frames of the lockstep exchange in compiled code have the bytes of the codecs, and refuse what these refuse."""

from __future__ import annotations

import numpy as np
from fastcrc import crc16
from hypothesis import given, settings
from hypothesis import strategies as st

from flightstack.simulator_link.frame_kernels import (
    CHECKSUM,
    HEADER,
    SHAPE,
    checksum_of,
    frame_size,
    read_bytes,
    seal,
    write_bytes,
)
from flightstack.simulator_link.hot_frames import ActuatorsFrame, PlantStateFrame
from flightstack.simulator_link.sensor_frames import ACCEL, GYRO, SENSOR_SHAPE, HilSensorFrame

SENSOR = np.array([SENSOR_SHAPE], SHAPE)
properties = settings(max_examples=60)


def as_array(data: bytes | memoryview) -> np.ndarray:
    return np.frombuffer(bytes(data), np.uint8).copy()


@properties
@given(st.binary(min_size=1, max_size=300), st.integers(0, 255), st.data())
def test_checksum_is_that_of_fastcrc(data: bytes, extra: int, places: st.DataObject) -> None:
    begin = places.draw(st.integers(0, len(data)))
    end = places.draw(st.integers(begin, len(data)))
    expected = crc16.mcrf4xx(data[begin:end] + bytes([extra]))
    assert checksum_of(as_array(data), begin, end, extra) == expected


@properties
@given(st.integers(1, 8), st.data())
def test_numbers_are_little_endian(count: int, data: st.DataObject) -> None:
    value = data.draw(st.integers(0, 2 ** min(63, 8 * count) - 1))
    array = np.full(12, 170, np.uint8)
    write_bytes(array, 2, count, value)
    assert array.tobytes() == b"\xaa\xaa" + value.to_bytes(count, "little") + b"\xaa" * (10 - count)
    assert read_bytes(array, 2, count) == value


@properties
@given(st.integers(0, 2**63 - 1), st.integers(0, 600))
def test_sealed_frames_have_the_bytes_of_the_codec(time_us: int, before: int) -> None:
    for kind in (PlantStateFrame, ActuatorsFrame):
        codec, compiled = kind(3, 200), kind(3, 200)
        frame = np.frombuffer(compiled.frame, np.uint8)
        for at_us in (*[0] * (before % 3), time_us):
            expected = bytes(codec.seal(at_us, 0))
            assert seal(frame, at_us, compiled.shape.size, compiled.shape.extra) == len(expected)
        assert frame.tobytes() == expected


@properties
@given(st.integers(0, 2**63 - 1), st.sampled_from([ACCEL | GYRO, 0x1FF, 0x1BFF]), st.integers(0, 2))
def test_frames_of_the_codec_are_found(time_us: int, fields: int, number: int) -> None:
    codec = HilSensorFrame(3, 200)
    codec.values[:] = range(13)
    data = as_array(b"junk" + bytes(codec.seal(time_us, fields, number)) + b"more")
    size = len(data) - 8
    assert frame_size(data, 4, len(data), SENSOR) == frame_size(data, 4, len(data) - 4, SENSOR) == size
    assert read_bytes(data, 4 + HEADER, 8) == time_us
    assert frame_size(data, 4, len(data) - 5, SENSOR) == 0  # not all of it is there
    assert frame_size(data, 3, len(data), SENSOR) == 0


def test_any_changed_bit_is_refused() -> None:
    codec = HilSensorFrame(3, 200)
    codec.values[:] = range(13)
    good = bytes(codec.seal(5000, ACCEL | GYRO, 0))
    for index in range(len(good)):
        for bit in range(8):
            bad = as_array(good)
            bad[index] ^= 1 << bit
            assert frame_size(bad, 0, len(bad), SENSOR) == 0, (index, bit)
    state = PlantStateFrame()
    other = as_array(state.seal(5000, 0))
    assert frame_size(other, 0, len(other), SENSOR) == 0
    assert frame_size(other, 0, len(other), np.array([state.shape], SHAPE)) == len(other)


def test_short_data_is_no_frame() -> None:
    data = as_array(bytes([0xFD, 0]) + bytes(HEADER + CHECKSUM - 2))
    for end in range(len(data) + 1):
        assert frame_size(data, 0, end, SENSOR) == 0
