"""Samples of flights, written by hand."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from flightstack.core.enums import NAVIGATION_STATE, Mode
from gcs_cli.report.flight_data import Series, Status, series


def samples(time_s: list[float], values: list[Any]) -> Series:
    return series(np.array(time_s, dtype=float), np.array(values, dtype=float))


def armed_from(time_s: float, until_s: float = math.inf) -> tuple[Status, ...]:
    hold = NAVIGATION_STATE[Mode.HOLD]
    return (Status(0.0, hold, False), Status(time_s, hold, True), Status(until_s, hold, False))
