"""What the setpoint messages mean: every type mask in every frame, and numbers that are none."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flightstack.core.contract import Vector3
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.guidance.setpoints import AttitudeSetpoint, PointSetpoint
from flightstack.mavlink.dialect import mavlink
from flightstack.services.streams.setpoint_server import PoseReference, read_setpoint

HOME = GeoPoint(47.0, 8.0, 500.0)
HERE = PoseReference(Vector3(10.0, 20.0, -30.0), math.pi / 2, LocalFrame(HOME), HOME.altitude_m)
P, V, A, YAW, YAW_RATE = (1.0, 2.0, -3.0), (0.5, -0.25, 0.125), (0.3, 0.2, 0.1), 0.7, 0.2
LOCAL_FRAMES = (1, 7, 8, 9, 12)
ALL = 0


def local(mask: int, frame: int = 1, p=P, v=V, a=A, yaw=YAW, yaw_rate=YAW_RATE):
    return mavlink.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, frame, mask, *p, *v, *a, yaw, yaw_rate
    )


def global_point(mask: int, frame: int, alt: float = 540.0, lat: int = 470001000, lon: int = 80002000):
    return mavlink.MAVLink_set_position_target_global_int_message(
        0, 1, 1, frame, mask, lat, lon, alt, *V, *A, YAW, YAW_RATE
    )


def expected_numbers(mask: int, frame: int) -> list[float]:
    """The eleven numbers of a local message by the definition of its frame, NaN where a bit ignores one.

    The vehicle is at (10, 20, −30) and looks east: forward is east, right is south.
    """
    body_only = {8: V, 9: V, 12: V}
    numbers = [*P, *V, *A, YAW, YAW_RATE]
    bits = [*range(9), 10, 11]
    given = [math.nan if mask >> bit & 1 else number for bit, number in zip(bits, numbers, strict=True)]
    for start, turns in ((0, frame in (9, 12)), (3, frame in body_only), (6, frame in body_only)):
        forward, right = given[start : start + 2]
        if turns and not (math.isnan(forward) and math.isnan(right)):
            forward = 0.0 if math.isnan(forward) else forward
            right = 0.0 if math.isnan(right) else right
            given[start : start + 2] = -right, forward
    if frame in (7, 9, 12):
        given[:3] = [own + offset for own, offset in zip((10.0, 20.0, -30.0), given[:3], strict=True)]
    return given


def is_sensible(numbers: list[float]) -> bool:
    """PX4's rule: horizontal parts in pairs, and something to go by both horizontally and vertically."""
    known = [not math.isnan(number) for number in numbers]
    pairs = all(known[start] == known[start + 1] for start in (0, 3, 6))
    return pairs and any(known[0:9:3]) and any(known[2:9:3])


@pytest.mark.parametrize("frame", LOCAL_FRAMES)
def test_every_mask_of_a_local_setpoint(frame: int) -> None:
    accepted = 0
    for mask in range(4096):
        read = read_setpoint(local(mask, frame), lambda: HERE)
        numbers = expected_numbers(mask, frame)
        if mask & 512:
            assert read == "a force is not supported"
        elif not is_sensible(numbers):
            assert isinstance(read, str), bin(mask)
        else:
            accepted += 1
            assert isinstance(read, PointSetpoint), (bin(mask), read)
            flat = [*read.position_ned_m, *read.velocity_ned_m_s, *read.acceleration_ned_m_s2, *read[3:]]
            assert flat == pytest.approx(numbers, abs=1e-7, nan_ok=True), bin(mask)
    # LOCAL: (2³−1) horizontal times (2³−1) vertical choices, with or without heading and its rate
    least = 7 * 7 * 4
    assert accepted == least if frame in (1, 7) else accepted > least


@pytest.mark.parametrize(("frame", "altitude_above_home"), [(0, 40.0), (5, 40.0), (3, 540.0), (6, 540.0)])
def test_a_global_setpoint_is_a_place_above_sea_level_or_home(frame: int, altitude_above_home: float) -> None:
    read = read_setpoint(global_point(0b1111_1111_1000 & ~512, frame), lambda: HERE)
    assert isinstance(read, PointSetpoint)
    there = LocalFrame(HOME).to_ned(GeoPoint(47.0001, 8.0002, 500.0 + altitude_above_home))
    assert read.position_ned_m == pytest.approx(there, abs=1e-6)
    assert all(math.isnan(number) for number in (*read.velocity_ned_m_s, *read[3:]))


def test_every_mask_of_a_global_setpoint_follows_the_rule() -> None:
    for mask in range(4096):
        numbers = expected_numbers(mask, 1)
        read = read_setpoint(global_point(mask, 6), lambda: HERE)
        assert isinstance(read, PointSetpoint) == (is_sensible(numbers) and not mask & 512), bin(mask)


