"""HIL_GPS of compiled code has the bytes and the values of ``sensor_frames``."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flightstack.core.compiled import plain
from flightstack.core.contract import Vector3
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.mavlink.frames import CHECKSUM_SIZE, HEADER_V2
from flightstack.simulator_link.gps_kernels import (
    FIX_SIZE,
    GPS_NUMBER_AT,
    GPS_SIZE,
    FixRow,
    read_gps,
    write_gps,
)
from flightstack.simulator_link.sensor_frames import (
    GPS_SHAPE,
    decode_gps,
    encode_gps,
    gps_buffer,
    gps_message,
)

HOMES = (GeoPoint(47.4, 8.5, 488.0), GeoPoint(-16.8, 179.99, 3.0), GeoPoint(89.0, -179.99, -50.0))


def fixes() -> list[FixRow]:
    random, found = np.random.default_rng(3), []
    for home in HOMES:
        for position in random.normal(0.0, 4000.0, (40, 3)):
            point = LocalFrame(home).to_geo(Vector3(*position.tolist()))
            speed = random.normal(0.0, 10.0 ** random.uniform(-3.0, 3.0), 3)
            accuracy = np.abs(random.normal(0.0, 10.0 ** random.uniform(-3.0, 3.0), 2))
            found.append(FixRow(*point, *accuracy, *speed, random.integers(0, 7), random.integers(0, 255)))
    still = FixRow(*HOMES[0], 0.005, 0.015, 0.0, 0.0, 0.0, 3.0, 14.0)
    return [
        *found,
        still,
        still._replace(eph_m=math.nan, north_m_s=math.inf, altitude_m=1e9),
        FixRow(*[0.0] * 10),
    ]


@pytest.mark.parametrize("compile_them", [True, False])
def test_payload_and_values_are_those_of_the_frames(compile_them: bool) -> None:
    write, read = (write_gps, read_gps) if compile_them else (plain(write_gps), plain(read_gps))
    for number, fix in enumerate(fixes()):
        payload, row = np.full(GPS_SIZE, 7, np.uint8), np.zeros(FIX_SIZE)
        write(payload, 1000 * number, np.array(fix))
        frame = encode_gps(gps_message(1000 * number, fix), 0, 1, 1)
        assert payload.tobytes().rstrip(b"\x00") == frame[HEADER_V2:-CHECKSUM_SIZE].rstrip(b"\x00")
        read(payload, row)
        decoded = decode_gps(frame)
        assert decoded is not None
        assert gps_message(1000 * number, FixRow(*row.tolist())) == decoded


def test_unknown_accuracies_are_read_as_such() -> None:
    payload, row = np.zeros(GPS_SIZE, np.uint8), np.zeros(FIX_SIZE)
    payload[20:24] = 0xFF
    read_gps(payload, row)
    fix = FixRow(*row.tolist())
    assert math.isnan(fix.eph_m)
    assert math.isnan(fix.epv_m)


def test_buffer_and_shape_are_those_of_the_message() -> None:
    buffer, frame = gps_buffer(3, 51), encode_gps(gps_message(5, fixes()[0])._replace(number=1), 255, 3, 51)
    assert buffer[2:HEADER_V2] == frame[2:HEADER_V2]
    assert len(buffer) == HEADER_V2 + GPS_SHAPE.size + CHECKSUM_SIZE
    assert frame[HEADER_V2 + GPS_NUMBER_AT] == 1
