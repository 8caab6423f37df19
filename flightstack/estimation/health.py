"""Health of an estimate: what commander and arming checks need to know of it."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple, TypeAlias

import numpy as np

from flightstack.core.compiled import compiled, direct
from flightstack.core.contract import FloatArray, Record, RecordArray
from flightstack.core.record_types import dtype_of
from flightstack.estimation.error_state import ACCEL_BIAS, ATTITUDE, GYRO_BIAS, POSITION, VELOCITY
from flightstack.estimation.kalman import (
    BARO,
    GNSS_POSITION,
    GNSS_VELOCITY,
    MAG,
)
from flightstack.estimation.memory import MemoryArray, MemoryRecord
from flightstack.estimation.sensor_feed import NewestSamples
from flightstack.estimation.sensor_samples import BaroSample, GnssFix

SMOOTHING = 0.1
"""Share of the newest test ratio in its mean."""
STUCK_SAMPLES = 100
"""Equal successive samples of the inertial sensor after which it is stuck; PX4's limit. Noise changes the last bits."""
MISSING_FIX_S, STUCK_S = 1.0, 1.0
CLIMBED_M = 0.3
"""Change of the height in the air that must change the pressure, also of a barometer without noise."""
NOISY = 40
"""Changes of the pressure in turn, 2 s at the interval of the health, that show the noise of a barometer; the rotors
of a vehicle that has landed stop sooner."""
IDEAL = 3
"""Repeats in turn that show a barometer without noise: a pressure equals the last one by chance once in a hundred."""
ACCURATE_SHARE, ACCURATE_S = 0.8, 1.0
"""Share of the limit below which an inaccurate position is accurate again, after this time there."""


class EstimateHealth(NamedTuple):
    """Health at one time. Ages are infinite without a measurement; deviations are 1σ; ratios are 1 at the gate."""

    aligned: bool
    has_origin: bool
    imu_age_s: float
    imu_is_stuck: bool
    mag_age_s: float
    baro_age_s: float
    baro_is_stuck: bool
    """True if the pressure has not changed for 1 s, after it had noise on the ground or in a climb or descent."""
    fix_age_s: float
    """Time since the newest three-dimensional fix."""
    unaided_s: float
    """Time since the newest accepted horizontal position or velocity: that of dead reckoning."""
    refused_s: float
    """Time for which horizontal positions or heights of GNSS have arrived and were refused."""
    is_inaccurate: bool
    """True if ``horizontal_m`` exceeds its limit; with hysteresis, see ``accuracy_step``."""
    lag_s: float
    """Time from the filter's state to the newest IMU sample."""
    horizontal_m: float
    velocity_m_s: float
    """Horizontal."""
    tilt_rad: float
    gyro_bias_rad_s: float
    accel_bias_m_s2: float
    velocity_ratio: float
    position_ratio: float
    height_ratio: float
    heading_ratio: float
    spare_imu_has_failed: bool = False
    """True if an inertial sensor that is not selected cannot replace the selected one."""
    imus_disagree: bool = False
    """True if two inertial sensors contradict each other."""


NO_HEALTH = EstimateHealth(
    False, False, math.inf, False, math.inf, math.inf, False, math.inf, math.inf, 0.0, False, 0.0,
    math.inf, math.inf, math.inf, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
)  # fmt: skip


class HealthSummary(NamedTuple):
    """What the estimator's memory says of ``EstimateHealth``."""

    unaided_s: float
    refused_s: float
    lag_s: float
    horizontal_m: float
    velocity_m_s: float
    tilt_rad: float
    gyro_bias_rad_s: float
    accel_bias_m_s2: float
    velocity_ratio: float
    position_ratio: float
    height_ratio: float
    heading_ratio: float


SUMMARY = dtype_of(HealthSummary)
SummaryArray: TypeAlias = Annotated[RecordArray, HealthSummary]
"""An array of one summary, shape (1,)."""


@compiled
def _largest(values: FloatArray, first: int, count: int) -> float:
    largest = 0.0
    for i in range(first, first + count):
        largest = max(largest, abs(values[i]))
    return largest


@compiled
def _mean_ratio(mean: float, m: MemoryRecord, first: int, count: int) -> float:
    """Return a mean of test ratios after the newest one, the largest of ``count`` rows."""
    largest = 0.0
    for row in range(first, first + count):
        largest = max(largest, abs(m["observations"][row]["test_ratio"]))
    return mean + SMOOTHING * (math.sqrt(largest) - mean)


@compiled
def health_kernel(memory: MemoryArray, summary: SummaryArray) -> None:
    """Write the summary of an estimator's record; it holds the mean ratios of the last call."""
    m, s = memory[0], summary[0]
    p, o, x = m["covariance"], m["observations"], m["nominal"]
    position_s = min(o[GNSS_POSITION]["fused_s"], o[GNSS_POSITION + 1]["fused_s"])
    velocity_s = min(o[GNSS_VELOCITY]["fused_s"], o[GNSS_VELOCITY + 1]["fused_s"])
    s["unaided_s"] = m["clock"][0] - max(position_s, velocity_s)
    s["refused_s"] = max(m["refused_s"][3], m["refused_s"][4], m["refused_s"][5])
    s["lag_s"] = m["output"][0] - m["clock"][0]
    s["horizontal_m"] = math.sqrt(p[POSITION, POSITION] + p[POSITION + 1, POSITION + 1])
    s["velocity_m_s"] = math.sqrt(p[VELOCITY, VELOCITY] + p[VELOCITY + 1, VELOCITY + 1])
    s["tilt_rad"] = math.sqrt(max(p[ATTITUDE, ATTITUDE], p[ATTITUDE + 1, ATTITUDE + 1]))
    s["gyro_bias_rad_s"], s["accel_bias_m_s2"] = _largest(x, GYRO_BIAS + 1, 3), _largest(x, ACCEL_BIAS + 1, 3)
    s["velocity_ratio"] = _mean_ratio(s["velocity_ratio"], m, GNSS_VELOCITY, 3)
    s["position_ratio"] = _mean_ratio(s["position_ratio"], m, GNSS_POSITION, 2)
    s["height_ratio"] = _mean_ratio(s["height_ratio"], m, BARO, 1)
    s["heading_ratio"] = _mean_ratio(s["heading_ratio"], m, MAG, 3)


