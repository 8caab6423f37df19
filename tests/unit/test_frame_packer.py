"""Frames of compiled packers equal pymavlink's, byte for byte, also on signed links and of absurd flights."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from flightstack.core.contract import LoopRow, Vector3
from flightstack.core.portable_math import distance, euler_angles
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.fields import fitted, int16, whole
from flightstack.mavlink.frame_packer import FramePacker
from flightstack.mavlink.link import Link, Message
from flightstack.mavlink.packed import Packing
from flightstack.mavlink.signing import LinkSigning, Signing
from flightstack.services.telemetry.motion import CONTENTS
from flightstack.services.telemetry.streams import GROUND_RATES_HZ
from flightstack.services.telemetry.telemetry import MOTION
from flightstack.vehicle.status import VehicleStatus, in_single_precision
from tests.support.telemetry_status import HOME, flight_state, status, telemetry

NAMES = (*CONTENTS, "ACTUATOR_OUTPUT_STATUS", "GPS_RAW_INT", "HIGHRES_IMU", "ODOMETRY")
EXTREME = [0.0, -0.0, 0.5, 1.5, -2.5, 3.5e38, -3.5e38, 1e300, 1e-300, math.nan, math.inf, -math.inf]
NUMBERS = st.one_of(
    st.floats(), st.floats(width=32), st.sampled_from(EXTREME), st.integers(-(2**53), 2**53).map(float)
)
PACKINGS = {name: Packing(name) for name in NAMES}
SIZES = {name: len(packing.codes) for name, packing in PACKINGS.items()}
VALUES = np.zeros(1, [(name, "f8", (size,)) for name, size in SIZES.items()])
PACKER = FramePacker(VALUES, {name: (name,) for name in NAMES})


def packed(name: str, values: list[float]) -> Message:
    """Return pymavlink's message of values, fitted as they are; whole ones up to 2**53, which a float64 holds."""
    packing = PACKINGS[name]
    codes = zip(values, packing.codes, strict=True)
    fits = [
        fitted(value, code, False) if code == "f" else min(fitted(value, code, False), 2**53)
        for value, code in codes
    ]
    return packing.message(*fits)


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=25)
@given(data=st.data())
def test_frames_are_pymavlinks(name: str, data: st.DataObject) -> None:
    values = data.draw(st.lists(NUMBERS, min_size=SIZES[name], max_size=SIZES[name]))
    VALUES[name] = values
    number = NAMES.index(name)
    ours, theirs = Link(7, 1), Link(7, 1)
    for _ in range(2):
        assert ours.encode_numbered(PACKER, [number]) == [theirs.encode(packed(name, values))]
    assert ours.encode(PACKER.message(number)) == theirs.encode(packed(name, values))


@pytest.mark.parametrize("is_signed", [False, True])
def test_messages_of_one_call_have_successive_sequence_numbers(is_signed: bool) -> None:
    for name in NAMES:
        VALUES[name] = np.arange(SIZES[name]) + 1.0
    ours, theirs = (Link(3, 4, signing=signed_link() if is_signed else None) for _ in range(2))
    numbers = [5, 0, 3, 11]
    for _ in range(70):  # beyond 255
        expected = [
            theirs.encode(packed(NAMES[number], VALUES[0][NAMES[number]].tolist())) for number in numbers
        ]
        assert ours.encode_numbered(PACKER, numbers) == expected
    assert ours.sent == theirs.sent == 280
    assert ours.encode_numbered(PACKER, []) == []


def signed_link() -> LinkSigning:
    return LinkSigning(Signing(bytes(range(32)), lambda: 1_000_000), 2)


def test_values_missing_at_the_end_of_a_message_are_zero() -> None:
    values = np.zeros(1, [("time", "f8"), ("angles", "f8", (3,))])
    values["time"], values["angles"] = 5.0, (1.0, 2.0, 3.0)
    packer = FramePacker(values, {"ATTITUDE": ("time", "angles")})
    assert packer.message(0).payload == PACKINGS["ATTITUDE"](5, 1.0, 2.0, 3.0).payload


# ---------------------------------------------------------------------- messages of motion


def heading_deg(q: list[float]) -> float:
    return math.degrees(euler_angles(*q)[2]) % 360.0 if math.isfinite(q[0]) else 0.0


def global_position(f: VehicleStatus) -> tuple[float, ...]:
    x = f.state
    latitude_deg, longitude_deg, altitude_m = f.info.frame.to_geo(Vector3(*x[:3]))
    return (
        latitude_deg * 1e7, longitude_deg * 1e7, altitude_m * 1e3, (altitude_m - f.home.altitude_m) * 1e3,
        x[3] * 100.0, x[4] * 100.0, x[5] * 100.0, whole(heading_deg(x[6:10]) * 100.0, 0, 35999),
    )  # fmt: skip


def attitude_target(f: VehicleStatus) -> tuple[float, ...]:
    target = f.attitude_target
    thrust = min(1.0, max(0.0, target[4] / f.info.max_thrust_n)) if math.isfinite(target[4]) else 0.0
    return 0, *target[:4], *in_single_precision(f.row[LoopRow.REFERENCE_RATES]), thrust


