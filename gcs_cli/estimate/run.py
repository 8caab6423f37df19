"""The estimator over the samples of a log."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from flightstack.core.contract import FloatArray, RecordArray
from flightstack.core.geodesy import FIELD_YEAR, earth_field_ned_gauss
from flightstack.estimation.error_state import ERROR_STATES, NOMINAL_SIZE
from flightstack.estimation.estimator import Estimator
from flightstack.estimation.kalman import OBSERVATIONS, symmetric
from flightstack.estimation.sensor_samples import BaroSample, GnssSample, ImuSample, MagSample, RangeSample
from flightstack.estimation.snapshot import ESTIMATOR_START, restored
from gcs_cli.errors import CliError
from gcs_cli.estimate.log_samples import Landed, params_of, samples_of
from gcs_cli.estimate.track import Track
from gcs_cli.logs.recording import Recording

SNAPSHOT_S = 0.1
"""Interval of the states, deviations and innovations that are kept."""
MOTION_SIZE = 9
"""Error states of attitude, velocity and position."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """The output of the filter at each IMU sample, and its inner state at intervals.

    ``state_s`` (m,) has the times of ``nominal`` (m, 28), ``deviations`` (m, 27), ``covariance`` of attitude, velocity
    and position (m, 9, 9) and ``observations`` (m, 25), records of ``Observed``: those of the horizon, which is behind
    the output.
    """

    track: Track
    state_s: FloatArray
    nominal: FloatArray
    deviations: FloatArray
    covariance: FloatArray
    observations: RecordArray
    samples: dict[str, int]


def run(log: Recording, given: Mapping[str, float]) -> Estimate:
    """Run the filter with parameters ``given`` by name; raise CliError if the log's sensors do not suffice.

    The log of a vehicle of this version has the filter's memory at its start in ``log.info``: without other parameters
    the filter continues from it, and so repeats the flown estimate.
    """
    estimator = None if given else _continued(log)
    estimator = estimator or _new(log, given)
    recorder = _Recorder(estimator)
    year = log.year or FIELD_YEAR
    for sample in samples_of(log):
        recorder.count(sample)
        if isinstance(sample, ImuSample):
            estimator.imu(sample)
            recorder.record(sample.time_s)
        elif isinstance(sample, MagSample):
            estimator.mag(sample)
        elif isinstance(sample, BaroSample):
            estimator.baro(sample)
        elif isinstance(sample, GnssSample):
            was_known = estimator.frame is not None
            estimator.gnss(sample)
            if not was_known and estimator.frame is not None:
                estimator.set_earth_field(earth_field_ned_gauss(estimator.frame.origin, year))
        elif isinstance(sample, RangeSample):
            estimator.range(sample)
        elif isinstance(sample, Landed):
            estimator.set_landed(sample.is_landed)
    return recorder.result(log)


def _continued(log: Recording) -> Estimator | None:
    start = log.info.get(ESTIMATOR_START)
    return restored(start) if isinstance(start, bytes) else None


def _new(log: Recording, given: Mapping[str, float]) -> Estimator:
    params, limits, declination_rad = params_of(log, given)
    estimator = Estimator(params, limits)
    if math.isfinite(declination_rad):
        estimator.set_declination(declination_rad)
    return estimator


class _Recorder:
    def __init__(self, estimator: Estimator) -> None:
        self._estimator = estimator
        self._record: Any = estimator.memory[0]
        self._outputs: list[FloatArray] = []
        self._states: list[tuple[float, FloatArray, FloatArray, FloatArray, FloatArray]] = []
        self._samples: dict[str, int] = {}
        self._next_s = 0.0

    def count(self, sample: Any) -> None:
        name = type(sample).__name__.removesuffix("Sample").lower()
        self._samples[name] = self._samples.get(name, 0) + 1

    def record(self, time_s: float) -> None:
        if not self._estimator.aligned:
            return
        self._outputs.append(self._record["output"].copy())
        if time_s >= self._next_s:
            self._next_s = time_s + SNAPSHOT_S
            record = self._record
            self._states.append(
                (
                    float(record["clock"][0]),
                    record["nominal"].copy(),
                    self._estimator.deviations(),
                    symmetric(record["covariance"][:MOTION_SIZE, :MOTION_SIZE]),
                    record["observations"].copy(),
                )
            )

    def result(self, log: Recording) -> Estimate:
        if len(self._outputs) < 2:
            raise CliError(f"{log.source}: the log is too short to align the filter")
        output = np.array(self._outputs)
        frame = self._estimator.frame
        signs = np.where(np.sum(output[1:, 1:5] * output[:-1, 1:5], axis=1) < 0.0, -1.0, 1.0)
        attitude = output[:, 1:5] * np.concatenate([[1.0], np.cumprod(signs)])[:, None]
        times, nominal, deviations, covariance, observations = zip(*self._states, strict=True)
        return Estimate(
            Track(
                output[:, 0],
                attitude,
                output[:, 0],
                output[:, 5:8],
                output[:, 8:11],
                None if frame is None else frame.origin,
            ),
            np.array(times),
            np.array(nominal).reshape(-1, NOMINAL_SIZE),
            np.array(deviations).reshape(-1, ERROR_STATES),
            np.array(covariance).reshape(-1, MOTION_SIZE, MOTION_SIZE),
            np.array(observations).reshape(-1, OBSERVATIONS),
            self._samples,
        )