class PressureTrack(NamedTuple):
    """The last pressure, time and height at its change, and the number of its changes in turn, up to ``NOISY``.

    The height is the present one on the ground, where only the estimate moves.
    """

    pressure_hpa: float = math.nan
    equal_since_s: float = 0.0
    height_m: float = 0.0
    changes: int = 0
    is_ideal: bool = False
    """True if the pressure has repeated itself on the ground: a simulator's ideal barometer does at rest."""
    repeats: int = 0
    """Pressures on the ground that equal the last one, in turn."""

    def is_stuck(self, landed: bool, height_m: float, time_s: float) -> bool:
        """Return True if the pressure should have changed: by its noise, or in a climb or descent."""
        if landed:
            should_change = self.changes == NOISY
        else:
            should_change = not self.is_ideal or abs(height_m - self.height_m) > CLIMBED_M
        return should_change and time_s - self.equal_since_s > STUCK_S


def pressure_step(
    memory: PressureTrack, pressure_hpa: float, landed: bool, height_m: float, time_s: float
) -> PressureTrack:
    """Compare a pressure with the last one; changes count at rest, where those of a barometer are its noise."""
    if pressure_hpa != memory.pressure_hpa:
        changes = min(memory.changes + 1, NOISY) if landed else memory.changes
        return PressureTrack(pressure_hpa, time_s, height_m, changes, memory.is_ideal and changes < NOISY)
    if not landed or memory.changes == NOISY:
        return memory
    repeats = memory.repeats + 1
    if repeats < IDEAL:
        return memory._replace(height_m=height_m, repeats=repeats)
    return memory._replace(changes=0, height_m=height_m, is_ideal=True, repeats=repeats)


class Accuracy(NamedTuple):
    """Whether the position is inaccurate, and the last time at which its deviation was too large."""

    is_inaccurate: bool = False
    exceeded_s: float = 0.0


def accuracy_step(memory: Accuracy, deviation_m: float, limit_m: float, time_s: float) -> Accuracy:
    """Compare a deviation with its limit, with hysteresis; a limit of zero or less is none."""
    if limit_m <= 0.0:
        return Accuracy()
    if deviation_m > limit_m * (ACCURATE_SHARE if memory.is_inaccurate else 1.0):
        return Accuracy(True, time_s)
    return Accuracy(memory.is_inaccurate and time_s - memory.exceeded_s < ACCURATE_S, memory.exceeded_s)


class HealthMonitor:
    """Summarises an estimator at intervals."""

    def __init__(self, memory: RecordArray) -> None:
        """``memory`` is the estimator's, shape (1,)."""
        self._memory = memory
        self._flags: Record = memory["flags"][0]
        self._state: FloatArray = memory["state"][0]
        self._summary = np.zeros(1, SUMMARY)
        self._accuracy = Accuracy()
        self._pressure = PressureTrack()
        self._baro: BaroSample | None = None
        self._summarise = direct(health_kernel, memory, self._summary)

    def update(
        self, samples: NewestSamples, has_origin: bool, limit_m: float, time_s: float
    ) -> EstimateHealth:
        """Return the health at ``time_s``; ``limit_m`` is that of the horizontal deviation, -1 for none."""
        self._summarise(self._memory, self._summary)
        summary = HealthSummary(*self._summary.tolist()[0])
        self._accuracy = accuracy_step(self._accuracy, summary.horizontal_m, limit_m, time_s)
        fix_age_s, imu = _fix_age_s(samples, time_s), samples.imu
        return EstimateHealth(
            bool(self._flags["aligned"]),
            has_origin,
            math.inf if imu is None else time_s - imu.time_s,
            samples.imu_track.repeats >= STUCK_SAMPLES,
            math.inf if samples.mag is None else time_s - samples.mag.time_s,
            math.inf if samples.baro is None else time_s - samples.baro.time_s,
            self._baro_is_stuck(samples.baro, time_s),
            fix_age_s,
            summary.unaided_s if has_origin else math.inf,
            summary.refused_s if has_origin and fix_age_s < MISSING_FIX_S else 0.0,
            self._accuracy.is_inaccurate,
            summary.lag_s,
            summary.horizontal_m,
            summary.velocity_m_s,
            summary.tilt_rad,
            summary.gyro_bias_rad_s,
            summary.accel_bias_m_s2,
            summary.velocity_ratio,
            summary.position_ratio,
            summary.height_ratio,
            summary.heading_ratio,
        )

    def _baro_is_stuck(self, baro: BaroSample | None, time_s: float) -> bool:
        if baro is None:
            return False
        landed, height_m = bool(self._flags["landed"]), -float(self._state[2])
        if baro is not self._baro:  # the health may be newer than the pressure
            self._pressure = pressure_step(self._pressure, baro.pressure_hpa, landed, height_m, time_s)
        self._baro = baro
        return self._pressure.is_stuck(landed, height_m, time_s)


def _fix_age_s(samples: NewestSamples, time_s: float) -> float:
    gnss = samples.gnss
    return math.inf if gnss is None or gnss.fix_type < GnssFix.FIX_3D else time_s - gnss.time_s
