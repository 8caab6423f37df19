"""Topics of the estimator in the log, as pyulog reads them, after a flight with known errors of its sensors."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from pyulog import ULog

from flightstack.core.contract import FloatArray
from flightstack.core.geodesy import LocalFrame
from flightstack.estimation.estimator import Estimator
from flightstack.estimation.sensed import Sensed
from flightstack.estimation.sensor_feed import NewestSamples
from flightstack.estimation.sensor_samples import BaroSample, RangeSample
from flightstack.estimation.snapshot import snapshot
from flightstack.flight_log.estimator_topics import ESTIMATOR, WIND_GROUP, store_estimator
from flightstack.flight_log.flight_log import FlightLog
from flightstack.flight_log.recorder import FlightRecorder
from flightstack.flight_log.sensor_recorder import SENSOR_GROUPS, SensorRecorder
from tests.support import flown_sensors as flown
from tests.support.flown_sensors import Faults
from tests.support.sensed_flight import PARAMS, sensed_after

SECONDS, WRONG_S = 20.0, 19.5
TOO_LARGE = Faults(
    jump_s=(WRONG_S, math.inf), jump_m=30.0, vertical_jump_m_s=3.0, disturbed_s=(WRONG_S, math.inf),
    disturbance_gauss=0.4,
)  # fmt: skip


def topics(sensed: Sensed) -> dict[str, Any]:
    """Return the topics of one row of the log, by name."""
    file = io.BytesIO()
    log = FlightLog(file, 4)
    log.start(0, {}, {}, flown.HOME, (ESTIMATOR,))
    row, wind = log.sampled[ESTIMATOR.name].append(1), np.zeros(WIND_GROUP.columns)
    store_estimator(sensed.memory, sensed.track, sensed.time_s, row, wind)
    log.flush()
    return {data.name: data.data for data in ULog(io.BytesIO(file.getvalue())).data_list}


@pytest.mark.parametrize("fault", [0, 1])
def test_fault_of_the_magnetometer_is_a_flag_in_the_log(fault: int) -> None:
    memory = sensed_after(SECONDS)[1].memory.copy()
    memory["flags"][0]["mag_fault"] = fault
    found = topics(Sensed(memory, sensed_after(SECONDS)[0].samples))
    assert found["estimator_status_flags"]["cs_mag_fault"][0] == fault
    assert int(found["estimator_status"]["control_mode_flags"][0]) >> 18 & 1 == fault  # PX4's bit


def test_log_without_a_true_state_has_no_groundtruth() -> None:
    file = io.BytesIO()
    log = FlightLog(file, 4)
    log.start(0, {}, {}, flown.HOME, SENSOR_GROUPS)
    recorder = SensorRecorder(
        cast(FlightRecorder, SimpleNamespace(log=log, estimate=np.zeros(23))),
        LocalFrame(flown.HOME),
        flown.HOME,
    )
    sensed, estimator = sensed_after(SECONDS)
    recorder.begin(lambda: snapshot(estimator))

    def topics_after(truth: FloatArray | None, time_us: int) -> set[str]:
        recorder.state(time_us, lambda: truth, lambda: sensed)
        log.flush()
        return {data.name for data in ULog(io.BytesIO(file.getvalue())).data_list}

    before = topics_after(None, 1)
    assert "estimator_status" in before
    assert not [name for name in before if name.endswith("_groundtruth")]
    assert topics_after(np.zeros(13), 100_000) - before == {
        f"vehicle_{name}_groundtruth"
        for name in ("attitude", "angular_velocity", "local_position", "global_position")
    }


def too_large_measurements() -> Iterator[Any]:
    """Yield the samples of a flight; from ``WRONG_S`` on altitude and distance are 5 m too large."""
    for sample in flown.samples(SECONDS, TOO_LARGE):
        if not isinstance(sample, BaroSample):
            yield sample
            continue
        time_s = sample.time_s
        error_m = 5.0 if time_s >= WRONG_S else 0.0
        x, y = flown.attitude(time_s)[1:3]
        height_m = 1.0 - flown.position(time_s)[2]
        yield sample._replace(pressure_altitude_m=sample.pressure_altitude_m + error_m)
        yield RangeSample(time_s, height_m / (1.0 - 2.0 * (x * x + y * y)) + error_m, 1.0)


def test_logged_innovations_have_the_signs_of_px4() -> None:
    estimator = Estimator(PARAMS)
    estimator.set_earth_field(flown.EARTH)
    for sample in too_large_measurements():
        if isinstance(sample, RangeSample):
            estimator.range(sample)
        else:
            flown.feed(estimator, sample)
    innovations = topics(Sensed(estimator.memory, NewestSamples()))["estimator_innovations"]
    expected = {
        "gps_hpos[0]": -30.0, "gps_vvel": -3.0, "mag_field[0]": -0.4, "baro_vpos": 5.0, "rng_vpos": 5.0, "hagl": -5.0,
    }  # fmt: skip
    found = {name: float(innovations[name][0]) for name in expected}
    assert found == pytest.approx(expected, rel=0.3)
    ratios = topics(Sensed(estimator.memory, NewestSamples()))["estimator_innovation_test_ratios"]
    assert all(ratios[name][0] > 0.0 for name in expected)
