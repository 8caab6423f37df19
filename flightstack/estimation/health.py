"""Health of an estimate: what commander and arming checks need to know of it."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple, TypeAlias

import numpy as np

from flightstack.core.compiled import compiled, direct
from flightstack.core.contract import FloatArray, Record, RecordArray
from flightstack.core.record_types import dtype_of
from flightstack.estimation.error_state import ACCEL_BIAS, ATTITUDE, GYRO_BIAS, POSITION, VELOCITY
from flightstack.estimation.kalman import BARO, GNSS_POSITION, GNSS_VELOCITY, MAG, RANGE, ObservedRecord
from flightstack.estimation.memory import MemoryArray, MemoryRecord
from flightstack.estimation.sensor_feed import NewestSamples
from flightstack.estimation.sensor_samples import GnssFix

SMOOTHING, MOST_MEAN = 0.1, 2.0
"""Share of the newest ratio in a mean, and the largest mean, also of squares by their root: PX4's limit of a filtered
innovation."""
SCATTERED = 0.5
"""Mean square of ratios from which they scatter: noise at a gate of three deviations has 0.11 (at most 0.31)."""
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

    mean_ratios: Annotated[FloatArray, RANGE]
    """Of GNSS, barometer and magnetometer; see ``_follow_ratio``."""
    mean_squares: Annotated[FloatArray, RANGE]
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
SummaryRecord: TypeAlias = Annotated[Record, HealthSummary]
SummaryArray: TypeAlias = Annotated[RecordArray, HealthSummary]
"""An array of one summary, shape (1,)."""


@compiled
def _largest(values: FloatArray, first: int, count: int) -> float:
    largest = 0.0
    for i in range(first, first + count):
        largest = max(largest, abs(values[i]))
    return largest


@compiled
def _follow_ratio(s: SummaryRecord, row: int, o: ObservedRecord) -> None:
    """Update the mean ratio of innovations to their gate, with their signs, and that of the squares.

    The mean of noise is zero, that of an error of the estimate is not: ± 0.08 at a gate of three deviations and a
    measurement an interval. The largest magnitude of three axes is 0.44 in the mean without any error, hardly below
    the limit. Errors that alternate cancel in the mean, and are found by the mean square.
    """
    sign = -1.0 if o["innovation"] < 0.0 else 1.0
    mean, square = s["mean_ratios"][row], s["mean_squares"][row]
    mean += SMOOTHING * (sign * math.sqrt(o["test_ratio"]) - mean)
    square += SMOOTHING * (o["test_ratio"] - square)
    if not square <= MOST_MEAN * MOST_MEAN:  # also if the ratio is NaN
        square = MOST_MEAN * MOST_MEAN
    if not abs(mean) <= MOST_MEAN:
        mean = sign * MOST_MEAN
    s["mean_ratios"][row], s["mean_squares"][row] = mean, square


@compiled
def _ratio(s: SummaryRecord, first: int, count: int) -> float:
    """Return the largest mean ratio of ``count`` rows, or the root of the mean square if they scatter."""
    square = _largest(s["mean_squares"], first, count)
    return math.sqrt(square) if square > SCATTERED else _largest(s["mean_ratios"], first, count)


@compiled
def _summarise(m: MemoryRecord, s: SummaryRecord) -> None:
    """Write the summary of an estimator's record; it holds the mean ratios of the last call."""
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
    for row in range(RANGE):
        _follow_ratio(s, row, o[row])
    s["velocity_ratio"], s["position_ratio"] = _ratio(s, GNSS_VELOCITY, 3), _ratio(s, GNSS_POSITION, 2)
    s["height_ratio"], s["heading_ratio"] = _ratio(s, BARO, 1), _ratio(s, MAG, 3)


@compiled
def health_kernel(memory: MemoryArray, summary: SummaryArray) -> None:
    """Write the summary of an estimator's memory."""
    _summarise(memory[0], summary[0])


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


@compiled
def is_stuck(track: PressureTrack, landed: bool, height_m: float, time_s: float) -> bool:
    """Return True if the pressure should have changed: by its noise, or in a climb or descent."""
    if landed:
        should_change = track.changes == NOISY
    else:
        should_change = not track.is_ideal or abs(height_m - track.height_m) > CLIMBED_M
    return should_change and time_s - track.equal_since_s > STUCK_S


