"""Enumerations that the autopilot, telemetry and logs share: flight modes and severities of texts."""

from __future__ import annotations

from enum import IntEnum


class Mode(IntEnum):
    """Flight mode, independent of the arming state."""

    HOLD = 0
    TAKEOFF = 1
    MISSION = 2
    RETURN = 3
    LAND = 4
    POSITION = 5
    ALTITUDE = 6
    OFFBOARD = 7
    TERMINATION = 8


STREAM_MODES = (Mode.OFFBOARD, Mode.POSITION, Mode.ALTITUDE)
"""Modes controlled by a stream of setpoints or stick positions from the ground, which also command takeoff."""

_AUTO = 4 << 16
CUSTOM_MODE: dict[Mode, int] = {
    Mode.TAKEOFF: _AUTO | 2 << 24,
    Mode.HOLD: _AUTO | 3 << 24,
    Mode.MISSION: _AUTO | 4 << 24,
    Mode.RETURN: _AUTO | 5 << 24,
    Mode.LAND: _AUTO | 6 << 24,
    Mode.ALTITUDE: 2 << 16,
    Mode.POSITION: 3 << 16,
    Mode.OFFBOARD: 6 << 16,
    Mode.TERMINATION: 10 << 16,
}
MODE_OF_CUSTOM: dict[int, Mode] = {number: mode for mode, number in CUSTOM_MODE.items()}

NAVIGATION_STATE: dict[Mode, int] = {
    Mode.ALTITUDE: 1,
    Mode.POSITION: 2,
    Mode.MISSION: 3,
    Mode.HOLD: 4,
    Mode.RETURN: 5,
    Mode.TERMINATION: 13,
    Mode.OFFBOARD: 14,
    Mode.TAKEOFF: 17,
    Mode.LAND: 18,
}
"""``vehicle_status.nav_state`` of PX4's logs."""


class Severity(IntEnum):
    """MAV_SEVERITY, the levels of RFC 5424; ULog and STATUSTEXT use the same numbers."""

    EMERGENCY = 0
    ALERT = 1
    CRITICAL = 2
    ERROR = 3
    WARNING = 4
    NOTICE = 5
    INFO = 6
    DEBUG = 7
