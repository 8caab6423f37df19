"""What quiet ticks take of magnetometer and barometer, and record of the true state."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flightstack.core.compiled import IS_DISABLED, plain
from flightstack.core.contract import Vector3
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.core.kernels.calls import as_bytes
from flightstack.estimation.sensor_feed import SlowSamples
from flightstack.flight_log.sensor_rows import store_global
from flightstack.params.config import StackConfig
from flightstack.process.assembly import build
from flightstack.process.quiet_sensors import QuietSensors
from flightstack.simulator_link.frame_kernels import SENSOR_NEWS
from flightstack.simulator_link.gps_kernels import GPS_SIZE
from flightstack.simulator_link.sensor_frames import HIL_VALUES, VALUES
from flightstack.vehicle.estimation import Watched
from flightstack.vehicle.slow_kernel import take_slow


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
    take_slow(sensors.push, sensors.constant, 10_000, filters, following)
    values[:], news[0] = -1.0, (0, 0, 0)
    take_slow(sensors.push, sensors.constant, 12_000, filters, following)
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