def pulses(f: VehicleStatus) -> list[int]:
    shares = [command / 600.0 for command in f.row[LoopRow.ROTOR_COMMAND][: f.info.rotors]]
    return [1000 + round(1000.0 * min(1.0, share)) if 0.0 < share < math.inf else 1000 for share in shares]


def hud(f: VehicleStatus) -> tuple[float, ...]:
    x, throttle = f.state, 100.0 * f.row[LoopRow.WRENCH_ACHIEVED][0] / f.info.max_thrust_n
    speed = distance(x[3], x[4])
    return speed, speed, int16(heading_deg(x[6:10])), whole(throttle, 0, 100), HOME.altitude_m - x[2], -x[5]


def altitudes(f: VehicleStatus) -> tuple[float, ...]:
    above_sea_m = HOME.altitude_m - f.state[2]
    above_home_m = above_sea_m - f.home.altitude_m
    return f.time_us, above_sea_m, above_sea_m, -f.state[2], above_home_m, math.nan, math.nan


def boot_ms(f: VehicleStatus) -> int:
    return f.time_us // 1000 % 2**32


EXPECTED: dict[str, Callable[[VehicleStatus], tuple[float, ...]]] = {
    "ALTITUDE": altitudes,
    "ATTITUDE": lambda f: (boot_ms(f), *euler_angles(*f.state[6:10]), *f.state[10:]),
    "ATTITUDE_QUATERNION": lambda f: (boot_ms(f), *f.state[6:]),
    "ATTITUDE_TARGET": lambda f: (boot_ms(f), *attitude_target(f)),
    "GLOBAL_POSITION_INT": lambda f: (boot_ms(f), *global_position(f)),
    "LOCAL_POSITION_NED": lambda f: (boot_ms(f), *f.state[:6]),
    "POSITION_TARGET_LOCAL_NED": lambda f: (boot_ms(f), 1, 0, *f.setpoint),
    "SERVO_OUTPUT_RAW": lambda f: (f.time_us % 2**32, 0, *pulses(f)),
    "VFR_HUD": hud,
}

STATES = st.lists(NUMBERS | st.floats(-100.0, 100.0), min_size=13, max_size=13)
ROWS = st.lists(NUMBERS | st.floats(-1.0, 700.0), min_size=48, max_size=48)


@pytest.mark.parametrize("name", CONTENTS)
@settings(max_examples=40)
@given(STATES, ROWS, st.integers(0, 2**48), st.sampled_from([3, 4, 6, 8]))
@example([1e19] * 13, [1e19] * 48, 2**32 * 1000, 8)
def test_messages_of_motion_show_the_status(
    name: str, state: list[float], row: list[float], time_us: int, rotors: int
) -> None:
    shown = status(
        {"rotors": rotors, "top_speed_rad_s": (600.0,) * rotors}, time_us=time_us, state=np.array(state),
        row=np.array(row), setpoint=np.resize(state[::-1], 11), attitude_target=np.resize(row, 5),
        home=HOME._replace(altitude_m=450.5),
    )  # fmt: skip
    values = list(EXPECTED[name](shown))
    values += [0] * (SIZES[name] - len(values))
    message_id = PACKINGS[name].message_id
    (frame,) = telemetry(shown).frames([message_id], Link(1, 1))
    assert frame == Link(1, 1).encode(packed(name, values))
    (message,) = telemetry(shown).requested(message_id)
    assert Link(1, 1).encode(message) == frame


def test_all_messages_of_50_hz_are_packed_by_kernels() -> None:
    assert {message_id for message_id, rate_hz in GROUND_RATES_HZ.items() if rate_hz >= 50.0} <= MOTION


def test_frames_keep_the_order_of_the_streams() -> None:
    ids = list(GROUND_RATES_HZ)
    assert ids != sorted(ids, key=lambda message_id: message_id not in MOTION)
    sent = [
        message.get_msgId()
        for frame in telemetry().frames(ids, Link(1, 1))
        for message in Link(255, 190).decode(frame)
    ]
    assert sent == ids


def test_frames_of_another_tick_or_poll_are_of_then() -> None:
    attitude, link, station = mavlink.MAVLINK_MSG_ID_ATTITUDE, Link(1, 1), Link(255, 190)
    now = flight_state(status())
    told = telemetry(now=now)

    def roll_rate() -> float:
        ((message,),) = [list(station.decode(frame)) for frame in told.frames([attitude], link)]
        return float(message.rollspeed)

    assert roll_rate() == pytest.approx(0.01)
    now.state[10] = 5.0
    assert roll_rate() == pytest.approx(0.01)  # of the same poll
    now.time_us += 2000
    assert roll_rate() == 5.0
    now.state[10] = 6.0
    told.begin_poll()
    assert roll_rate() == 6.0


def test_a_places_frame_follows_a_new_origin_and_home() -> None:
    shown = status()
    told, position = telemetry(shown), mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT
    (before,) = told.requested(position)
    shown.info.frame.move_to(HOME._replace(latitude_deg=46.0))
    (after,) = told.requested(position)
    assert before.payload != after.payload
