"""A flight on sensors for the batch smoother: measurements of its log, and the model of the vehicle's sensors."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from flightstack.core.contract import FloatArray
from flightstack.core.geodesy import GeoPoint, LocalFrame, earth_field_ned_gauss
from flightstack.estimation.sensor_samples import BaroSample, GnssSample, ImuSample, MagSample
from flightstack.params.sensors import Sensors
from gcs_cli.estimate.log_samples import Landed, Sample, samples_of, times_s, topic_of
from gcs_cli.logs.recording import Recording
from tests.support.batch_smoother import Noise
from tests.support.preintegration import Flight

_M_PER_HPA = 8.43
"""Height of 1 hPa near sea level (ISO 2533)."""
_ROUNDING = math.sqrt(1.0 / 12.0)
"""Standard deviation of the rounding to a step of 1."""
_REST_MARGIN_S = 1.0
"""Time before the land detector's report from which on the vehicle may move."""


def noise_of(sensors: Sensors, imu_step_s: float, duration_s: float) -> Noise:
    """Return the model of the sensors; rounding is white noise, and the drift by temperature a random walk."""
    numbers = {name: {key: float(value) for key, value in table.items() if not isinstance(value, tuple)}
               for name, table in sensors.numbers.items()}  # fmt: skip
    imu, mag, baro, gnss = (numbers[name] for name in ("imu", "mag", "baro", "gnss"))
    warming_k_s = imu["warm_up_k"] / imu["warm_up_time_s"]
    white, turn_on, walk, matrix = [], [], [], []
    for name, unit, factor in (("gyro", "deg_s", math.radians(1.0)), ("accel", "m_s2", 1.0)):
        rounding = _ROUNDING * imu[f"{name}_resolution_{unit}"] * math.sqrt(imu_step_s)
        white.append(factor * math.hypot(imu[f"{name}_noise_{unit}_sqrt_hz"], rounding))
        turn_on.append(factor * imu[f"{name}_turn_on_bias_{unit}"])
        wander = imu[f"{name}_bias_instability_{unit}"] * math.sqrt(2.0 / imu["bias_time_s"])
        warming = imu[f"{name}_temperature_{unit}_k"] * warming_k_s * math.sqrt(duration_s)
        walk.append(factor * math.hypot(wander, warming))
        matrix.append(
            np.where(np.eye(3) > 0.0, imu[f"{name}_scale_error"], math.radians(imu["misalignment_deg"]))
        )
    drift = np.array([gnss["horizontal_drift_m"], gnss["horizontal_drift_m"], gnss["vertical_drift_m"]])
    drift_walk, baro_walk = (
        drift * math.sqrt(2.0 / gnss["drift_time_s"]),
        math.sqrt(2.0 / baro["drift_time_s"]),
    )
    return Noise(
        *white,
        math.hypot(mag["noise_gauss"], _ROUNDING * mag["resolution_gauss"]),
        baro["noise_hpa"] * _M_PER_HPA,
        np.array([gnss["horizontal_noise_m"], gnss["horizontal_noise_m"], gnss["vertical_noise_m"]]),
        np.array([gnss["velocity_noise_m_s"]] * 2 + [gnss["vertical_velocity_noise_m_s"]]),
        np.concatenate([np.repeat(turn_on, 3), drift, [baro["turn_on_offset_hpa"] * _M_PER_HPA]]),
        np.concatenate([np.repeat(walk, 3), drift_walk, [baro["drift_hpa"] * _M_PER_HPA * baro_walk]]),
        np.concatenate([np.full(6, np.inf), np.full(3, gnss["drift_time_s"]), [np.inf]]),
        np.concatenate(
            [
                *map(np.ravel, matrix),
                np.repeat([mag["soft_iron"], mag["hard_iron_gauss"], mag["current_gauss_a"]], [9, 3, 3]),
            ]
        ),
    )


def measurements(log: Recording, home: GeoPoint, latency_s: float) -> tuple[Flight, FloatArray]:
    """Return the measurements of a log, GNSS ``latency_s`` before its messages, and the times of its keyframes."""
    samples = samples_of(log)
    imu = [sample for sample in samples if isinstance(sample, ImuSample)]
    start_s, step_s = imu[0].time_s - imu[0].dt_s, imu[0].dt_s
    fixes = [
        sample
        for sample in samples
        if isinstance(sample, GnssSample) and start_s < sample.time_s - latency_s + 0.5 * step_s
    ]
    at = np.array([fix.time_s for fix in fixes]) - latency_s
    edges = np.rint((at - start_s) / step_s).astype(int)
    samples_each = int(edges[1] - edges[0])
    assert (np.diff(edges) == samples_each).all(), "GNSS has no constant rate"
    frame = LocalFrame(home)
    places = [
        frame.to_ned(GeoPoint(fix.latitude_deg, fix.longitude_deg, fix.altitude_msl_m)) for fix in fixes
    ]
    lifts_s = min(sample.time_s for sample in samples if isinstance(sample, Landed) and not sample.is_landed)
    battery = topic_of(log, "battery_status")
    assert battery is not None
    middle = 0.5 * (at[1:] + at[:-1])
    on_grid = _Grid(start_s, step_s, int(edges[0]), len(fixes) - 1, samples_each)
    return Flight(
        step_s,
        on_grid.values(samples, ImuSample, "gyro_frd_rad_s"),
        on_grid.values(samples, ImuSample, "accel_frd_m_s2"),
        on_grid.values(samples, MagSample, "field_frd_gauss"),
        np.interp(middle, times_s(battery), battery.fields["current_a"]),
        on_grid.values(samples, BaroSample, "pressure_altitude_m")[..., 0] - home.altitude_m,
        np.array(places),
        np.array([fix.velocity_ned_m_s for fix in fixes]),
        at < lifts_s - _REST_MARGIN_S,
        np.array(earth_field_ned_gauss(home)),
    ), at  # fmt: skip


class _Grid:
    """The steps of the IMU between the first and the last keyframe."""

    def __init__(self, start_s: float, step_s: float, first: int, intervals: int, steps: int) -> None:
        self._start_s, self._step_s, self._first = start_s, step_s, first
        self._shape = intervals, steps

    def values(self, samples: Iterable[Sample | Landed], kind: type, name: str) -> FloatArray:
        """Return a measurement of one kind of sample at the end of each step, NaN without one."""
        rows = [
            (sample.time_s, *np.ravel(getattr(sample, name)))
            for sample in samples
            if isinstance(sample, kind)
        ]
        table = np.array(rows)
        step = np.rint((table[:, 0] - self._start_s) / self._step_s).astype(int) - 1 - self._first
        count = self._shape[0] * self._shape[1]
        found = np.full((count, table.shape[1] - 1), np.nan)
        inside = (step >= 0) & (step < count)
        found[step[inside]] = table[inside, 1:]
        return found.reshape(*self._shape, -1)
