"""The checks of loops on a target: limits and measured values. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

from gcs_cli.pil.compare import Difference
from gcs_cli.pil.signals import BY_NAME, STAGES

MIL, SIL, PIL = "MIL", "SIL", "PIL"
SAME_BITS_ULPS = 0.0
"""Limit between two builds of the C core on processors with IEEE arithmetic: no bit may differ."""
BOARD_FACTOR = 2.0
"""Factor on the limits between C and Python for a board whose arithmetic may differ from IEEE in the last bit (F28377S:
no denormals, TI's division), because rounding errors occur in both. No board was measured yet."""

CLOSED_LOOP_ULPS = {
    "target_attitude": 128.0,  # measured 12
    "target_thrust": 128.0,  # 10
    "reference_attitude": 128.0,  # 8
    "reference_rates": 2048.0,  # 167
    "reference_acceleration": 8192.0,  # 946
    "thrust": 128.0,  # 10
    "torque": 8192.0,  # 992
    "thrust_achieved": 1024.0,  # 11
    "torque_achieved": 8192.0,  # 992
    "rotor_command": 32_768.0,  # 4520
    "position": 16.0,  # 1
    "velocity": 64.0,  # 5
    "attitude": 256.0,  # 24
    "rates": 8192.0,  # 648
}
"""Limits between Python's float64 loops and C's float32 ones, each flying its own vehicle, in the air; beside each the
largest difference of ten flights of both vehicles with both laws, with and without wind."""

OPEN_LOOP_ULPS = {
    "target_attitude": 64.0,  # measured 5
    "target_thrust": 128.0,  # 9
    "reference_attitude": 64.0,  # 5
    "reference_rates": 2048.0,  # 171
    "reference_acceleration": 8192.0,  # 1025
    "thrust": 128.0,  # 9
    "torque": 16_384.0,  # 2029
    "thrust_achieved": 1024.0,  # 36
    "torque_achieved": 16_384.0,  # 2028
    "rotor_command": 32_768.0,  # 4695
}
"""The same for the same inputs, replayed from the logs of those flights of Python's loops, on the ground as well."""


def same_bits_limits(limits_ulps: Mapping[str, float]) -> dict[str, float]:
    """Return the limits of the same signals if no bit may differ."""
    return dict.fromkeys(limits_ulps, SAME_BITS_ULPS)


def board_limits(limits_ulps: Mapping[str, float]) -> dict[str, float]:
    """Return the limits between the host and a board."""
    return {name: BOARD_FACTOR * limit for name, limit in limits_ulps.items()}


class Check(NamedTuple):
    """One check: ``measured`` must be at most ``limit``, in ``unit``."""

    name: str
    limit: float
    measured: float
    unit: str
    about: str = ""

    @property
    def passed(self) -> bool:
        """True if ``measured`` is within the limit; False for NaN."""
        return self.measured <= self.limit

    @property
    def margin(self) -> float | None:
        """Ratio of limit to measured value; None unless both are positive."""
        return self.limit / self.measured if self.measured > 0.0 and self.limit > 0.0 else None

    def as_json(self) -> dict[str, Any]:
        """Return the object for ``pil.json``."""
        return {
            "name": self.name,
            "passed": self.passed,
            "limit": self.limit,
            "measured": self.measured if math.isfinite(self.measured) else None,
            "margin": self.margin,
            "unit": self.unit,
            "about": self.about,
        }


def difference_checks(
    pair: str,
    differences: Iterable[Difference],
    limits_ulps: Mapping[str, float],
    left_out: str | None = None,
) -> Iterator[Check]:
    """Yield a check per stage, of the signal nearest to its limit, or furthest beyond it.

    A signal with a limit that was not compared in any tick fails its stage. ``left_out``: a stage without a check.
    """
    there = {found.signal: found for found in differences}
    for stage in STAGES:
        checks = [
            _difference_check(f"{pair} {stage}", limit, signal, there.get(signal))
            for signal, limit in limits_ulps.items()
            if BY_NAME[signal].stage == stage != left_out
        ]
        if checks:
            yield max(checks, key=_closeness)


def _difference_check(name: str, limit: float, signal: str, found: Difference | None) -> Check:
    if found is None or not found.samples:
        return Check(name, limit, math.nan, "ulp", f"{BY_NAME[signal].title}: no samples to compare")
    return Check(name, limit, found.ulps, "ulp", _about(found))


def _about(found: Difference) -> str:
    signal = BY_NAME[found.signal]
    if found.largest == 0.0:
        return "same bits"
    unit = "" if signal.unit == "1" else f" {signal.unit}"
    return f"{signal.title}: {found.largest:.3g}{unit}"


def _closeness(check: Check) -> float:
    if not math.isfinite(check.measured):
        return math.inf
    return check.measured / check.limit if check.limit else check.measured


def all_passed(checks: Iterable[Check]) -> bool:
    """Return True if all checks passed; False without checks."""
    listed = list(checks)
    return bool(listed) and all(check.passed for check in listed)
