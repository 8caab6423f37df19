"""Whether the loops on a target are those that were designed: stated limits beside what was measured. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

from gcs_cli.pil.compare import Difference
from gcs_cli.pil.signals import BY_NAME, STAGES

MIL, SIL, PIL = "MIL", "SIL", "PIL"
SAME_BITS_ULPS = 0.0
"""Between two builds of the C core on processors with IEEE arithmetic: not a bit may differ."""
BOARD_ULPS = 65_536.0
"""Between the host and a board whose arithmetic is not IEEE's to the last bit (F28377S: no denormals, TI's division):
as far as C may be from Python, since a board's rounding errors are of the same kind. No board was measured yet."""

CLOSED_LOOP_ULPS = {
    "target_attitude": 256.0,
    "target_thrust": 512.0,
    "reference_attitude": 256.0,
    "reference_rates": 4096.0,
    "reference_acceleration": 65_536.0,
    "thrust": 512.0,
    "torque": 65_536.0,
    "thrust_achieved": 1024.0,
    "torque_achieved": 65_536.0,
    "rotor_command": 65_536.0,
    "position": 256.0,
    "velocity": 1024.0,
    "attitude": 256.0,
    "rates": 4096.0,
}
"""Limits between Python's float64 loops and C's float32 ones, each flying its own vehicle."""

OPEN_LOOP_ULPS = {
    "target_attitude": 32.0,
    "target_thrust": 64.0,
    "reference_attitude": 32.0,
    "reference_rates": 1024.0,
    "reference_acceleration": 8192.0,
    "thrust": 64.0,
    "torque": 16_384.0,
    "thrust_achieved": 256.0,
    "torque_achieved": 16_384.0,
    "rotor_command": 32_768.0,
}
"""The same for the same inputs, replayed from the log of a flight of Python's loops."""


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
    differences: Iterable[Difference], limits_ulps: dict[str, float] | float
) -> Iterator[Check]:
    """Yield a check of each stage: of its signals, the one that comes nearest to its limit, or exceeds it most.

    ``limits_ulps`` is one limit for every signal or one for each; signals without one are not judged.
    """
    listed = list(differences)
    for stage in STAGES:
        checks = [
            Check(f"{found.pair} {stage}", limit, found.ulps, "ulp", BY_NAME[found.signal].title)
            for found in listed
            if BY_NAME[found.signal].stage == stage
            and (limit := _limit(limits_ulps, found.signal)) is not None
        ]
        if checks:
            yield max(checks, key=_closeness)


def _limit(limits: dict[str, float] | float, signal: str) -> float | None:
    return limits.get(signal) if isinstance(limits, dict) else limits


def _closeness(check: Check) -> float:
    if not math.isfinite(check.measured):
        return math.inf
    return check.measured / check.limit if check.limit else check.measured


def all_passed(checks: Iterable[Check]) -> bool:
    """Tell whether all hold; of no check at all, nothing does."""
    listed = list(checks)
    return bool(listed) and all(check.passed for check in listed)
