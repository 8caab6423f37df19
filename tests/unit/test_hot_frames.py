"""The frames encoded in place: their bytes against pymavlink's, and what they refuse."""

from __future__ import annotations

import math
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flightstack.mavlink.dialect import FsActuators, FsPlantState, mavlink
from flightstack.mavlink.link import Link
from flightstack.simulator_link.hot_frames import ActuatorsFrame, PlantStateFrame

properties = settings(max_examples=60)
times = st.integers(0, 2**64 - 1)
doubles = st.floats(allow_nan=True, allow_infinity=True, width=64)
singles = st.floats(allow_nan=True, allow_infinity=True, width=32)
states = st.lists(doubles, min_size=13, max_size=13)
flags = st.integers(0, 255)


def plant_frame(system: int, seq: int, time_us: int, state, speeds, count: int, flag: int) -> bytes:
    frame = PlantStateFrame(system, 1)
    for _ in range(seq):
        frame.seal(0, 0)
    frame.state[:] = state
    frame.rotor_speed_rad_s[:] = speeds
    frame.set_rotor_count(count)
    return bytes(frame.seal(time_us, flag))


@properties
@given(
    st.integers(1, 255),
    st.integers(0, 300),
    times,
    states,
    st.lists(singles, min_size=8, max_size=8),
    flags,
    flags,
)
def test_plant_state_has_pymavlinks_bytes(system, seq, time_us, state, speeds, count, flag) -> None:
    codec = mavlink.MAVLink(None, system, 1)
    codec.seq = seq % 256
    message = FsPlantState(time_us, state[:3], state[3:6], state[6:10], state[10:13], speeds, count, flag | 1)
    assert plant_frame(system, seq, time_us, state, speeds, count, flag) == bytes(message.pack(codec))


@properties
@given(st.integers(1, 255), times, st.lists(doubles, min_size=8, max_size=8), flags, flags)
def test_actuators_have_pymavlinks_bytes(system, time_us, speeds, count, flag) -> None:
    frame = ActuatorsFrame(system)
    frame.rotor_speed_rad_s[:] = speeds
    frame.set_rotor_count(count)
    message = FsActuators(time_us, speeds, count, flag | 1)
    assert bytes(frame.seal(time_us, flag)) == bytes(message.pack(mavlink.MAVLink(None, system, 1)))


@properties
@given(times, st.lists(st.floats(allow_nan=False), min_size=13, max_size=13))
def test_sealed_frame_opens_and_equals_pymavlink(time_us: int, state: list[float]) -> None:
    data = plant_frame(9, 0, time_us, state, [1.5] * 8, 4, 2)
    frame = PlantStateFrame()
    assert frame.open(data)
    assert frame.state.tolist() == state
    assert (frame.time_us, frame.flags) == (time_us, 3)
    (message,) = Link(1, 1).decode(data)
    assert message.get_type() == "FS_PLANT_STATE"
    assert [*message.position_ned_m, *message.velocity_ned_m_s, *message.q, *message.rates_frd_rad_s] == state
    assert (message.time_us, message.rotor_count, message.get_srcSystem()) == (time_us, 4, 9)


@pytest.mark.parametrize("kind", [PlantStateFrame, ActuatorsFrame])
def test_any_corrupted_byte_is_refused_and_changes_nothing(kind) -> None:
    rng = np.random.default_rng(3)
    sender, receiver = kind(), kind()
    sender.frame[10:] = rng.bytes(len(sender.frame) - 10)
    data = bytes(sender.seal(123_456, 7))
    assert receiver.open(data)
    held = bytes(receiver.frame)
    sender.frame[12:20] = bytes(8)
    other = bytes(sender.seal(200_000, 7))
    for position in range(len(other)):
        for bit in range(8):
            bad = bytearray(other)
            bad[position] ^= 1 << bit
            assert not receiver.open(bytes(bad)), (position, bit)
            assert not receiver.open(memoryview(bad))
    assert bytes(receiver.frame) == held
    assert receiver.open(other)


def test_only_exactly_one_frame_is_opened() -> None:
    data = plant_frame(1, 0, 5, [0.0] * 13, [0.0] * 8, 4, 0)
    frame = PlantStateFrame()
    for wrong in (b"", data[:1], data[:5], data[:-1], data + b"\x00", data + data, bytes(len(data))):
        assert not frame.open(wrong)
    assert not ActuatorsFrame().open(data)
    assert frame.open(data)


def test_signed_frames_are_left_to_the_general_codec() -> None:
    codec = mavlink.MAVLink(None, 1, 1)
    codec.signing.secret_key = b"k" * 32
    codec.signing.sign_outgoing = True
    signed = bytes(FsActuators(1, [1.0] * 8, 4, 1).pack(codec))
    assert not ActuatorsFrame().open(signed)


def test_the_state_is_the_payload_itself() -> None:
    """No copy: what the kernel reads is what arrived."""
    frame = PlantStateFrame()
    view = frame.state
    frame.open(plant_frame(1, 0, 5, range(13), [2.0] * 8, 4, 0))
    assert view.tolist() == [float(value) for value in range(13)]
    assert view.ctypes.data % 8 == 0
    assert frame.rotor_speed_rad_s.tolist() == [2.0] * 8


def test_sequence_numbers_count_round() -> None:
    frame = ActuatorsFrame()
    assert [frame.seal(0, 0)[4] for _ in range(258)] == [*range(256), 0, 1]


def test_nan_goes_through_bit_by_bit() -> None:
    frame, other = ActuatorsFrame(), ActuatorsFrame()
    frame.rotor_speed_rad_s[:] = math.nan
    assert other.open(bytes(frame.seal(0, 0)))
    assert struct.pack("<d", other.rotor_speed_rad_s[3]) == struct.pack("<d", math.nan)
