"""How fast the loops grow that a motor lag of the matrix makes unstable, in words: slowly enough to come home. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from gcs_cli.experiments.paper.cases import CONDITIONS
from gcs_cli.experiments.paper.linear.gains import AttitudeGains
from gcs_cli.experiments.paper.linear.sampled import Actuators, AttitudeTick
from gcs_cli.experiments.paper.report_labels import ANGLES, AXIS_TITLES, fixed
from gcs_cli.experiments.paper.report_onset import loop_title

INNER_HZ = 1000.0


def beyond_note(loops: Sequence[Mapping[str, Any]]) -> str:
    """Return what becomes of loops at motor lags of the matrix above those they bear; empty if they bear them all."""
    feedbacks = {  # one loop for each axis and feedback: what is fed ahead moves no pole
        (axis, *(loop["axes"][axis]["gains"][name] for name in ("kp", "ki", "kd"))): loop
        for loop in reversed(loops)
        for axis in ANGLES
    }
    found = [(loop, key[0]) for key, loop in reversed(feedbacks.items())]
    told = [words for lag_s in _lags() for loop, axis in found for words in _of_axis(loop, axis, lag_s)]
    if not told:
        return ""
    return f"{'; '.join(told)}: a flight that hardly excites the axis may end before it shows."


def _lags() -> list[float]:
    return sorted({condition.changes["lag_s"] for condition in CONDITIONS if condition.changes.get("lag_s")})


def _of_axis(loop: Mapping[str, Any], axis: str, lag_s: float) -> Iterator[str]:
    of = loop["axes"][axis]
    if of["largest_lag_s"] is None or of["largest_lag_s"] >= lag_s:
        return
    doubling_s = doubling_time_s(AttitudeGains(**of["gains"]), lag_s)
    if doubling_s is not None:
        yield (
            f"With motors of {fixed(1e3 * lag_s, 0)} ms, {AXIS_TITLES[axis]} of {loop_title(loop)} is unstable, but "
            f"needs {fixed(doubling_s, 1)} s to double its swing"
        )


def doubling_time_s(gains: AttitudeGains, lag_s: float) -> float | None:
    """Return in which time a small swing of an attitude axis doubles at 1000 Hz; None if it dies away."""
    loop = AttitudeTick(gains, INNER_HZ, Actuators(0, lag_s))
    growth = float(np.abs(np.linalg.eigvals(loop.closed())).max())
    return math.log(2.0) / (INNER_HZ * math.log(growth)) if growth > 1.0 + 1e-12 else None
