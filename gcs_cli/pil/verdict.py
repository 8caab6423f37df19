"""Whether the loops on a target are those that were designed: stated limits beside what was measured. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

from gcs_cli.pil.compare import Difference
from gcs_cli.pil.signals import BY_NAME, STAGES

MIL, SIL, PIL = "MIL", "SIL", "PIL"
SAME_BITS_ULPS = 0.0
"""Between two builds of the C core on processors with IEEE arithmetic: not a bit may differ."""
BOARD_FACTOR = 2.0
"""Between the host and a board whose arithmetic may not be IEEE's to the last bit (F28377S: no denormals, TI's own
division): twice what C may be from Python, since rounding errors of the same kind come twice. No board was measured
yet."""

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
largest difference of ten flights of both vehicles with both laws, in wind and without."""

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
    """Return the limits of the same signals where not a bit may differ."""
    return dict.fromkeys(limits_ulps, SAME_BITS_ULPS)


def board_limits(limits_ulps: Mapping[str, float]) -> dict[str, float]:
    """Return the limits between the host and a board."""
    return {name: BOARD_FACTOR * limit for name, limit in limits_ulps.items()}


class Check(NamedTuple):
    """One thing that must hold: ``measured`` is at most ``limit``, in ``unit``."""

    name: str
    limit: float
    measured: float
    unit: str
    about: str = ""

    @property
    def passed(self) -> bool:
        """Whether it holds; what is not a number does not."""
        return self.measured <= self.limit

    @property
    def margin(self) -> float | None:
        """How many times larger the measured value might be; None if nothing was measured, or all is lost."""
        return self.limit / self.measured if self.measured > 0.0 and self.limit > 0.0 else None

    def as_json(self) -> dict[str, Any]:
        """Return what ``pil.json`` says of it."""
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
    """Yield a check of each stage: of its signals, the one that comes nearest to its limit, or exceeds it most.

    Every signal that has a limit must have been compared: one that was not, or in no tick, fails its stage.
    ``left_out``: a stage that is not judged.
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
    """Tell whether all hold; of no check at all, nothing does."""
    listed = list(checks)
    return bool(listed) and all(check.passed for check in listed)
