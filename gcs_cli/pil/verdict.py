"""The checks of loops on a target: limits and measured values. Pure."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
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

SENSED_ULPS = {
    "target_attitude": 150_000.0,  # measured 18 261: 0.0022
    "target_thrust": 210_000.0,  # 26 260: 0.013 N
    "reference_attitude": 140_000.0,  # 17 613
    "reference_rates": 1_300_000.0,  # 166 188: 0.04 rad/s
    "reference_acceleration": 8_600_000.0,  # 1 073 850: 4 rad/s²
    "thrust": 210_000.0,  # 26 260
    "torque": 4_700_000.0,  # 587 392: 0.035 N m
    "thrust_achieved": 270_000.0,  # 34 195
    "torque_achieved": 4_700_000.0,  # 587 392
    "rotor_command": 2_100_000.0,  # 259 895: 8 rad/s
    "position": 50_000.0,  # 6097: 6 mm
    "velocity": 150_000.0,  # 18 618: 9 mm/s
    "attitude": 140_000.0,  # 17 709
    "rates": 1_600_000.0,  # 204 060: 0.05 rad/s
}
"""The same for flights on sensors: eight times the largest difference of the square of x_quad. The estimate of a filter
in float32 is millimetres from that of one in float64, and the sensors of another path measure other values."""

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


class Limits(NamedTuple):
    """Limits by the name of a signal. A signal without a limit of a kind is not checked in that respect."""

    ulp: Mapping[str, float]
    """Largest difference [ulp]."""
    rms_ulp: Mapping[str, float] = {}  # never changed
    """Root mean square of the difference [ulp]."""
    slope_ppm: Mapping[str, float] = {}
    """Distance of the regression's slope from 1 [10⁻⁶]."""

    def scaled(self, factor: float) -> Limits:
        """Return all limits times a factor."""
        return Limits(*({name: factor * limit for name, limit in kind.items()} for kind in self))


_SLOPE_PPM = 2.0
STAGE_LIMITS = Limits(
    {
        "target_attitude": 10.0,  # measured 2.4
        "target_thrust": 12.0,  # 3.0
        "reference_attitude": 6.0,  # 1.5
        "reference_rates": 32.0,  # 8.0
        "reference_acceleration": 700.0,  # 169
        "thrust": 0.0,  # the target's own attitude target, unchanged
        "torque": 10.0,  # 2.5
        "thrust_achieved": 4.0,  # 1.0
        "torque_achieved": 8.0,  # 2.0
        "rotor_command": 44.0,  # 11
    },
    {
        "target_attitude": 2.0,  # 0.50
        "target_thrust": 4.0,  # 0.95
        "reference_attitude": 1.0,  # 0.25
        "reference_rates": 3.5,  # 0.86
        "reference_acceleration": 48.0,  # 12
        "thrust": 0.0,
        "torque": 1.7,  # 0.41
        "thrust_achieved": 1.3,  # 0.32
        "torque_achieved": 1.7,  # 0.41
        "rotor_command": 2.3,  # 0.55
    },
    {
        "target_attitude": _SLOPE_PPM,  # 0.43
        "target_thrust": _SLOPE_PPM,  # 0.03
        "reference_attitude": _SLOPE_PPM,  # 0.07
        "reference_rates": _SLOPE_PPM,  # 0.03
        "reference_acceleration": 8.0,  # 1.8
        "torque": _SLOPE_PPM,  # 0.03
        "thrust_achieved": _SLOPE_PPM,  # 0.08
        "torque_achieved": _SLOPE_PPM,  # 0.07
        "rotor_command": _SLOPE_PPM,  # 0.03
    },
)
"""Limits of each stage, computed in float64 from the inputs that the target reports for it: four times the rounding of
float32, measured in three flights in gusts and in the excitation, both vehicles and both controllers."""


class LimitSet(NamedTuple):
    """Limits of all comparisons."""

    flight: Limits
    """Between flights in Python and in C, each with its own vehicle."""
    replay: Limits
    """Between the log of Python's loops and a target."""
    stages: Limits
    """Between Python's stages and a target's."""
    sensed: Limits
    """As ``flight``, of flights on sensors."""


DEFAULT_LIMITS = LimitSet(Limits(CLOSED_LOOP_ULPS), Limits(OPEN_LOOP_ULPS), STAGE_LIMITS, Limits(SENSED_ULPS))


def same_bits_limits(limits: Limits) -> Limits:
    """Return the limits of the same signals if no bit may differ."""
    return Limits(dict.fromkeys(limits.ulp, SAME_BITS_ULPS))


def board_limits(limits: Limits) -> Limits:
    """Return the limits between the host and a board."""
    return limits.scaled(BOARD_FACTOR)


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


class _Kind(NamedTuple):
    """One kind of limit: the suffix of its check, its unit, and the measured value."""

    suffix: str
    unit: str
    measured: Callable[[Difference], float]


_KINDS = {
    "ulp": _Kind("", "ulp", lambda found: found.ulps),
    "rms_ulp": _Kind(" rms", "ulp", lambda found: found.rms_ulps),
    "slope_ppm": _Kind(" slope", "ppm", lambda found: found.slope_ppm),
}


def difference_checks(
    pair: str,
    differences: Iterable[Difference],
    limits: Limits,
    left_out: str | None = None,
) -> Iterator[Check]:
    """Yield a check per stage and kind of limit, of the signal nearest to its limit, or furthest beyond it.

    A signal with a limit that was not compared in any tick fails its stage. A signal that does not vary has no slope,
    which is not checked then. ``left_out``: a stage without a check.
    """
    there = {found.signal: found for found in differences}
    for stage in STAGES:
        for kind, by_signal in limits._asdict().items():
            checks = [
                _difference_check(f"{pair} {stage}", _KINDS[kind], limit, signal, there.get(signal))
                for signal, limit in by_signal.items()
                if BY_NAME[signal].stage == stage != left_out
                and (kind != "slope_ppm" or (signal in there and there[signal].line is not None))
            ]
            if checks:
                yield max(checks, key=_closeness)


def _difference_check(name: str, kind: _Kind, limit: float, signal: str, found: Difference | None) -> Check:
    name += kind.suffix
    if found is None or not found.samples:
        return Check(name, limit, math.nan, kind.unit, f"{BY_NAME[signal].title}: no samples to compare")
    return Check(name, limit, kind.measured(found), kind.unit, _about(found, kind))


def _about(found: Difference, kind: _Kind) -> str:
    signal = BY_NAME[found.signal]
    if found.largest == 0.0:
        return "same bits"
    if kind.unit == "ppm" and found.line is not None:
        return f"{signal.title} {found.line.component}: slope {found.line.slope:.6f}"
    unit = "" if signal.unit == "1" else f" {signal.unit}"
    return f"{signal.title}: {found.rms if kind.suffix else found.largest:.3g}{unit}"


def _closeness(check: Check) -> float:
    if not check.limit:
        return 0.0 if check.passed else math.inf
    return check.measured / check.limit if math.isfinite(check.measured) else math.inf


def all_passed(checks: Iterable[Check]) -> bool:
    """Return True if all checks passed; False without checks."""
    listed = list(checks)
    return bool(listed) and all(check.passed for check in listed)
