"""BATTERY_STATUS of compiled code has the bytes and the values of ``battery_frame``."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flightstack.core.compiled import plain
from flightstack.mavlink.frames import CHECKSUM_SIZE, HEADER_V2
from flightstack.simulator_link.battery_frame import (
    BatteryReport,
    battery_buffer,
    decode_battery,
    encode_battery,
    report_in,
)
from flightstack.simulator_link.battery_kernels import BATTERY_SIZE, has_more_charge, write_battery
from sim_bridge.plant.battery import BatteryState, battery_report


def states() -> list[BatteryState]:
    random = np.random.default_rng(5)
    drawn = random.uniform((0.0, -10.0, 0.0, 0.0, 0.0), (60.0, 200.0, 1.0, 9000.0, 1e6), (60, 5))
    edges = [
        BatteryState(0.0, 0.0, 0.0, 0.0, 0.0),
        BatteryState(1e9, 1e9, 2.0, 1e12, 1e15),
        BatteryState(-1.0, -1e9, -1.0, -1e12, -1e15),
        BatteryState(math.nan, math.inf, math.nan, -math.inf, math.nan),
        BatteryState(0.0025, 0.125, 0.125, 0.5, 250.0),  # halves
    ]
    return [*(BatteryState(*row) for row in drawn.tolist()), *edges]


@pytest.mark.parametrize("compile_it", [True, False])
@pytest.mark.parametrize("cells", [1, 4, 10, 11, 14])
def test_the_payload_is_that_of_the_codec(cells: int, compile_it: bool) -> None:
    write = write_battery if compile_it else plain(write_battery)
    payload = np.frombuffer(battery_buffer(1, 200), np.uint8)[HEADER_V2:-CHECKSUM_SIZE].copy()
    assert len(payload) == BATTERY_SIZE
    for state in states():
        write(payload, np.array(state), cells)
        report = battery_report(state, cells)
        frame = encode_battery(report, 0, 1, 200)
        assert payload.tobytes().rstrip(b"\0") == frame[HEADER_V2:-CHECKSUM_SIZE]
        assert report_in(payload.tobytes()) == decode_battery(frame) == report


def test_the_buffer_precedes_the_first_message() -> None:
    assert battery_buffer(3, 200)[4:7] == bytes([255, 3, 200])


@pytest.mark.parametrize("compile_it", [True, False])
def test_the_first_battery_has_more_charge_than_a_share(compile_it: bool) -> None:
    is_more = has_more_charge if compile_it else plain(has_more_charge)
    report = BatteryReport(0, (3900,) * 3 + (0xFFFF,) * 7 + (0,) * 4, 1250, 100, 4, 64)
    for changed, least, expected in (
        (report, 0.63, True),
        (report, 0.64, False),
        (report, math.inf, False),
        (report._replace(remaining_percent=-1), 0.0, False),
        (report._replace(remaining_percent=0), 0.0, False),
        (report._replace(number=1), 0.0, False),
    ):
        payload = encode_battery(changed, 0, 1, 1)[HEADER_V2:-CHECKSUM_SIZE]
        assert is_more(np.frombuffer(payload, np.uint8), least) is expected
