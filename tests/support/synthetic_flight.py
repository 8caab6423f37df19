"""A synthetic flight, written by ``FlightLog``: takeoff, a square, landing."""

from __future__ import annotations

import io
import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from flightstack.core.contract import LoopRow
from flightstack.core.enums import NAVIGATION_STATE, Mode
from flightstack.core.geodesy import GeoPoint
from flightstack.flight_log.flight_log import FlightLog
from flightstack.flight_log.topics import ARMING_STATE_ARMED, ARMING_STATE_DISARMED, OUTER

HOME = GeoPoint(47.397742, 8.545594, 488.0)
CORNERS_NED_M = [(10.0, 0.0, -3.0), (10.0, 10.0, -4.0), (0.0, 10.0, -5.0), (0.0, 0.0, -3.0)]
LEG_S = 6.0
CLIMB_S = 5.0
INFO: Mapping[str, str | int | float] = {
    "sys_name": "flightstack",
    "ver_sw": "0.1.0",
    "vehicle": "paper_quad",
    "controller": "pid",
    "gains": "tuned",
    "loops": "python",
    "inner_hz": 500.0,
    "outer_hz": 100.0,
    "rotor_min_speed_rad_s": 30.0,
    "rotor_max_speed_rad_s": 303.4,
}
PARAMETERS: Mapping[str, float] = {"MIS_DIST_1WP": 900.0, "MPC_XY_CRUISE": 3.0, "INNER_DIVISOR": 5}


def _path(time_s: float) -> np.ndarray[Any, Any]:
    """Return the position setpoint [m NED] at ``time_s`` after the start of the takeoff."""
    points = [(0.0, 0.0, 0.0), (0.0, 0.0, -3.0), *CORNERS_NED_M, (0.0, 0.0, 0.0)]
    durations = [CLIMB_S] + [LEG_S] * 4 + [CLIMB_S]
    for (start, end), duration in zip(pairwise(points), durations, strict=True):
        if time_s < duration:
            s = max(0.0, time_s / duration)
            blend = s * s * (3.0 - 2.0 * s)
            return np.array(start) + blend * (np.array(end) - np.array(start))
        time_s -= duration
    return np.array(points[-1])


def _quaternion(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    cr, sr = math.cos(roll / 2), math.sin(roll / 2)
    cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def _attitude(time_s: float) -> tuple[float, float, float, float]:
    return _quaternion(
        0.12 * math.sin(2.0 * time_s), 0.15 * math.cos(1.3 * time_s), 0.4 * math.sin(0.2 * time_s)
    )


def _fill_inner(row: np.ndarray[Any, Any], time_s: float, noise: np.ndarray[Any, Any]) -> None:
    position = _path(time_s - 0.15) + 0.01 * noise[:3]
    row[:3] = position
    row[3:6] = (_path(time_s - 0.149) - _path(time_s - 0.151)) / 0.002
    row[6:10] = _attitude(time_s - 0.05)
    row[10:13] = 0.1 * noise[3:6]
    row[LoopRow.REFERENCE_ATTITUDE] = _attitude(time_s - 0.02)
    row[LoopRow.WRENCH.start] = row[LoopRow.WRENCH_ACHIEVED.start] = 5.4 + 0.1 * noise[0]
    row[LoopRow.ROTOR_COMMAND][:4] = 214.0 + 8.0 * noise[:4]
    row[LoopRow.ROTOR_SPEED][:4] = 214.0 + 6.0 * noise[:4]


def _fill_outer(row: np.ndarray[Any, Any], time_s: float, state: np.ndarray[Any, Any]) -> None:
    row[:13] = state
    row[OUTER.setpoint : OUTER.setpoint + 3] = _path(time_s)
    row[OUTER.target_attitude : OUTER.target_attitude + 4] = _attitude(time_s)
    row[OUTER.target_thrust] = 5.4


def _events(log: FlightLog, tick_ms: int, total: int) -> None:
    time_us = tick_ms * 1000
    if tick_ms == 0:
        log.event(
            "vehicle_status",
            time_us,
            arming_state=ARMING_STATE_DISARMED,
            nav_state=NAVIGATION_STATE[Mode.HOLD],
        )
        log.event("vehicle_land_detected", time_us, landed=True, ground_contact=True)
        log.event("mission_result", time_us, seq_total=6, valid=True)
    elif tick_ms == 1000:
        log.message(time_us, 6, "Armed")
        log.event(
            "vehicle_status",
            time_us,
            arming_state=ARMING_STATE_ARMED,
            nav_state=NAVIGATION_STATE[Mode.TAKEOFF],
        )
        log.event("vehicle_land_detected", time_us, landed=False)
    elif tick_ms == total - 1000:
        log.message(time_us, 6, "Landed, disarming")
        log.event("vehicle_land_detected", time_us, landed=True)
        log.event(
            "vehicle_status",
            time_us,
            arming_state=ARMING_STATE_DISARMED,
            nav_state=NAVIGATION_STATE[Mode.LAND],
        )
        log.event(
            "mission_result", time_us, seq_reached=5, seq_current=5, seq_total=6, valid=True, finished=True
        )
    for seq in range(5):
        reached_ms = 1000 + round(1000 * (CLIMB_S + LEG_S * seq)) + 200
        if tick_ms == reached_ms:
            state = NAVIGATION_STATE[Mode.LAND] if seq == 4 else NAVIGATION_STATE[Mode.MISSION]
            log.event("vehicle_status", time_us, arming_state=ARMING_STATE_ARMED, nav_state=state)
            log.event(
                "mission_result", time_us, seq_reached=seq, seq_current=seq + 1, seq_total=6, valid=True
            )
            log.message(time_us, 6, f"Reached item {seq}")


def write_synthetic_flight(file: Any, inner_ms: int = 2, outer_ms: int = 10, seconds: float = 36.0) -> None:
    """Write the flight to ``file``. Items: 0 takeoff, 1 to 4 corners, 5 land."""
    log = FlightLog(file, rotors=4)
    log.start(0, INFO, PARAMETERS, HOME)
    log.event("home_position", 0, lat=HOME.latitude_deg, lon=HOME.longitude_deg, alt=HOME.altitude_m)
    noise = np.random.default_rng(1).standard_normal((round(seconds * 1000) + 1, 6))
    total = round(seconds * 1000)
    for tick_ms in range(0, total, inner_ms):
        _events(log, tick_ms, total)
        time_s = tick_ms * 1e-3 - 1.0
        row = log.inner.append(tick_ms * 1000)
        _fill_inner(row, time_s, noise[tick_ms])
        if tick_ms % outer_ms == 0:
            _fill_outer(log.outer.append(tick_ms * 1000), time_s, row[:13])
        if tick_ms % 1000 == 0:
            log.event(
                "loop_timing", tick_ms * 1000, ticks=tick_ms // inner_ms, inner_hz=500.0, outer_hz=100.0
            )
    log.close()


class KeptBytes(io.BytesIO):
    """A file in memory, readable after it was closed."""

    def close(self) -> None:
        self.content = self.getvalue()
        super().close()


def synthetic_flight_bytes(inner_ms: int = 2, outer_ms: int = 10, seconds: float = 36.0) -> bytes:
    """Return the log of the synthetic flight as bytes."""
    file = KeptBytes()
    write_synthetic_flight(file, inner_ms, outer_ms, seconds)
    return file.content
