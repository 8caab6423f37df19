"""HIL_SENSOR and HIL_GPS: their bytes against pymavlink's, and what they refuse."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link
from flightstack.simulator_link.sensor_frames import (
    ACCEL,
    BARO,
    GYRO,
    MAG,
    HilGps,
    HilSensorFrame,
    decode_gps,
    encode_gps,
    gps_of,
)

properties = settings(max_examples=60)
times = st.integers(0, 2**64 - 1)
singles = st.floats(allow_nan=False, allow_infinity=True, width=32)
thirteen = st.lists(singles, min_size=13, max_size=13)
NAMES = (
    "xacc", "yacc", "zacc", "xgyro", "ygyro", "zgyro", "xmag", "ymag", "zmag",
    "abs_pressure", "diff_pressure", "pressure_alt", "temperature",
)  # fmt: skip


def sealed(values, time_us: int = 5000, fields: int = ACCEL | GYRO, number: int = 0, seq: int = 0) -> bytes:
    frame = HilSensorFrame(3, 200)
    for _ in range(seq):
        frame.seal(0, 0, 0)
    frame.values[:] = values
    return bytes(frame.seal(time_us, fields, number))


def test_groups_of_fields_are_those_that_px4_tests() -> None:
    assert (ACCEL, GYRO, MAG, BARO) == (0x7, 0x38, 0x1C0, 0x1A00)


@properties
@given(
    thirteen, times, st.sampled_from([0, 0x3F, 0x1FF, 0x1BFF, 2**31]), st.integers(0, 2), st.integers(0, 300)
)
def test_hil_sensor_has_pymavlinks_bytes(values, time_us, fields, number, seq) -> None:
    codec = mavlink.MAVLink(None, 3, 200)
    codec.seq = seq % 256
    message = mavlink.MAVLink_hil_sensor_message(time_us, *values, fields, number)
    assert sealed(values, time_us, fields, number, seq) == bytes(message.pack(codec))


@properties
@given(thirteen, times, st.integers(0, 2**32 - 1), st.integers(0, 255))
def test_hil_sensor_opens_what_was_sealed(values, time_us, fields, number) -> None:
    frame = HilSensorFrame()
    frame.values[:] = 1.0
    assert frame.open(sealed(values, time_us, fields, number))
    assert frame.values.tobytes() == np.array(values, "<f4").tobytes()
    assert (frame.time_us, frame.fields, frame.number) == (time_us, fields, number)
    (message,) = Link(1, 1).decode(sealed(values, time_us, fields, number))
    other = HilSensorFrame()
    other.take(message)
    assert other.values.tobytes() == frame.values.tobytes()
    assert (other.time_us, other.fields, other.number) == (time_us, fields, number)


@pytest.mark.parametrize(("fields", "number"), [(0, 0), (0, 1), (0x3F, 0)])
def test_sealing_keeps_the_values_of_hil_sensor(fields: int, number: int) -> None:
    """Without fields the last values may be zero, and the checksum stands in their place in the message."""
    frame = HilSensorFrame()
    frame.values[:3] = (1.0, 2.0, 3.0)
    before = frame.values.tolist()
    frame.seal(5000, fields, number)
    assert frame.values.tolist() == before


def test_corrupted_hil_sensor_is_refused_and_changes_nothing() -> None:
    data, frame = sealed(range(13)), HilSensorFrame()
    before = frame.values.tobytes()
    for index in range(len(data)):
        broken = bytearray(data)
        broken[index] ^= 1
        assert not frame.open(broken)
    assert not frame.open(data[:-1])
    assert not frame.open(data + b"\x00")
    assert not frame.open(b"")
    assert (frame.values.tobytes(), frame.time_us) == (before, 0)


FIX = HilGps(123456789, 47.3977421, 8.5455944, 488.123, 0.58, 0.63, (1.25, -2.5, 0.75), 3, 14)


def test_hil_gps_has_pymavlinks_bytes_in_px4s_units() -> None:
    """Accuracies in centimetres, as PX4 reads them; the course of (1.25, −2.5) is 296.57°."""
    message = mavlink.MAVLink_hil_gps_message(
        123456789, 3, 473977421, 85455944, 488123, 58, 63, 280, 125, -250, 75, 29657, 14
    )
    assert encode_gps(FIX, 7, 3, 200) == bytes(packed(message, 7))


def packed(message, seq: int) -> bytes:
    codec = mavlink.MAVLink(None, 3, 200)
    codec.seq = seq
    return bytes(message.pack(codec))


def test_hil_gps_is_decoded_by_both_decoders() -> None:
    data = encode_gps(FIX, 0, 3, 200)
    (message,) = Link(1, 1).decode(data)
    fix = decode_gps(data)
    assert fix == gps_of(message)
    assert fix is not None
    for given_value, found in zip(FIX, fix, strict=True):
        assert found == pytest.approx(given_value)


def test_unknown_accuracy_of_hil_gps_is_nan() -> None:
    message = mavlink.MAVLink_hil_gps_message(1, 3, 0, 0, 0, 65535, 65535, 0, 0, 0, 0, 0, 5)
    fix = decode_gps(packed(message, 0))
    assert fix is not None
    assert math.isnan(fix.eph_m)
    assert math.isnan(fix.epv_m)


def test_corrupted_hil_gps_is_refused() -> None:
    data = encode_gps(FIX, 0, 3, 200)
    for index in range(len(data)):
        broken = bytearray(data)
        broken[index] ^= 1
        assert decode_gps(broken) is None
    assert decode_gps(b"") is None