@pytest.mark.parametrize("frame", [0, 2, 3, 4, 5, 6, 10, 11, 13, 20, 21, 255])
def test_other_frames_of_a_local_setpoint_are_refused(frame: int) -> None:
    assert read_setpoint(local(ALL, frame), lambda: HERE) == f"coordinate frame {frame} is not supported"


@pytest.mark.parametrize("frame", [1, 2, 8, 10, 11, 255])
def test_other_frames_of_a_global_setpoint_are_refused(frame: int) -> None:
    assert (
        read_setpoint(global_point(ALL, frame), lambda: HERE) == f"coordinate frame {frame} is not supported"
    )


def test_nan_is_not_given_and_a_place_that_is_none_is_refused() -> None:
    nan = math.nan
    read = read_setpoint(local(ALL, p=(nan, nan, nan), a=(nan, nan, math.inf), yaw=nan), lambda: HERE)
    assert isinstance(read, PointSetpoint)
    assert read.velocity_ned_m_s == V
    assert all(math.isnan(n) for n in (*read.position_ned_m, *read.acceleration_ned_m_s2, read.yaw_rad))
    assert isinstance(read_setpoint(local(ALL, p=(1.0, nan, 1.0)), lambda: HERE), str)
    assert isinstance(read_setpoint(local(0b1111_1111_1000 & ~512, p=(1e30, 1e30, 0.0)), lambda: HERE), str)
    assert isinstance(read_setpoint(global_point(ALL, 6, lat=910000000), lambda: HERE), str)
    unset = 0x7FFFFFFF
    read = read_setpoint(global_point(ALL, 6, lat=unset, lon=unset), lambda: HERE)
    assert isinstance(read, PointSetpoint)
    assert math.isnan(read.position_ned_m.x)


def attitude_message(mask: int, q=(0.8, 0.0, 0.6, 0.0), rates=(0.1, 0.2, 0.3), thrust=0.4):
    return mavlink.MAVLink_set_attitude_target_message(0, 1, 1, mask, list(q), *rates, thrust)


def test_every_mask_of_an_attitude_setpoint() -> None:
    for mask in range(256):
        read = read_setpoint(attitude_message(mask), lambda: HERE)
        if mask & (32 | 64) or (mask & 128 and mask & 7 == 7):
            assert isinstance(read, str), mask
            continue
        assert isinstance(read, AttitudeSetpoint)
        assert read.thrust_share == pytest.approx(0.4)
        if mask & 128:
            rates = [0.0 if mask >> axis & 1 else rate for axis, rate in enumerate((0.1, 0.2, 0.3))]
            assert read.attitude is None
            assert read.rates_frd_rad_s == pytest.approx(rates)
        else:
            assert read.attitude == pytest.approx((0.8, 0.0, 0.6, 0.0))
            assert read.rates_frd_rad_s == (0.0, 0.0, 0.0)


def test_an_attitude_is_normalised_and_its_thrust_bounded() -> None:
    read = read_setpoint(attitude_message(7, q=(1.2, 0.0, 0.0, 0.9), thrust=7.0), lambda: HERE)
    assert isinstance(read, AttitudeSetpoint)
    assert read.attitude == pytest.approx((0.8, 0.0, 0.0, 0.6))
    assert read.thrust_share == 1.0
    for q in ((0.0, 0.0, 0.0, 0.0), (math.nan, 0.0, 0.0, 1.0), (math.inf, 0.0, 0.0, 0.0)):
        assert isinstance(read_setpoint(attitude_message(7, q=q), lambda: HERE), str)
    assert isinstance(read_setpoint(attitude_message(7, thrust=math.nan), lambda: HERE), str)


number = st.floats(width=32)


@settings(max_examples=300)
@given(
    st.integers(0, 0xFFFF),
    st.integers(0, 255),
    st.lists(number, min_size=13, max_size=13),
    st.integers(-(2**31), 2**31 - 1),
    st.integers(-(2**31), 2**31 - 1),
)
def test_whatever_the_numbers_are_what_is_read_is_usable(
    mask: int, frame: int, x: list[float], lat: int, lon: int
) -> None:
    messages = (
        local(mask, frame, tuple(x[:3]), tuple(x[3:6]), tuple(x[6:9]), x[9], x[10]),
        mavlink.MAVLink_set_position_target_global_int_message(
            0, 1, 1, frame, mask, lat, lon, *x[2:9], x[9], x[10]
        ),
        attitude_message(mask & 0xFF, x[:4], x[4:7], x[7]),
    )
    for message in messages:
        read = read_setpoint(message, lambda: HERE)
        if isinstance(read, str):
            continue
        vectors = [part for part in read[:3] if isinstance(part, tuple)]
        assert not any(math.isinf(value) for vector in vectors for value in vector)
        if isinstance(read, AttitudeSetpoint):
            assert 0.0 <= read.thrust_share <= 1.0
            assert read.attitude is None or math.hypot(*read.attitude) == pytest.approx(1.0)
