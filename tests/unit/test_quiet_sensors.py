"""What quiet ticks take of magnetometer and barometer, and record of estimate and true state."""

from __future__ import annotations

import io
import math

import numpy as np
import pytest

from flightstack.commander.transitions import Status
from flightstack.core.compiled import IS_DISABLED, plain
from flightstack.core.contract import Vector3
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.core.kernels.calls import as_bytes
from flightstack.estimation.sensed import Sensed
from flightstack.estimation.sensor_feed import SlowSamples
from flightstack.flight_log.estimator_topics import ESTIMATOR, WIND_GROUP
from flightstack.flight_log.flight_log import FlightLog
from flightstack.flight_log.sensor_rows import store_global
from flightstack.params.config import StackConfig
from flightstack.process.assembly import Stack, build
from flightstack.process.quiet_sensors import QuietSensors
from flightstack.simulator_link.frame_kernels import SENSOR_NEWS
from flightstack.simulator_link.gps_kernels import GPS_SIZE
from flightstack.simulator_link.sensor_frames import HIL_VALUES, VALUES
from flightstack.vehicle.estimation import Watched
from flightstack.vehicle.quiet_kernel import QUIET_CALLS
from flightstack.vehicle.slow_kernel import log_estimate, take_slow
from tests.support.sensed_flight import sensed_after


@pytest.mark.skipif(IS_DISABLED, reason="needs compiled code")
def test_a_sample_is_kept_when_later_messages_lack_it() -> None:
    """A HIL_SENSOR may hold anything in the fields that it does not announce."""
    stack = build(StackConfig(), lambda: None)
    assert stack.estimation is not None
    values, news = np.zeros(VALUES, np.float32), np.zeros(1, SENSOR_NEWS)
    sensors = QuietSensors(stack, values, news, np.zeros(GPS_SIZE, np.uint8))
    parts = values.view(HIL_VALUES)
    filters = tuple(as_bytes(each.memory) for each in stack.estimation.estimators)
    following = sensors.following()
    parts["mag_gauss"], parts["pressure_hpa"] = (0.2, 0.1, 0.4), 955.5
    parts["altitude_m"], parts["temperature_c"] = 488.0, 15.0
    news[0] = 1, 1, 0
    take_slow(sensors.calls["push"], sensors.constant, 10_000, filters, following)
    values[:], news[0] = -1.0, (0, 0, 0)
    take_slow(sensors.calls["push"], sensors.constant, 12_000, filters, following)
    sensors.pass_by(12_000, 2000)
    mag, baro = stack.estimation.samples.mag, stack.estimation.samples.baro
    assert mag == (0.01, tuple(np.float32((0.2, 0.1, 0.4)).tolist()))
    assert baro == (0.01, 955.5, 488.0, 15.0)


@pytest.mark.parametrize(
    "origin", [GeoPoint(47.4, 8.5, 488.0), GeoPoint(-16.8, 179.99, 3.0), GeoPoint(89.0, -179.99, 0.0)]
)
def test_the_true_place_is_that_of_the_local_frame(origin: GeoPoint) -> None:
    frame, row = LocalFrame(origin), np.zeros(3)
    for state in np.random.default_rng(1).normal(0.0, 3000.0, (50, 13)):
        for store in (store_global, plain(store_global)):
            store(row, state, np.array((*origin, *frame.scales)))
            assert tuple(row.tolist()) == frame.to_geo(Vector3(*state[:3].tolist()))


def test_a_health_that_is_due_in_a_tick_with_a_reset_is_updated_in_it() -> None:
    """The kernel ends at the reset, before the health."""
    stack = build(StackConfig(), lambda: None)
    estimation = stack.estimation
    assert estimation is not None
    assert not math.isfinite(estimation.health.imu_age_s)
    estimation.estimator.memory["resets"][0]["position"]["number"] = 1.0
    due_us = estimation.begin_watch()[0]
    estimation.pass_by(120_000, 2000, SlowSamples(), Watched(due_us, 0))
    assert estimation.begin_watch()[0] == 150_000


def _logging_stack(wind_variance: float, has_gnss: int) -> tuple[Stack, FlightLog]:
    """Return a vehicle that records the estimate of a flight, and its log."""
    log = FlightLog(io.BytesIO(), 4)
    stack = build(StackConfig(), lambda: log)
    sensed, estimator = sensed_after(20.0)
    assert stack.estimation is not None
    stack.estimation.estimator.memory[:] = estimator.memory
    stack.estimation.estimator.memory["covariance"][0, 21:23, 21:23] = wind_variance * np.eye(2)
    stack.estimation.estimator.memory["flags"]["has_gnss"] = has_gnss
    stack.estimation.samples.imu_track.memory[:] = sensed.track
    stack.now.has_state = True
    stack.recorder.status(1, Status(armed=True))
    stack.estimation.recorder.begin(lambda: b"")
    return stack, log


def _recorded(stack: Stack, log: FlightLog) -> list[tuple[bytes, bytes]]:
    assert stack.estimation is not None
    traces = [log.sampled[group.name] for group in (ESTIMATOR, WIND_GROUP)]
    recorded = [(trace.rows[: trace.n].tobytes(), trace.times_us[: trace.n].tobytes()) for trace in traces]
    return [*recorded, (stack.recorder.estimate.tobytes(), stack.estimation.recorder.due.tobytes())]


@pytest.mark.skipif(IS_DISABLED, reason="needs compiled code")
@pytest.mark.parametrize(("wind_variance", "has_gnss"), [(0.1, 1), (0.6, 1), (0.1, 0)])
def test_quiet_ticks_record_the_estimate_as_other_ticks_do(wind_variance: float, has_gnss: int) -> None:
    """A wind that is not observed has no row; a position that is not valid is recorded more often."""
    (single, log), (quiet, quiet_log) = (_logging_stack(wind_variance, has_gnss) for _ in range(2))
    assert single.estimation is not None
    assert quiet.estimation is not None
    memory, track = quiet.estimation.estimator.memory, quiet.estimation.samples.imu_track.memory
    sensors = QuietSensors(
        quiet, np.zeros(VALUES, np.float32), np.zeros(1, SENSOR_NEWS), np.zeros(GPS_SIZE, np.uint8)
    )
    following = sensors.following()
    calls = np.zeros(1, QUIET_CALLS)
    calls["local_position"], calls["estimator"] = sensors.calls["local_position"], sensors.calls["estimator"]
    for time_us in range(20_000_000, 21_500_000, 2000):
        now = Sensed(single.estimation.estimator.memory, single.estimation.samples, time_s=time_us * 1e-6)
        single.estimation.recorder.state(time_us, lambda: None, lambda now=now: now)
        single.estimation.recorder.due["truth_us"] = 0  # not recorded by either
        log_estimate(calls[0], sensors.constant, time_us, (as_bytes(memory), as_bytes(track)), following)
    sensors.count_rows()
    assert log.sampled[ESTIMATOR.name].n == 3
    assert log.sampled[WIND_GROUP.name].n == (3 if wind_variance < 0.5 else 0)
    assert single.recorder.estimate.any()
    assert _recorded(quiet, quiet_log) == _recorded(single, log)