@compiled
def pressure_step(
    memory: PressureTrack, pressure_hpa: float, landed: bool, height_m: float, time_s: float
) -> PressureTrack:
    """Compare a pressure with the last one; changes count at rest, where those of a barometer are its noise."""
    if pressure_hpa != memory.pressure_hpa:
        changes = min(memory.changes + 1, NOISY) if landed else memory.changes
        return PressureTrack(pressure_hpa, time_s, height_m, changes, memory.is_ideal and changes < NOISY, 0)
    if not landed or memory.changes == NOISY:
        return memory
    repeats = memory.repeats + 1
    is_ideal = repeats >= IDEAL
    return PressureTrack(
        memory.pressure_hpa,
        memory.equal_since_s,
        height_m,
        0 if is_ideal else memory.changes,
        is_ideal or memory.is_ideal,
        repeats,
    )


class Accuracy(NamedTuple):
    """Whether the position is inaccurate, and the last time at which its deviation was too large."""

    is_inaccurate: bool = False
    exceeded_s: float = 0.0


@compiled
def accuracy_step(memory: Accuracy, deviation_m: float, limit_m: float, time_s: float) -> Accuracy:
    """Compare a deviation with its limit, with hysteresis; a limit of zero or less is none."""
    if limit_m <= 0.0:
        return Accuracy(False, 0.0)
    if deviation_m > limit_m * (ACCURATE_SHARE if memory.is_inaccurate else 1.0):
        return Accuracy(True, time_s)
    return Accuracy(memory.is_inaccurate and time_s - memory.exceeded_s < ACCURATE_S, memory.exceeded_s)


class Newest(NamedTuple):
    """Newest measurements. Times [s] are minus infinity without one."""

    imu_s: float
    repeats: int
    """Number of successive samples of the inertial sensor that repeat the one before."""
    mag_s: float
    baro_s: float
    pressure_hpa: float
    fix_s: float
    """Of the newest sample of GNSS, if it has a three-dimensional fix."""


class HealthWatch(NamedTuple):
    """Memory of the health of one estimator."""

    newest: Annotated[Record, Newest]
    summary: Annotated[Record, HealthSummary]
    pressure: Annotated[Record, PressureTrack]
    compared_s: float
    """Time of the last pressure in ``pressure``."""
    accuracy: Annotated[Record, Accuracy]
    health: Annotated[Record, EstimateHealth]


WATCH = dtype_of(HealthWatch)
WatchRecord: TypeAlias = Annotated[Record, HealthWatch]
WatchArray: TypeAlias = Annotated[RecordArray, HealthWatch]
"""An array of one such record, shape (1,)."""


@compiled
def _update_pressure(m: MemoryRecord, w: WatchRecord, time_s: float) -> bool:
    """Compare the newest pressure, if it is new, with the last one; return True if the barometer is stuck."""
    newest, p = w["newest"], w["pressure"]
    if newest["baro_s"] == -math.inf:
        return False
    landed, height_m = m["flags"]["landed"] != 0, -m["state"][2]
    track = PressureTrack(
        p["pressure_hpa"], p["equal_since_s"], p["height_m"], p["changes"], p["is_ideal"], p["repeats"]
    )
    if newest["baro_s"] != w["compared_s"]:
        track = pressure_step(track, newest["pressure_hpa"], landed, height_m, time_s)
        p["pressure_hpa"], p["equal_since_s"], p["height_m"] = (
            track.pressure_hpa,
            track.equal_since_s,
            track.height_m,
        )
        p["changes"], p["is_ideal"], p["repeats"] = track.changes, track.is_ideal, track.repeats
        w["compared_s"] = newest["baro_s"]
    return is_stuck(track, landed, height_m, time_s)


