"""Severity of texts for the operator and the log."""

from __future__ import annotations

from enum import IntEnum


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