@compiled
def update_health(
    memory: MemoryArray, watch: WatchArray, has_origin: bool, limit_m: float, time_s: float
) -> None:
    """Write the health at ``time_s``; ``limit_m`` is that of the horizontal deviation, -1 for none."""
    m, w = memory[0], watch[0]
    h, s, a, newest = w["health"], w["summary"], w["accuracy"], w["newest"]
    _summarise(m, s)
    accuracy = accuracy_step(
        Accuracy(a["is_inaccurate"], a["exceeded_s"]), s["horizontal_m"], limit_m, time_s
    )
    a["is_inaccurate"], a["exceeded_s"] = accuracy.is_inaccurate, accuracy.exceeded_s
    fix_age_s = time_s - newest["fix_s"]
    h["aligned"], h["has_origin"] = m["flags"]["aligned"] != 0, has_origin
    h["imu_age_s"], h["imu_is_stuck"] = time_s - newest["imu_s"], newest["repeats"] >= STUCK_SAMPLES
    h["mag_age_s"], h["baro_age_s"], h["fix_age_s"] = (
        time_s - newest["mag_s"],
        time_s - newest["baro_s"],
        fix_age_s,
    )
    h["baro_is_stuck"] = _update_pressure(m, w, time_s)
    h["unaided_s"] = s["unaided_s"] if has_origin else math.inf
    h["refused_s"] = s["refused_s"] if has_origin and fix_age_s < MISSING_FIX_S else 0.0
    h["is_inaccurate"] = accuracy.is_inaccurate
    h["lag_s"], h["tilt_rad"] = s["lag_s"], s["tilt_rad"]
    h["horizontal_m"], h["velocity_m_s"] = s["horizontal_m"], s["velocity_m_s"]
    h["gyro_bias_rad_s"], h["accel_bias_m_s2"] = s["gyro_bias_rad_s"], s["accel_bias_m_s2"]
    h["velocity_ratio"], h["position_ratio"] = s["velocity_ratio"], s["position_ratio"]
    h["height_ratio"], h["heading_ratio"] = s["height_ratio"], s["heading_ratio"]


class HealthMonitor:
    """Summarises an estimator at intervals."""

    def __init__(self, memory: RecordArray) -> None:
        """``memory`` is the estimator's, shape (1,)."""
        self._memory = memory
        self.watch: RecordArray = np.zeros(1, WATCH)
        """Memory of the health, shape (1,)."""
        self.watch["pressure"]["pressure_hpa"] = self.watch["compared_s"] = math.nan
        self._newest: RecordArray = self.watch["newest"]
        self._health: Record = self.watch["health"][0]
        self._update = direct(update_health, memory, self.watch, False, 0.0, 0.0)

    def take(self, samples: NewestSamples) -> None:
        """Note the newest measurements."""
        track, mag, baro, gnss = samples.imu_track, samples.mag, samples.baro, samples.gnss
        has_fix = gnss is not None and gnss.fix_type >= GnssFix.FIX_3D
        self._newest[0] = Newest(
            track.newest_s,
            track.repeats,
            -math.inf if mag is None else mag.time_s,
            -math.inf if baro is None else baro.time_s,
            math.nan if baro is None else baro.pressure_hpa,
            gnss.time_s if gnss is not None and has_fix else -math.inf,
        )

    def update(
        self, samples: NewestSamples, has_origin: bool, limit_m: float, time_s: float
    ) -> EstimateHealth:
        """Return the health at ``time_s``; ``limit_m`` is that of the horizontal deviation, -1 for none."""
        self.take(samples)
        self._update(self._memory, self.watch, has_origin, limit_m, time_s)
        return self.health()

    def magnitudes(self) -> tuple[float, float, float, float]:
        """Return the ratios of velocity, position, height and heading as root mean squares, as of the last update.

        The noise of a measurement is in those of all filters that take it, so that their difference is of the filters.
        The means with their signs have a noise of their own.
        """
        squares = self.watch["summary"]["mean_squares"][0].tolist()
        kinds = (GNSS_VELOCITY, 3), (GNSS_POSITION, 2), (BARO, 1), (MAG, 3)
        velocity, position, height, heading = (
            math.sqrt(max(0.0, *squares[row : row + count])) for row, count in kinds
        )
        return velocity, position, height, heading

    def health(self) -> EstimateHealth:
        """Return the health of the last update."""
        return EstimateHealth(*self._health.item())
